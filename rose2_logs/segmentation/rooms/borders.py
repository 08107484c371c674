"""Which cells are a room's: left out free space is taken in, borders are straightened."""

from __future__ import annotations

import functools

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.model.labels import narrow
from rose2_logs.model.occupancy import BoolArray


def adopt_left_out(
    labels: NDArray[np.int32], free: BoolArray, resolution_m: float, parameters: FloorPlanParameters
) -> NDArray[np.int32]:
    """Give free space outside all rooms to the room that it opens to most, where it is wide.

    A face of which little was seen is outside, for it holds rays through windows; what was seen of it
    may yet be the corner of a room. Rays are narrower than `leak_max_width_m`.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms of the free cells, 0 elsewhere.
    free : (H, W) bool
        Free cells.
    """
    width = 2 * round(parameters.leak_max_width_m / resolution_m / 2) + 1
    wide = cv2.morphologyEx(free.astype(np.uint8), cv2.MORPH_OPEN, np.ones((width, width), np.uint8))
    left_out = (wide > 0) & (labels == 0)
    cells = np.flatnonzero(left_out)
    if len(cells) == 0:
        return labels
    count, piece = cv2.connectedComponents(left_out.view(np.uint8), connectivity=4)
    number = piece.take(cells).astype(np.int64)
    rooms = int(labels.max(initial=0)) + 1
    sides = np.zeros(count * rooms, np.int64)
    around = np.pad(labels, 1)
    in_around = np.flatnonzero(np.pad(left_out, 1))
    for step in (-around.shape[1], -1, 1, around.shape[1]):
        beside = around.take(in_around + step)
        sides += np.bincount(number * rooms + beside, minlength=count * rooms)
    sides = sides.reshape(count, rooms)
    sides[:, 0] = 0
    room = sides.argmax(1).astype(np.int32)
    room[sides.max(1) * resolution_m < parameters.join_min_open_m] = 0
    adopted = labels.copy()
    adopted.reshape(-1)[cells] = room.take(number)
    return adopted


def settle_borders(labels: NDArray[np.int32], resolution_m: float, strip_m: float) -> NDArray[np.int32]:
    """Give strips of a room that lie along the other side of a wall to the room on that side.

    A representative line runs within a wall, but not in the middle of every cell of it, so that a strip of
    free cells before the wall may fall on the line's other side. What is narrower than `strip_m` is taken
    away from its room and grown again from the rooms that it is open to.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms of the free cells, 0 elsewhere.
    """
    radius = max(1, round(strip_m / resolution_m / 2))
    kernel = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    grown = narrow(labels)
    if grown.dtype == np.int32:
        grown = grown.astype(np.float32)  # OpenCV's morphology knows no other type for so many labels
    core = cv2.erode(grown, kernel) == grown
    core &= cv2.dilate(grown, kernel) == grown
    grown[~core] = 0
    grown = np.pad(grown, 1)
    values, width = grown.ravel(), grown.shape[1]
    empty = np.flatnonzero((grown == 0) & np.pad(labels > 0, 1))
    # Every step reaches one cell further; twice the width of the strip also restores corners.
    for _ in range(4 * radius):
        reached = functools.reduce(np.maximum, (values.take(empty + k) for k in (-width, -1, 1, width)))
        values[empty] = reached
        empty = empty.compress(reached == 0)
    settled = labels.copy()
    grown = grown[1:-1, 1:-1]
    np.copyto(settled, grown, where=grown > 0, casting="unsafe")
    return settled
