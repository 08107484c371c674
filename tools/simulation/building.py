"""The simulated building: true rooms, and everything that a lidar meets in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

FloatArray = NDArray[np.float64]

DOORWAY_REACH_M = 0.25
"""How far a room's label reaches past its walls: half of the thickest doorway, and the width that range and
pose noise give to a mapped wall. Free cells further out (rays that left through a window) have no room."""


@dataclass(frozen=True)
class Room:
    """One true room.

    Attributes
    ----------
    number : int
        Label of the room in every label image of its building, from 1.
    name : str
        Kind and number, e.g. ``office 3``.
    polygon : shapely Polygon
        Clear floor from wall to wall, furniture included, world meters.
    """

    number: int
    name: str
    polygon: Polygon


@dataclass(frozen=True, eq=False)
class Building:
    """A building with what is true about it.

    Attributes
    ----------
    name : str
        Style and seed.
    rooms : tuple of Room
        Every room, also those behind closed doors.
    doorways : tuple of shapely Polygon
        Openings through walls, from room to room.
    furniture : shapely geometry
        Cross-section of furniture, door leaves, and chair and table legs at the lidar's height.
    segments : (S, 4) float
        Everything that returns a ray: x0, y0, x1, y1 in world meters.
    transmission : (S,) float
        Probability that a ray passes the segment: 0 for what is opaque, more for glass.
    start_xy_m : (float, float)
        Where the robot starts.
    """

    name: str
    rooms: tuple[Room, ...]
    doorways: tuple[Polygon, ...]
    furniture: BaseGeometry
    segments: FloatArray
    transmission: FloatArray
    start_xy_m: tuple[float, float]

    @property
    def doorway_rooms(self) -> tuple[tuple[int, int], ...]:
        """The two rooms that each doorway connects, the smaller number first."""
        polygons = np.array([room.polygon for room in self.rooms])
        pairs = []
        for door in self.doorways:
            near = np.argsort(shapely.area(shapely.intersection(polygons, door.buffer(0.1))))[-2:]
            first, second = sorted(self.rooms[i].number for i in near)
            pairs.append((first, second))
        return tuple(pairs)

    def bounds(self, margin_m: float) -> tuple[float, float, float, float]:
        """Extent (x min, y min, x max, y max) of the rooms with a margin, meters."""
        x0, y0, x1, y1 = shapely.union_all([room.polygon for room in self.rooms]).bounds
        return x0 - margin_m, y0 - margin_m, x1 + margin_m, y1 + margin_m

    def walkable(self, clearance_m: float) -> BaseGeometry:
        """The floor on which the center of a robot of radius `clearance_m` can stand."""
        floor = shapely.union_all([room.polygon for room in self.rooms] + list(self.doorways))
        solid = self.furniture.buffer(clearance_m, quad_segs=2)
        return floor.buffer(-clearance_m, quad_segs=2).difference(solid)

    def room_labels(self, resolution_m: float) -> tuple[NDArray[np.uint16], tuple[float, float]]:
        """True room of every cell of the whole building.

        Cells in a doorway or in a wall belong to the nearest room, up to `DOORWAY_REACH_M` from it.

        Parameters
        ----------
        resolution_m : float
            Side of a cell.

        Returns
        -------
        labels : (H, W) uint16
            0 outside, room numbers inside; row 0 at the origin.
        origin_xy_m : (float, float)
            World position of the outer corner of cell (0, 0), a multiple of the resolution.
        """
        x0, y0, x1, y1 = self.bounds(1.0)
        column0, row0 = int(np.floor(x0 / resolution_m)), int(np.floor(y0 / resolution_m))
        shape = (int(np.ceil(y1 / resolution_m)) - row0, int(np.ceil(x1 / resolution_m)) - column0)
        labels = np.zeros(shape, np.uint16)
        for room in self.rooms:
            a0, b0, a1, b1 = (np.array(room.polygon.bounds) / resolution_m).astype(int)
            rows = np.arange(b0 - row0 - 1, b1 - row0 + 2)
            columns = np.arange(a0 - column0 - 1, a1 - column0 + 2)
            x = (columns + column0 + 0.5)[None, :] * resolution_m
            y = (rows + row0 + 0.5)[:, None] * resolution_m
            inside = shapely.contains_xy(room.polygon, *np.broadcast_arrays(x, y))
            block = labels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            block[inside] = room.number
        distance, nearest = distance_transform_edt(labels == 0, return_indices=True)
        reach = distance * resolution_m <= DOORWAY_REACH_M
        labels[reach] = labels[nearest[0][reach], nearest[1][reach]]
        return labels, (column0 * resolution_m, row0 * resolution_m)


def boundary_segments(geometry: BaseGeometry) -> FloatArray:
    """Every edge (S, 4) of the outlines of polygons."""
    rings = shapely.get_rings(shapely.get_parts(geometry))
    pieces = [np.hstack([c[:-1], c[1:]]) for c in (shapely.get_coordinates(ring) for ring in rings)]
    return np.concatenate(pieces) if pieces else np.zeros((0, 4))
