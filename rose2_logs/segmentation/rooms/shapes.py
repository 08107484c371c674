"""Shapes of rooms: their faces, or their cells where a split cut through faces."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.labels import distinct_labels
from rose2_logs.model.outlines import room_outlines
from rose2_logs.segmentation.floor_plan.faces import FaceGraph
from rose2_logs.segmentation.floor_plan.stage import FloorPlanResult


def rooms_of_faces(labels: NDArray[np.int32], plan: FloorPlanResult) -> NDArray[np.int32]:
    """Room (F,) of each face, 0 for none.

    A group of faces that was split, or lost cells to a split, has no faces of its own any more.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms 1.. of the free cells.
    plan : FloorPlanResult
        The faces, their groups and the group of each cell.
    """
    group_count = int(plan.group.max(initial=0)) + 1
    fits = (int(labels.max(initial=0)) + 1) * group_count < 2**31
    pair_of_cell = labels * (np.int32(group_count) if fits else np.int64(group_count))
    pair_of_cell += plan.labels
    pairs, _ = distinct_labels(pair_of_cell)
    rooms, groups = np.divmod(pairs, group_count)
    rooms, groups = rooms[rooms > 0], groups[rooms > 0]
    rooms_in_group = np.bincount(groups, minlength=group_count)
    room_of_group = np.zeros(len(rooms_in_group), np.int32)
    whole = rooms_in_group[groups] == 1
    room_of_group[groups[whole]] = rooms[whole]
    room_of_face = room_of_group[plan.group]
    room_of_face[plan.group == 0] = 0
    return room_of_face


def most_seen_rooms(
    labels: NDArray[np.int32], faces: NDArray[np.int32], face_count: int
) -> NDArray[np.int32]:
    """Room (F,) that holds most of the labeled cells of each face, 0 for none.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms 1.. of the free cells.
    faces : (H, W) int32
        Face 1..F of each cell, 0 for none.
    face_count : int
        F.
    """
    rooms = int(labels.max(initial=0)) + 1
    inside = (labels > 0) & (faces > 0)
    key = (faces[inside].astype(np.int64) - 1) * rooms + labels[inside]
    pair, cells = np.unique(key, return_counts=True)
    face, room = np.divmod(pair, rooms)
    order = np.lexsort((-room, cells))
    of_face = np.zeros(face_count, np.int32)
    of_face[face[order]] = room[order]
    return of_face


def room_shapes(
    labels: NDArray[np.int32],
    plan: FloorPlanResult,
    room_of_face: NDArray[np.int32],
    resolution_m: float,
    min_seen: float,
) -> list[BaseGeometry]:
    """Predicted shape of each room: its faces, or its cells where it has none.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms 1.. of the free cells.
    plan : FloorPlanResult
        The faces.
    room_of_face : (F,) int32
        Room of each face, 0 for none.
    resolution_m : float
        Side of a cell.
    min_seen : float
        Faces less seen than this share are not part of a shape.

    Returns
    -------
    shapes : list of shapely geometries
        Grid frame, meters.
    """
    shown = np.where(plan.seen >= min_seen, room_of_face, 0)
    shapes = list(predicted_shapes(plan.graph, shown, int(labels.max(initial=0))))
    # Rooms that a split took from a face are as large as their cells.
    without = np.array([False, *(shape.is_empty for shape in shapes)])
    for room, shape in enumerate(room_outlines(np.where(without[labels], labels, 0), resolution_m)):
        if not shape.is_empty:
            shapes[room] = shape
    return shapes


def predicted_shapes(
    graph: FaceGraph, room_of_face: NDArray[np.int32], count: int
) -> tuple[BaseGeometry, ...]:
    """Join the faces of each room to one shape; gaps that it encloses belong to it.

    Parameters
    ----------
    room_of_face : (F,) int32
        Room 1..count of each face, 0 for none.

    Returns
    -------
    shapes : tuple of `count` shapely geometries
        Grid frame, meters; empty where a room has no face.
    """
    shapes = [shapely.union_all(graph.polygons[room_of_face == room]) for room in range(1, count + 1)]
    inner = graph.polygons[room_of_face > 0]
    tree = shapely.STRtree(shapely.point_on_surface(inner))
    return tuple(_without_empty_holes(shape, tree) for shape in shapes)


def _without_empty_holes(shape: BaseGeometry, face_points: shapely.STRtree) -> BaseGeometry:
    """Fill the holes of a shape that hold no face of a room."""
    rings, part = shapely.get_rings(shapely.get_parts(shape), return_index=True)
    if len(rings) == len(shapely.get_parts(shape)):
        return shape
    first_of_part = np.concatenate([[True], part[1:] != part[:-1]])
    holes = shapely.polygons(rings[~first_of_part])
    taken = np.unique(face_points.query(holes, predicate="contains")[0])
    return shapely.union_all([shape, *np.delete(holes, taken)])
