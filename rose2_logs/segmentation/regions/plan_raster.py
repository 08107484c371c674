"""A map on its plan frame, and what the network sees of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.regions.plan_frame import POINTS_PER_SIDE, PlanFrame

FloatImage = NDArray[np.float32]

SHARE_STEPS = POINTS_PER_SIDE**2
OFFSETS = ((0, 2), (2, 0), (0, 6), (6, 0), (0, 14), (14, 0))
"""Pairs of cells that the network is asked about, rows and columns apart: 0.2, 0.6 and 1.4 m."""
OUTPUTS = len(OFFSETS) + 1
"""An answer for each pair, and one whether a cell is outside."""
DISTANCE_MAX = 30
"""Distances are told to the network up to this many cells."""
WALL_MIN_SHARE, FREE_MIN_SHARE = 0.25, 0.5
"""Shares from which distances are measured: two points of a cell are wall, half of it is free."""


@dataclass(frozen=True, eq=False)
class PlanRaster:
    """A map on its plan frame.

    Attributes
    ----------
    wall, free : (H, W) uint8
        Points of each cell, of `SHARE_STEPS`, that are occupied and free.
    """

    wall: NDArray[np.uint8]
    free: NDArray[np.uint8]

    @classmethod
    def of(cls, free: BoolArray, occupied: BoolArray, frame: PlanFrame) -> PlanRaster:
        """Sample the masks (H, W) of a map."""
        return cls(*frame.counts(occupied, free))


def shares_of(steps: NDArray[np.integer[Any]]) -> FloatImage:
    """Shares in [0, 1] from counts of points."""
    return (steps / np.float32(SHARE_STEPS)).astype(np.float32)


def network_input(wall: FloatImage, free: FloatImage) -> FloatImage:
    """Channels (4, H, W): wall and free share, distances from walls and from what is not free."""
    from_wall = cv2.distanceTransform((wall < WALL_MIN_SHARE).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3)
    from_rest = cv2.distanceTransform((free > FREE_MIN_SHARE).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3)
    scaled = [np.minimum(d, DISTANCE_MAX) / np.float32(DISTANCE_MAX) for d in (from_wall, from_rest)]
    return np.stack([wall, free, *scaled]).astype(np.float32)
