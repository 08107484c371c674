"""Outlines of cells as shapes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.occupancy import BoolArray, FloatArray

NORTHWEST, NORTHEAST, SOUTHWEST, SOUTHEAST = 1, 2, 4, 8
"""Bits of the four cells around a corner of cells, rows counted southward."""


def outline(mask: BoolArray, resolution_m: float) -> BaseGeometry:
    """Outline of the cells of a mask as a polygon or multipolygon in the grid frame, meters."""
    shapes = room_outlines(mask.astype(np.int32), resolution_m)
    return shapes[0] if shapes else shapely.Polygon()


def room_outlines(labels: NDArray[np.integer], resolution_m: float) -> list[BaseGeometry]:
    """Outlines of the cells of rooms 1.. in the grid frame, meters; empty for numbers without cells.

    Where three rooms meet, each has a vertex, so that the outlines are a coverage in the sense of shapely.
    """
    count = int(labels.max(initial=0))
    room, row, column, code, second = _vertices(np.pad(labels, 1))
    along_row = _partners(room, row, column, second)
    # Where an outline touches itself, the edges on both sides of a cell of the room share a vertex.
    along_column = _partners(room, column, row, second ^ (code == NORTHEAST | SOUTHWEST))
    order, length = _rings(along_row, along_column, row * (labels.shape[1] + 1) + column, code, second)
    vertices = np.column_stack([column, row])[order] * resolution_m
    ring = np.repeat(np.arange(len(length)), length)
    return _polygons(
        shapely.linearrings(vertices, indices=ring), room[order][np.diff(ring, prepend=-1) > 0], count
    )


def _vertices(padded: NDArray[np.integer]) -> tuple[NDArray[np.int64], ...]:
    """Find where the outlines of rooms turn, meet a third room, or touch themselves.

    Returns
    -------
    room, row, column : (N,) int
        In the order of rooms, rows and columns. Vertices at which an outline passes straight on or touches
        itself are there twice.
    code : (N,) int
        Which of the four cells around are the room's.
    second : (N,) int
        0, or 1 for the second of two.
    """
    around = padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]
    northwest, northeast, southwest, southeast = around
    flat = (northwest == northeast) & (southwest == southeast)
    flat |= (northwest == southwest) & (northeast == southeast)
    row, column = np.divmod(np.flatnonzero(~flat), flat.shape[1])
    cells = np.column_stack([part[row, column] for part in around])
    is_same = cells[:, :, None] == cells[:, None, :]
    codes = is_same @ np.array([NORTHWEST, NORTHEAST, SOUTHWEST, SOUTHEAST])
    vertex, which = np.nonzero((cells > 0) & (is_same.argmax(2) == np.arange(4)))
    code = codes[vertex, which]
    twice = is_same.sum(2)[vertex, which] == 2
    index = np.repeat(np.arange(len(vertex)), 1 + twice)
    second = np.zeros(len(index), np.int64)
    second[1:] = index[1:] == index[:-1]
    room, vertex = cells[vertex, which][index].astype(np.int64), vertex[index]
    order = np.lexsort((second, column[vertex], row[vertex], room))
    return room[order], row[vertex][order], column[vertex][order], code[index][order], second[order]


def _partners(
    room: NDArray[np.int64], line: NDArray[np.int64], place: NDArray[np.int64], second: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Other end (N,) of the edge along a line of the grid at each vertex: every two that follow are one's."""
    order = np.lexsort((second, place, line, room))
    partner = np.empty(len(order), np.int64)
    partner[order] = order.reshape(-1, 2)[:, ::-1].ravel()
    return partner


def _rings(
    along_row: NDArray[np.int64],
    along_column: NDArray[np.int64],
    place: NDArray[np.int64],
    code: NDArray[np.int64],
    second: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Follow edges along rows and columns in turn, the room on the left; cut rings that touch themselves.

    Returns
    -------
    order : (M,) int
        The vertices, ring after ring, each place once in a ring.
    length : (K,) int
        Number of vertices of each ring.
    """
    at, is_outer = place.tolist(), (code & SOUTHEAST > 0).tolist()
    beside, below = along_row.tolist(), along_column.tolist()
    is_left = [True] * len(beside)
    # Most places have one vertex of a room: a ring can touch itself at the others only.
    once = ((second | np.append(second[1:], 0)) == 0).tolist()
    order: list[int] = []
    length = []
    for start in range(len(beside)):
        if not is_left[start]:
            continue
        # A ring's first vertex is its uppermost: around a hole, the room is on the left going down.
        first, then = (beside, below) if is_outer[start] else (below, beside)
        vertex = start
        ring: list[int] = []
        position: dict[int, int] = {}
        while is_left[vertex]:
            other = first[vertex]
            is_left[vertex] = is_left[other] = False
            for reached in (vertex, other):
                if once[reached]:
                    ring.append(reached)
                    continue
                back = position.setdefault(at[reached], len(ring))
                if back == len(ring):
                    ring.append(reached)
                elif back < len(ring) - 1:
                    cut = ring[back:]
                    order += cut
                    length.append(len(cut))
                    for dropped in ring[back + 1 :]:
                        position.pop(at[dropped], None)
                    del ring[back + 1 :]
            vertex = then[other]
        order += ring
        length.append(len(ring))
    return np.array(order, np.int64), np.array(length, np.int64)


def _polygons(rings: NDArray[np.object_], room: NDArray[np.int64], count: int) -> list[BaseGeometry]:
    """Polygons of rings, which come room by room: those around holes run clockwise."""
    outer = shapely.is_ccw(rings)
    all_shells, all_holes = shapely.polygons(rings[outer]), rings[~outer]
    numbers = np.arange(1, count + 2)
    ends_of_shells, ends_of_holes = (
        np.searchsorted(room[each], numbers).tolist() for each in (outer, ~outer)
    )
    shapes: list[BaseGeometry] = []
    for of_shells, of_holes in zip(pairwise(ends_of_shells), pairwise(ends_of_holes), strict=True):
        shells, holes = all_shells[slice(*of_shells)], all_holes[slice(*of_holes)]
        if len(shells) == 1 and len(holes) == 0:  # as most rooms
            shapes.append(shells[0])
            continue
        if len(shells) > 1:
            shapely.prepare(shells)
            surround = shapely.covers(shells[:, None], holes[None])
            part = np.where(surround, shapely.area(shells)[:, None], np.inf).argmin(0)
        else:
            part = np.zeros(len(holes), int)
        for index in np.unique(part):
            shells[index] = shapely.polygons(shells[index].exterior, holes[part == index])
        if len(shells) == 0:
            shapes.append(shapely.Polygon())
        else:
            shapes.append(shells[0] if len(shells) == 1 else shapely.multipolygons(shells))
    return shapes


def outer_rings(shape: BaseGeometry) -> list[FloatArray]:
    """Closed outer rings (K, 2) of the polygons of a shape, world meters."""
    parts = shapely.get_parts(shape)
    rings = shapely.get_exterior_ring(parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON])
    points, ring = shapely.get_coordinates(rings, return_index=True)
    return np.split(points, np.flatnonzero(np.diff(ring)) + 1) if len(points) else []
