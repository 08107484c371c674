"""Laser scans and transforms from message bytes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.errors import InvalidMapError
from rose2_logs.io.messages import Fields, ros_type
from rose2_logs.io.scan_topics import ECHOES_TYPE
from rose2_logs.mapping.transforms import Transform
from rose2_logs.model.occupancy import FloatArray

MOST_BEAMS = 1 << 16
"""No planar lidar has more beams; anything more is treated as damage."""
LONGEST_SWEEP_NS = 10**9
"""No lidar takes longer for a scan; where the message claims it, all beams count as of its stamp."""


@dataclass(frozen=True, eq=False)
class Scan:
    """One scan of a planar lidar.

    Attributes
    ----------
    stamp_ns : int
        Time of the first beam.
    frame_id : str
        Frame of the lidar, without a leading slash.
    bearings_rad : (B,) float
        Angle of each beam to the frame's x axis.
    ranges_m : (B,) float
        Measured ranges: NaN if nothing is known, infinite if nothing returned.
    times_ns : (B,) int
        When each beam was measured.
    """

    stamp_ns: int
    frame_id: str
    bearings_rad: FloatArray
    ranges_m: FloatArray
    times_ns: NDArray[np.int64]


def scan_of(fields: Fields, message_type: str) -> Scan:
    """Read a LaserScan or a MultiEchoLaserScan, of which the nearest echo counts.

    Raises
    ------
    InvalidMapError
        If the message ends too early, or its angles or the number of its beams make no sense.
    """
    stamp_ns, frame_id = fields.header()
    angle_min, _, angle_step, time_step, _, range_min, range_max = fields.numbers("f", 7)
    if ros_type(message_type) == ECHOES_TYPE:
        ranges_m = _nearest_echoes(fields)
    else:
        ranges_m = fields.singles("ranges").astype(float)
    if not math.isfinite(angle_min) or not math.isfinite(angle_step):
        raise InvalidMapError(f"its angles, from {angle_min} in steps of {angle_step}, are not finite")
    if len(ranges_m) > MOST_BEAMS:
        raise InvalidMapError(f"it has {len(ranges_m)} beams, more than {MOST_BEAMS}")
    beams = np.arange(len(ranges_m))
    sweep_ns = time_step * 1e9 * max(len(beams) - 1, 0)
    step_ns = time_step * 1e9 if abs(sweep_ns) <= LONGEST_SWEEP_NS else 0.0
    return Scan(
        stamp_ns,
        frame_id.lstrip("/"),
        angle_min + angle_step * beams.astype(float),
        _understood(ranges_m, range_min, range_max),
        stamp_ns + np.rint(step_ns * beams).astype(np.int64),
    )


def _nearest_echoes(fields: Fields) -> FloatArray:
    """First echo of each beam of a MultiEchoLaserScan; infinite where there is none."""
    (count,) = fields.integers("I")
    ranges_m = np.full(min(count, fields.left), np.inf)
    for beam in range(count):
        echoes = fields.singles("echoes")
        if len(echoes):
            ranges_m[beam] = echoes[0]
    return ranges_m


def _understood(ranges_m: FloatArray, range_min: float, range_max: float) -> FloatArray:
    """Ranges by REP 117, also of drivers older than it: infinite if nothing returned, NaN if not known.

    A lidar that claims no sensible bounds is taken at its word for every positive range.
    """
    if not 0 <= range_min < range_max:
        range_min, range_max = 0.0, np.inf
    with np.errstate(invalid="ignore"):
        near = np.where((ranges_m > 0) & (ranges_m >= range_min), ranges_m, np.nan)
        return np.where(near >= range_max, np.inf, near)


def transforms_of(fields: Fields) -> Iterator[Transform]:
    """Read the transforms of a tf message.

    Raises
    ------
    InvalidMapError
        If the message ends too early.
    """
    for _ in range(fields.integers("I")[0]):
        stamp_ns, parent = fields.header()
        child = fields.string("child_frame_id")
        pose = fields.numbers("d", 7)
        yield Transform(stamp_ns, parent.lstrip("/"), child.lstrip("/"), pose)
