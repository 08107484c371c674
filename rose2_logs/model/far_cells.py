"""Cells far from everything else: a stray speck, or rays through a window, must not cost as a building.

The explored part of a map is a rectangle, so one cell 300 m away makes it as large as a town. What was
explored shows as blocks of cells that are mostly known; rays and specks do not fill theirs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.model.labels import COUNTED_AT_ONCE, cells_where

BLOCK_CELLS = 16
"""Side of the blocks in cells: a ray through one leaves it nearly empty."""
FILLED_SHARE = 0.5
"""Cells of a block that are known where it was explored: with rays two cells apart, half of them."""


@dataclass(frozen=True)
class FarCells:
    """What is left out of a map because it is far from the rest.

    Attributes
    ----------
    window : (slice, slice)
        Rows and columns of what stays.
    count : int
        Known cells that are left out.
    farthest_m : float
        Distance of the farthest of them from what stays, in meters.
    """

    window: tuple[slice, slice]
    count: int
    farthest_m: float

    @property
    def note(self) -> str:
        """One line that tells of it."""
        cells = "1 known cell" if self.count == 1 else f"{self.count} known cells"
        return (
            f"{cells} up to {self.farthest_m:.0f} m from the rest of the map, where nothing else is known "
            "but rays and specks, are left out; occupancy.far_cells=keep takes them with it"
        )


def find_far_cells(
    cells: NDArray[np.int8], resolution_m: float, parameters: OccupancyParameters
) -> FarCells | None:
    """Find what is far from the rest of a map and would make its explored part much larger.

    Parameters
    ----------
    cells : (H, W) int8
        Occupancy in percent, -1 for unknown.
    resolution_m : float
        Side of a cell.
    parameters : OccupancyParameters
        Whether and from when on something is left out.

    Returns
    -------
    FarCells or None
        None where nothing is left out, as in nearly all maps.
    """
    if parameters.far_cells == "keep" or cells.shape[0] * cells.shape[1] == 0:
        return None
    known_of, spans = _known_extent(cells)
    most = spans / parameters.far_min_gain
    # A window that is full enough cannot shrink so much: hardly a map goes on from here to lists of cells.
    if not 0 < known_of.sum() <= most:
        return None
    window = _explored_window(known_of, cells.shape, resolution_m, parameters, most)
    if window is None:
        return None
    row, column = np.divmod(cells_where(cells, lambda part: part >= 0), cells.shape[1])
    down, right = (
        np.maximum(np.maximum(along.start - place, place - along.stop + 1), 0)
        for along, place in zip(window, (row, column), strict=True)
    )
    away = np.hypot(down, right)
    return FarCells(window, int(np.count_nonzero(away)), float(away.max()) * resolution_m)


def _known_extent(cells: NDArray[np.int8]) -> tuple[NDArray[np.intp], int]:
    """Count the known cells of each block, and all cells of the smallest rectangle around the known ones."""
    height, width = cells.shape
    beside = np.arange(0, width, BLOCK_CELLS)
    counts = np.zeros((-(-height // BLOCK_CELLS), len(beside)), np.intp)
    rows, columns = np.zeros(height, bool), np.zeros(width, bool)
    whole = height - height % BLOCK_CELLS
    at_once = max(1, COUNTED_AT_ONCE // (width * BLOCK_CELLS)) * BLOCK_CELLS
    for low, high in pairwise([*range(0, whole, at_once), *sorted({whole, height})]):
        known = cells[low:high] >= 0
        rows[low:high] = known.any(1)
        # At most the side of a block, so that a byte holds it.
        tall = known.view(np.uint8).reshape(-1, min(BLOCK_CELLS, high - low), width)
        stacked = np.add.reduce(tall, axis=1, dtype=np.uint8)
        columns |= stacked.any(0)
        first = low // BLOCK_CELLS
        counts[first : first + len(stacked)] = np.add.reduceat(stacked, beside, axis=1, dtype=np.intp)
    if not rows.any():
        return counts, 0
    spans = [int(np.ptp(np.flatnonzero(each))) + 1 for each in (rows, columns)]
    return counts, spans[0] * spans[1]


def _explored_window(
    known: NDArray[np.intp],
    shape: tuple[int, ...],
    resolution_m: float,
    parameters: OccupancyParameters,
    most: float,
) -> tuple[slice, slice] | None:
    """Rows and columns of a canvas around all filled blocks that could hold a room.

    They begin and end with blocks of the canvas, so that the part of a map that stays is left as it is. None
    without such blocks, and where there would be more than `most` cells.
    """
    filled = (known >= FILLED_SHARE * BLOCK_CELLS**2).astype(np.uint8)
    # A filled block and the filled ones around it are of one piece: in nearly all maps that decides.
    padded = np.pad(known * filled, 1)
    nearby = padded[:-2] + padded[1:-1] + padded[2:]
    nearby = nearby[:, :-2] + nearby[:, 1:-1] + nearby[:, 2:]
    sure = np.nonzero(filled * (nearby * resolution_m**2 >= parameters.far_min_area_m2))
    if len(sure[0]):
        low, high = (np.array([of(sure[1]), of(sure[0])]) for of in (np.min, np.max))
        if _cells_of(_with_margin(low, high + 1, shape, resolution_m, parameters)) > most:
            return None
    import cv2

    count, piece, boxes, _ = cv2.connectedComponentsWithStats(filled, connectivity=8)
    cells = np.bincount(piece.reshape(-1), known.reshape(-1), count)
    boxes = boxes[1:][cells[1:] * resolution_m**2 >= parameters.far_min_area_m2]
    if not len(boxes):
        return None
    low, high = boxes[:, :2].min(axis=0), (boxes[:, :2] + boxes[:, 2:4]).max(axis=0)
    window = _with_margin(low, high, shape, resolution_m, parameters)
    return None if _cells_of(window) > most else window


def _with_margin(
    low: NDArray[np.intp],
    high: NDArray[np.intp],
    shape: tuple[int, ...],
    resolution_m: float,
    parameters: OccupancyParameters,
) -> tuple[slice, slice]:
    """Rows and columns of a canvas from blocks `low` (2,), in x and y, to before `high`, with a margin."""
    # A block more, for those at the border of a floor are not filled.
    margin = int(np.ceil(parameters.far_margin_m / (resolution_m * BLOCK_CELLS))) + 1
    columns, rows = (
        slice(max(int(begin - margin) * BLOCK_CELLS, 0), min(int(end + margin) * BLOCK_CELLS, side))
        for begin, end, side in zip(low, high, shape[::-1], strict=True)
    )
    return rows, columns


def _cells_of(window: tuple[slice, slice]) -> int:
    rows, columns = (int(along.stop - along.start) for along in window)
    return rows * columns
