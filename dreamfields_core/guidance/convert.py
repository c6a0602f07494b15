"""From a file's names and layouts to ours, one array at a time.

A family's table says, for each of our arrays, which arrays of the file it is made of and how. Arrays are asked for one by one, so
a file that is mapped into memory is never held twice, and only the towers that are wanted are read.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import nnx

from dreamfields_core.guidance.architecture import Architecture, UnfitModel
from dreamfields_core.guidance.tables import Source, Table
from dreamfields_core.guidance.text import TextTransformer
from dreamfields_core.guidance.vit import VisionTransformer
from dreamfields_core.types import Params


def modules(arch: Architecture) -> dict[str, nnx.Module]:
    """Both towers without weights: shapes only."""
    return {
        "image": nnx.eval_shape(lambda: VisionTransformer(arch.image, nnx.Rngs(0))),
        "text": nnx.eval_shape(lambda: TextTransformer(arch.text, nnx.Rngs(0))),
    }


def convert(
    arrays: Mapping[str, np.ndarray],
    arch: Architecture,
    tables: Mapping[str, Table],
    *,
    towers: Collection[str],
    ignored: Callable[[str], bool],
) -> Params:
    """The parameters {"image": ..., "text": ..., "scoring": {...}} of the towers wanted, in the precision of the file.

    Args:
      arrays: the file, name -> array; may read each array only when asked for it.
      tables: for "image", "text" and "scoring", our names to theirs.
      ignored: names in the file that are known and of no use.

    Raises:
      UnfitModel: arrays are missing, too many, or of another shape or kind. Nothing is returned half-loaded.
    """
    _check_names(arrays, tables, ignored)
    params: dict[str, Any] = {}
    for tower, module in modules(arch).items():
        if tower in towers:
            shapes = {name: leaf.shape for name, leaf in flatten(nnx.to_pure_dict(nnx.state(module)))}
            wanted = {place for name, shape in shapes.items() for place in _places(name, shape)}
            assert wanted == tables[tower].keys(), sorted(wanted ^ tables[tower].keys())
            params[tower] = nest({name: _array(arrays, name, tables[tower], shape) for name, shape in shapes.items()})
    params["scoring"] = {name: _array(arrays, name, tables["scoring"], ()) for name in tables["scoring"]}
    return params


def flatten(tree: Params, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Leaves of nested dicts with their path, "blocks/norm1/scale"."""
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{name}/")
        else:
            yield f"{prefix}{name}", value


def nest(flat: Mapping[str, Any]) -> dict[str, Any]:
    """The inverse of `flatten`."""
    tree: dict[str, Any] = {}
    for path, value in flat.items():
        *folders, leaf = path.split("/")
        inner = tree
        for folder in folders:
            inner = inner.setdefault(folder, {})
        inner[leaf] = value
    return tree


def _check_names(arrays: Mapping[str, np.ndarray], tables: Mapping[str, Table], ignored: Callable[[str], bool]) -> None:
    wanted = {name for table in tables.values() for source in table.values() for name in source.names}
    missing = sorted(wanted - set(arrays))
    extra = sorted(name for name in set(arrays) - wanted if not ignored(name))
    if missing:
        raise UnfitModel(
            f'expected {len(wanted)} arrays, got {len(wanted) - len(missing)} of them, "{missing[0]}" being the first of those missing: '
            "the file is of another model than its configuration says, or incomplete: fetch both again"
        )
    if extra:
        raise UnfitModel(
            f'expected only the {len(wanted)} arrays of this architecture, got {len(extra)} more, "{extra[0]}" the first: '
            "the file is of another model than its configuration says"
        )


def _places(name: str, shape: tuple[int, ...]) -> list[str]:
    """The names in a table that one of our arrays is made of: of a stack of blocks, [layers, ...], one a layer."""
    folder, _, rest = name.partition("/")
    return [f"{folder}/{place}/{rest}" for place in range(shape[0])] if folder == "blocks" else [name]


def _array(arrays: Mapping[str, np.ndarray], name: str, table: Table, shape: tuple[int, ...]) -> jax.Array:
    places = _places(name, shape)
    if places == [name]:
        return jnp.array(_take(arrays, name, table[name], shape))  # a copy: the file may go
    layers = np.empty(shape, _take(arrays, places[0], table[places[0]], shape[1:]).dtype)
    for place, layer in enumerate(places):
        made = _take(arrays, layer, table[layer], shape[1:])
        layers = layers if made.dtype == layers.dtype else layers.astype(np.float32)
        layers[place] = made
    return jnp.asarray(layers)


def _take(arrays: Mapping[str, np.ndarray], name: str, source: Source, shape: tuple[int, ...]) -> np.ndarray:
    found = [arrays[part] for part in source.names]
    if not all(jnp.issubdtype(array.dtype, jnp.floating) for array in found):
        raise UnfitModel(f'expected real numbers for "{source.names[0]}", got {found[0].dtype}: this is no plain weights file')
    try:
        made = source.make(*found)
        while made.ndim > len(shape) and made.shape[0] == 1:
            made = made[0]
    except ValueError as problem:
        raise UnfitModel(f'expected "{source.names[0]}" to make {name} of shape {shape}, got {found[0].shape}: {problem}') from problem
    if made.shape != shape:
        raise UnfitModel(
            f'expected {name} of shape {shape} from "{source.names[0]}", got {made.shape}: '
            "the file is of another size than its configuration says"
        )
    return made.astype(np.float32) if made.dtype.itemsize > 4 else made
