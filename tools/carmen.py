"""Read laser scans with corrected poses from a CARMEN log."""

from __future__ import annotations

import gzip
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rose2_logs.errors import LogError

FloatArray = NDArray[np.float64]
DEFAULT_MAX_RANGE_M = 80.0
"""No return of a SICK LMS reads 81.83 or 81.91; used where a log does not say its laser's range."""
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
        Measured ranges; NaN where nothing returned.
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
        If the file is no CARMEN log with laser scans, or one of its lines is cut off.
    """
    scans: list[CarmenScan] = []
    odometry: FloatArray | None = None
    laser_max = max_range_m or DEFAULT_MAX_RANGE_M
    try:
        with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as lines:
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
                except (ValueError, IndexError) as error:
                    raise LogError(
                        f"{path}: line {number} is no whole {kind} message; cut the log there"
                    ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: cannot be read as a CARMEN log ({error})") from error
    if not scans:
        raise LogError(f"{path}: holds no ROBOTLASER1 or FLASER message; give a CARMEN log with laser scans")
    times = np.array([scan.time_s for scan in scans])
    stamped = bool(np.all(times > 0)) and len(np.unique(times)) >= MIN_DISTINCT_STAMPS * len(scans)
    if stamped:
        return [scans[i] for i in np.argsort(times, kind="stable")], True
    return [_at(float(i), scan) for i, scan in enumerate(scans)], False


def _robot_laser(words: list[str], max_range_m: float | None) -> CarmenScan:
    """Parse ROBOTLASER1: laser's data, readings, remissions, poses of laser and robot, ..., stamp."""
    start, step, laser_max = float(words[2]), float(words[4]), float(words[5])
    count = int(words[8])
    after = 9 + count
    remissions = int(words[after])
    poses = np.array(words[after + 1 + remissions : after + 7 + remissions], float)
    return CarmenScan(
        time_s=float(words[after + 12 + remissions]),
        laser_pose=poses[:3],
        robot_pose=poses[3:6],
        odometry=poses[3:6],
        bearings_rad=start + step * np.arange(count, dtype=float),
        ranges_m=_returned(np.array(words[9:after], float), max_range_m or laser_max),
    )


def _front_laser(words: list[str], max_range_m: float, odometry: FloatArray | None) -> CarmenScan:
    """Parse FLASER: readings over half a turn, corrected pose, raw pose, stamp."""
    count = int(words[1])
    readings = np.array(words[2 : 2 + count], float)
    poses = np.array(words[2 + count : 8 + count], float)
    # 181 or 361 readings include both ends of the half turn, 180 or 360 leave the last one out.
    step = float(np.pi) / (count - 1 if count % 2 else count)
    return CarmenScan(
        time_s=float(words[8 + count]),
        laser_pose=poses[:3],
        robot_pose=poses[:3],
        odometry=poses[3:6] if odometry is None else odometry,
        bearings_rad=step * np.arange(count, dtype=float) - float(np.pi / 2),
        ranges_m=_returned(readings, max_range_m),
    )


def _returned(readings: FloatArray, max_range_m: float) -> FloatArray:
    """Readings with NaN where nothing returned."""
    return np.where((readings > 0) & (readings < max_range_m), readings, np.nan)


def _at(time_s: float, scan: CarmenScan) -> CarmenScan:
    return CarmenScan(
        time_s, scan.laser_pose, scan.robot_pose, scan.odometry, scan.bearings_rad, scan.ranges_m
    )
