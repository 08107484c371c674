"""What part of the world a run is about: where a viewer is to look."""

from __future__ import annotations

import numpy as np
import shapely

from rose2_logs.model.occupancy import FloatArray
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot


class Extent:
    """The rectangle that holds all rooms' shapes so far; rays that leave through windows do not count.

    Attributes
    ----------
    low_m, high_m : (2,) float
        Its corners in world meters; those of the first map while there has been no room.
    """

    def __init__(self) -> None:
        self.low_m, self.high_m = np.full(2, np.inf), np.full(2, -np.inf)
        self._has_rooms = False

    def add(self, step: TrackedSnapshot) -> None:
        """Take one map."""
        shapes = [shape for shape in step.analysis.rooms.polygons if not shape.is_empty]
        has_rooms = len(shapes) > 0
        if has_rooms and not self._has_rooms:
            self._has_rooms = True
            self.low_m, self.high_m = np.full(2, np.inf), np.full(2, -np.inf)
        if has_rooms:
            self._grow(shapely.total_bounds(shapes).reshape(2, 2))
        elif not self._has_rooms:
            self._grow(step.analysis.geometry.corners_m())

    def _grow(self, points_m: FloatArray) -> None:
        self.low_m = np.minimum(self.low_m, points_m.min(axis=0))
        self.high_m = np.maximum(self.high_m, points_m.max(axis=0))
