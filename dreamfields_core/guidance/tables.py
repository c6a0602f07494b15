"""Where each of our arrays comes from in a published file: its names there, and what is made of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Make = Callable[..., np.ndarray]


@dataclass(frozen=True)
class Source:
    """names: of the arrays in the file. make: takes them, in that order, to our array, whose shape is then checked."""

    names: tuple[str, ...]
    make: Make


Table = dict[str, Source]
"""Our name, "blocks/0/mlp/widen/kernel", to where it comes from."""


def same(name: str) -> Source:
    """An array as it is."""
    return Source((name,), lambda array: array)


def transposed(*names: str) -> Source:
    """Dense kernels [out, in] of PyTorch as one [in, sum of out]."""
    return Source(names, lambda *kernels: np.concatenate([kernel.T for kernel in kernels], axis=1))


def joined(*names: str) -> Source:
    """Biases one after the other."""
    return Source(names, lambda *biases: np.concatenate([bias.reshape(-1) for bias in biases]))


def dense(ours: str, theirs: str) -> Table:
    """A dense layer in PyTorch's names."""
    return {f"{ours}/kernel": transposed(f"{theirs}.weight"), f"{ours}/bias": same(f"{theirs}.bias")}


def norm(ours: str, theirs: str) -> Table:
    """A normalisation in PyTorch's names."""
    return {f"{ours}/scale": same(f"{theirs}.weight"), f"{ours}/bias": same(f"{theirs}.bias")}
