"""One map in, its building's structure and rooms out; reads like the paper."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.baselines import METHODS
from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.topology import TopologyParameters
from rose2_logs.errors import ParameterError
from rose2_logs.model.analysis import FloorPlan, SnapshotAnalysis, Structure, Walls
from rose2_logs.model.borders import Border
from rose2_logs.model.explored import ExploredPart
from rose2_logs.model.labels import distance_from, label_sizes
from rose2_logs.model.occupancy import FloatArray, OccupancySnapshot
from rose2_logs.model.outlines import room_outlines
from rose2_logs.model.room_quality import room_quality
from rose2_logs.model.rooms import Doorway, RoomMap
from rose2_logs.segmentation.baselines.stage import segment_by_baseline
from rose2_logs.segmentation.floor_plan.stage import FloorPlanResult, make_floor_plan
from rose2_logs.segmentation.regions.stage import (
    RegionTree,
    find_atoms,
    generous_floor_plan,
    generous_walls,
    region_tree,
)
from rose2_logs.segmentation.rooms.doorways import borders_between, find_doorways
from rose2_logs.segmentation.rooms.stage import finish_rooms, make_rooms
from rose2_logs.segmentation.rose.stage import CleanMap, StructureResult, find_structure, make_clean_map
from rose2_logs.segmentation.topology.splitting import split_rooms
from rose2_logs.segmentation.topology.voronoi import voronoi_lines
from rose2_logs.segmentation.walls.stage import WallCounter, WallResult, find_walls
from rose2_logs.segmentation.walls.strips import WallCells

Analysis = TypeVar("Analysis", bound=SnapshotAnalysis)

__all__ = ["METHODS", "RoomTree", "analyze", "analyze_with_tree"]


def analyze(
    snapshot: OccupancySnapshot,
    parameters: Parameters | Mapping[str, Any] | None = None,
    method: str = "rose2",
    *,
    voronoi: bool = False,
) -> SnapshotAnalysis:
    """Segment one map into rooms.

    Parameters
    ----------
    snapshot : OccupancySnapshot
        The map.
    parameters : Parameters or mapping, optional
        As `Parameters.from_any` takes them; by default all defaults.
    method : str
        One of `METHODS`.
    voronoi : bool
        Whether to return the Voronoi graph as well, which is only for looking at.

    Returns
    -------
    SnapshotAnalysis
        The same for the same input, whatever ran before.

    Raises
    ------
    ParameterError
        If `method` is none of `METHODS`, or a parameter cannot be used.
    """
    return analyze_with_tree(snapshot, parameters, method, voronoi=voronoi)[0]


def analyze_with_tree(
    snapshot: OccupancySnapshot,
    parameters: Parameters | Mapping[str, Any] | None = None,
    method: str = "rose2",
    *,
    voronoi: bool = False,
) -> tuple[SnapshotAnalysis, RoomTree | None]:
    """Segment one map as `analyze` does, and keep what gives its rooms at any other detail.

    The tree is None where rooms do not come from fitted borders.
    """
    parameters = Parameters.from_any(parameters)
    if method not in METHODS:
        raise ParameterError(f"method={method!r}: it must be one of {', '.join(METHODS)}")
    watch = _StopWatch()
    explored = ExploredPart.of(snapshot.cells, snapshot.geometry, parameters.occupancy)
    watch.lap("prepare")
    if method == "rose2":
        stages = _analyze_by_rose2(explored, parameters, watch, voronoi=voronoi)
    else:
        stages = _analyze_by_baseline(method, explored, parameters, watch)
    quality = room_quality(snapshot, explored, stages.rooms, parameters.quality)
    watch.lap("quality")
    analysis = SnapshotAnalysis(
        snapshot.index,
        snapshot.log_time_ns,
        snapshot.stamp_ns,
        snapshot.geometry,
        explored.free_area_m2,
        stages.resolution_m,
        stages.rooms,
        stages.structure,
        stages.walls,
        stages.floor_plan,
        quality,
        watch.seconds,
        stages.voronoi_m,
        stages.borders,
        stages.outside_m2,
    )
    return analysis, stages.tree


@dataclass(frozen=True, eq=False)
class _Stages:
    """What the stages of a method give, as in `SnapshotAnalysis`."""

    resolution_m: float
    rooms: RoomMap
    structure: Structure | None = None
    walls: Walls | None = None
    floor_plan: FloorPlan | None = None
    voronoi_m: FloatArray | None = None
    borders: tuple[Border, ...] = ()
    outside_m2: float = 0.0
    tree: RoomTree | None = None


def _analyze_by_rose2(
    explored: ExploredPart, parameters: Parameters, watch: _StopWatch, *, voronoi: bool
) -> _Stages:
    """Go through the stages of the paper."""
    occupied, cell_m = explored.occupied, explored.resolution_m

    # A: dominant directions and clean map
    scored = find_structure(occupied, cell_m, parameters.spectrum)
    directions = scored.directions_rad
    count_walls = WallCounter(WallCells(scored.supported, directions, cell_m), parameters.walls)
    clean = make_clean_map(scored, explored.free_area_m2, count_walls, parameters.spectrum)
    structure = _structure(scored, clean, explored)
    watch.lap("structure")

    # B: wall segments, wall clusters, representative lines
    built = find_walls(count_walls, clean.cells, clean.attached)
    walls = built.walls
    watch.lap("walls")

    # C and D: rooms between the walls
    strongest = float(directions[0]) if len(directions) else 0.0
    by_borders = parameters.floor_plan.grouping == "fitted"
    tree = None
    if by_borders:
        generous = generous_walls(scored, count_walls, parameters)
        del count_walls, clean  # the rest needs their memory
        tree = _grow_tree(explored, scored, generous, strongest, parameters, watch)
        del scored, generous
        found = tree.rooms(parameters.regions.detail)
    else:
        del count_walls, clean  # the rest needs their memory
        found = _rooms_by_walls(explored, scored, built, strongest, parameters, watch)
        del scored
    watch.lap("rooms")

    graph = None
    if voronoi:
        # Clutter does not keep the free space apart.
        inside = (found.labels > 0) | (occupied & ~walls)
        graph = explored.segments(voronoi_lines(inside, walls, cell_m, parameters.topology))
        watch.lap("voronoi")
    return _Stages(
        cell_m,
        found.rooms,
        structure,
        _walls(built, explored),
        found.floor_plan,
        graph,
        found.borders,
        found.outside_m2,
        tree,
    )


@dataclass(frozen=True, eq=False)
class _FoundRooms:
    """What stages C and D give."""

    labels: NDArray[np.int32]
    """On the analyzed cells."""
    rooms: RoomMap
    floor_plan: FloorPlan
    borders: tuple[Border, ...] = ()
    outside_m2: float = 0.0


@dataclass(frozen=True, eq=False)
class RoomTree:
    """A map whose atoms are judged, so that its rooms at any detail only take joining and finishing.

    Attributes
    ----------
    explored : ExploredPart
    plan : FloorPlanResult
        The faces that the atoms were cut with, in no group.
    tree : RegionTree
    parameters : Parameters
    """

    explored: ExploredPart
    plan: FloorPlanResult
    tree: RegionTree
    parameters: Parameters

    def rooms(self, detail: float) -> _FoundRooms:
        """Join the atoms to rooms as far as a detail asks for, log odds, and finish these."""
        explored, parameters = self.explored, self.parameters
        found = self.tree.rooms(detail)
        finished, found_as = finish_rooms(
            found, self.plan, explored.free, explored.occupied, explored.resolution_m, parameters
        )
        rooms = _room_map(finished.labels, finished.shapes, explored, parameters.topology)
        most_m = parameters.regions.door_max_width_m
        return _FoundRooms(
            finished.labels,
            rooms,
            _floor_plan(self.plan, finished.room_of_face, explored, parameters.floor_plan),
            borders_between(rooms.doorways, found.strengths, found_as, rooms.areas_m2, most_m),
            found.outside_m2,
        )

    def at_detail(self, analysis: Analysis, snapshot: OccupancySnapshot, detail: float) -> Analysis:
        """Give the analysis of a map with its rooms at another detail."""
        watch = _StopWatch()
        found = self.rooms(detail)
        watch.lap("rooms")
        quality = room_quality(snapshot, self.explored, found.rooms, self.parameters.quality)
        watch.lap("quality")
        return replace(
            analysis,
            rooms=found.rooms,
            floor_plan=found.floor_plan,
            quality=quality,
            seconds=watch.seconds,
            borders=found.borders,
            outside_m2=found.outside_m2,
        )


def _grow_tree(
    explored: ExploredPart,
    scored: StructureResult,
    generous: WallResult,
    strongest_rad: float,
    parameters: Parameters,
    watch: _StopWatch,
) -> RoomTree:
    """Cut the floor into atoms, by faces and by basins of the clearance, and judge their borders."""
    free, occupied, cell_m = explored.free, explored.occupied, explored.resolution_m
    plan = generous_floor_plan(generous, free, strongest_rad, cell_m, parameters)
    watch.lap("floor_plan")
    atoms = find_atoms(
        free, occupied, scored.score, plan.face_of_cell, strongest_rad, cell_m, parameters.regions
    )
    watch.lap("atoms")
    tree = region_tree(atoms, free, cell_m, parameters.regions)
    watch.lap("regions")
    return RoomTree(explored, plan, tree, parameters)


def _rooms_by_walls(
    explored: ExploredPart,
    scored: StructureResult,
    built: WallResult,
    strongest_rad: float,
    parameters: Parameters,
    watch: _StopWatch,
) -> _FoundRooms:
    """Faces joined where no wall divides them, and rooms split at narrow places of their Voronoi graph."""
    free, cell_m, lines_m = explored.free, explored.resolution_m, built.lines.ends_m
    distance = distance_from(built.walls)
    plan = make_floor_plan(lines_m, built.walls, distance, free, strongest_rad, cell_m, parameters.floor_plan)
    watch.lap("floor_plan")
    split = split_rooms(plan.labels, distance, lines_m, scored.directions_rad, cell_m, parameters.topology)
    del distance
    watch.lap("topology")
    finished = make_rooms(split, plan, free, explored.occupied, cell_m, parameters.floor_plan)
    return _FoundRooms(
        finished.labels,
        _room_map(finished.labels, finished.shapes, explored, parameters.topology),
        _floor_plan(plan, finished.room_of_face, explored, parameters.floor_plan),
    )


def _analyze_by_baseline(
    method: str, explored: ExploredPart, parameters: Parameters, watch: _StopWatch
) -> _Stages:
    """Segment by one of the methods that the paper compares with."""
    # Their parameters count cells, so they take the map as it is.
    cells = explored.in_cells()
    labels = segment_by_baseline(method, cells.free, cells.resolution_m, parameters)
    watch.lap(method)
    rooms = _room_map(labels, room_outlines(labels, cells.resolution_m), cells, parameters.topology)
    watch.lap("rooms")
    return _Stages(cells.resolution_m, rooms)


class _StopWatch:
    """Seconds per stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.seconds[stage] = now - self._last
        self._last = now


def _room_map(
    labels: NDArray[np.int32],
    shapes: list[BaseGeometry],
    explored: ExploredPart,
    parameters: TopologyParameters,
) -> RoomMap:
    full = explored.labels(labels)
    doorways = find_doorways(labels, explored.resolution_m, parameters)
    return RoomMap(
        geometry=explored.geometry,
        labels=full,
        polygons=tuple(explored.shape(shape) for shape in shapes),
        areas_m2=label_sizes(full[explored.window], len(shapes))[1:].astype(float)
        * explored.geometry.cell_area_m2,
        doorways=tuple(Doorway(pair, explored.points(ends)) for pair, ends in doorways),
    )


def _structure(scored: StructureResult, clean: CleanMap, explored: ExploredPart) -> Structure:
    cells = explored.occupied_cells()
    return Structure(
        directions_rad=np.mod(scored.directions_rad + explored.geometry.yaw_rad, np.pi),
        strengths=scored.strengths,
        scores=explored.values_at(cells, scored.score),
        threshold=clean.threshold,
        clean_cells=explored.values_at(cells, clean.cells),
        spectrum=scored.spectrum,
    )


def _walls(built: WallResult, explored: ExploredPart) -> Walls:
    return Walls(
        segments_m=explored.segments(built.segments_m),
        segment_direction=built.segment_direction,
        segment_cluster=built.segment_line,
        lines_m=explored.segments(built.lines.ends_m),
        line_direction=built.lines.direction,
        line_weight=built.lines.weight,
    )


def _floor_plan(
    plan: FloorPlanResult,
    room_of_face: NDArray[np.int32],
    explored: ExploredPart,
    parameters: FloorPlanParameters,
) -> FloorPlan:
    return FloorPlan(
        edges_m=explored.segments(plan.graph.edges_m),
        edge_weight=plan.cover.weight,
        edge_faces=plan.graph.edge_faces,
        faces_wkb=tuple(shapely.to_wkb(shapely.transform(plan.graph.polygons, explored.points)).tolist()),
        face_inside=plan.seen >= parameters.face_min_seen,
        room_of_face=room_of_face,
    )
