"""The robot's path from the start of a run or of a part on, thinned to be drawn again with every map."""

from __future__ import annotations

import numpy as np
import shapely

from rose2_logs.io.poses import JUMP_M, map_frame
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

GAP_M = JUMP_M
"""Poses farther apart are not joined."""
TOLERANCE_M = 0.02
"""How far the thinned path may be from the poses, at first: less than a cell of most maps."""
MOST_POINTS = 2000
"""The path is thinned more where it has more points than this, enough for about 2 km in a building."""


class RobotTrail:
    """Where the robot has been so far on the map of a part of the run, in one frame.

    Attributes
    ----------
    pieces_m : list of (N, 2) float
        The path in world meters; one piece for each stretch without a gap of `GAP_M`.
    """

    def __init__(self) -> None:
        self.pieces_m: list[FloatArray] = []
        self._tolerance_m = TOLERANCE_M
        self._place: tuple[int | None, str] | None = None

    def follow(self, step: TrackedSnapshot) -> None:
        """Go on with the poses of a map; the same coordinates are elsewhere in another part or frame."""
        place = step.part, map_frame(step.snapshot.geometry.frame_id)
        if place != self._place:
            self.pieces_m, self._tolerance_m, self._place = [], TOLERANCE_M, place
        self.add(step.path)

    def add(self, path: FloatArray | None) -> None:
        """Go on along poses (K, 3): x, y in world meters, yaw in radians."""
        if path is None or not len(path):
            return
        last = [self.pieces_m.pop()] if self.pieces_m else []
        points = np.concatenate([*(piece[-1:] for piece in last), path[:, :2]])
        is_far = np.hypot(*np.diff(points, axis=0).T) > GAP_M
        first, *others = np.split(points, np.flatnonzero(is_far) + 1)
        first = self._thinned(first)
        self.pieces_m.append(np.concatenate([*(piece[:-1] for piece in last), first]))
        self.pieces_m += map(self._thinned, others)
        # Each time the path moves by the tolerance at most, so by less than twice the last one in all.
        while sum(map(len, self.pieces_m)) > max(MOST_POINTS, 2 * len(self.pieces_m)):
            self._tolerance_m *= 2
            self.pieces_m = list(map(self._thinned, self.pieces_m))

    def _thinned(self, points_m: FloatArray) -> FloatArray:
        if len(points_m) < 2:
            return points_m
        line = shapely.simplify(shapely.linestrings(points_m), self._tolerance_m, preserve_topology=False)
        thinned: FloatArray = shapely.get_coordinates(line)
        return thinned
