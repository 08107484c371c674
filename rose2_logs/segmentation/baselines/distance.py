"""Distance transform segmentation: rooms are where the free space is wide."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.baselines import DistanceParameters
from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.baselines.growing import grow
from rose2_logs.segmentation.baselines.regions import connected_parts, eroded, obstacle_distance


def segment_distance(
    free: BoolArray, resolution_m: float, parameters: DistanceParameters
) -> NDArray[np.int32]:
    """Segment free space at the distance from obstacles that gives the most rooms.

    For every distance, in steps of one cell, the cells farther from obstacles fall into connected parts;
    those of a room's size count. The distance with the most of them, the least of several, gives the seeds
    that then grow back over the free space.

    Parameters
    ----------
    free : (H, W) bool
        The free cells.
    resolution_m : float
        Side of a cell.
    parameters : DistanceParameters

    Returns
    -------
    labels : (H, W) int32
        Rooms 1.., 0 for none; so are free cells from which no room can be reached.
    """
    distance = obstacle_distance(eroded(free))
    seeds = np.zeros(free.shape, np.int32)
    most = 0
    for threshold in range(int(distance.max(initial=0)), 0, -1):
        part, size = connected_parts(distance > threshold)
        area = size * resolution_m**2
        is_room = (area >= parameters.room_min_area_m2) & (area <= parameters.room_max_area_m2)
        is_room[0] = False
        count = int(np.count_nonzero(is_room))
        if count >= max(most, 1):
            most = count
            seeds = np.where(is_room, np.cumsum(is_room), 0).astype(np.int32)[part]
    return grow(seeds, free)
