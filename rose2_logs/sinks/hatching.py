"""The parts of rooms that nobody has seen yet, as lines to hatch them with."""

from __future__ import annotations

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.occupancy import UNKNOWN, BoolArray, FloatArray, GridGeometry, straight_runs
from rose2_logs.tracking.frames import TrackedSnapshot

HATCH_STEP_M = 0.4
"""Distance of the lines along a row of cells: told from a fill, and a niche of a metre gets some."""
HATCH_MIN_M = 0.3
"""Shorter lines are left out: gaps between rays and the inside of walls and chairs."""


def hatch_unseen(frame: TrackedSnapshot) -> tuple[FloatArray, NDArray[np.intp]]:
    """Hatch what the rooms' shapes hold of unknown cells.

    The lines lie on the diagonals of the grid, so those of neighbouring rooms go on in one another.

    Returns
    -------
    lines_m : (N, 4) float
        x0, y0, x1, y1, world metres.
    room : (N,) int
        Index of the room of each.
    """
    geometry = frame.analysis.geometry
    period = max(2, round(HATCH_STEP_M / geometry.resolution_m))
    shortest = HATCH_MIN_M / np.sqrt(2) / geometry.resolution_m
    lines, rooms = [np.zeros((0, 4))], [np.zeros(0, np.intp)]
    for room, shape in enumerate(frame.analysis.rooms.polygons):
        if shape.is_empty:
            continue
        inside, corner = cells_within(shape, geometry)
        row, column = np.nonzero(inside & _unknown(frame.snapshot.cells, corner, inside.shape))
        row, column = row + corner[0], column + corner[1]
        hatched = (row + column) % period == 0
        first, last = straight_runs(row[hatched], column[hatched], (1, -1))
        is_long = last[:, 0] - first[:, 0] >= shortest
        ends = np.concatenate([first[is_long], last[is_long]], axis=1).reshape(-1, 2, 2)
        lines.append(geometry.cell_centres(ends[..., 0], ends[..., 1]).reshape(-1, 4))
        rooms.append(np.full(len(ends), room))
    return np.concatenate(lines), np.concatenate(rooms)


def cells_within(shape: BaseGeometry, geometry: GridGeometry) -> tuple[BoolArray, tuple[int, int]]:
    """Cells of a grid, continued beyond its canvas, that a shape covers.

    Returns
    -------
    inside : (h, w) bool
        Within the shape's box.
    corner : (int, int)
        Row and column of the box's first cell; negative beyond the canvas.
    """
    rings = [
        geometry.world_to_grid(shapely.get_coordinates(ring)) / geometry.resolution_m - 0.5
        for ring in shapely.get_rings(shapely.get_parts(shape))
    ]
    points = np.concatenate(rings)
    low = np.floor(points.min(axis=0)).astype(int)
    width, height = (np.ceil(points.max(axis=0)).astype(int) - low + 1).tolist()
    mask = np.zeros((height, width), np.uint8)
    # Rings within rings are holes to fillPoly, as they are to the shape.
    cv2.fillPoly(mask, [np.rint(ring - low).astype(np.int32) for ring in rings], 1)
    return mask.astype(bool), (int(low[1]), int(low[0]))


def _unknown(cells: NDArray[np.int8], corner: tuple[int, int], shape: tuple[int, ...]) -> BoolArray:
    """Unknown cells of a window that may reach beyond the canvas, where all are unknown."""
    unknown = np.ones(shape, bool)
    top, left = max(-corner[0], 0), max(-corner[1], 0)
    bottom, right = min(shape[0], cells.shape[0] - corner[0]), min(shape[1], cells.shape[1] - corner[1])
    if top < bottom and left < right:
        there = cells[corner[0] + top : corner[0] + bottom, corner[1] + left : corner[1] + right]
        unknown[top:bottom, left:right] = there == UNKNOWN
    return unknown
