"""Rooms from groups of faces: which faces are inside, labels of cells, predicted shapes (paper, III-C)."""

from __future__ import annotations

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.parameters import FloorPlanParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.floor_plan.faces import FaceGraph, rasterize


def label_faces(graph: FaceGraph, shape: tuple[int, int], resolution_m: float) -> NDArray[np.int32]:
    """Paint the faces: (H, W) int32 with 1 + index of the face that holds each cell, 0 for none."""
    return rasterize(
        graph.polygons, np.arange(1, len(graph.polygons) + 1, dtype=np.int32), shape, resolution_m
    )


def free_area(
    face_of_cell: NDArray[np.int32], free: BoolArray, count: int, resolution_m: float
) -> FloatArray:
    """Free area (F,) of each face in square meters."""
    cells = np.bincount(face_of_cell[free], minlength=count + 1)[1:]
    return cells.astype(float) * resolution_m**2


def clearance(
    face_of_cell: NDArray[np.int32], free: BoolArray, walls: BoolArray, count: int, resolution_m: float
) -> FloatArray:
    """Greatest distance (F,) in meters of a free cell of each face from a wall."""
    distance = cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    greatest = np.zeros(count + 1, np.float32)
    np.maximum.at(greatest, face_of_cell[free], distance[free])
    return greatest[1:].astype(float) * resolution_m


def adopt_left_out(
    labels: NDArray[np.int32], free: BoolArray, resolution_m: float, parameters: FloorPlanParameters
) -> NDArray[np.int32]:
    """Give free space outside all rooms to the room that it opens to most, where it is wide.

    A face of which little was seen is outside, for it holds rays through windows; what was seen of it
    may yet be the corner of a room. Rays are narrower than `leak_max_width_m`.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms of the free cells, 0 elsewhere.
    free : (H, W) bool
        Free cells.
    """
    width = 2 * round(parameters.leak_max_width_m / resolution_m / 2) + 1
    wide = cv2.morphologyEx(free.astype(np.uint8), cv2.MORPH_OPEN, np.ones((width, width), np.uint8))
    left_out = (wide > 0) & (labels == 0)
    count, piece = cv2.connectedComponents(left_out.astype(np.uint8), connectivity=4)
    rooms = int(labels.max(initial=0)) + 1
    contacts = np.zeros(count * rooms, np.int64)
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        for here, there in ((one, other), (other, one)):
            meet = (piece[here] > 0) & (labels[there] > 0)
            key = piece[here][meet].astype(np.int64) * rooms + labels[there][meet]
            contacts += np.bincount(key, minlength=count * rooms)
    contacts = contacts.reshape(count, rooms)
    room = contacts.argmax(1).astype(np.int32)
    room[contacts.max(1) * resolution_m < parameters.join_min_open_m] = 0
    adopted = labels.copy()
    adopted[left_out] = room[piece[left_out]]
    return adopted


def settle_borders(labels: NDArray[np.int32], resolution_m: float, strip_m: float) -> NDArray[np.int32]:
    """Give strips of a room that lie along the other side of a wall to the room on that side.

    A representative line runs within a wall, but not in the middle of every cell of it, so that a strip of
    free cells before the wall may fall on the line's other side. What is narrower than `strip_m` is taken
    away from its room and grown again from the rooms that it is open to.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms of the free cells, 0 elsewhere.
    """
    radius = max(1, round(strip_m / resolution_m / 2))
    kernel = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    grown = labels.astype(np.float32)
    core = cv2.erode(grown, kernel) == grown
    core &= cv2.dilate(grown, kernel) == grown
    grown[~core] = 0
    open_cells = labels > 0
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    # Every step reaches a cell further; twice the strip brings back what lies in corners.
    for _ in range(4 * radius):
        np.copyto(grown, cv2.dilate(grown, cross), where=(grown == 0) & open_cells)
    settled = labels.copy()
    np.copyto(settled, grown, where=grown > 0, casting="unsafe")
    return settled


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
