"""Morphological segmentation: walls grow until rooms come apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.baselines import MorphologicalParameters
from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.baselines.growing import grow
from rose2_logs.segmentation.baselines.regions import connected_parts, eroded


def segment_morphological(
    free: BoolArray, resolution_m: float, parameters: MorphologicalParameters
) -> NDArray[np.int32]:
    """Segment free space by eroding it round by round.

    As soon as a connected part of what is left has the size of a room, it is one and takes no further part.
    The rooms found in this way then grow back over the free space.

    Parameters
    ----------
    free : (H, W) bool
        The free cells.
    resolution_m : float
        Side of a cell.
    parameters : MorphologicalParameters

    Returns
    -------
    labels : (H, W) int32
        Rooms 1.., 0 for none; so are free cells from which no room can be reached.
    """
    seeds = np.zeros(free.shape, np.int32)
    left = free
    rooms = 0
    for _ in range(parameters.max_rounds):
        left = eroded(left)
        if not left.any():
            break
        part, size = connected_parts(left)
        area = size * resolution_m**2
        is_room = (area > parameters.room_min_area_m2) & (area < parameters.room_max_area_m2)
        number = np.where(is_room, rooms + np.cumsum(is_room), 0).astype(np.int32)
        rooms += int(np.count_nonzero(is_room))
        seeds += number[part]
        left = left & ~is_room[part]
    return grow(seeds, free)
