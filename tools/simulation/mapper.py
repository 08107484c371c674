"""Log-odds occupancy mapping on a canvas that grows with what is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import GridGeometry

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class MapperSettings:
    """How scans become a map.

    Attributes
    ----------
    resolution_m : float
        Side of a cell.
    hit_log_odds, miss_log_odds : float
        What one scan adds to a cell that returned a ray, and to a cell that a ray crossed. With the defaults
        a cell is occupied when more than about a quarter of its rays end in it, GMapping's usual threshold.
    max_log_odds : float
        Bound of a cell's log-odds on both sides.
    usable_range_m : float
        Longer rays mark free cells up to here, and no occupied one.
    canvas_step_m : float
        The canvas grows by multiples of this.
    """

    resolution_m: float = 0.05
    hit_log_odds: float = 0.9
    miss_log_odds: float = -0.32
    max_log_odds: float = 6.0
    usable_range_m: float = 20.0
    canvas_step_m: float = 3.2


class LogOddsMapper:
    """Occupancy map that scans are added to, one after the other."""

    def __init__(self, settings: MapperSettings | None = None) -> None:
        self.settings = settings or MapperSettings()
        self._first_cell = np.zeros(
            2, np.intp
        )  # column, row of the canvas' corner; cell 0, 0 at the world's origin
        self._log_odds = np.zeros((0, 0), np.float32)
        self._seen = np.zeros((0, 0), bool)

    def add_scan(self, pose: FloatArray, bearings_rad: FloatArray, ranges_m: FloatArray) -> None:
        """Add one scan.

        Parameters
        ----------
        pose : (3,) float
            The lidar's x, y in meters and heading in radians.
        bearings_rad : (B,) float
            Angle of each ray to the heading.
        ranges_m : (B,) float
            Measured ranges; rays with NaN or infinity are skipped.
        """
        s = self.settings
        good = np.isfinite(ranges_m)
        angles, ranges = pose[2] + bearings_rad[good], ranges_m[good]
        if not len(ranges):
            return
        returned = ranges <= s.usable_range_m
        reach = np.minimum(ranges, s.usable_range_m)[:, None]
        ends = pose[:2] + reach * np.stack([np.cos(angles), np.sin(angles)], 1)
        start_cell = np.floor(pose[:2] / s.resolution_m).astype(np.intp)
        end_cells = np.floor(ends / s.resolution_m).astype(np.intp)
        self._grow(np.vstack([end_cells, start_cell]))

        width = self._log_odds.shape[1]
        crossed = line_cells(start_cell, end_cells) - self._first_cell
        hits = end_cells[returned] - self._first_cell
        hit_index = np.unique(hits[:, 1] * width + hits[:, 0])
        # A cell counts once a scan, and as hit where any ray ends in it.
        miss_index = np.setdiff1d(np.unique(crossed[:, 1] * width + crossed[:, 0]), hit_index)
        flat = self._log_odds.reshape(-1)
        flat[hit_index] += s.hit_log_odds
        flat[miss_index] += s.miss_log_odds
        touched = np.concatenate([hit_index, miss_index])
        flat[touched] = np.clip(flat[touched], -s.max_log_odds, s.max_log_odds)
        self._seen.reshape(-1)[touched] = True

    def _grow(self, cells: NDArray[np.intp]) -> None:
        """Enlarge the canvas, in whole steps, so that it holds all of `cells` (N, 2) as column, row."""
        step = max(1, round(self.settings.canvas_step_m / self.settings.resolution_m))
        low, high = cells.min(0), cells.max(0) + 1
        size = np.array(self._log_odds.shape[::-1])
        if size.any():
            low, high = np.minimum(low, self._first_cell), np.maximum(high, self._first_cell + size)
        first = low // step * step
        shape = (-(-high // step) * step - first)[::-1]
        if np.array_equal(first, self._first_cell) and np.array_equal(shape, self._log_odds.shape):
            return
        log_odds, seen = np.zeros(shape, np.float32), np.zeros(shape, bool)
        column, row = self._first_cell - first if size.any() else (0, 0)
        log_odds[row : row + size[1], column : column + size[0]] = self._log_odds
        seen[row : row + size[1], column : column + size[0]] = self._seen
        self._log_odds, self._seen, self._first_cell = log_odds, seen, first

    def geometry(self, frame_id: str = "map") -> GridGeometry:
        """Where the canvas lies now."""
        origin = np.round(self._first_cell * self.settings.resolution_m, 9)  # -9.6, not -9.600000000000001
        return GridGeometry(
            self.settings.resolution_m,
            (float(origin[0]), float(origin[1])),
            0.0,
            frame_id,
            self._log_odds.shape,
        )

    def trinary(self) -> NDArray[np.int8]:
        """The map (H, W) as GMapping publishes it: -1 unknown, 0 free, 100 occupied; row 0 at the origin."""
        known = np.where(self._log_odds > 0, 100, 0)
        return np.where(self._seen, known, -1).astype(np.int8)

    def probabilities(self) -> NDArray[np.int8]:
        """The map (H, W) as Cartographer publishes it: -1 unknown, 0..100 occupancy in percent."""
        percent = np.rint(100 / (1 + np.exp(-self._log_odds.astype(float))))
        return np.where(self._seen, percent, -1).astype(np.int8)

    def known_at(self, xy_m: FloatArray) -> NDArray[np.bool_]:
        """Whether the cells that hold world points (N, 2) have been seen."""
        cells = np.floor(xy_m / self.settings.resolution_m).astype(np.intp) - self._first_cell
        inside = ((cells >= 0) & (cells < np.array(self._seen.shape[::-1]))).all(1)
        known = np.zeros(len(xy_m), bool)
        known[inside] = self._seen[cells[inside, 1], cells[inside, 0]]
        return known


def line_cells(start: NDArray[np.intp], ends: NDArray[np.intp]) -> NDArray[np.intp]:
    """Cells (N, 2) on the digital lines from one cell to each of `ends` (B, 2), both ends included.

    One cell per step along the longer axis, as Bresenham's line has it.
    """
    delta = ends - start
    steps = np.abs(delta).max(axis=1)
    line = np.repeat(np.arange(len(ends)), steps + 1)
    first = np.concatenate([[0], np.cumsum(steps + 1)[:-1]])
    share = (np.arange(len(line)) - first[line]) / np.maximum(steps, 1)[line]
    cells: NDArray[np.intp] = start + np.floor(delta[line] * share[:, None] + 0.5).astype(np.intp)
    return cells
