"""What stage B returns: segments, wall clusters, representative lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import FloatArray


@dataclass(frozen=True, eq=False)
class Walls:
    """The walls of one map (paper, section III-B). All lengths in metres, world frame.

    Attributes
    ----------
    segments_m : (N, 4) float
        Line segments x0, y0, x1, y1.
    segment_direction : (N,) int
        Index of each segment's dominant direction.
    segment_cluster : (N,) int
        Index of each segment's wall cluster, which is that of its representative line; -1 for none.
    lines_m : (L, 4) float
        Representative lines x0, y0, x1, y1 as far as they divide the map.
    line_direction : (L,) int
        Index of each line's dominant direction.
    line_weight : (L,) float
        Share of each line that walls cover, in [0, 1].
    """

    segments_m: FloatArray
    segment_direction: NDArray[np.int32]
    segment_cluster: NDArray[np.int32]
    lines_m: FloatArray
    line_direction: NDArray[np.int32]
    line_weight: FloatArray
