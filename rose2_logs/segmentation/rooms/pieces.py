"""Rooms in one piece: what does not hang together is not one room."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.regions import RegionParameters
from rose2_logs.model.labels import LabelRuns, narrow_labels
from rose2_logs.model.occupancy import BoolArray


def rooms_in_one_piece(
    labels: NDArray[np.int32],
    occupied: BoolArray,
    resolution_m: float,
    parameters: RegionParameters,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Make rooms of their own of the pieces of a room that do not hang together.

    A small piece that a wall closes in the midst of its room is no room: it is the floor within an object,
    such as a stack of pallets or a column, and is left out.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms 1.. of the free cells, 0 elsewhere.
    occupied : (H, W) bool
        Occupied cells: what they close is no gap.
    resolution_m : float
        Side of a cell.
    parameters : RegionParameters
        How wide a gap pieces hang together across, and what is within an object; pieces smaller
        than any room stay with the largest one of theirs, and what is nowhere wide enough is no room.

    Returns
    -------
    pieces : (H, W) int32
        The largest piece of each room that is wide enough and what is small have the number of the room,
        others new ones.
    room_of_piece : (P,) int32
        Room of each of these numbers, 0 first.
    """
    pieces = labels.copy()
    rooms = list(range(int(labels.max(initial=0)) + 1))
    kernel = _square(parameters.piece_gap_m / resolution_m / 2)
    for room, box in enumerate(LabelRuns.of(labels).windows(), start=1):
        if box is None:
            continue
        inside = labels[box] == room
        grown = cv2.dilate(inside.astype(np.uint8), kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0)
        grown[occupied[box]] = 0
        number, components = cv2.connectedComponents(grown, connectivity=4)
        if number <= 2:
            continue
        cells = np.bincount(components.take(np.flatnonzero(inside)), minlength=number)
        large = cells * resolution_m**2 >= parameters.room_min_area_m2
        if np.count_nonzero(large) < 2:
            continue
        of_pieces = np.where(inside, components, 0)
        width, speck = parameters.room_min_width_m / resolution_m, parameters.speck_max_m / resolution_m
        narrow = np.append(False, narrow_labels(of_pieces, number - 1, width, speck))
        # The largest that is wide enough stays the room, with what is small.
        large[(np.where(large & ~narrow, cells, 0) if (large & ~narrow).any() else cells).argmax()] = False
        for other in np.flatnonzero(large).tolist():
            piece = inside & (components == other)
            is_small = cells[other] * resolution_m**2 < parameters.object_max_m2
            if narrow[other] or (
                is_small and _is_within_object(labels, occupied, room, box, piece, resolution_m, parameters)
            ):
                pieces[box][piece] = 0
                continue
            pieces[box][piece] = len(rooms)
            rooms.append(room)
    return pieces, np.array(rooms, np.int32)


def _is_within_object(
    labels: NDArray[np.int32],
    occupied: BoolArray,
    room: int,
    box: tuple[slice, slice],
    piece: BoolArray,
    resolution_m: float,
    parameters: RegionParameters,
) -> bool:
    """Whether a piece of the box of a room has that room, and hardly anything else, around its wall."""
    kernel = _square(parameters.object_wall_m / resolution_m)
    reach = len(kernel) // 2
    low = [max(side.start - reach, 0) for side in box]
    window = tuple(slice(a, side.stop + reach) for a, side in zip(low, box, strict=True))
    near = np.zeros(labels[window].shape, np.uint8)
    rows, columns = np.nonzero(piece)
    near[rows + box[0].start - low[0], columns + box[1].start - low[1]] = 1
    around = (cv2.dilate(near, kernel) > near) & ~occupied[window]
    if not around.any():
        return False
    return bool((labels[window][around] == room).mean() >= parameters.object_min_surrounded)


def _square(reach_cells: float) -> NDArray[np.uint8]:
    side = 2 * max(0, round(reach_cells)) + 1
    return np.ones((side, side), np.uint8)
