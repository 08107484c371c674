"""What a map shows of each room's outline: how much of it is wall, and where the room goes on unseen."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.tracking import QualityParameters
from rose2_logs.model.explored import ExploredPart
from rose2_logs.model.labels import distance_from, narrow
from rose2_logs.model.occupancy import UNKNOWN, BoolArray, FloatArray, OccupancySnapshot
from rose2_logs.model.rooms import RoomMap

UNSURE_SIGN = "?"
"""Behind the number of an unsure room, wherever its name is drawn."""
UNSURE_BELOW = 0.7
"""Rooms with less wall support are marked as unsure; doorways alone take a room to about 0.9. A matter of
display: no stored result depends on it."""
DISK_MAX_CELLS = 8
"""Up to this radius, growing a mask by a disk is faster than measuring all distances: several times at 4."""


def is_unsure(wall_support: float | None) -> bool:
    """Whether little of a room's outline is known to be wall; of what was not measured nothing is said."""
    return wall_support is not None and wall_support < UNSURE_BELOW


def unsure_sign(wall_support: float | None) -> str:
    """Return what follows the number of a room: a sign where the room is unsure."""
    return UNSURE_SIGN if is_unsure(wall_support) else ""


@dataclass(frozen=True, eq=False)
class RoomQuality:
    """How sure the rooms of one map are.

    Attributes
    ----------
    wall_support : (R,) float
        Share of each room's outline, with its predicted part, that occupied cells support; NaN for a room
        without outline. Doorways are not supported, so an ordinary room stays a little below 1.
    frontier_m : (R,) float
        Length of each room's open frontier: cell sides between its free cells and unknown ones, meters. What
        is beyond the grid is unknown, as if the map had a border of unknown cells.
    """

    wall_support: FloatArray
    frontier_m: FloatArray


def room_quality(
    snapshot: OccupancySnapshot, explored: ExploredPart, rooms: RoomMap, parameters: QualityParameters
) -> RoomQuality:
    """Measure how far the outlines of rooms are supported by walls, and their open frontier.

    Parameters
    ----------
    snapshot : OccupancySnapshot
        The map.
    explored : ExploredPart
        Its explored part.
    rooms : RoomMap
        The rooms found in it, on its grid.
    parameters : QualityParameters
    """
    return RoomQuality(_wall_shares(explored, rooms, parameters), _frontiers(snapshot, explored, rooms))


def _wall_shares(explored: ExploredPart, rooms: RoomMap, parameters: QualityParameters) -> FloatArray:
    near = _within(explored.occupied, parameters.wall_reach_m / explored.resolution_m)
    grid = explored.geometry.part(explored.window, explored.factor)
    outlines = _points_along(rooms.polygons, parameters.outline_step_m)
    # Outline by outline: the last digits of a product depend on how many points it has.
    row, column = np.concatenate([np.zeros((0, 2), np.intp), *map(grid.world_to_cell, outlines)]).T
    room = np.repeat(np.arange(len(rooms)), [len(points) for points in outlines])
    inside = (row >= 0) & (row < near.shape[0]) & (column >= 0) & (column < near.shape[1])
    supported = np.bincount(room[inside], near[row[inside], column[inside]], minlength=len(rooms))
    count = np.bincount(room, minlength=len(rooms))
    shares: FloatArray = np.divide(supported, count, out=np.full(len(rooms), np.nan), where=count > 0)
    return shares


def _points_along(polygons: Sequence[BaseGeometry], step_m: float) -> list[FloatArray]:
    """Points (N, 2) every so many meters along the rings of each shape, one ring after the other.

    As shapely interpolates along its boundary, which looks for each point from the beginning.
    """
    parts, shape_of_part = shapely.get_parts(np.array(polygons, object), return_index=True)
    rings, part_of_ring = shapely.get_rings(parts, return_index=True)
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    begins = np.searchsorted(shape_of_part[part_of_ring[ring]], np.arange(len(polygons) + 1))
    steps = corners[1:] - corners[:-1]
    lengths = np.where(ring[1:] == ring[:-1], np.hypot(*steps.T), 0.0)
    sides, shares = [np.zeros(0, np.intp)], [np.zeros(0)]
    for begin, end in itertools.pairwise(begins):
        of_shape = lengths[begin : max(end - 1, begin)]
        ends = np.cumsum(of_shape)
        whole = ends[-1] if len(ends) else 0.0
        distances = np.arange(0.0, whole, step_m)
        distances = distances[distances < whole]
        side = np.searchsorted(ends, distances, "right")
        sides.append(begin + side)
        shares.append((distances - (ends - of_shape)[side]) / of_shape[side])
    side = np.concatenate(sides)
    points = corners[side] + np.concatenate(shares)[:, None] * steps[side]
    return np.split(points, np.cumsum([len(share) for share in shares[1:]])[:-1])


def _within(mask: BoolArray, reach_cells: float) -> BoolArray:
    """Cells no further from one of a mask (H, W) than a number of cells."""
    import cv2

    if reach_cells > DISK_MAX_CELLS:
        return distance_from(mask) <= reach_cells
    middle = int(reach_cells) + 1
    disk = distance_from(np.pad([[True]], middle)) <= reach_cells
    return cv2.dilate(mask.astype(np.uint8), disk.astype(np.uint8)) > 0


def _frontiers(snapshot: OccupancySnapshot, explored: ExploredPart, rooms: RoomMap) -> FloatArray:
    """Length (R,) in meters of the sides that cells of each room share with unknown ones."""
    known = explored.window
    window = tuple(slice(max(part.start - 1, 0), part.stop + 1) for part in known)
    unknown, labels = snapshot.cells[window] == UNKNOWN, narrow(rooms.labels[window])
    # A map may be cropped to its known cells, or grow only when something is seen.
    margins = [
        (int(part.start == 0), int(part.stop == size))
        for part, size in zip(known, rooms.labels.shape, strict=True)
    ]
    unknown, labels = np.pad(unknown, margins, constant_values=True), np.pad(labels, margins)
    in_room = labels > 0
    sides = np.zeros(len(rooms) + 1, np.int64)
    left, right, upper, lower = np.s_[:, :-1], np.s_[:, 1:], np.s_[:-1], np.s_[1:]
    for here, beside in ((left, right), (right, left), (upper, lower), (lower, upper)):
        sides += np.bincount(labels[here][in_room[here] & unknown[beside]], minlength=len(rooms) + 1)
    return sides[1:].astype(np.float64) * snapshot.geometry.resolution_m
