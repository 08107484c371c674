"""Buildings drawn from wall segments: any angle, resolution, clutter; rooms known by construction."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot

WALL_M = 0.15
MARGIN_M = 1.0
# Two rooms of 5 x 4 m above a corridor of 10 x 2 m; a door of 0.9 m leads from each to the corridor.
WALLS_M = (
    (0, 0, 10, 0), (0, 6, 10, 6), (0, 0, 0, 6), (10, 0, 10, 6),
    (0, 2, 2, 2), (2.9, 2, 7, 2), (7.9, 2, 10, 2), (5, 2, 5, 6),
)  # fmt: skip
SIZE_M = (10.0, 6.0)
ROOMS_M = ((0, 2, 5, 6), (5, 2, 10, 6), (0, 0, 10, 2))


def office(
    *, turn_rad: float = 0.0, resolution_m: float = 0.05, clutter: int = 0, pad: tuple[int, int] = (0, 0)
) -> tuple[NDArray[np.int8], NDArray[np.int32]]:
    """Cells and true rooms (1, 2 and the corridor 3) of the drawn office; row 0 at the origin."""
    diagonal = float(np.hypot(*SIZE_M)) + 2 * MARGIN_M
    side = round(diagonal / resolution_m)
    c, s = np.cos(turn_rad), np.sin(turn_rad)

    def pixels(points_m: object) -> NDArray[np.int32]:
        local = np.asarray(points_m, float).reshape(-1, 2) - np.array(SIZE_M) / 2
        turned = local @ np.array([[c, s], [-s, c]]) + diagonal / 2
        return np.rint((turned / resolution_m - 0.5) * 256).astype(np.int32)

    rooms = np.zeros((side, side), np.int32)
    for number, (x0, y0, x1, y1) in enumerate(ROOMS_M, start=1):
        corners = pixels([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
        cv2.fillPoly(rooms, [corners], number, shift=8)
    cells = np.where(rooms > 0, 0, -1).astype(np.int8)
    walls = np.zeros(rooms.shape, np.uint8)
    for wall in WALLS_M:
        cv2.polylines(
            walls, [pixels(wall)], False, 1, thickness=max(1, round(WALL_M / resolution_m)), shift=8
        )
    rng = np.random.default_rng(7)
    for x, y in rng.uniform((0.5, 2.5), (9.5, 5.5), (clutter, 2)):
        leg = [(x, y), (x + 0.1, y), (x + 0.1, y + 0.1), (x, y + 0.1)]
        cv2.fillPoly(walls, [pixels(leg)], 1, shift=8)
    cells[walls > 0] = 100
    rooms[walls > 0] = 0
    return np.pad(cells, (pad, pad), constant_values=-1), np.pad(rooms, (pad, pad))


def snapshot(
    cells: NDArray[np.int8],
    resolution_m: float = 0.05,
    origin_xy_m: tuple[float, float] = (0.0, 0.0),
    yaw_rad: float = 0.0,
) -> OccupancySnapshot:
    """Put cells into a snapshot."""
    geometry = GridGeometry(resolution_m, origin_xy_m, yaw_rad, "map", (cells.shape[0], cells.shape[1]))
    return OccupancySnapshot(0, 1, 2, "/map", np.ascontiguousarray(cells, np.int8), geometry)


def agreement(one: NDArray[np.integer], two: NDArray[np.integer]) -> float:
    """Least IoU, over the labels of both images, of a label with its best partner in the other; in [0, 1]."""
    worst = 1.0
    for first, second in ((one, two), (two, one)):
        for label in np.unique(first[first > 0]):
            mask = first == label
            partners = np.unique(second[mask & (second > 0)])
            overlaps = [(mask & (second == p)).sum() / (mask | (second == p)).sum() for p in partners]
            worst = min(worst, max(overlaps, default=0.0))
    return float(worst)
