"""Doorways: where free space of two rooms is connected; borders: what lies between neighboring rooms."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rose2_logs.config.topology import TopologyParameters
from rose2_logs.model.borders import Border
from rose2_logs.model.labels import contacts, narrow
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.model.regions import connected
from rose2_logs.model.rooms import Doorway

ROUNDING_M = 1e-9
"""Numerical: more than the lengths of doorways are rounded off."""


def find_doorways(
    labels: NDArray[np.int32], resolution_m: float, parameters: TopologyParameters
) -> list[tuple[tuple[int, int], FloatArray]]:
    """Find the passages between rooms.

    Parameters
    ----------
    labels : (H, W) int32
        The segmented map.
    resolution_m : float
        Side of a cell.
    parameters : TopologyParameters
        The narrowest doorway, and which contacts are one.

    Returns
    -------
    doorways : list of ((int, int), (2, 2) float)
        The two rooms, smaller first, and the ends of the passage in the grid frame, meters; sorted.
    """
    meet = contacts(narrow(labels))
    meet = meet.chosen(meet.low > 0)
    if len(meet.low) == 0:
        return []
    # Middles of the sides at which two rooms meet, x and y in cells.
    corners = [np.column_stack(np.divmod(cell, labels.shape[1])[::-1]) for cell in (meet.first, meet.second)]
    points = (corners[0] + corners[1] + 1) / 2
    pairs, pair = meet.pairs()
    near = cKDTree(points).query_pairs(parameters.doorway_gap_cells, output_type="ndarray")
    near = near[pair[near[:, 0]] == pair[near[:, 1]]]
    count, component = connected(len(points), *near.T)
    order = np.argsort(component, kind="stable")
    bounds = np.searchsorted(component[order], np.arange(count + 1))
    doorways = []
    least_m = parameters.doorway_min_width_m
    for first, last in itertools.pairwise(bounds):
        members = order[first:last]
        of_doorway = points[members]
        if (np.hypot(*np.ptp(of_doorway, axis=0)) + 1) * resolution_m < least_m - ROUNDING_M:
            continue  # not even their box is wide enough
        ends = _extremes(of_doorway) * resolution_m
        if np.linalg.norm(ends[1] - ends[0]) + resolution_m >= least_m:
            doorways.append((pairs[pair[members[0]]], ends))
    return sorted(doorways, key=lambda item: (item[0], item[1].tolist()))


def borders_between(
    doorways: Sequence[Doorway],
    strengths: Mapping[tuple[int, int], float],
    region_of_room: NDArray[np.int32],
    areas_m2: FloatArray,
    door_max_width_m: float,
) -> tuple[Border, ...]:
    """Say what lies between each two neighboring rooms, in the order of their numbers.

    Parameters
    ----------
    doorways : sequence of Doorway
        Between the rooms.
    strengths : mapping of (int, int) to float
        Probability that two neighboring regions are different rooms, the smaller number first.
    region_of_room : (R + 1,) int32
        Region that each room is a piece of, 0 first; the largest one stands for the region where a border has
        no doorway.
    areas_m2 : (R,) float
        Of the rooms.
    door_max_width_m : float
        Wider doorways are openings.
    """
    by_area = np.argsort(areas_m2, kind="stable") + 1
    largest = dict(zip(region_of_room[by_area].tolist(), by_area.tolist(), strict=True))
    found = {}
    for pair, strength in strengths.items():
        if pair[0] in largest and pair[1] in largest:
            one, other = sorted((largest[pair[0]], largest[pair[1]]))
            found[one, other] = Border((one, other), "wall", 0.0, strength)
    for doorway in doorways:
        one, other = sorted(region_of_room[list(doorway.rooms)].tolist())
        known, width_m = found.get(doorway.rooms), doorway.width_m
        if known is None or width_m > known.width_m:
            kind = "door" if width_m <= door_max_width_m else "opening"
            found[doorway.rooms] = Border(doorway.rooms, kind, width_m, strengths.get((one, other), 1.0))
    return tuple(found[pair] for pair in sorted(found))


def _extremes(points: FloatArray) -> FloatArray:
    """Two points (2, 2) farthest apart along the main axis of a few points."""
    centered = points - points.mean(0)
    axis = np.linalg.svd(centered, full_matrices=False)[2][0]
    along = centered @ axis
    ends: FloatArray = np.array([points[along.argmin()], points[along.argmax()]])
    return ends[np.lexsort((ends[:, 1], ends[:, 0]))]
