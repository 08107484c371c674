"""RoomMap: the narrow waist that every segmenter returns; tracking and evaluation need nothing more."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.labels import LabelRuns, label_sizes
from rose2_logs.model.occupancy import FloatArray, GridGeometry
from rose2_logs.system.text import counted

LABEL_DEPTH_SHARE = 0.8
"""Where a room's name stands: the point nearest to the middle of those that are at least this share of its
greatest depth from the border, so halfway along a corridor."""


@dataclass(frozen=True, eq=False)
class Doorway:
    """A passage through which free space of two rooms is connected.

    Attributes
    ----------
    rooms : (int, int)
        The two room numbers, the smaller one first.
    ends_m : (2, 2) float
        The two ends of the passage, world meters.

    Examples
    --------
    >>> import numpy as np, rose2_logs as rl
    >>> rl.Doorway((1, 2), np.array([[3.0, 1.0], [3.0, 2.0]])).width_m
    1.0
    """

    rooms: tuple[int, int]
    ends_m: FloatArray

    @property
    def width_m(self) -> float:
        """Clear width of the passage in meters."""
        return float(np.linalg.norm(self.ends_m[1] - self.ends_m[0]))


@dataclass(frozen=True, eq=False)
class RoomMap:
    """The rooms of one map.

    Attributes
    ----------
    geometry : GridGeometry
        Position of `labels` in the world.
    labels : (H, W) int32, read-only
        0 = no room, 1..R = the rooms: the segmented map.
    polygons : tuple of R shapely Polygon or MultiPolygon
        Shape of room i + 1 in world meters. From ROSE2 it includes the predicted, unseen part of the room;
        from a baseline it is the outline of the labeled cells.
    areas_m2 : (R,) float
        Area of the labeled cells of each room.
    doorways : tuple of Doorway
        Passages between rooms.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> with rl.open_log("sample_logs/office.mcap") as reader:
    ...     found = rl.segment(reader.last())
    >>> found.rooms
    RoomMap(18 rooms, 17 doorways, 704 x 512 cells of 0.05 m)
    """

    geometry: GridGeometry
    labels: NDArray[np.int32]
    polygons: tuple[BaseGeometry, ...]
    areas_m2: FloatArray
    doorways: tuple[Doorway, ...] = ()

    def __repr__(self) -> str:
        rooms, doorways = counted(len(self), "room"), counted(len(self.doorways), "doorway")
        return f"RoomMap({rooms}, {doorways}, {self.geometry.size_text})"

    def __post_init__(self) -> None:
        labels = self.labels.view()
        labels.flags.writeable = False
        object.__setattr__(self, "labels", labels)

    @classmethod
    def from_labels(cls, labels: NDArray[np.int32], geometry: GridGeometry) -> RoomMap:
        """Rooms known by their cells alone, as tracking needs them: without shapes and doorways.

        Parameters
        ----------
        labels : (H, W) int32
            0 = none; a number that does not occur is a room without cells.
        geometry : GridGeometry
            Where they lie.
        """
        cells = label_sizes(labels, int(labels.max(initial=0)))[1:]
        areas = cells.astype(np.float64) * geometry.cell_area_m2
        return cls(geometry, labels, (Polygon(),) * len(cells), areas)

    def __len__(self) -> int:
        return len(self.polygons)

    @cached_property
    def predicted_areas_m2(self) -> FloatArray:
        """Area (R,) of each room's polygon in square meters."""
        import shapely

        areas: FloatArray = shapely.area(np.array(self.polygons, object)).astype(float)
        return areas

    @cached_property
    def windows(self) -> tuple[tuple[slice, slice] | None, ...]:
        """Rows and columns that hold the cells of each room; None for a room without cells."""
        found = LabelRuns.of(self.labels).windows()[: len(self)]
        return (*found, *[None] * (len(self) - len(found)))

    @cached_property
    def label_points_m(self) -> FloatArray:
        """World point (R, 2) for the name of each room, meters: well inside its cells, so where it was seen.

        Of a room without cells it is a point of its polygon, NaN where that is empty.
        """
        import cv2

        points = np.full((len(self), 2), np.nan)
        cells: dict[int, tuple[int, int]] = {}
        for number, window in enumerate(self.windows):
            shape = self.polygons[number]
            if window is not None:
                inside = np.equal(self.labels[window], number + 1).view(np.uint8)
                framed = cv2.copyMakeBorder(inside, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
                depth = cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_3)[1:-1, 1:-1]
                deep = np.flatnonzero(depth >= LABEL_DEPTH_SHARE * depth.max())
                row, column = np.divmod(deep, depth.shape[1])
                sums = cv2.moments(inside, binaryImage=True)
                down, right = sums["m01"] / sums["m00"], sums["m10"] / sums["m00"]
                middle = np.argmin((row - down) ** 2 + (column - right) ** 2)
                cells[number] = window[0].start + row[middle], window[1].start + column[middle]
            elif not shape.is_empty:
                points[number] = shape.representative_point().coords[0]
        # As (R, 1, 2): so that the rounding of a point does not depend on the others.
        row, column = np.array([*cells.values()], np.intp).reshape(-1, 1, 2).T
        points[[*cells]] = self.geometry.cell_centers(row.T, column.T)[:, 0]
        return points

    @cached_property
    def outer_rings_m(self) -> tuple[list[FloatArray], ...]:
        """Closed outer rings (K, 2) of each room's polygon in world meters."""
        import shapely

        parts, room = shapely.get_parts(np.array(self.polygons, object), return_index=True)
        points, ring = shapely.get_coordinates(shapely.get_exterior_ring(parts), return_index=True)
        rings = np.split(points, np.flatnonzero(np.diff(ring)) + 1)
        of_room: tuple[list[FloatArray], ...] = tuple([] for _ in self.polygons)
        for number, corners in zip(room[np.unique(ring)].tolist(), rings, strict=False):
            of_room[number].append(corners)
        return of_room

    @cached_property
    def adjacency(self) -> tuple[tuple[int, int], ...]:
        """Pairs of room numbers, smaller first, that at least one doorway connects; sorted."""
        return tuple(sorted({doorway.rooms for doorway in self.doorways}))

    def neighbors(self, room: int) -> tuple[int, ...]:
        """Rooms that a doorway connects with `room`, ascending."""
        return self._neighbors.get(room, ())

    @cached_property
    def _neighbors(self) -> dict[int, tuple[int, ...]]:
        """For each room that has some, those that a doorway connects with it."""
        found: dict[int, list[int]] = {}
        for a, b in self.adjacency:
            found.setdefault(a, []).append(b)
            found.setdefault(b, []).append(a)
        return {room: tuple(sorted(others)) for room, others in found.items()}
