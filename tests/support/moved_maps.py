"""Maps whose whole content moves within its frame, as in a loop closure, on a canvas of their own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.tracking.matching import resample_labels
from rose2_logs.tracking.registration import RigidMotion


def motion_about(
    snapshot: OccupancySnapshot, shift_xy_m: tuple[float, float], turn_deg: float
) -> RigidMotion:
    """Motion about the middle of a map's canvas."""
    x, y = snapshot.geometry.corners_m().mean(axis=0).tolist()
    return RigidMotion((x, y), shift_xy_m, math.radians(turn_deg))


def moved(
    snapshot: OccupancySnapshot, labels: NDArray[np.int32], motion: RigidMotion
) -> tuple[OccupancySnapshot, NDArray[np.int32]]:
    """The map and its labels where a motion brings them, on an upright canvas that holds all of it."""
    source = motion.grid(snapshot.geometry)
    cell = source.resolution_m
    corners = source.corners_m() / cell
    low, high = np.floor(corners.min(axis=0)), np.ceil(corners.max(axis=0))
    x, y = (low * cell).tolist()
    columns, rows = (high - low).astype(int).tolist()
    target = GridGeometry(cell, (x, y), 0.0, source.frame_id, (rows, columns))
    # Resampling gives 0 outside: known cells are shifted above it, and back.
    cells = resample_labels(snapshot.cells.astype(np.int32) + 1, source, target) - 1
    about = snapshot.index, snapshot.log_time_ns, snapshot.stamp_ns, snapshot.topic
    return (
        OccupancySnapshot(*about, np.ascontiguousarray(cells, np.int8), target),
        resample_labels(labels, source, target),
    )
