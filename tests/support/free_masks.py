"""Free cells drawn by hand, with their true rooms, at 5 cm a cell: what the baselines segment."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

RESOLUTION_M = 0.05
DOOR = 18
WALL = 4

Mask = NDArray[np.bool_]
Labels = NDArray[np.int32]


def two_rooms(size: tuple[int, int] = (100, 120)) -> tuple[Mask, Labels]:
    """Two rooms of 5 x 6 m with a door of 0.9 m between them; the door's cells are of no room."""
    height, width = size
    rooms = np.zeros((height + 10, 2 * width + WALL + 10), np.int32)
    rooms[5 : 5 + height, 5 : 5 + width] = 1
    rooms[5 : 5 + height, 5 + width + WALL : 5 + 2 * width + WALL] = 2
    free = rooms > 0
    free[40 : 40 + DOOR, 5 + width : 5 + width + WALL] = True
    return free, rooms


def ring() -> tuple[Mask, Labels]:
    """Four rooms of 4 x 4 m, 1 to 4, and a corridor of 2 m around them, 5, with a door to each."""
    room, corridor = 80, 40
    block = 2 * room + 3 * WALL
    side = block + 2 * corridor
    rooms = np.full((side, side), 5, np.int32)
    rooms[corridor:-corridor, corridor:-corridor] = 0
    free = rooms > 0
    starts = (corridor + WALL, corridor + 2 * WALL + room)
    for number, (row, column) in enumerate([(r, c) for r in starts for c in starts], start=1):
        rooms[row : row + room, column : column + room] = number
        free[row : row + room, column : column + room] = True
        door = column + 30
        beyond = slice(row - WALL, row) if row == starts[0] else slice(row + room, row + room + WALL)
        free[beyond, door : door + DOOR] = True
    return np.pad(free, 5), np.pad(rooms, 5)


def overlap_with_room(labels: Labels, rooms: Labels, room: int) -> float:
    """Intersection over union of a true room with the label that most of its cells have."""
    is_room = rooms == room
    is_found = labels == np.bincount(labels[is_room]).argmax()
    return float((is_room & is_found).sum() / (is_room | is_found).sum())


def with_pocket(free: Mask, side: int) -> tuple[Mask, tuple[slice, slice]]:
    """Add a closed square of free cells beside a map; return also where it is."""
    wider = np.pad(free, ((0, 0), (0, side + 10)))
    where = (slice(10, 10 + side), slice(free.shape[1] + 5, free.shape[1] + 5 + side))
    wider[where] = True
    return wider, where
