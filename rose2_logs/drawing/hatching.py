"""The parts of rooms that nobody has seen yet, as lines to hatch them with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.labels import straight_runs
from rose2_logs.model.occupancy import UNKNOWN, BoolArray, FloatArray, GridGeometry
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

HATCH_STEP_M = 0.4
"""Distance of the lines along a row of cells: told from a fill, and a niche of a meter gets some."""
HATCH_MIN_M = 0.3
"""Shorter lines are left out: gaps between rays and the inside of walls and chairs."""


def hatch_unseen(step: TrackedSnapshot) -> tuple[FloatArray, NDArray[np.intp]]:
    """Hatch what the rooms' shapes hold of unknown cells.

    The lines lie on the diagonals of the grid, so those of neighboring rooms go on in one another.

    Returns
    -------
    lines_m : (N, 4) float
        x0, y0, x1, y1, world meters.
    room : (N,) int
        Index of the room of each.
    """
    geometry = step.analysis.geometry
    period = max(2, round(HATCH_STEP_M / geometry.resolution_m))
    shortest = HATCH_MIN_M / np.sqrt(2) / geometry.resolution_m
    shapes = cells_within(step.analysis.rooms.polygons, geometry)
    hatched = _to_hatch(step.snapshot.cells, shapes, period)
    # Cells of all rooms together, each room's moved so far along the rows that no line reaches the next.
    apart = hatched.cells.shape[0] + hatched.cells.shape[1]
    rows, columns = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
    for room, inside, corner in shapes:
        top, left = corner[0] - hatched.corner[0], corner[1] - hatched.corner[1]
        window = hatched.cells[top : top + inside.shape[0], left : left + inside.shape[1]]
        row, column = np.divmod(np.flatnonzero(inside & window), inside.shape[1])
        rows.append(row + top)
        columns.append(column + (left + room * apart))
    first, last = straight_runs(np.concatenate(rows), np.concatenate(columns), (1, -1))
    is_long = last[:, 0] - first[:, 0] >= shortest
    ends = np.stack([first[is_long], last[is_long]], axis=1)
    rooms, column = np.divmod(ends[..., 1], apart)
    lines = geometry.cell_centers(ends[..., 0] + hatched.corner[0], column + hatched.corner[1])
    return lines.reshape(-1, 4), rooms[:, 0]


class Covered(NamedTuple):
    """Cells of a grid, continued beyond its canvas, that a shape covers.

    Attributes
    ----------
    number : int
        Index of the shape.
    inside : (h, w) bool
        Within the shape's box.
    corner : (int, int)
        Row and column of the box's first cell; negative beyond the canvas.
    """

    number: int
    inside: BoolArray
    corner: tuple[int, int]


def cells_within(shapes: Sequence[BaseGeometry], geometry: GridGeometry) -> list[Covered]:
    """Find the cells that each of some shapes covers, those without any point left out."""
    parts, shape = shapely.get_parts(np.array(shapes, object), return_index=True)
    rings, part = shapely.get_rings(parts, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    if not len(points):
        return []
    cells = geometry.world_to_grid(points) / geometry.resolution_m - 0.5
    number, begins = np.unique(shape[part[ring]], return_index=True)
    lows = np.floor(np.minimum.reduceat(cells, begins)).astype(int)
    sizes = np.ceil(np.maximum.reduceat(cells, begins)).astype(int) - lows + 1
    counts = np.diff(np.append(begins, len(points)))
    corners = np.rint(cells - np.repeat(lows, counts, axis=0)).astype(np.int32)
    ring_begins = np.flatnonzero(np.diff(ring)) + 1
    found = []
    for index, begin, count, low, size in zip(
        number.tolist(), begins.tolist(), counts.tolist(), lows.tolist(), sizes.tolist(), strict=True
    ):
        inside = np.zeros((size[1], size[0]), np.uint8)
        own = ring_begins[
            np.searchsorted(ring_begins, begin, "right") : np.searchsorted(ring_begins, begin + count)
        ]
        # Rings within rings are holes to fillPoly, as they are to the shape.
        cv2.fillPoly(inside, np.split(corners[begin : begin + count], own - begin), 1)
        found.append(Covered(index, inside.view(bool), (low[1], low[0])))
    return found


class _Part(NamedTuple):
    """Some cells of a grid, from the row and column of its corner on, which may lie beyond the canvas."""

    cells: BoolArray
    corner: tuple[int, int]


def _to_hatch(cells: NDArray[np.int8], shapes: Sequence[Covered], period: int) -> _Part:
    """Unknown cells on every so many diagonals, in the box of all shapes; beyond the canvas all are."""
    if not shapes:
        return _Part(np.zeros((0, 0), bool), (0, 0))
    top, left = (min(each.corner[axis] for each in shapes) for axis in (0, 1))
    bottom, right = (max(each.corner[axis] + each.inside.shape[axis] for each in shapes) for axis in (0, 1))
    marked = np.zeros((bottom - top, right - left), bool)
    for row in range(min(period, len(marked))):
        marked[row::period, -(row + top + left) % period :: period] = True
    rows = slice(*np.clip([top, bottom], 0, cells.shape[0]).tolist())
    columns = slice(*np.clip([left, right], 0, cells.shape[1]).tolist())
    there = marked[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
    there &= cells[rows, columns] == UNKNOWN
    return _Part(marked, (top, left))
