"""The raster that buildings are drawn on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CELL_M = 0.05
"""Side of a cell, the usual one of SLAM maps."""

Labels = NDArray[np.int32]
Mask = NDArray[np.uint8]
Generator = np.random.Generator


def numbers_in(labels: Labels) -> list[int]:
    """Numbers above 0 of a label image, in ascending order."""
    sizes = np.bincount(labels.ravel())
    sizes[:1] = 0
    return np.flatnonzero(sizes).tolist()


def larger_than(labels: Labels, area_m2: float) -> set[int]:
    """Numbers above 0 of a label image that cover a larger area."""
    sizes = np.bincount(labels.ravel()) * CELL_M**2
    sizes[:1] = 0.0
    return set(np.flatnonzero(sizes > area_m2).tolist())


def cells(meters: float) -> int:
    """Number of cells along a length."""
    return round(meters / CELL_M)


def between(rng: Generator, low_m: float, high_m: float) -> int:
    """Random length of the given range, in cells."""
    return cells(rng.uniform(low_m, high_m))


def chance(rng: Generator, probability: float) -> bool:
    """Whether something of that probability happens."""
    return bool(rng.random() < probability)
