"""One snapshot in, its building's structure and rooms out; reads like the paper."""

from __future__ import annotations

import time
from functools import partial

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.baselines import METHODS
from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import ParameterError
from rose2_logs.model.analysis import FloorPlan, SnapshotAnalysis, Structure, Walls
from rose2_logs.model.explored import ExploredPart
from rose2_logs.model.labels import distinct_labels, label_sizes, number_rooms, renumber_in_place
from rose2_logs.model.occupancy import BoolArray, OccupancySnapshot
from rose2_logs.model.outlines import room_outlines
from rose2_logs.model.rooms import Doorway, RoomMap
from rose2_logs.segmentation.baselines.stage import BASELINES, segment_by_baseline
from rose2_logs.segmentation.floor_plan.doorways import find_doorways
from rose2_logs.segmentation.floor_plan.rooms import adopt_left_out, predicted_shapes, settle_borders
from rose2_logs.segmentation.floor_plan.stage import FloorPlanResult, make_floor_plan
from rose2_logs.segmentation.rose.stage import RoseResult, find_structure
from rose2_logs.segmentation.topology.splitting import split_rooms
from rose2_logs.segmentation.topology.voronoi import voronoi_lines
from rose2_logs.segmentation.walls.stage import WallResult, count_walls, find_walls

__all__ = ["METHODS", "analyze"]


def analyze(
    snapshot: OccupancySnapshot, parameters: Parameters, method: str = "rose2", *, voronoi: bool = False
) -> SnapshotAnalysis:
    """Segment one map into rooms.

    Parameters
    ----------
    snapshot : OccupancySnapshot
    parameters : Parameters
    method : str
        One of `METHODS`.
    voronoi : bool
        Whether to return the Voronoi graph as well, which nothing but looking at it needs.

    Returns
    -------
    SnapshotAnalysis
        The same for the same input, whatever ran before.

    Raises
    ------
    ParameterError
        If `method` is none of `METHODS`.
    """
    if method not in METHODS:
        raise ParameterError(f"method={method!r}: it must be one of {', '.join(METHODS)}")
    watch = _StopWatch()
    geometry = snapshot.geometry
    # The baselines' parameters count cells, so they take the map as it is.
    occupancy = parameters.occupancy.unblocked() if method in BASELINES else parameters.occupancy
    explored = ExploredPart.of(snapshot.cells, geometry, occupancy)
    resolution, free, occupied = explored.resolution_m, explored.free, explored.occupied
    free_m2 = explored.free_area_m2
    watch.lap("prepare")

    analysis = partial(
        SnapshotAnalysis,
        index=snapshot.index,
        log_time_ns=snapshot.log_time_ns,
        stamp_ns=snapshot.stamp_ns,
        geometry=geometry,
        free_area_m2=free_m2,
        resolution_m=resolution,
        seconds=watch.seconds,
    )
    if method in BASELINES:
        labels = segment_by_baseline(method, free, resolution, parameters)
        watch.lap(method)
        rooms = _room_map(labels, room_outlines(labels, resolution), explored, parameters)
        watch.lap("rooms")
        return analysis(rooms=rooms, structure=None, walls=None, floor_plan=None)
    found = find_structure(
        occupied,
        free_m2,
        resolution,
        lambda clean, directions: count_walls(clean, directions, resolution, parameters.walls),
        parameters.spectrum,
    )
    directions, structure = found.directions_rad, _structure(found, explored)
    watch.lap("structure")
    walls = find_walls(found.supported, found.clean, found.attached, directions, resolution, parameters.walls)
    del found  # what the stages to come need the memory of
    watch.lap("walls")
    plan = make_floor_plan(
        walls.lines.ends_m,
        walls.walls,
        free,
        float(directions[0]) if len(directions) else 0.0,
        resolution,
        parameters.floor_plan,
    )
    watch.lap("floor_plan")
    labels = split_rooms(
        plan.labels, walls.walls, walls.lines.ends_m, directions, resolution, parameters.topology
    )
    watch.lap("topology")
    labels, shapes, room_of_face = _finished_rooms(labels, plan, free, resolution, parameters)
    rooms = _room_map(labels, shapes, explored, parameters)
    watch.lap("rooms")
    graph = None
    if voronoi:
        passage_m = parameters.topology.doorway_min_width_m / 2
        # Clutter does not keep the free space apart.
        inside = (labels > 0) | (occupied & ~walls.walls)
        graph = explored.segments(voronoi_lines(inside, walls.walls, resolution, passage_m))
        watch.lap("voronoi")
    return analysis(
        rooms=rooms,
        voronoi_m=graph,
        structure=structure,
        walls=_walls(walls, explored),
        floor_plan=_floor_plan(plan, room_of_face, explored, parameters),
    )


class _StopWatch:
    """Seconds per stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.seconds[stage] = now - self._last
        self._last = now


def _finished_rooms(
    labels: NDArray[np.int32],
    plan: FloorPlanResult,
    free: BoolArray,
    resolution_m: float,
    parameters: Parameters,
) -> tuple[NDArray[np.int32], list[BaseGeometry], NDArray[np.int32]]:
    """Labels (H, W) of the rooms with straight borders, their shapes, and the room of each face."""
    unsettled = adopt_left_out(labels, free, resolution_m, parameters.floor_plan)
    labels = settle_borders(unsettled, resolution_m, parameters.floor_plan.border_strip_m)
    number = number_rooms(
        labels, int(unsettled.max(initial=0)), parameters.floor_plan.room_min_area_m2, resolution_m
    )
    labels = renumber_in_place(labels, number)
    # Which faces are a room's is told by the labels before their borders settled.
    room_of_face, shapes = _room_shapes(
        plan, renumber_in_place(unsettled, number), labels, resolution_m, parameters
    )
    return labels, shapes, room_of_face


def _room_shapes(
    plan: FloorPlanResult,
    unsettled: NDArray[np.int32],
    labels: NDArray[np.int32],
    resolution_m: float,
    parameters: Parameters,
) -> tuple[NDArray[np.int32], list[BaseGeometry]]:
    """Room of each face, and predicted shapes: a room's faces, or its cells where a split cut faces."""
    count = int(labels.max(initial=0))
    group_count = int(plan.group.max(initial=0)) + 1
    fits = (count + 1) * group_count < 2**31
    pair_of_cell = unsettled * (np.int32(group_count) if fits else np.int64(group_count))
    pair_of_cell += plan.labels
    pairs, _ = distinct_labels(pair_of_cell)
    del pair_of_cell
    rooms, groups = np.divmod(pairs, group_count)
    # A group that was split, or lost cells to a split, has no faces of its own any more.
    rooms, groups = rooms[rooms > 0], groups[rooms > 0]
    rooms_in_group = np.bincount(groups, minlength=group_count)
    room_of_group = np.zeros(len(rooms_in_group), np.int32)
    whole = rooms_in_group[groups] == 1
    room_of_group[groups[whole]] = rooms[whole]
    room_of_face = room_of_group[plan.group]
    room_of_face[plan.group == 0] = 0
    shown = np.where(plan.seen >= parameters.floor_plan.shape_min_seen, room_of_face, 0)
    shapes = list(predicted_shapes(plan.graph, shown, count))
    # Rooms that a split took from a face are as large as their cells.
    without = np.array([False, *(shape.is_empty for shape in shapes)])
    for room, shape in enumerate(room_outlines(np.where(without[labels], labels, 0), resolution_m)):
        if not shape.is_empty:
            shapes[room] = shape
    return room_of_face, shapes


def _room_map(
    labels: NDArray[np.int32], shapes: list[BaseGeometry], explored: ExploredPart, parameters: Parameters
) -> RoomMap:
    full = explored.labels(labels)
    doorways = find_doorways(labels, explored.resolution_m, parameters.topology.doorway_min_width_m)
    return RoomMap(
        geometry=explored.geometry,
        labels=full,
        polygons=tuple(explored.shape(shape) for shape in shapes),
        areas_m2=label_sizes(full[explored.window], len(shapes))[1:].astype(float)
        * explored.geometry.cell_area_m2,
        doorways=tuple(Doorway(pair, explored.points(ends)) for pair, ends in doorways),
    )


def _structure(found: RoseResult, explored: ExploredPart) -> Structure:
    cells = explored.occupied_cells()
    return Structure(
        directions_rad=np.mod(found.directions_rad + explored.geometry.yaw_rad, np.pi),
        strengths=found.strengths,
        scores=explored.values_at(cells, found.score),
        threshold=found.threshold,
        clean_cells=explored.values_at(cells, found.clean),
        spectrum=found.spectrum,
    )


def _walls(found: WallResult, explored: ExploredPart) -> Walls:
    return Walls(
        segments_m=explored.segments(found.segments_m),
        segment_direction=found.segment_direction,
        segment_cluster=found.segment_line,
        lines_m=explored.segments(found.lines.ends_m),
        line_direction=found.lines.direction,
        line_weight=found.lines.weight,
    )


def _floor_plan(
    found: FloorPlanResult, room_of_face: NDArray[np.int32], explored: ExploredPart, parameters: Parameters
) -> FloorPlan:
    return FloorPlan(
        edges_m=explored.segments(found.graph.edges_m),
        edge_weight=found.evidence.weight,
        edge_faces=found.graph.edge_faces,
        faces=tuple(shapely.transform(found.graph.polygons, explored.points)),
        face_inside=found.seen >= parameters.floor_plan.face_min_seen,
        room_of_face=room_of_face,
    )
