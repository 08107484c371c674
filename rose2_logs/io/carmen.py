"""CARMEN logs: laser scans with poses, corrected or of the wheels, as text."""

from __future__ import annotations

import logging
import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.config.selection import Times
from rose2_logs.errors import LogError
from rose2_logs.io.carmen_format import CARMEN_FORMAT, opened_text
from rose2_logs.io.placed_scans import PlacedScan
from rose2_logs.io.source import LoggedMap, LogInfo, MessageSource, TopicInfo
from rose2_logs.mapping.log_odds import beams_of
from rose2_logs.mapping.motion_filter import LidarPose
from rose2_logs.model.occupancy import FARTHEST_ORIGIN_M, FloatArray
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

SCAN_TOPIC = "/carmen"
"""What stands for a topic: CARMEN logs have none."""
SCAN_KINDS = ("ROBOTLASER1", "FLASER")
EPOCH_OF_UNSTAMPED_S = 1_000_000_000
"""Where a log starts whose own stamps cannot be used: any fixed time."""
DEFAULT_MAX_RANGE_M = 80.0
"""No return of a SICK LMS reads 81.83 or 81.91; used where a log does not say its laser's range."""
KEPT_BEARINGS = 16
"""Lidars whose angles are kept: a robot has one or two, but a damaged log may name others in each line."""
MIN_DISTINCT_STAMPS = 0.9
"""Share of scans with a stamp of their own below which a log's stamps are taken for damaged."""


@dataclass(frozen=True, eq=False)
class CarmenScan:
    """One laser scan.

    Attributes
    ----------
    time_s : float
        The log's stamp, seconds; since the epoch or since a robot's start, as the log has it.
    laser_pose, robot_pose, odometry : (3,) float
        x, y in meters and heading in radians: corrected pose of the laser and of the robot, and the raw pose
        of the wheels. Where the log has no raw pose, `odometry` repeats the corrected one.
    bearings_rad : (B,) float
        Angle of each ray to the laser's heading.
    ranges_m : (B,) float
        Measured ranges: infinite where nothing returned, NaN where nothing is known.
    """

    time_s: float
    laser_pose: FloatArray
    robot_pose: FloatArray
    odometry: FloatArray
    bearings_rad: FloatArray
    ranges_m: FloatArray


def read_carmen(path: Path, *, max_range_m: float | None = None) -> tuple[list[CarmenScan], bool]:
    """Read the scans of a CARMEN log, sorted by time.

    Parameters
    ----------
    path : Path
        The log, plain or ``.gz``, with ROBOTLASER1 or FLASER messages.
    max_range_m : float, optional
        Readings from here on mean that nothing returned. By default what the log says of its laser.

    Returns
    -------
    scans : list of CarmenScan
        In the order of their stamps; in the file's order where the stamps are damaged.
    stamped : bool
        False where the stamps are damaged (FLASER logs that were written with six digits): times then count
        scans, one second each.

    Raises
    ------
    LogError
        If the file is no CARMEN log with laser scans, or none of them is whole.
    """
    scans: list[CarmenScan] = []
    damaged: list[str] = []
    odometry: FloatArray | None = None
    laser_max = max_range_m or DEFAULT_MAX_RANGE_M
    try:
        with opened_text(path) as lines:
            for number, line in enumerate(lines, 1):
                words = line.split()
                kind = words[0] if words else ""
                try:
                    if kind == "PARAM" and words[1] == "robot_front_laser_max" and max_range_m is None:
                        laser_max = float(words[2])
                    elif kind == "ODOM":
                        odometry = np.array(words[1:4], float)
                    elif kind == "ROBOTLASER1":
                        scans.append(_robot_laser(words, max_range_m))
                    elif kind == "FLASER":
                        scans.append(_front_laser(words, laser_max, odometry))
                except (ValueError, IndexError):
                    damaged.append(f"line {number} is no whole {kind} message")
    except (OSError, EOFError, UnicodeDecodeError, zlib.error) as error:
        damaged.append(f"it cannot be read further than scan {len(scans)} ({error})")
    if not scans:
        what = damaged[0] if damaged else f"holds no {' or '.join(SCAN_KINDS)} message"
        raise LogError(f"{path}: {what}; give a CARMEN log with laser scans", file=path)
    if damaged:
        more = f" and {len(damaged) - 1} more like it" if len(damaged) > 1 else ""
        log_warning(logger, "damaged_message", f"{path}: {damaged[0]}{more}; skipped", file=path)
    times = np.array([scan.time_s for scan in scans])
    stamped = bool(np.all(times > 0)) and len(np.unique(times)) >= MIN_DISTINCT_STAMPS * len(scans)
    if stamped:
        return [scans[i] for i in np.argsort(times, kind="stable")], True
    return [replace(scan, time_s=float(i)) for i, scan in enumerate(scans)], False


class CarmenLog(MessageSource):
    """A CARMEN log: scans with poses, and no maps.

    Parameters
    ----------
    path : Path
        The log.

    Attributes
    ----------
    scans : list of CarmenScan
        In the order of their stamps.

    Raises
    ------
    LogError
        As `read_carmen`.
    """

    def __init__(self, path: Path) -> None:
        self.scans, self.stamped = read_carmen(path)
        if not self.stamped:
            text = f"{path}: its stamps are damaged; the scans count as one second apart, in the file's order"
            log_warning(logger, "stamps_damaged", text, file=path)
        first_ns, last_ns = self.time_ns(self.scans[0]), self.time_ns(self.scans[-1])
        topic = TopicInfo(SCAN_TOPIC, "laser scans", len(self.scans), False, "carmen")
        self.info = LogInfo(path, CARMEN_FORMAT, path.stat().st_size, first_ns, last_ns, (topic,), True)

    def time_ns(self, scan: CarmenScan) -> int:
        """When a scan was taken, nanoseconds since the epoch."""
        whole_s = math.floor(scan.time_s)
        zero_s = 0 if self.stamped else EPOCH_OF_UNSTAMPED_S
        return (zero_s + whole_s) * 10**9 + round((scan.time_s - whole_s) * 1e9)

    def log_times(self, topic: str) -> Times:
        """Return no times: there are no maps."""
        return np.zeros(0, np.int64)

    def read(self, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Yield nothing: there are no maps."""
        return iter(())

    def close(self) -> None:
        """Do nothing: the file was read when the log was opened."""


class CarmenScans:
    """The scans of a CARMEN log at the poses that it gives, in the frame ``map``.

    Parameters
    ----------
    log : CarmenLog
        The log.
    parameters : MappingParameters
        What is trusted of beams.
    """

    topic = SCAN_TOPIC
    frame_id = "map"

    def __init__(self, log: CarmenLog, parameters: MappingParameters) -> None:
        self._log = log
        self._parameters = parameters

    def __iter__(self) -> Iterator[PlacedScan]:
        """Yield the scans in the order of their stamps."""
        for scan in self._log.scans:
            time_ns, pose = self._log.time_ns(scan), scan.laser_pose
            angles = pose[2] + scan.bearings_rad
            directions = np.stack([np.cos(angles), np.sin(angles)], 1)
            beams = beams_of(pose[:2], directions, scan.ranges_m, self._parameters)
            yield PlacedScan(time_ns, time_ns, LidarPose(*pose.tolist()), beams)


def _robot_laser(words: list[str], max_range_m: float | None) -> CarmenScan:
    """Parse ROBOTLASER1: laser's data, readings, remissions, poses of laser and robot, ..., stamp."""
    start, step, laser_max = float(words[2]), float(words[4]), float(words[5])
    count = int(words[8])
    after = 9 + count
    remissions = int(words[after])
    poses = _poses(words[after + 1 + remissions : after + 7 + remissions])
    return CarmenScan(
        time_s=float(words[after + 12 + remissions]),
        laser_pose=poses[:3],
        robot_pose=poses[3:6],
        odometry=poses[3:6],
        bearings_rad=_bearings(start, step, count),
        ranges_m=_returned(np.array(words[9:after], float), max_range_m or laser_max),
    )


def _front_laser(words: list[str], max_range_m: float, odometry: FloatArray | None) -> CarmenScan:
    """Parse FLASER: readings over half a turn, corrected pose, raw pose, stamp."""
    count = int(words[1])
    readings = np.array(words[2 : 2 + count], float)
    poses = _poses(words[2 + count : 8 + count])
    # 181 or 361 readings include both ends of the half turn, 180 or 360 leave the last one out.
    step = math.pi / (count - 1 if count % 2 else count)
    return CarmenScan(
        time_s=float(words[8 + count]),
        laser_pose=poses[:3],
        robot_pose=poses[:3],
        odometry=poses[3:6] if odometry is None else odometry,
        bearings_rad=_bearings(-math.pi / 2, step, count),
        ranges_m=_returned(readings, max_range_m),
    )


@lru_cache(maxsize=KEPT_BEARINGS)
def _bearings(start_rad: float, step_rad: float, count: int) -> FloatArray:
    """Angles (count,) of the beams; one array for all scans of a lidar."""
    bearings = start_rad + step_rad * np.arange(count, dtype=float)
    bearings.flags.writeable = False
    return bearings


def _poses(words: list[str]) -> FloatArray:
    """Read two poses (6,)."""
    poses = np.array(words, float)
    if poses.shape != (6,) or not (np.abs(poses) < FARTHEST_ORIGIN_M).all():
        raise ValueError("no poses of a robot")
    return poses


def _returned(readings: FloatArray, max_range_m: float) -> FloatArray:
    """Readings; infinite from the laser's range on, NaN where they are zero or less."""
    return np.where(readings >= max_range_m, np.inf, np.where(readings > 0, readings, np.nan))
