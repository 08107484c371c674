"""What a map shows of each room's outline: how much of it is wall, and where the room goes on unseen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.tracking import QualityParameters
from rose2_logs.model.explored import ExploredPart
from rose2_logs.model.labels import contacts, known_window
from rose2_logs.model.occupancy import UNKNOWN, BoolArray, FloatArray, OccupancySnapshot
from rose2_logs.model.rooms import RoomMap

UNSURE_SIGN = "?"
"""Behind the number of an unsure room, wherever its name is drawn."""
UNSURE_BELOW = 0.7
"""Rooms with less wall support are marked as unsure; doorways alone take a room to about 0.9. A matter of
display: no stored result depends on it."""


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
    return RoomQuality(_wall_shares(explored, rooms, parameters), _frontiers(snapshot, rooms))


def _wall_shares(explored: ExploredPart, rooms: RoomMap, parameters: QualityParameters) -> FloatArray:
    near = _within(explored.occupied, parameters.wall_reach_m / explored.resolution_m)
    grid = explored.geometry.part(explored.window, explored.factor)
    shares = np.full(len(rooms), np.nan)
    for number, polygon in enumerate(rooms.polygons):
        points = _points_along(polygon, parameters.outline_step_m)
        if len(points) == 0:
            continue
        row, column = np.moveaxis(grid.world_to_cell(points), -1, 0)
        inside = (row >= 0) & (row < near.shape[0]) & (column >= 0) & (column < near.shape[1])
        shares[number] = np.count_nonzero(near[row[inside], column[inside]]) / len(points)
    return shares


def _points_along(polygon: BaseGeometry, step_m: float) -> FloatArray:
    """Points (N, 2) every so many meters along the rings of a shape, one ring after the other.

    As shapely interpolates along its boundary, which looks for each point from the beginning.
    """
    corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(polygon)), return_index=True)
    if len(corners) == 0:
        return np.zeros((0, 2))
    sides = corners[1:] - corners[:-1]
    lengths = np.where(ring[1:] == ring[:-1], np.hypot(*sides.T), 0.0)
    ends = np.cumsum(lengths)
    distances = np.arange(0.0, ends[-1], step_m)
    distances = distances[distances < ends[-1]]
    side = np.searchsorted(ends, distances, "right")
    share = (distances - (ends - lengths)[side]) / lengths[side]
    points: FloatArray = corners[side] + share[:, None] * sides[side]
    return points


def _within(mask: BoolArray, reach_cells: float) -> BoolArray:
    """Cells no further from one of a mask (H, W) than a number of cells."""
    import cv2

    distance = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return np.asarray(distance <= reach_cells)


def _frontiers(snapshot: OccupancySnapshot, rooms: RoomMap) -> FloatArray:
    """Length (R,) in meters of the sides that cells of each room share with unknown ones."""
    known = known_window(rooms.labels > 0)
    window = tuple(slice(max(part.start - 1, 0), part.stop + 1) for part in known)
    labels, unknown = rooms.labels[window], snapshot.cells[window] == UNKNOWN
    marked = np.where(unknown, UNKNOWN, labels)
    # A map may be cropped to its known cells, or grow only when something is seen.
    margins = [
        (int(part.start == 0), int(part.stop == size))
        for part, size in zip(known, rooms.labels.shape, strict=True)
    ]
    meet = contacts(np.pad(marked, margins, constant_values=UNKNOWN))
    sides = np.bincount(meet.high[(meet.low == UNKNOWN) & (meet.high > 0)], minlength=len(rooms) + 1)
    return sides[1:].astype(np.float64) * snapshot.geometry.resolution_m
