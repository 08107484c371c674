"""Which regions are rooms: not rays through windows, not white around a building, not too small."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.regions import RegionParameters
from rose2_logs.model.labels import labels_near, row_ends
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.model.regions import root_of, roots_of
from rose2_logs.segmentation.regions.features import join_features, joinable, region_features
from rose2_logs.segmentation.regions.graph import RegionGraph
from rose2_logs.segmentation.regions.joining import Strength
from rose2_logs.segmentation.regions.plan_frame import Labels
from rose2_logs.segmentation.regions.plan_raster import PlanRaster

Together = Callable[[NDArray[np.int64], NDArray[np.int64]], tuple[FloatArray, ...]]
"""Which pairs of regions (K,), (K,) belong together most: numbers (K,), the most important ones first."""
EDGE_REACH_CELLS = 1.5
"""An atom reaches the edge of the map from the cell beside it: turned edges are ragged."""


def edge_shares(atoms: Labels, raster: PlanRaster, count: int) -> FloatArray:
    """Share (N,) of the edge of the known part's convex hull that each atom holds.

    The walls of a building keep its rooms from that edge; the white around a drawing holds nearly all of it,
    however the drawing is turned or padded.

    Parameters
    ----------
    atoms : (H, W) int32
        Atom 1..N of each plan cell, 0 for none.
    raster : PlanRaster
    count : int
        Number of atoms.
    """
    known = ((raster.wall > 0) | (raster.free > 0)).astype(np.uint8)
    if not known.any():
        return np.zeros(count)
    # The ends of each row hold the corners of the hull.
    rows, first, last = row_ends(known > 0)
    corners = np.stack([np.concatenate([first, last]), np.concatenate([rows, rows])], axis=1)
    hull = cv2.convexHull(corners[np.lexsort(corners.T)].astype(np.int32))
    edge = cv2.polylines(np.zeros_like(known), [hull], isClosed=True, color=1) > 0
    cells = np.flatnonzero(edge)
    beside = np.where(raster.wall.take(cells) > 0, 0, labels_near(atoms, cells, EDGE_REACH_CELLS))
    return np.bincount(beside, minlength=count + 1)[1:] / len(beside)


def surroundings(edge_share: FloatArray, area_m2: FloatArray, parameters: RegionParameters) -> BoolArray:
    """Regions (N,) that lie around the building, from their share of the map's edge and their area."""
    around: BoolArray = edge_share >= parameters.surroundings_min_edge
    # A field or a hall without outer walls has nothing within, or several parts share its edge.
    least = 2 * parameters.surroundings_min_edge
    rest_m2 = area_m2[~around].sum()
    if edge_share[around].sum() < least or rest_m2 < parameters.building_min_share * area_m2.sum():
        return np.zeros(len(area_m2), bool)
    # Where there is white around the building, a corner of it that is cut off is no room either.
    return np.asarray(edge_share >= parameters.surroundings_rest_min_edge)


def outside_of(
    graph: RegionGraph,
    edge_share: FloatArray,
    is_room: Strength,
    parameters: RegionParameters,
    narrow: BoolArray | None = None,
) -> BoolArray:
    """Which regions (N,) of a graph are outside.

    Parameters
    ----------
    graph : RegionGraph
        The regions at even odds.
    edge_share : (N,) float
        Share of the map's edge that each region holds, see `edge_shares`.
    is_room : callable
        Log odds (N,) of `region_features` (N, F).
    parameters : RegionParameters
    narrow : (N,) bool, optional
        Regions that are nowhere wide enough for a room.
    """
    area, walled_m, unknown_m = graph.node_sums[:, :3].T
    around = surroundings(edge_share, area, parameters)
    whole_m2 = area[~around].sum()
    no_room = [is_room(region_features(graph)) < parameters.room_min_log_odds]
    if narrow is not None:
        no_room.append(narrow)
    outside = np.zeros(len(area), bool)
    for answer in no_room:
        with_answer = outside | (answer & ~around)
        # An answer by which hardly anything is left is not believed, nor one that takes much of a map, unless
        # what it leaves are several rooms behind walls: a building whose windows are seen through.
        left = ~with_answer & ~around
        least_walled_m = parameters.walled_min_share * (walled_m[left].sum() + unknown_m[left].sum())
        is_building = (
            parameters.outside_max_share > 0
            and np.count_nonzero(area[left] >= parameters.room_min_area_m2) >= parameters.walled_min_rooms
            and area[left].sum() > parameters.walled_min_left * whole_m2
            and walled_m[left].sum() > least_walled_m
        )
        if is_building or area[with_answer].sum() <= parameters.outside_max_share * whole_m2:
            outside = with_answer
    return outside | around


def rooms_among(area_m2: FloatArray, outside: BoolArray, parameters: RegionParameters) -> BoolArray:
    """Which regions (N,) are large enough for a room, by the area of their cells, and not outside."""
    room: BoolArray = ~outside & (area_m2 >= parameters.room_min_area_m2)
    return room


def leftovers_joined(
    graph: RegionGraph,
    area_m2: FloatArray,
    room: BoolArray,
    outside: BoolArray,
    strength: Strength,
    parameters: RegionParameters,
    together: Together | None = None,
    narrow: BoolArray | None = None,
) -> tuple[NDArray[np.int64], BoolArray]:
    """Give regions that are no rooms, such as the floor of a doorway, to the room they most likely are of.

    The border of such a region that comes first is removed, again and again, but for those between two rooms.
    Small regions that are together as large as a room are one.

    Parameters
    ----------
    graph : RegionGraph
    area_m2 : (N,) float
        Area of the cells of each region.
    room, outside : (N,) bool
        Regions that are rooms, and those that no room gets.
    strength : callable
        Log odds that two regions are one room.
    parameters : RegionParameters
    together : callable, optional
        What comes before the strength.
    narrow : (N,) bool, optional
        Regions too narrow for a room, that make none together.

    Returns
    -------
    region : (N,) int64
        Region that each is part of; itself but for those that are given away.
    room : (N,) bool
        Regions that are rooms now.
    """
    least_m2 = parameters.room_min_area_m2
    size = (area_m2 if narrow is None else np.where(narrow, 0.0, area_m2)).tolist()
    is_room, region = room.tolist(), list(range(len(room)))
    which = np.flatnonzero(joinable(graph))
    ends = graph.ends[which]
    asked = ~room[ends].all(1) & ~outside[ends].any(1)
    which, ends = which[asked], ends[asked]
    if len(which):
        before = together(*ends.T) if together else ()
        order = np.lexsort([-value for value in (strength(join_features(graph, which)), *before[::-1])])
        for pair in ends[order].tolist():
            target, given = sorted(root_of(region, number) for number in pair)
            if target == given or (is_room[target] and is_room[given]):
                continue
            if is_room[given]:
                target, given = given, target
            region[given] = target
            size[target] += size[given]
            is_room[target] = is_room[target] or size[target] >= least_m2
    return roots_of(np.array(region, np.intp)), np.array(is_room, bool)
