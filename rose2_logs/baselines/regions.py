"""Masks of free cells: erosion, distance, parts, lines. What lies outside a mask or its frame is obstacle."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import BoolArray, FloatArray

SQUARE = np.ones((3, 3), np.uint8)
CROSS = np.array(((0, 1, 0), (1, 1, 1), (0, 1, 0)), np.uint8)


def eroded(mask: BoolArray, kernel: NDArray[np.uint8] = SQUARE, rounds: int = 1) -> BoolArray:
    """Cells (H, W) whose neighbourhood lies in the mask altogether, `rounds` times over."""
    result = cv2.erode(
        mask.astype(np.uint8), kernel, iterations=rounds, borderType=cv2.BORDER_CONSTANT, borderValue=0
    )
    return result.astype(bool)


def opened(mask: BoolArray) -> BoolArray:
    """Mask (H, W) without its parts that are narrower than three cells."""
    return cv2.dilate(eroded(mask).astype(np.uint8), SQUARE).astype(bool)


def obstacle_distance(mask: BoolArray) -> NDArray[np.float32]:
    """Distance (H, W) of each cell of the mask from the nearest one outside, in whole cells; 0 outside.

    The survey's methods compare distances in whole cells: along a corridor with rough walls they are equal.
    """
    padded = np.pad(mask, 1).astype(np.uint8)
    distance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.rint(distance[1:-1, 1:-1]).astype(np.float32)


def connected_parts(mask: BoolArray, connectivity: int = 8) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Find the connected parts of a mask.

    Parameters
    ----------
    mask : (H, W) bool
    connectivity : int
        8, or 4 where parts that touch at corners only are apart.

    Returns
    -------
    part : (H, W) int32
        1..K, 0 outside the mask.
    size : (K + 1,) int64
        Cells of each part; those outside, first, count as none.
    """
    count, part = cv2.connectedComponents(mask.astype(np.uint8), connectivity=connectivity, ltype=cv2.CV_32S)
    size = np.bincount(part.ravel(), minlength=count).astype(np.int64)
    size[0] = 0
    return np.asarray(part, np.int32), size


def nearest_cells(points: FloatArray) -> NDArray[np.intp]:
    """Cells (..., 2) nearest to points in rows and columns; of two the one with the higher number."""
    return np.floor(points + 0.5).astype(np.intp)


def cells_on_lines(first: FloatArray, last: FloatArray) -> NDArray[np.intp]:
    """Cells (N, 2) on straight lines between points (L, 2), both in rows and columns."""
    steps = np.ceil(np.abs(last - first).max(1, initial=0.0)).astype(np.intp)
    line = np.repeat(np.arange(len(steps)), steps + 1)
    start = np.cumsum(steps + 1) - (steps + 1)
    share = (np.arange(len(line)) - start[line]) / np.maximum(steps[line], 1)
    return nearest_cells(first[line] + share[:, None] * (last - first)[line])
