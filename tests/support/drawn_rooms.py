"""Maps drawn by hand as label arrays, as snapshots and analyses that tracking and the sinks can take."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.model.room_quality import RoomQuality
from rose2_logs.model.rooms import Doorway, RoomMap

SECOND_NS = 10**9


def drawn(
    labels: NDArray[np.integer],
    index: int = 0,
    *,
    origin_xy_m: tuple[float, float] = (0.0, 0.0),
    yaw_rad: float = 0.0,
    resolution_m: float = 1.0,
    doorways: tuple[Doorway, ...] = (),
) -> tuple[OccupancySnapshot, SnapshotAnalysis]:
    """Snapshot and analysis of a map whose rooms are the labels, row 0 first; cells of rooms are free.

    Each room's polygon is the box around its cells.
    """
    labels = np.asarray(labels, np.int32)
    geometry = GridGeometry(resolution_m, origin_xy_m, yaw_rad, "map", labels.shape)
    cells = np.where(labels > 0, 0, -1).astype(np.int8)
    time_ns = (index + 1) * SECOND_NS
    snapshot = OccupancySnapshot(index, time_ns, time_ns, "/map", cells, geometry)
    count = int(labels.max(initial=0))
    polygons = tuple(_box(labels == room, geometry) for room in range(1, count + 1))
    areas = np.bincount(labels.ravel(), minlength=count + 1)[1:] * geometry.cell_area_m2
    rooms = RoomMap(geometry, labels, polygons, areas, doorways)
    free_m2 = float((cells == 0).sum()) * geometry.cell_area_m2
    quality = RoomQuality(np.full(count, np.nan), np.zeros(count))
    return snapshot, SnapshotAnalysis(
        index,
        time_ns,
        time_ns,
        geometry,
        free_m2,
        resolution_m,
        rooms,
        None,
        None,
        None,
        quality,
        {"draw": 0.0},
    )


def _box(mask: NDArray[np.bool_], geometry: GridGeometry) -> shapely.Polygon:
    rows, columns = np.nonzero(mask)
    if len(rows) == 0:
        return shapely.Polygon()
    x, y = (columns.min(), columns.max() + 1), (rows.min(), rows.max() + 1)
    corners = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])], float)
    return shapely.Polygon(geometry.grid_to_world(corners * geometry.resolution_m))


def rows(*text: str) -> NDArray[np.int32]:
    """Labels from lines of digits, the first line being row 0; ``.`` is no room."""
    return np.array([[0 if digit == "." else int(digit) for digit in line] for line in text], np.int32)
