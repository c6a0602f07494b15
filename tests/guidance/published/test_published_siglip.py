"""SigLIP under open_clip's names is the same model as under the hub's; its kin of variable resolution are refused."""

from __future__ import annotations

import copy
from pathlib import Path

import jax
import numpy as np
import plain_siglip
import pytest
from safetensors.numpy import save_file

from dreamfields_core.guidance import siglip_trunk
from dreamfields_core.guidance.architecture import UnfitModel
from dreamfields_core.guidance.families import read_architecture
from dreamfields_core.guidance.published import read_weights
from storage.mapped import map_arrays


@pytest.fixture(autouse=True)
def small_trunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(siglip_trunk.SIZES, "small", plain_siglip.SMALL)


def trunk(name: str) -> dict:
    config = copy.deepcopy(plain_siglip.OPEN_CLIP)
    config["model_cfg"]["vision_cfg"]["timm_model_name"] = name
    return config


def test_both_names_are_one_model(tmp_path: Path) -> None:
    hub, ours = plain_siglip.arrays(), read_architecture(plain_siglip.HUB)
    save_file(plain_siglip.as_open_clip(hub), tmp_path / "open_clip_model.safetensors")
    arch = read_architecture(plain_siglip.OPEN_CLIP)
    assert (arch.image, arch.text, arch.pixels, arch.sigmoid) == (ours.image, ours.text, ours.pixels, True)
    found = read_weights(map_arrays([tmp_path / "open_clip_model.safetensors"]), arch)
    wanted = read_weights(hub, ours)
    assert jax.tree.structure(found) == jax.tree.structure(wanted)
    jax.tree.map(np.testing.assert_array_equal, found, wanted)


PUBLISHED = {"vit_base_patch16_siglip_224": 92.9, "vit_large_patch16_siglip_256": 316.0, "vit_so400m_patch14_siglip_384": 428.2}
"""timm's name -> parameters of the image tower, millions."""


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_sizes_are_those_of_the_published_models(name: str) -> None:
    """A block has 4 w^2 weights in its attention and 2 w h in its MLP, and the pooling head has as many; the rest is small."""
    config = trunk(name)
    config["model_cfg"]["vision_cfg"].pop("image_size")
    width, layers, _, hidden = siglip_trunk.SIZES[name.split("_")[1]]
    config["model_cfg"] |= {"embed_dim": width}
    config["model_cfg"]["text_cfg"] = config["model_cfg"]["text_cfg"] | {"width": width, "heads": 16 if width % 12 else 12}
    image = read_architecture(config).image
    assert image.stack.layers == layers and f"patch{image.patch}_" in name and name.endswith(f"_{image.image_size}")
    count = (layers + 1) * (4 * width**2 + 2 * width * hidden) + width * (3 * image.patch**2 + image.tokens)
    assert count / 1e6 == pytest.approx(PUBLISHED[name], rel=0.005)


@pytest.mark.parametrize(
    ("config", "words"),
    [
        (trunk("naflexvit_so400m_patch16_siglip"), "NaFlex"),
        (plain_siglip.HUB | {"model_type": "siglip2"}, "NaFlex"),
        (trunk("vit_base_patch16_siglip_gap_224"), 'got "vit_base_patch16_siglip_gap_224": use the same model in the hub'),
        (trunk("vit_medium_patch16_siglip_224"), "of size base, large"),
        (trunk("vit_base_patch16_224"), "got a model with timm_model_name"),
    ],
)
def test_other_kinds_are_refused_in_one_sentence(config: dict, words: str) -> None:
    with pytest.raises(UnfitModel, match=words) as refused:
        read_architecture(config)
    assert "\n" not in str(refused.value) and "use " in str(refused.value)
