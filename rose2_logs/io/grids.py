"""Maps and patches as decoded from messages of any format, and the checks that they pass."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.reading import ReadingParameters
from rose2_logs.errors import InvalidMapError
from rose2_logs.model.occupancy import UNKNOWN, GridGeometry

Cells = NDArray[np.int8]


GRID_TYPE = "nav_msgs/msg/OccupancyGrid"
"""Type of maps in ROS 2: of those that are built from scans, and of those that are written."""
FOXGLOVE_GRID_TYPE = "foxglove.Grid"
MOST_CELLS = ReadingParameters().map_max_cells


MOST_TILT_RAD = math.radians(5.0)
"""A map tilted out of the plane by less than this has lengths correct to half a percent."""


UNIT_TOLERANCE = 0.01
"""Quaternions whose length differs from 1 by less than this are taken as rounded."""


LONGEST_NAME_BYTES = 1024
"""Longest name of a frame; anything longer is treated as damage."""


MOST_CHANNELS = 256
"""Channels of a packed grid that are read; more are damage."""


class MapWarning(NamedTuple):
    """What is unusual about a map that can be read anyway: kind and text."""

    kind: str
    text: str


@dataclass(frozen=True, eq=False)
class Grid:
    """A whole map: stamp in nanoseconds, geometry, cells (H, W) int8 as they are stored, warnings, height."""

    stamp_ns: int
    geometry: GridGeometry
    cells: Cells
    map_warnings: tuple[MapWarning, ...] = ()
    z_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Patch:
    """New values for a rectangle of the previous map: stamp, first row and column, cells (h, w) int8."""

    stamp_ns: int
    row: int
    column: int
    cells: Cells
    map_warnings: tuple[MapWarning, ...] = ()


Decoder = Callable[[memoryview], Grid | Patch | None]


def check_cells(rows: int, columns: int, most_cells: int) -> None:
    """Check that a map does not have more cells than the limit.

    Raises
    ------
    InvalidMapError
        If it has; the message says which parameter sets the limit.
    """
    if rows * columns > most_cells:
        raise InvalidMapError(
            f"it has {columns} x {rows} cells, more than the limit of {most_cells}; if that is correct, "
            "raise the parameter reading.map_max_cells"
        )


def percent(values: Cells, map_warnings: list[MapWarning]) -> Cells:
    """Occupancy as -1, 0..100; any other value becomes unknown, as in map savers, with a warning."""
    if values.size == 0 or (values.min() >= UNKNOWN and values.max() <= 100):
        return values
    odd = (values < UNKNOWN) | (values > 100)
    count = np.count_nonzero(odd)
    map_warnings.append(
        MapWarning("odd_values", f"{count} cells have values outside -1..100; they are read as unknown")
    )
    return np.where(odd, np.int8(UNKNOWN), values)


def flat_yaw_of(quaternion: tuple[float, float, float, float], map_warnings: list[MapWarning]) -> float:
    """Rotation about z, in radians, of a quaternion x, y, z, w; warns if its length is not 1.

    Raises
    ------
    InvalidMapError
        If it contains NaN or infinity, or tilts the map out of the plane.
    """
    x, y, z, w = quaternion
    if not all(math.isfinite(part) for part in quaternion):
        raise InvalidMapError(
            f"the orientation of its origin ({x}, {y}, {z}, {w}) must consist of finite numbers"
        )
    length = math.hypot(*quaternion)
    if abs(length - 1) > UNIT_TOLERANCE:
        map_warnings.append(
            MapWarning("quaternion", f"the orientation of its origin has length {length:g} instead of 1")
        )
    if length == 0 or math.isinf(length):
        return 0.0
    x, y, z, w = x / length, y / length, z / length, w / length
    tilt = math.acos(min(max(w * w + z * z - x * x - y * y, -1.0), 1.0))
    if tilt > MOST_TILT_RAD:
        raise InvalidMapError(
            f"its origin is tilted by {math.degrees(tilt):.0f} degrees out of the plane; only flat maps are "
            "supported"
        )
    return yaw_of(x, y, z, w)


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Rotation about z, in radians, of a quaternion of any length; 0 for an unset one (all zeros)."""
    # The length need not be divided out: it cancels in the ratio of the two arguments.
    return math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)


def exact_resolution(single: float) -> float:
    """Undo the writer's rounding to single precision: 0.05, not 0.0500000007."""
    return float(str(np.float32(single)))


def make_grid(
    stamp_ns: int,
    frame_id: str,
    resolution_m: float,
    pose: tuple[float, ...],
    cells: Cells,
    map_warnings: list[MapWarning],
) -> Grid | None:
    """Build a grid; `pose` is x, y, z and the quaternion x, y, z, w. None if there are no cells.

    A height that is no finite number is taken as 0: nothing that is found depends on it.
    """
    if cells.size == 0:
        return None
    x, y, z, *quaternion = pose
    height, width = cells.shape
    yaw_rad = flat_yaw_of((quaternion[0], quaternion[1], quaternion[2], quaternion[3]), map_warnings)
    geometry = GridGeometry(resolution_m, (x, y), yaw_rad, frame_id, (height, width))
    return Grid(stamp_ns, geometry, cells, tuple(map_warnings), z if z and math.isfinite(z) else 0.0)
