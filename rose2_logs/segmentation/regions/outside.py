"""Which regions are rooms: not rays through windows, not white around a building, not too small."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.regions import RegionParameters
from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.regions.features import region_features
from rose2_logs.segmentation.regions.graph import RegionGraph
from rose2_logs.segmentation.regions.joining import Strength


def rooms_of(
    graph: RegionGraph, is_room: Strength, parameters: RegionParameters
) -> tuple[NDArray[np.int64], BoolArray]:
    """Number the regions of a graph that are rooms.

    Parameters
    ----------
    graph : RegionGraph
        The final regions.
    is_room : callable
        Log odds (N,) of `region_features` (N, F).
    parameters : RegionParameters

    Returns
    -------
    room : (N,) int64
        Room 1.. of each region, 0 for none.
    outside : (N,) bool
        Regions that are outside; those that are too small are not.
    """
    area = graph.node_sums[:, 0]
    outside = is_room(region_features(graph)) < parameters.room_min_log_odds
    # An answer by which hardly anything is left is not believed.
    if area[outside].sum() > parameters.outside_max_share * area.sum():
        outside[:] = False
    room = ~outside & (area >= parameters.room_min_area_m2)
    return np.where(room, np.cumsum(room), 0), outside
