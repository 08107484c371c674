"""Small regions: closets and toilets are rooms of their own, corners and pockets belong to a neighbor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.regions import RegionParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.regions.features import (
    FEATURES,
    REGION_FEATURES,
    join_features,
    joinable,
    region_features,
)
from rose2_logs.segmentation.regions.graph import RegionGraph
from rose2_logs.segmentation.regions.joining import Joins, Strength

BUILDING_FEATURES = ("strength", "log_area_of_all", "log_area_typical")
"""Log odds of the likeliest join, and how large the building and its rooms are."""
OWN_ROOM_FEATURES = (
    *(f"region_{name}" for name in REGION_FEATURES),
    *(f"join_{name}" for name in FEATURES),
    *BUILDING_FEATURES,
)
NO_NEIGHBOR = -9.0
"""What features of a join are where a region has no larger neighbor."""


@dataclass(frozen=True, eq=False)
class LikeliestNeighbors:
    """The larger neighbor that each region is likeliest one room with.

    Attributes
    ----------
    region : (N,) int
        Its number, -1 for none.
    features : (N, len(OWN_ROOM_FEATURES)) float
        Of each region, of that join, and of the building.
    """

    region: NDArray[np.intp]
    features: FloatArray

    @classmethod
    def of(cls, graph: RegionGraph, strength: Strength) -> LikeliestNeighbors:
        """Look for them by the strengths of joins."""
        area = graph.node_sums[:, 0]
        which = np.flatnonzero(joinable(graph))
        neighbor = np.full(len(area), -1)
        join = np.full((len(area), len(FEATURES) + 1), NO_NEIGHBOR)
        if len(which):
            ends = graph.ends[which]
            swap = area[ends[:, 0]] > area[ends[:, 1]]
            small, large = np.where(swap[:, None], ends[:, ::-1], ends).T
            features = join_features(graph, which)
            log_odds = strength(features)
            order = np.argsort(log_odds, kind="stable")
            order = order[area[large[order]] > area[small[order]]]
            # Assigned from the weakest to the strongest, so that the strongest stays.
            neighbor[small[order]] = large[order]
            join[small[order]] = np.column_stack([features, log_odds])[order]
        building = np.log([area.sum(), typical_area(area)]) if len(area) else np.zeros(2)
        columns = [region_features(graph), join, np.broadcast_to(building, (len(area), 2))]
        return cls(neighbor, np.column_stack(columns))


def typical_area(area_m2: FloatArray) -> float:
    """Area of the region in which half of all floor lies in smaller ones and half in larger ones."""
    ordered = np.sort(area_m2)
    total = np.cumsum(ordered)
    return float(ordered[np.searchsorted(total, total[-1] / 2)])


def small_region_joins(
    graph: RegionGraph,
    outside: BoolArray,
    strength: Strength,
    is_own_room: Strength,
    parameters: RegionParameters,
) -> Joins:
    """Joins of small regions that are no rooms of their own with the neighbors they are likeliest of.

    A small region is not joined to another one that is a room (of two side by side, each may be a toilet) or
    that is outside.

    The strength of such a join is by how much its region misses the least odds of a room, so that more detail
    undoes the least sure ones first.

    Parameters
    ----------
    graph : RegionGraph
        The regions at even odds.
    outside : (N,) bool
        Regions that are outside: these stay by themselves.
    strength : callable
        Log odds that two regions are one room.
    is_own_room : callable
        Log odds (N,) that small regions are rooms of their own, from their features (N, F).
    parameters : RegionParameters
    """
    found = LikeliestNeighbors.of(graph, strength)
    area = graph.node_sums[:, 0]
    small = area < parameters.small_room_max_m2
    which = np.flatnonzero(small & (found.region >= 0) & ~outside)
    missed = np.zeros(0)
    if len(which):
        missed = parameters.small_room_min_log_odds - is_own_room(found.features[which])
        may_be_room = small & (area >= parameters.room_min_area_m2)
        part = np.zeros(len(small), bool)
        part[which] = missed > 0
        # The largest first: whether these are rooms is known when one beside them asks.
        for number in which[np.argsort(-area[which], kind="stable")].tolist():
            neighbor = found.region[number]
            part[number] &= not may_be_room[neighbor] or part[neighbor]
        which, missed = which[part[which]], missed[part[which]]
    pairs = np.column_stack([found.region[which], which])
    return Joins(len(graph.node_sums), pairs, missed)
