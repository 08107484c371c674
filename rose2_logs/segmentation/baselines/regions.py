"""Masks of free cells: erosion, distance, parts, lines. All outside a mask or its frame is obstacle."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import BoolArray, FloatArray

SQUARE = np.ones((3, 3), np.uint8)
SAME_DECIMALS = 6
"""Positions in cells that differ less are the same."""
CROSS = np.array(((0, 1, 0), (1, 1, 1), (0, 1, 0)), np.uint8)


def eroded(mask: BoolArray, kernel: NDArray[np.uint8] = SQUARE, rounds: int = 1) -> BoolArray:
    """Cells (H, W) whose whole neighborhood is in the mask, repeated `rounds` times."""
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


def ranks_by_size(labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """Rank labels by their cells, in a way that does not depend on how the map lies.

    Parameters
    ----------
    labels : (H, W) int32
        Labels 1.., 0 elsewhere.

    Returns
    -------
    rank : (N,) int32
        Rank of each label, the largest first; of several as large the one that lies nearer to the middle of
        all labeled cells, and then the lower label. The last rank is that of 0.
    """
    row, column = np.nonzero(labels)
    present = labels[row, column]
    size = np.bincount(present, minlength=1)
    middle = middle_of(labels > 0)
    from_middle = np.hypot(row - middle[0], column - middle[1])
    distance = np.bincount(present, from_middle, minlength=1) / np.maximum(size, 1)
    order = np.lexsort((np.round(distance, SAME_DECIMALS), -size))
    rank = np.empty(len(size), np.int32)
    rank[np.append(order[order != 0], 0)] = np.arange(len(size))
    return rank


def middle_of(mask: BoolArray) -> FloatArray:
    """Mean row and column (2,) of the cells of a mask; NaN without any."""
    rows, columns = mask.sum(1), mask.sum(0)
    weighted = np.array([rows @ np.arange(len(rows)), columns @ np.arange(len(columns))], float)
    return weighted / (rows.sum() or np.nan)


def nearest_cells(points: FloatArray, middle: FloatArray) -> NDArray[np.intp]:
    """Cells (..., 2) nearest to points in rows and columns.

    Of two cells it is the one towards the middle of the map, so that the cells turn with the map.
    """
    points = np.round(points, SAME_DECIMALS)
    return np.where(points < middle, np.floor(points + 0.5), np.ceil(points - 0.5)).astype(np.intp)


def cells_on_lines(first: FloatArray, last: FloatArray, middle: FloatArray) -> NDArray[np.intp]:
    """Cells (N, 2) on straight lines between points (L, 2); see `nearest_cells`."""
    steps = np.ceil(np.abs(last - first).max(1, initial=0.0)).astype(np.intp)
    line = np.repeat(np.arange(len(steps)), steps + 1)
    start = np.cumsum(steps + 1) - (steps + 1)
    share = (np.arange(len(line)) - start[line]) / np.maximum(steps[line], 1)
    return nearest_cells(first[line] + share[:, None] * (last - first)[line], middle)
