"""Maps on the plan frame with their true rooms, and crops of them to train the network on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.regions.plan_frame import Labels, PlanFrame
from rose2_logs.segmentation.regions.plan_raster import (
    OFFSETS,
    OUTPUTS,
    FloatImage,
    PlanRaster,
    network_input,
    shares_of,
)

WORN_SHARE = 0.45
"""Share of the crops that are worn or furnished."""
STRETCHED_SHARE, STRETCH_MIN, STRETCH_MAX = 0.6, 0.8, 1.25
"""Share of the crops that are stretched, each axis by itself: rooms of other proportions."""
DIFFERENT_WEIGHT = (3.0, 2.0, 1.5)
"""Pairs in different rooms are rarer than others, the nearer the more so."""


@dataclass(frozen=True, eq=False)
class TruthRaster:
    """A map on a plan frame, and its true rooms.

    Attributes
    ----------
    raster : PlanRaster
    truths : tuple of (H, W) uint16
        True room of each cell, 0 where none.
    """

    raster: PlanRaster
    truths: tuple[NDArray[np.uint16], ...]

    @classmethod
    def of(
        cls, free: BoolArray, occupied: BoolArray, frame: PlanFrame, truths: tuple[Labels, ...]
    ) -> TruthRaster:
        """Sample the masks and truths (H, W) of a map."""
        sampled = tuple(frame.sampled(truth).astype(np.uint16) for truth in truths)
        return cls(PlanRaster.of(free, occupied, frame), sampled)


def random_crop(
    rng: np.random.Generator, one: TruthRaster, size: int
) -> tuple[FloatImage, FloatImage, FloatImage]:
    """Cut a square of a map around a cell of a room, turned, mirrored, at times stretched or worn.

    Returns
    -------
    inputs : (4, size, size) float32
    targets, weights : (OUTPUTS, size, size) float32
    """
    rows, columns = np.nonzero(one.truths[0])
    at = rng.integers(len(rows))
    stretch = rng.uniform(STRETCH_MIN, STRETCH_MAX, 2) if rng.random() < STRETCHED_SHARE else np.ones(2)
    sides = np.ceil(size / stretch).astype(int)
    low = np.array([rows[at], columns[at]]) - (rng.uniform(0.15, 0.85, 2) * sides).astype(int)
    turns, mirror = int(rng.integers(4)), bool(rng.integers(2))

    def seen(image: NDArray[Any], blend: bool) -> NDArray[Any]:
        window = _window(image, low, sides)
        if window.shape != (size, size):
            shrinks = window.shape[0] >= size and window.shape[1] >= size
            how = (cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR) if blend else cv2.INTER_NEAREST
            window = cv2.resize(window, (size, size), interpolation=how)
        return np.rot90(window[:, ::-1] if mirror else window, turns)

    wall, free = (seen(shares_of(steps), True) for steps in (one.raster.wall, one.raster.free))
    truths: list[Labels] = [seen(truth, False).astype(np.int32) for truth in one.truths]
    if rng.random() < WORN_SHARE:
        wall, free = _worn(rng, wall, free)
    targets, weights = network_targets(free > 0.3, truths)
    return network_input(wall, free), targets, weights


def _window(image: NDArray[Any], low: NDArray[np.int64], sides: NDArray[np.int64]) -> NDArray[Any]:
    out = np.zeros(tuple(sides), image.dtype)
    (r0, c0), (h, w) = low, image.shape
    ra, rb, ca, cb = max(r0, 0), min(r0 + sides[0], h), max(c0, 0), min(c0 + sides[1], w)
    if ra < rb and ca < cb:
        out[ra - r0 : rb - r0, ca - c0 : cb - c0] = image[ra:rb, ca:cb]
    return out


def _worn(rng: np.random.Generator, wall: FloatImage, free: FloatImage) -> tuple[FloatImage, FloatImage]:
    """Thin walls out, sprinkle spots, cut unknown holes, put furniture in, or leave a side unseen."""
    kind, size = rng.integers(5), wall.shape[0]
    if kind == 0:
        left = (rng.random(wall.shape) > rng.uniform(0, 0.3)).astype(np.float32)
        return wall * left, free
    wall, free = wall.copy(), free.copy()
    if kind == 1:
        spots = (rng.random(wall.shape) < rng.uniform(0, 0.006)) & (free > 0.5)
        wall[spots], free[spots] = 0.6, 0.4
    elif kind == 2:
        for _ in range(rng.integers(1, 4)):
            row, column = rng.integers(0, size, 2)
            height, width = rng.integers(3, 30, 2)
            wall[row : row + height, column : column + width] = 0
            free[row : row + height, column : column + width] = 0
    elif kind == 3:
        _furnish(rng, wall, free)
    else:
        angle, beyond = rng.uniform(0, 2 * np.pi), rng.uniform(0.1, 0.5) * size
        y, x = np.mgrid[:size, :size] - size / 2
        unseen = np.cos(angle) * x + np.sin(angle) * y > beyond
        wall[unseen], free[unseen] = 0, 0
    return wall, free


def _furnish(rng: np.random.Generator, wall: FloatImage, free: FloatImage) -> None:
    """Put hollow boxes of 0.3 to 2.5 m where the floor is free."""
    rows, columns = np.nonzero(free > 0.9)
    if len(rows) == 0:
        return
    for _ in range(rng.integers(1, 9)):
        at = rng.integers(len(rows))
        height, width = rng.integers(3, 26), rng.integers(3, 12)
        if rng.random() < 0.5:
            height, width = width, height
        box = np.s_[rows[at] : rows[at] + height, columns[at] : columns[at] + width]
        if (free[box] < 0.9).any():
            continue
        wall[box], free[box] = 0.7, 0.2
        inner = np.s_[rows[at] + 1 : rows[at] + height - 1, columns[at] + 1 : columns[at] + width - 1]
        wall[inner], free[inner] = 0, 0


def network_targets(valid: BoolArray, truths: list[Labels]) -> tuple[FloatImage, FloatImage]:
    """What the network is to answer, and how much each answer counts.

    Cells beside a room without a label (in doorways, below noise) are not asked about; neither are pairs on
    which two truths differ.

    Parameters
    ----------
    valid : (H, W) bool
        Free cells.
    truths : list of (H, W) int32
    """
    shape = valid.shape
    targets = np.zeros((OUTPUTS, *shape), np.float32)
    weights = np.zeros((OUTPUTS, *shape), np.float32)
    first = truths[0]
    distance = cv2.distanceTransform((first == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3)
    outside = valid & (first == 0) & (distance > 2.5)
    valid = valid & ((first > 0) | outside)
    for k, (down, right) in enumerate(OFFSETS):
        here, there = np.s_[down:, right:], np.s_[: shape[0] - down, : shape[1] - right]
        a, b = first[here], first[there]
        different = a != b
        counts = valid[here] & valid[there] & ((a > 0) | (b > 0))
        for other in truths[1:]:
            counts &= different == (other[here] != other[there])
        targets[k][here] = different
        weights[k][here] = counts * np.where(different, DIFFERENT_WEIGHT[k // 2], 1.0)
    targets[-1] = outside
    weights[-1] = valid * np.where(outside, 2.0, 1.0)
    return targets, weights
