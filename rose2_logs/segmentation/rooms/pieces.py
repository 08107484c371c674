"""Rooms in one piece: what does not hang together is not one room."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rose2_logs.model.occupancy import BoolArray


def rooms_in_one_piece(
    labels: NDArray[np.int32],
    occupied: BoolArray,
    resolution_m: float,
    gap_m: float,
    piece_min_m2: float,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Make rooms of their own of the pieces of a room that do not hang together.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms 1.. of the free cells, 0 elsewhere.
    occupied : (H, W) bool
        Occupied cells: what they close is no gap.
    resolution_m : float
        Side of a cell.
    gap_m : float
        Pieces hang together across gaps up to this wide: noise, the legs of furniture.
    piece_min_m2 : float
        Smaller pieces stay with the largest one of their room.

    Returns
    -------
    pieces : (H, W) int32
        The largest piece of each room and what is small have the number of the room, others new ones.
    room_of_piece : (P,) int32
        Room of each of these numbers, 0 first.
    """
    count = int(labels.max(initial=0))
    pieces = labels.copy()
    rooms = list(range(count + 1))
    reach = max(0, round(gap_m / resolution_m / 2))
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    for room, box in enumerate(ndimage.find_objects(labels, max_label=count), start=1):
        if box is None:
            continue
        inside = labels[box] == room
        grown = cv2.dilate(inside.astype(np.uint8), kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0)
        grown[occupied[box]] = 0
        number, components = cv2.connectedComponents(grown, connectivity=4)
        if number <= 2:
            continue
        cells = np.bincount(components[inside], minlength=number)
        large = np.flatnonzero(cells * resolution_m**2 >= piece_min_m2)
        for other in large[large != cells.argmax()].tolist():
            pieces[box][inside & (components == other)] = len(rooms)
            rooms.append(room)
    return pieces, np.array(rooms, np.int32)
