"""Line segments of the clean map and the direction that each belongs to (paper, III-B)."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import BoolArray, FloatArray
from rose2_logs.parameters import WallParameters


def detect_segments(clean: BoolArray, resolution_m: float, parameters: WallParameters) -> FloatArray:
    """Find straight segments by the probabilistic Hough transform.

    Returns
    -------
    segments_m : (N, 4) float
        x0, y0, x1, y1 in the grid frame, metres.
    """
    found = cv2.HoughLinesP(
        clean.astype(np.uint8),
        1,
        parameters.hough_angle_step_rad,
        max(2, round(parameters.hough_min_votes_m / resolution_m)),
        minLineLength=parameters.segment_min_length_m / resolution_m,
        maxLineGap=parameters.segment_max_gap_m / resolution_m,
    )
    if found is None:
        return np.zeros((0, 4))
    segments: FloatArray = (np.asarray(found, float).reshape(-1, 4) + 0.5) * resolution_m
    # The detector's order is an accident of its sampling.
    return segments[np.lexsort(segments.T[::-1])]


def detect_local_segments(
    occupied: BoolArray, clean: BoolArray, resolution_m: float, parameters: WallParameters
) -> tuple[FloatArray, BoolArray]:
    """Find the walls that follow no dominant direction: curved and slanted ones.

    Longer segments are asked for than along the dominant directions, for here nothing else tells a wall from
    furniture.

    Returns
    -------
    segments_m : (N, 4) float
        Segments of the occupied cells outside the clean map.
    walls : (H, W) bool
        The occupied cells that they pass over.
    """
    rest = occupied & ~clean
    minimum = parameters.local_segment_min_length_m
    longer = dataclasses.replace(parameters, segment_min_length_m=minimum, hough_min_votes_m=minimum / 2)
    segments = detect_segments(rest, resolution_m, longer)
    drawn = np.zeros(rest.shape, np.uint8)
    ends = np.floor(segments / resolution_m).astype(np.int32).reshape(-1, 2, 2)
    cv2.polylines(drawn, list(ends), isClosed=False, color=1, thickness=3)
    return segments, rest & (drawn > 0)


def segment_angles(segments_m: FloatArray) -> FloatArray:
    """Angle (N,) of each segment in [0, pi)."""
    return np.mod(np.arctan2(segments_m[:, 3] - segments_m[:, 1], segments_m[:, 2] - segments_m[:, 0]), np.pi)


def group_by_angle(
    segments_m: FloatArray, dominant_rad: FloatArray, parameters: WallParameters
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Give each segment a direction: the nearest dominant one, or a local one where none is near.

    A curved or slanted wall follows no dominant direction; its segments share local directions, which lie on
    a lattice of `local_direction_step_rad` counted from the strongest dominant direction, so that they turn
    with the map.

    Returns
    -------
    directions_rad : (D,) float
        The dominant directions, then the local ones in use.
    direction : (N,) int32
        Index into `directions_rad` of each segment.
    """
    angle = segment_angles(segments_m)
    step = parameters.local_direction_step_rad
    base = dominant_rad[0] if len(dominant_rad) else 0.0
    slot = np.rint(np.mod(angle - base, np.pi) / step).astype(np.int64) % round(np.pi / step)
    used, local = np.unique(slot, return_inverse=True)
    direction: NDArray[np.int64] = len(dominant_rad) + local.astype(np.int64)
    if len(dominant_rad):
        away = np.abs(angle[:, None] - dominant_rad[None])
        away = np.minimum(away, np.pi - away)
        near = away.min(1) <= parameters.direction_tolerance_rad
        direction[near] = away.argmin(1)[near]
    directions = np.concatenate([dominant_rad, np.mod(base + used * step, np.pi)])
    kept, direction = np.unique(
        np.concatenate([np.arange(len(dominant_rad)), direction]), return_inverse=True
    )
    return directions[kept], direction[len(dominant_rad) :].astype(np.int32)
