"""The last map of a run with its rooms and walls: what two runs are compared by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from shapely.geometry.base import BaseGeometry

from rose2_logs.comparison.placement import PlacedMap
from rose2_logs.model.analysis import Walls
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.model.room_names import room_name
from rose2_logs.system.text import counted
from rose2_logs.tracking.registration import RigidMotion


@dataclass(frozen=True, eq=False)
class FinalLayout:
    """What a run found in the end.

    Attributes
    ----------
    name : str
        What the run is called.
    map : PlacedMap
        Its last map.
    tracks : tuple of R int
        Numbers of the rooms.
    shapes : tuple of R shapely Polygon or MultiPolygon
        Their shapes with the predicted part, meters in the map's frame.
    areas_m2 : (R,) float
        Their areas as far as they were seen.
    walls : Walls or None
        None from a method that finds none.
    names : mapping of int to str
        Names that rooms were given, by their numbers.
    """

    name: str
    map: PlacedMap
    tracks: tuple[int, ...]
    shapes: tuple[BaseGeometry, ...]
    areas_m2: FloatArray
    walls: Walls | None
    names: Mapping[int, str] = field(default_factory=dict)

    def name_of(self, track: int) -> str:
        """Return what a room is called."""
        return room_name(track, self.names.get(track, ""))

    def __repr__(self) -> str:
        size = self.map.snapshot.geometry.size_text
        return f"FinalLayout({self.name!r}, {counted(len(self.tracks), 'room')}, {size})"

    def shapes_moved(self, motion: RigidMotion) -> tuple[BaseGeometry, ...]:
        """Return the rooms' shapes where a motion brings them."""
        import shapely

        moved = shapely.transform(np.array(self.shapes, object), motion.points)
        return tuple(shapely.make_valid(shape) if not shape.is_valid else shape for shape in moved)
