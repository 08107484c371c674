"""Which scans a map needs: those of a lidar that has moved."""

from __future__ import annotations

import math
from typing import NamedTuple

from rose2_logs.config.mapping import MappingParameters


class LidarPose(NamedTuple):
    """Where a lidar was, in meters, and where it looked, in radians."""

    x_m: float
    y_m: float
    heading_rad: float


class MotionFilter:
    """Leaves out the scans of a lidar that has hardly moved since the last one that was taken.

    A robot that stands in a doorway looks along the same beams hundreds of times. As SLAM packages do
    (W. Hess et al., Real-time loop closure in 2D LIDAR SLAM, ICRA 2016), a scan is taken if the lidar moved
    or turned since, or if some time is over.

    Parameters
    ----------
    parameters : MappingParameters
        How far, and how long.
    """

    def __init__(self, parameters: MappingParameters) -> None:
        self._parameters = parameters
        self._last: tuple[int, LidarPose] | None = None

    def takes(self, time_ns: int, pose: LidarPose) -> bool:
        """Whether a scan of that time and pose is taken."""
        if self._last is not None:
            (last_ns, last), parameters = self._last, self._parameters
            moved_m = math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m)
            turned_rad = abs(math.remainder(pose.heading_rad - last.heading_rad, math.tau))
            if (
                moved_m < parameters.min_travel_m
                and turned_rad < parameters.min_turn_rad
                and abs(time_ns - last_ns) < parameters.scan_at_least_every_s * 1e9
            ):
                return False
        self._last = time_ns, pose
        return True
