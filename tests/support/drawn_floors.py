"""Floors drawn from rectangles in meters, with their rooms: grids of rooms, offices, white around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RESOLUTION_M = 0.05
WALL_M = 0.15
Box = tuple[float, float, float, float]
"""Left, bottom, right, top, meters."""


@dataclass(frozen=True, eq=False)
class Floor:
    """A drawn map.

    Attributes
    ----------
    cells : (H, W) int8
        As in an occupancy grid, row 0 at the bottom.
    rooms : (H, W) int32
        The drawn room 1.. of each free cell, 0 elsewhere and in doors.
    resolution_m : float
    """

    cells: NDArray[np.int8]
    rooms: NDArray[np.int32]
    resolution_m: float = RESOLUTION_M


def draw_floor(
    rooms: Sequence[Box],
    doors: Sequence[Box] = (),
    *,
    margin_m: float = 1.0,
    outside: int = -1,
    wall_m: float = WALL_M,
    resolution_m: float = RESOLUTION_M,
) -> Floor:
    """Draw rooms with walls of `wall_m` around them, and doors: gaps in walls.

    Rooms that lie `wall_m` apart share a wall. What no room or wall covers has the value `outside`.
    """
    boxes = np.array(list(rooms), float)
    low = boxes[:, :2].min(0) - wall_m - margin_m
    size = boxes[:, 2:].max(0) + wall_m + margin_m - low

    def within(box: Box, beyond_m: float = 0.0) -> tuple[slice, slice]:
        x0, y0, x1, y1 = box
        first = np.rint((np.array([x0, y0]) - beyond_m - low) / resolution_m).astype(int)
        last = np.rint((np.array([x1, y1]) + beyond_m - low) / resolution_m).astype(int)
        return slice(first[1], last[1]), slice(first[0], last[0])

    columns, rows = np.rint(size / resolution_m).astype(int)
    cells = np.full((rows, columns), outside, np.int8)
    labels = np.zeros(cells.shape, np.int32)
    for room in rooms:
        cells[within(room, wall_m)] = 100
    for number, room in enumerate(rooms, start=1):
        cells[within(room)] = 0
        labels[within(room)] = number
    for door in doors:
        cells[within(door)] = 0
    return Floor(cells, labels, resolution_m)


def room_grid(rows: int, columns: int, side_m: float, door_m: float = 0.8) -> Floor:
    """Square rooms in a grid, a door in the middle of every wall between two of them: all in line."""
    step = side_m + WALL_M
    rooms = [
        (c * step, r * step, c * step + side_m, r * step + side_m)
        for r in range(rows)
        for c in range(columns)
    ]
    first, last = (side_m - door_m) / 2, (side_m + door_m) / 2
    doors = [
        (c * step + side_m, r * step + first, (c + 1) * step, r * step + last)
        for r in range(rows)
        for c in range(columns - 1)
    ]
    doors += [
        (c * step + first, r * step + side_m, c * step + last, (r + 1) * step)
        for r in range(rows - 1)
        for c in range(columns)
    ]
    return draw_floor(rooms, doors)


def corridor_of_offices(
    count: int = 4,
    *,
    office_m: tuple[float, float] = (4.0, 5.0),
    corridor_m: float = 2.0,
    door_m: float = 0.9,
    outside: int = -1,
    margin_m: float = 1.0,
    resolution_m: float = RESOLUTION_M,
) -> Floor:
    """Offices 1..2N above and below a corridor 2N + 1, a door from each to the corridor."""
    wide, deep = office_m
    step = wide + WALL_M
    rooms, doors = [], []
    for bottom, wall in ((corridor_m + WALL_M, corridor_m), (-deep - WALL_M, -WALL_M)):
        for k in range(count):
            rooms.append((k * step, bottom, k * step + wide, bottom + deep))
            doors.append((k * step + 1, wall, k * step + 1 + door_m, wall + WALL_M))
    rooms.append((0.0, 0.0, count * step - WALL_M, corridor_m))
    return draw_floor(rooms, doors, outside=outside, margin_m=margin_m, resolution_m=resolution_m)


def turned(floor: Floor, degrees: float) -> Floor:
    """The floor turned about its middle: the nearest cells, unknown where none is."""
    angle = np.radians(degrees)
    c, s = np.cos(angle), np.sin(angle)
    height, width = floor.cells.shape
    rows = int(np.ceil(abs(width * s) + abs(height * c)))
    columns = int(np.ceil(abs(width * c) + abs(height * s)))
    y, x = np.indices((rows, columns)) - np.array([(rows - 1) / 2, (columns - 1) / 2])[:, None, None]
    column = np.rint(x * c + y * s + (width - 1) / 2).astype(int)
    row = np.rint(y * c - x * s + (height - 1) / 2).astype(int)
    there = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    row, column = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
    cells = np.where(there, floor.cells[row, column], -1).astype(np.int8)
    rooms = np.where(there, floor.rooms[row, column], 0).astype(np.int32)
    return Floor(cells, rooms, floor.resolution_m)


def rooms_right(found: NDArray[np.integer], true: NDArray[np.integer], least: float = 0.8) -> float:
    """Share of the true rooms that a found room covers with an IoU of `least` or more, in [0, 1]."""
    both = np.zeros((int(true.max()) + 1, int(found.max()) + 1))
    np.add.at(both, (true, found), 1)
    union = both.sum(1)[:, None] + both.sum(0)[None] - both
    iou = both[1:, 1:] / np.maximum(union[1:, 1:], 1)
    return float((iou.max(1, initial=0.0) >= least).mean())
