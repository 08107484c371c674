"""Voronoi segmentation: cuts at the narrow places of the Voronoi graph, pieces joined to rooms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.baselines import VoronoiBaselineParameters, VoronoiMergeParameters
from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.baselines.critical_lines import best_lines, critical_lines
from rose2_logs.segmentation.baselines.growing import grow
from rose2_logs.segmentation.baselines.merging import merge_rooms
from rose2_logs.segmentation.baselines.regions import connected_parts, middle_of, obstacle_distance
from rose2_logs.segmentation.baselines.voronoi_graph import boundary_cells, narrowest_cells, voronoi_cells


def segment_voronoi(
    free: BoolArray,
    resolution_m: float,
    parameters: VoronoiBaselineParameters,
    merge: VoronoiMergeParameters,
) -> NDArray[np.int32]:
    """Segment free space by cuts at narrow places.

    Parameters
    ----------
    free : (H, W) bool
        The free cells.
    resolution_m : float
        Side of a cell.
    parameters : VoronoiBaselineParameters
        Where to cut.
    merge : VoronoiMergeParameters
        Which pieces to join again.

    Returns
    -------
    labels : (H, W) int32
        Rooms 1.., 0 for none; so are free cells from which no room can be reached.
    """
    return merge_rooms(cut_rooms(free, resolution_m, parameters), resolution_m, merge)


def cut_rooms(
    free: BoolArray, resolution_m: float, parameters: VoronoiBaselineParameters
) -> NDArray[np.int32]:
    """Cut free space into pieces (H, W) 1.. along the critical lines, before any are joined."""
    distance = obstacle_distance(free)
    graph = voronoi_cells(free, parameters.clear_rounds, parameters.prune_passes)
    narrow = narrowest_cells(
        graph, distance, parameters.neighborhood_cells2, parameters.neighborhood_max_rounds
    )
    uncut = free.copy()
    if len(narrow):
        middle = middle_of(free)
        lines = critical_lines(narrow, boundary_cells(free), distance, middle)
        row, column = lines.cells(best_lines(lines, parameters.critical_min_gap), middle).T
        uncut[row, column] = False
    # A line's cells may touch at corners only, so that pieces must not be connected through corners.
    part, size = connected_parts(uncut, connectivity=4)
    area = size * resolution_m**2
    is_room = (area >= parameters.room_min_area_m2) & (area <= parameters.room_max_area_m2)
    is_room[0] = False
    return grow(np.where(is_room, np.cumsum(is_room), 0).astype(np.int32)[part], free)
