"""Stage C in one call."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import rotate

from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.model.labels import LabelRuns, row_ends
from rose2_logs.model.mitred import mitred
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.floor_plan.edge_weights import WallCover, edge_evidence, wall_cover
from rose2_logs.segmentation.floor_plan.faces import FaceGraph, build_faces, label_faces
from rose2_logs.segmentation.floor_plan.grouping import group_faces


@dataclass(frozen=True, eq=False)
class FloorPlanResult:
    """Stage C in the grid frame, meters.

    Attributes
    ----------
    graph : FaceGraph
    face_of_cell : (H, W) int32
        1 + index of the face that holds each cell.
    free_faces : LabelRuns
        The same of the free cells, 0 elsewhere.
    cover : WallCover
    seen : (F,) float
        Share of each face that is known to be free.
    group : (F,) int32
        Group of each face, 1.., 0 for faces outside.
    labels : (H, W) int32
        Group of each free cell, 0 for none.
    """

    graph: FaceGraph
    face_of_cell: NDArray[np.int32]
    free_faces: LabelRuns
    cover: WallCover
    seen: FloatArray
    group: NDArray[np.int32]
    labels: NDArray[np.int32]


def make_floor_plan(
    lines_m: FloatArray,
    walls: BoolArray,
    distance: NDArray[np.float32],
    free: BoolArray,
    direction_rad: float,
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> FloorPlanResult:
    """Faces, edge weights, inside and outside, groups of faces.

    The plane is cut within a box along `direction_rad`, the strongest dominant direction: what lies beyond
    counts as unseen, so that a box along the axes of the raster would give other rooms to a turned map.

    Parameters
    ----------
    lines_m : (L, 4) float
        Representative lines.
    walls : (H, W) bool
    distance : (H, W) float32
        Of each cell from the nearest wall cell, in cells.
    free : (H, W) bool
    direction_rad, resolution_m : float
    parameters : FloorPlanParameters
    """
    graph = _faces(lines_m, walls, free, direction_rad, resolution_m, parameters)
    evidence = edge_evidence(graph.edges_m, lines_m, walls, distance, free, resolution_m, parameters)
    plan = _ungrouped(graph, evidence, free, resolution_m)
    seen = plan.seen
    count = len(graph.polygons)
    # Without any line the map is one face, however little of it was seen.
    inside = (seen >= parameters.face_min_seen) | (count == 1)
    runs = plan.free_faces
    area = runs.sizes(count)[1:].astype(float) * resolution_m**2
    area[~inside] = 0
    widest = runs.greatest(distance, count)[1:].astype(float) * resolution_m
    group = 1 + group_faces(graph.edge_faces, evidence, area, seen, widest, parameters)
    labels = runs.renumbered(np.concatenate([np.zeros(1, np.int32), group]))
    return replace(plan, group=group, labels=labels)


def cut_by_lines(
    lines_m: FloatArray,
    walls: BoolArray,
    free: BoolArray,
    direction_rad: float,
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> FloorPlanResult:
    """Faces between lines (L, 4), with the weights of their edges, in no group yet."""
    graph = _faces(lines_m, walls, free, direction_rad, resolution_m, parameters)
    cover = wall_cover(graph.edges_m, lines_m, walls, resolution_m, parameters)
    return _ungrouped(graph, cover, free, resolution_m)


def _faces(
    lines_m: FloatArray,
    walls: BoolArray,
    free: BoolArray,
    direction_rad: float,
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> FaceGraph:
    return build_faces(
        lines_m, frame_along(free | walls, direction_rad, resolution_m, parameters.frame_margin_m)
    )


def _ungrouped(graph: FaceGraph, cover: WallCover, free: BoolArray, resolution_m: float) -> FloorPlanResult:
    count = len(graph.polygons)
    face_of_cell = label_faces(graph, (free.shape[0], free.shape[1]), resolution_m)
    free_faces = LabelRuns.of(face_of_cell * free)
    area = free_faces.sizes(count)[1:].astype(float) * resolution_m**2
    seen = area / np.maximum(shapely.area(graph.polygons), 1e-12)
    no_group, no_labels = np.zeros(count, np.int32), np.zeros(free.shape, np.int32)
    return FloorPlanResult(graph, face_of_cell, free_faces, cover, seen, no_group, no_labels)


def frame_along(
    known: BoolArray, direction_rad: float, resolution_m: float, margin_m: float
) -> shapely.Polygon:
    """Box around the known cells along a direction, with a margin: it turns with the map.

    Parameters
    ----------
    known : (H, W) bool
        Where there is none, the box is that of the raster, without a margin.
    direction_rad, resolution_m, margin_m : float

    Returns
    -------
    shapely Polygon
        Meters, grid frame.
    """
    rows, first, last = row_ends(known)
    if len(rows) == 0:
        return shapely.box(0, 0, known.shape[1] * resolution_m, known.shape[0] * resolution_m)
    corners = np.concatenate([np.column_stack([x, y]) for x in (first, last + 1) for y in (rows, rows + 1)])
    turned = rotate(shapely.linestrings(corners * resolution_m), -direction_rad, (0, 0), use_radians=True)
    box = mitred(shapely.envelope(turned), margin_m)
    frame: shapely.Polygon = rotate(box, direction_rad, (0, 0), use_radians=True)
    return frame
