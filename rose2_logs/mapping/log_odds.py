"""Log-odds occupancy mapping on a grid that grows with what is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.config.reading import ReadingParameters
from rose2_logs.errors import InvalidMapError
from rose2_logs.model.occupancy import HIGHEST_PERCENT, UNKNOWN, BoolArray, FloatArray, GridGeometry

_CROSSED, _HIT = 1, 2


@dataclass(frozen=True, eq=False)
class Beams:
    """The beams of a scan in the world, as far as they say something.

    Attributes
    ----------
    starts_m : (B, 2) or (2,) float
        Where the lidar was at each beam, or at all of them.
    ends_m : (B, 2) float
        Where the beam returned, or up to where it met nothing.
    returned : (B,) bool
        Whether there is something at its end.
    """

    starts_m: FloatArray
    ends_m: FloatArray
    returned: BoolArray


def beams_of(
    starts_m: FloatArray, directions: FloatArray, ranges_m: FloatArray, parameters: MappingParameters
) -> Beams:
    """Limit the beams of a scan to what is trusted of them.

    Parameters
    ----------
    starts_m : (B, 2) or (2,) float
        World position of the lidar at each beam, or at all of them.
    directions : (B, 2) float
        Directions in the world, of length 1 for a level lidar.
    ranges_m : (B,) float
        Measured ranges: NaN if nothing is known, infinite if nothing returned.
    parameters : MappingParameters
        Usable range, and how far beams without a return are free.
    """
    p = parameters
    returned = ranges_m <= p.usable_range_m
    reach_m = np.minimum(np.where(np.isinf(ranges_m), p.no_return_m, ranges_m), p.usable_range_m)
    used = reach_m > 0  # NaN is not
    starts_m = starts_m if starts_m.ndim == 1 else starts_m[used]
    return Beams(starts_m, starts_m + reach_m[used, None] * directions[used], returned[used])


class MapBuilder:
    """Occupancy map that scans are added to, one after the other.

    Parameters
    ----------
    parameters : MappingParameters, optional
        Cells, evidence and ranges.
    most_cells : int
        Number of cells that the map may have; a pose far off would make it grow without end.

    Examples
    --------
    >>> import numpy as np
    >>> builder = MapBuilder()
    >>> builder.add_scan(np.zeros(3), np.array([0.0]), np.array([0.97]))
    >>> builder.trinary()[0, :22].tolist() == [0] * 19 + [100, -1, -1]
    True
    """

    def __init__(
        self,
        parameters: MappingParameters | None = None,
        most_cells: int = ReadingParameters().map_max_cells,
    ) -> None:
        self.parameters = parameters or MappingParameters()
        self._most_cells = most_cells
        # Column and row of the canvas' corner; cell 0, 0 has its corner at the world's origin.
        self._first_cell = np.zeros(2, np.intp)
        self._log_odds = np.zeros((0, 0), np.float32)
        self._seen = np.zeros((0, 0), bool)
        self._step = max(1, round(self.parameters.canvas_step_m / self.parameters.resolution_m))
        self._added = np.zeros(3, np.float32)
        self._added[_CROSSED], self._added[_HIT] = self.parameters.miss_log_odds, self.parameters.hit_log_odds

    def add_scan(self, pose: FloatArray, bearings_rad: FloatArray, ranges_m: FloatArray) -> None:
        """Add a scan that was taken at one pose.

        Parameters
        ----------
        pose : (3,) float
            The lidar's x, y in meters and heading in radians.
        bearings_rad : (B,) float
            Angle of each beam to the heading.
        ranges_m : (B,) float
            Measured ranges: NaN if nothing is known, infinite if nothing returned.

        Raises
        ------
        InvalidMapError
            As `add`.
        """
        angles = pose[2] + bearings_rad
        directions = np.stack([np.cos(angles), np.sin(angles)], 1)
        self.add(beams_of(pose[:2], directions, ranges_m, self.parameters))

    def add(self, beams: Beams) -> None:
        """Add the beams of one scan; a cell counts once, as occupied if any beam ends in it.

        Raises
        ------
        InvalidMapError
            If the map would have too many cells; it stays as it was.
        """
        if not len(beams.ends_m):
            return
        resolution_m = self.parameters.resolution_m
        starts = np.floor(np.atleast_2d(beams.starts_m) / resolution_m).astype(np.intp)
        ends = np.floor(beams.ends_m / resolution_m).astype(np.intp)
        low = np.minimum(starts.min(0), ends.min(0))
        high = np.maximum(starts.max(0), ends.max(0)) + 1
        self._grow(low, high)

        columns, rows = (high - low).tolist()
        marks = np.zeros((rows, columns), np.uint8)
        flat = marks.reshape(-1)
        flat[_line_places(starts - low, ends - low, columns)] = _CROSSED
        hits = ends[beams.returned] - low
        flat[hits[:, 1] * columns + hits[:, 0]] = _HIT
        left, bottom = (low - self._first_cell).tolist()
        window = (slice(bottom, bottom + rows), slice(left, left + columns))
        log_odds, bound = self._log_odds[window], self.parameters.max_log_odds
        log_odds += self._added[marks]
        np.clip(log_odds, -bound, bound, out=log_odds)
        self._seen[window] |= marks > 0

    def _grow(self, low: NDArray[np.intp], high: NDArray[np.intp]) -> None:
        """Enlarge the canvas, in whole steps, so that it holds the cells from `low` to before `high`."""
        size = np.array(self._log_odds.shape[::-1])
        if size.any():
            low, high = np.minimum(low, self._first_cell), np.maximum(high, self._first_cell + size)
        first = low // self._step * self._step
        columns, rows = (-(-high // self._step) * self._step - first).tolist()
        if np.array_equal(first, self._first_cell) and (rows, columns) == self._log_odds.shape:
            return
        if rows * columns > self._most_cells:
            raise InvalidMapError(
                f"the map would have {columns} x {rows} cells, more than the limit of {self._most_cells}; if "
                "that is correct, raise the parameter reading.map_max_cells"
            )
        log_odds, seen = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), bool)
        column, row = (self._first_cell - first).tolist() if size.any() else (0, 0)
        log_odds[row : row + size[1], column : column + size[0]] = self._log_odds
        seen[row : row + size[1], column : column + size[0]] = self._seen
        self._log_odds, self._seen, self._first_cell = log_odds, seen, first

    def geometry(self, frame_id: str = "map") -> GridGeometry:
        """Where the canvas lies now."""
        resolution_m = self.parameters.resolution_m
        x, y = np.round(self._first_cell * resolution_m, 9).tolist()  # -9.6, not -9.600000000000001
        return GridGeometry(resolution_m, (x, y), 0.0, frame_id, self._log_odds.shape)

    def trinary(self) -> NDArray[np.int8]:
        """Return the map (H, W): -1 unknown, 0 free, 100 occupied; row 0 at the origin."""
        known = np.where(self._log_odds > 0, np.int8(HIGHEST_PERCENT), np.int8(0))
        return np.where(self._seen, known, np.int8(UNKNOWN))

    def probabilities(self) -> NDArray[np.int8]:
        """Return the map (H, W) with occupancy in percent: -1 unknown, 0..100; row 0 at the origin."""
        percent = np.rint(HIGHEST_PERCENT / (1 + np.exp(-self._log_odds.astype(float))))
        return np.where(self._seen, percent, UNKNOWN).astype(np.int8)

    def known_at(self, xy_m: FloatArray) -> BoolArray:
        """Whether the cells that hold world points (N, 2) have been seen; (N,) bool."""
        cells = np.floor(xy_m / self.parameters.resolution_m).astype(np.intp) - self._first_cell
        inside = ((cells >= 0) & (cells < np.array(self._seen.shape[::-1]))).all(1)
        known = np.zeros(len(xy_m), bool)
        known[inside] = self._seen[cells[inside, 1], cells[inside, 0]]
        return known


def _line_places(starts: NDArray[np.intp], ends: NDArray[np.intp], columns: int) -> NDArray[np.intp]:
    """Places, in an array of so many columns, of the cells on digital lines, both ends included.

    One cell per step along the longer axis, as Bresenham's line has it. Cells are (B, 2), column and row;
    `starts` may be a single one for all lines.
    """
    delta = ends - starts
    steps = np.abs(delta).max(axis=1)
    lengths = steps + 1
    before = np.cumsum(lengths) - lengths
    along = np.arange(int(lengths.sum())) - np.repeat(before, lengths)
    share = along / np.repeat(np.maximum(steps, 1), lengths)
    x = np.floor(np.repeat(delta[:, 0], lengths) * share + 0.5).astype(np.intp)
    y = np.floor(np.repeat(delta[:, 1], lengths) * share + 0.5).astype(np.intp)
    first = np.broadcast_to(starts[:, 1] * columns + starts[:, 0], steps.shape)
    places: NDArray[np.intp] = y * columns + x + np.repeat(first, lengths)
    return places
