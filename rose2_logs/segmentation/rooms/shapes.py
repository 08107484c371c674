"""Shapes of rooms: what was seen of them, and of the unseen what nothing known contradicts."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.model.labels import (
    Label,
    LabelRuns,
    distinct_labels,
    equal_pieces,
    label_sizes,
    labels_near,
    narrow,
)
from rose2_logs.model.occupancy import BoolArray
from rose2_logs.model.outlines import room_outlines
from rose2_logs.segmentation.floor_plan.stage import FloorPlanResult


def rooms_of_faces(
    labels: NDArray[np.int32], number: NDArray[np.int32], plan: FloorPlanResult
) -> NDArray[np.int32]:
    """Room (F,) of each face, 0 for none.

    A group of faces that was split, or lost cells to a split, has no faces of its own any more.

    Parameters
    ----------
    labels : (H, W) int32
        Labels of the free cells.
    number : (N,) int32
        Room 1.. of each label, 0 for none.
    plan : FloorPlanResult
        The faces, their groups and the group of each cell.
    """
    group_count = int(plan.group.max(initial=0)) + 1
    fits = (int(labels.max(initial=0)) + 1) * group_count < 2**31
    pair_of_cell = labels * (np.int32(group_count) if fits else np.int64(group_count))
    pair_of_cell += plan.labels
    pairs, _ = distinct_labels(pair_of_cell)
    rooms, groups = np.divmod(pairs, group_count)
    rooms = number[rooms]
    rooms, groups = rooms[rooms > 0], groups[rooms > 0]
    rooms_in_group = np.bincount(groups, minlength=group_count)
    room_of_group = np.zeros(len(rooms_in_group), np.int32)
    whole = rooms_in_group[groups] == 1
    room_of_group[groups[whole]] = rooms[whole]
    room_of_face = room_of_group[plan.group]
    room_of_face[plan.group == 0] = 0
    return room_of_face


def seen_cells(
    labels: NDArray[np.int32], free: BoolArray, face_of_cell: NDArray[np.int32], face_count: int
) -> NDArray[np.int64]:
    """Count the cells of each face and room.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms 1..R of the free cells, 0 for none.
    free : (H, W) bool
        Free cells.
    face_of_cell : (H, W) int32
        Face 1..F of each cell, 0 for none.
    face_count : int
        F.

    Returns
    -------
    cells : (F + 1, R + 2) int64
        Of each face, face 0 being what is in none: cells that are not free, those of each room, and free ones
        of no room.
    """
    kinds = int(labels.max(initial=0)) + 2
    fits = (face_count + 1) * kinds < 2**31
    key = face_of_cell * (np.int32(kinds) if fits else np.int64(kinds))
    key += labels
    key[free & (labels == 0)] += kinds - 1
    return label_sizes(key, (face_count + 1) * kinds - 1).reshape(-1, kinds)


def most_seen_rooms(cells: NDArray[np.int64]) -> NDArray[np.int32]:
    """Room (F,) that holds most of the labeled cells of each face, 0 for none, from `seen_cells`."""
    of_rooms = cells[1:, :-1].copy()
    of_rooms[:, 0] = 0
    rooms: NDArray[np.int32] = of_rooms.argmax(1).astype(np.int32)
    return rooms


def room_shapes(
    labels: NDArray[np.int32],
    free: BoolArray,
    occupied: BoolArray,
    face_of_cell: NDArray[np.int32],
    cells_of_face: NDArray[np.int64],
    room_of_face: NDArray[np.int32],
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> list[BaseGeometry]:
    """Predict the shape of each room.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms 1.. of the free cells, however they were found.
    free, occupied : (H, W) bool
        Free and occupied cells.
    face_of_cell : (H, W) int32
        1 + index of the face that holds each cell, 0 for none.
    cells_of_face : (F + 1, R + 2) int64
        Their cells, see `seen_cells`.
    room_of_face : (F,) int32
        Room of each face, 0 for none; of a face that rooms share, the one that has most of it.
    resolution_m : float
        Side of a cell.
    parameters : FloorPlanParameters

    Returns
    -------
    shapes : list of shapely geometries
        Grid frame, meters. They do not overlap, but for what straightening their outlines moves.
    """
    cells = predicted_cells(
        labels, free, occupied, face_of_cell, cells_of_face, room_of_face, resolution_m, parameters
    )
    outlines = room_outlines(cells, resolution_m)
    return list(shapely.coverage_simplify(outlines, parameters.shape_simplify_m)) if outlines else []


def predicted_cells(
    labels: NDArray[np.int32],
    free: BoolArray,
    occupied: BoolArray,
    face_of_cell: NDArray[np.int32],
    cells_of_face: NDArray[np.int64],
    room_of_face: NDArray[np.int32],
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> NDArray[np.integer]:
    """Cells of the rooms' shapes: (H, W) with rooms 1.., 0 for none, in the narrowest type.

    Each unseen cell is claimed by one room at most. The unseen cells of a room that hang together are a
    pocket; it is the room's if it is open to what was seen of the room rather than walled off, or small. Of
    the walls around, the room takes the side that is its own.
    """
    seen = narrow(labels)
    claim = _claims(seen, free, face_of_cell, cells_of_face, room_of_face, resolution_m, parameters)
    gap = round(parameters.shape_gap_m / resolution_m / 2)
    wall = _dilated(occupied, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * gap + 1, 2 * gap + 1)))
    wall &= seen == 0
    pocket = _parts(claim, (claim > 0) & ~wall)
    inside = np.flatnonzero(pocket > 0)
    is_room = _open_pockets(seen, claim, pocket, inside, wall, resolution_m, parameters)
    taken = inside.compress(is_room.take(pocket.take(inside)))
    cells = seen.copy()
    cells.reshape(-1)[taken] = claim.take(taken)
    reach = gap + max(1, round(parameters.shape_wall_m / resolution_m))
    beside = _dilated(cells > 0, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    beside &= (claim > 0) & (pocket == 0)
    np.copyto(cells, claim, where=beside)
    part = equal_pieces(cells > 0, cells)
    was_seen = np.zeros(part.max() + 1, bool)
    was_seen[LabelRuns.of(part * (seen > 0)).label] = True
    predicted = np.flatnonzero((cells > 0) & (seen == 0))
    cells.reshape(-1)[predicted.compress(~was_seen.take(part.take(predicted)))] = 0
    _fill_small_holes(cells, resolution_m, parameters.shape_fill_max_m2)
    return cells


def _claims(
    labels: NDArray[Label],
    free: BoolArray,
    face_of_cell: NDArray[np.int32],
    cells_of_face: NDArray[np.int64],
    room_of_face: NDArray[np.int32],
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> NDArray[Label]:
    """Room (H, W) that may be predicted in each cell that is not free, 0 for none.

    The room that was seen nearest, if it has a part of the face, else the room of the face.
    """
    known = cells_of_face[:, 1:].sum(1)
    is_known = known >= parameters.shape_min_seen * np.maximum(cells_of_face.sum(1), 1)
    is_known[0] = False
    in_rooms = cells_of_face[:, 1:-1]
    least = np.maximum(parameters.shape_share_of_face * in_rooms.sum(1, keepdims=True), 1)
    has_part = (in_rooms >= least) & is_known[:, None]
    room_of = np.where(is_known, np.concatenate([np.zeros(1, np.int32), room_of_face]), 0)
    unseen = np.flatnonzero(is_known.take(face_of_cell) & ~free)
    room = labels_near(labels, unseen, parameters.shape_reach_m / resolution_m)
    unseen, room = unseen.compress(room > 0), room.compress(room > 0)
    face = face_of_cell.take(unseen)
    claim = np.zeros_like(labels, order="C")
    claim.reshape(-1)[unseen] = np.where(has_part[face, room - 1], room, room_of.take(face))
    return claim


def _open_pockets(
    labels: NDArray[Label],
    claim: NDArray[Label],
    pocket: NDArray[np.int32],
    inside: NDArray[np.intp],
    wall: BoolArray,
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> BoolArray:
    """Which pockets (N,) are their rooms', by what is around the cells inside them."""
    number, room = pocket.take(inside), claim.take(inside)
    count = int(number.max(initial=0)) + 1
    is_wall = labels.dtype.type(labels.max(initial=0) + 1)
    around = np.pad(np.where(wall, is_wall, labels), 1)
    beside = _beside(around, np.flatnonzero(np.pad(pocket > 0, 1)))
    opening = np.bincount(number, (beside == room).sum(0), count)
    walled = np.bincount(number, (beside == is_wall).sum(0), count)
    small = np.bincount(number, minlength=count) * resolution_m**2 <= parameters.shape_fill_max_m2
    is_open = opening >= parameters.shape_min_open * (opening + walled)
    is_room: BoolArray = (opening > 0) & (small | is_open)
    return is_room


def _fill_small_holes(cells: NDArray[np.integer], resolution_m: float, largest_m2: float) -> None:
    """Give holes up to some size to the one room that surrounds them, in place."""
    empty = np.pad(cells == 0, 1, constant_values=True).astype(np.uint8)
    count, hole = cv2.connectedComponents(empty, connectivity=4)
    inside = np.flatnonzero(hole > 1)  # not the rooms themselves, nor what is outside of them
    number = hole.take(inside).astype(np.intp)
    small = np.bincount(number, minlength=count) * resolution_m**2 <= largest_m2
    of_small = np.flatnonzero(small.take(number))
    inside, number = inside.take(of_small), number.take(of_small)
    filled = np.pad(cells, 1)
    beside = _beside(filled, inside)
    highest, lowest = np.zeros(count, np.int32), np.full(count, np.iinfo(np.int32).max, np.int32)
    np.maximum.at(highest, number, beside.max(0, initial=0))
    np.minimum.at(lowest, number, np.where(beside > 0, beside, lowest[0]).min(0, initial=lowest[0]))
    filled.reshape(-1)[inside] = np.where(lowest == highest, highest, 0).take(number)
    cells[...] = filled[1:-1, 1:-1]


def _beside(padded: NDArray[Label], inside: NDArray[np.intp]) -> NDArray[Label]:
    """Values (4, N) beside each of some cells, numbered in reading order, of an image that has a margin."""
    width = padded.shape[1]
    return np.stack([padded.take(inside + step) for step in (-width, -1, 1, width)])


def _parts(values: NDArray[np.integer], mask: BoolArray) -> NDArray[np.int32]:
    """Number the parts of a mask in which a value hangs together; cells along a border of two get 0."""
    inside = mask.copy()
    inside[:, :-1] &= ~mask[:, 1:] | (values[:, :-1] == values[:, 1:])
    inside[:-1] &= ~mask[1:] | (values[:-1] == values[1:])
    _, part = cv2.connectedComponents(inside.astype(np.uint8), connectivity=4)
    return part.astype(np.int32, copy=False)


def _dilated(mask: BoolArray, kernel: NDArray[Any]) -> BoolArray:
    return cv2.dilate(mask.astype(np.uint8), kernel) > 0
