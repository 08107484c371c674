"""What the map says along each edge: wall, open, or not seen (paper, III-C: edge weights)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.floor_plan.faces import SNAP_M

LINE_SEARCH_M = 4 * SNAP_M
"""Noding moves an edge off its line by less than this."""
WALL, FREE = 1, 2
"""Bits of the image that tells both."""
Number = TypeVar("Number", bound=np.generic)


@dataclass(frozen=True, eq=False)
class WallCover:
    """Lengths (E,) in meters of each edge.

    Attributes
    ----------
    wall_m : (E,) float
        Covered by walls.
    length_m : (E,) float
        All of the edge.
    """

    wall_m: FloatArray
    length_m: FloatArray

    @property
    def weight(self) -> FloatArray:
        """Share (E,) of each edge that walls cover, in [0, 1]."""
        share: FloatArray = np.divide(
            self.wall_m, self.length_m, out=np.zeros_like(self.wall_m), where=self.length_m > 0
        )
        return np.minimum(share, 1.0)


@dataclass(frozen=True, eq=False)
class EdgeEvidence(WallCover):
    """All that the map says along each edge; what is neither wall nor open was not seen or is clutter.

    Attributes
    ----------
    blind_m : (E,) float
        Of what walls cover, in meters, what shows no free space on one of its sides, see `_Samples.blind`.
    open_m : (E,) float
        Open free space, meters.
    passage_share : (E,) float
        Width of the best passage through the edge (a stretch of its line without a wall) over the width of
        the room next to it: about 1 across a corridor, less in a doorway, 0 where the edge is not open.
    """

    blind_m: FloatArray
    open_m: FloatArray
    passage_share: FloatArray


def wall_cover(
    edges_m: FloatArray,
    lines_m: FloatArray,
    walls: BoolArray,
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> WallCover:
    """Read the walls along the representative lines and share what is found among their edges.

    Parameters
    ----------
    edges_m : (E, 4) float
        Edges in the grid frame, meters; those that are on no line get zeros.
    lines_m : (L, 4) float
        Representative lines.
    walls : (H, W) bool
    """
    if len(lines_m) == 0:
        return WallCover(np.zeros(len(edges_m)), _lengths(edges_m))
    samples = _Samples.of(lines_m, walls.view(np.uint8), resolution_m, parameters)
    return WallCover(_Places.of(edges_m, lines_m, samples).length_m(samples.is_wall), _lengths(edges_m))


def edge_evidence(
    edges_m: FloatArray,
    lines_m: FloatArray,
    walls: BoolArray,
    distance: NDArray[np.float32],
    free: BoolArray,
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> EdgeEvidence:
    """Read all of the map along the lines, as `wall_cover` reads its walls: what grouping asks for.

    Parameters
    ----------
    edges_m, lines_m
        As for `wall_cover`.
    walls, free : (H, W) bool
        Cells of walls and free cells.
    distance : (H, W) float32
        Of each cell from the nearest wall cell, in cells.
    """
    if len(lines_m) == 0:
        nothing = np.zeros(len(edges_m))
        return EdgeEvidence(nothing, _lengths(edges_m), nothing, nothing, nothing)
    # Both masks are looked up at once, one in each bit.
    kinds = walls * np.uint8(WALL) | free * np.uint8(FREE)
    samples = _Samples.of(lines_m, kinds, resolution_m, parameters)
    places, is_wall, is_free = _Places.of(edges_m, lines_m, samples), samples.is_wall, samples.free()
    share = _passages(
        samples.line, is_wall, is_free, samples.step_m, lines_m, distance, resolution_m, parameters
    )
    return EdgeEvidence(
        places.length_m(is_wall),
        _lengths(edges_m),
        places.length_m(samples.blind(resolution_m, parameters)),
        places.length_m(is_free & ~is_wall),
        places.greatest(share),
    )


def _lengths(edges_m: FloatArray) -> FloatArray:
    return np.hypot(edges_m[:, 2] - edges_m[:, 0], edges_m[:, 3] - edges_m[:, 1])


@dataclass(frozen=True, eq=False)
class _Places:
    """Where edges lie on the samples of the lines.

    Attributes
    ----------
    on_line : (E,) bool
        Edges that lie on a line.
    offset : (E,) int
        First sample of an edge's line.
    start, end : (E,) float
        From where to where the edge goes, in samples of its line.
    step_m : (E,) float
        Distance between the samples of an edge's line.
    """

    on_line: BoolArray
    offset: NDArray[np.intp]
    start: FloatArray
    end: FloatArray
    step_m: FloatArray

    @classmethod
    def of(cls, edges_m: FloatArray, lines_m: FloatArray, samples: _Samples) -> _Places:
        offset = np.concatenate([[0], np.cumsum(np.bincount(samples.line, minlength=len(lines_m)))])
        owner, start, end = _place_edges(edges_m, lines_m)
        step_m = samples.step_m[owner]
        return cls(owner >= 0, offset[owner], start / step_m, end / step_m, step_m)

    def length_m(self, flag: BoolArray) -> FloatArray:
        """Length (E,) of the samples (S,) with a flag on each edge."""
        total = np.concatenate([[0.0], np.cumsum(flag)])
        samples = np.arange(len(total), dtype=float)
        start, end = (
            np.interp((self.offset + at)[self.on_line], samples, total) for at in (self.start, self.end)
        )
        value = np.zeros(len(self.on_line))
        value[self.on_line] = (end - start) * self.step_m[self.on_line]
        return value

    def greatest(self, values: FloatArray) -> FloatArray:
        """Greatest (E,) of the values (S,) of each edge's samples, 0 for edges without any."""
        found = np.zeros(len(self.on_line))
        first, last = (self.offset + np.floor(at + 0.5).astype(np.int64) for at in (self.start, self.end))
        some = np.flatnonzero(self.on_line & (last > first))
        # In the order of the samples, since what lies between two edges is gone through as well.
        some = some[np.argsort(first[some], kind="stable")]
        if len(some):
            # One value more, since the last edge may end behind the last sample.
            bounds = np.column_stack([first[some], last[some]]).ravel()
            found[some] = np.maximum.reduceat(np.append(values, 0.0), bounds)[::2]
        return found


def _passages(
    line: NDArray[np.intp],
    is_wall: BoolArray,
    is_free: BoolArray,
    step_m: FloatArray,
    lines_m: FloatArray,
    distance: NDArray[np.float32],
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> FloatArray:
    """Length of the stretch without a wall that each sample lies in over the room on both sides of it.

    From some points of a stretch one looks straight ahead and back, as far as the stretch is wide (times
    `passage_look_widths`) or to the next wall. The greatest distance from walls met on a side is half the
    width of the room there. The stretch is held against the narrower side, so that a line across a corridor
    is as wide as the corridor; but a gap in a wall, between two jambs on its line, against the wider
    side, so that the mouth of a narrow corridor is the doorway of a hall.

    Returns
    -------
    share : (S,) float
        0 on walls and where nothing is free.
    """
    begins = np.flatnonzero(np.concatenate([[True], (np.diff(line) != 0) | (np.diff(is_wall) != 0)]))
    ends = np.append(begins[1:], len(line))
    run = np.repeat(np.arange(len(begins)), ends - begins)
    run_line = line[begins]
    length = (ends - begins) * step_m[run_line]
    gap = _between_jambs(begins, ends, line, is_wall, step_m, parameters)
    gap &= length <= parameters.doorway_max_width_m
    # Most stretches are walls, or lie where nothing is free.
    looked = np.flatnonzero(np.logical_or.reduceat(is_free & ~is_wall, begins))
    run_line, begin, count = run_line[looked], begins[looked], (ends - begins)[looked]
    step = step_m[run_line]
    start = lines_m[run_line, :2]
    vector = lines_m[run_line, 2:] - start
    vector /= np.maximum(np.hypot(vector[:, 0], vector[:, 1]), 1e-12)[:, None]
    (x, y), (along_x, along_y) = start.T, vector.T
    image = _Image(distance, resolution_m)
    depth = np.minimum(length[looked] * parameters.passage_look_widths, parameters.passage_look_max_m)
    ahead = depth[:, None] * np.linspace(0, 1, parameters.passage_look_samples)
    from_start = begin - np.searchsorted(line, run_line)
    looks = parameters.passage_look_points + 1
    sides = []
    for sign in (1, -1):
        widest = np.zeros(len(looked))
        ahead_x, ahead_y = sign * -along_y[:, None] * ahead, sign * along_x[:, None] * ahead
        for part in np.arange(1, looks) / looks:
            at = (from_start + part * count) * step
            met = image.at((x + along_x * at)[:, None] + ahead_x, (y + along_y * at)[:, None] + ahead_y)
            met = np.where(np.minimum.accumulate(met, axis=1) > 0, met, 0)
            np.maximum(widest, met.max(1), out=widest)
        sides.append(widest * resolution_m)
    half = np.where(gap[looked], np.maximum(*sides), np.minimum(*sides))
    share = np.zeros(len(begins))
    share[looked] = length[looked] / (2 * np.maximum(half, resolution_m / 2))
    return np.where(is_free & ~is_wall, share[run], 0.0)


def _between_jambs(
    begins: NDArray[np.intp],
    ends: NDArray[np.intp],
    line: NDArray[np.intp],
    is_wall: BoolArray,
    step_m: FloatArray,
    parameters: FloorPlanParameters,
) -> BoolArray:
    """Find which stretches (R,) of samples have wall on their line before and after them."""
    of_run = line[begins]
    count = np.maximum(1, np.round(parameters.jamb_length_m / step_m[of_run]).astype(np.intp))
    before = np.maximum(begins - count, np.searchsorted(line, of_run))
    after = np.minimum(ends + count, np.searchsorted(line, of_run, side="right"))
    total = np.concatenate([[0], np.cumsum(is_wall)])
    walled = np.minimum(total[begins] - total[before], total[after] - total[ends])
    between: BoolArray = walled >= parameters.jamb_min_fill * count
    return between


@dataclass(frozen=True, eq=False)
class _Samples:
    """Points along each line, in steps of one cell.

    Attributes
    ----------
    line : (S,) int
        Line of each sample, in order along the lines.
    step_m : (L,) float
        Distance between the samples of a line.
    points : four of (S,) float
        x and y of each sample, and of the unit vector across its line.
    kinds : _Image
        What the cells are, in bits.
    is_wall : (S,) bool
        Samples with a wall cell within the tolerance across.
    """

    line: NDArray[np.intp]
    step_m: FloatArray
    points: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    kinds: _Image[np.uint8]
    is_wall: BoolArray

    @classmethod
    def of(
        cls,
        lines_m: FloatArray,
        kinds: NDArray[np.uint8],
        resolution_m: float,
        parameters: FloorPlanParameters,
    ) -> _Samples:
        vector = lines_m[:, 2:] - lines_m[:, :2]
        length = np.hypot(vector[:, 0], vector[:, 1])
        count = np.maximum(np.ceil(length / resolution_m).astype(np.int64), 1)
        line = np.repeat(np.arange(len(lines_m)), count)
        position = np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count)
        share = (position + 0.5) / count[line]
        (begin_x, begin_y), (along_x, along_y) = lines_m[:, :2].T, vector.T
        x, y = begin_x[line] + along_x[line] * share, begin_y[line] + along_y[line] * share
        across = np.stack([-along_y, along_x]) / np.maximum(length, 1e-12)
        across_x, across_y = across[0][line], across[1][line]
        image = _Image(kinds, resolution_m)
        reach = round(parameters.wall_tolerance_m / resolution_m)
        steps = np.arange(-reach, reach + 1)[:, None] * resolution_m
        met = np.bitwise_or.reduce(image.at(x + across_x * steps, y + across_y * steps), axis=0)
        return cls(line, length / count, (x, y, across_x, across_y), image, (met & WALL) > 0)

    def free(self) -> BoolArray:
        """Whether each sample (S,) lies on a free cell."""
        x, y, _, _ = self.points
        is_free: BoolArray = (self.kinds.at(x, y) & FREE) > 0
        return is_free

    def blind(self, resolution_m: float, parameters: FloorPlanParameters) -> BoolArray:
        """Walls (S,) without a free cell within `blind_look_m` on one side, unless another wall runs there.

        What is behind them was not seen, or is a piece of furniture.
        """
        is_blind = np.zeros(len(self.line), bool)
        x, y, across_x, across_y = (values.compress(self.is_wall) for values in self.points)
        steps = np.arange(1, round(parameters.blind_look_m / resolution_m) + 1)[:, None] * resolution_m
        for side in (1, -1):
            found = self.kinds.at(x + across_x * (side * steps), y + across_y * (side * steps))
            any_of, all_of = np.bitwise_or.reduce(found, axis=0), np.bitwise_and.reduce(found, axis=0)
            is_blind[self.is_wall] |= ((any_of & FREE) == 0) & ((all_of & WALL) == 0)
        return is_blind


class _Image(Generic[Number]):
    """An image (H, W) that is read at points; 0 beside it."""

    def __init__(self, image: NDArray[Number], resolution_m: float) -> None:
        self._values = np.pad(image, 1).ravel()
        self._rows, self._columns = image.shape
        self._resolution_m = resolution_m
        self._index = np.promote_types(np.int32, np.min_scalar_type(-self._values.size))

    def at(self, x_m: FloatArray, y_m: FloatArray) -> NDArray[Number]:
        """Values of the cells that hold points."""
        index = self._padded(y_m, self._rows)
        index *= self._columns + 2
        index += self._padded(x_m, self._columns)
        return self._values.take(index)

    def _padded(self, place_m: FloatArray, count: int) -> NDArray[np.signedinteger[Any]]:
        """Number of the cell in the padded image; all that lies beside the image is in its margin."""
        cell = place_m / self._resolution_m
        np.floor(cell, out=cell)
        np.clip(cell, -1, count, out=cell)
        padded = cell.astype(self._index)
        padded += 1
        return padded


def _place_edges(edges_m: FloatArray, lines_m: FloatArray) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
    """Line of each edge (-1 for none) and where along it the edge starts and ends, in meters."""
    owner = np.full(len(edges_m), -1, np.intp)
    tree = shapely.STRtree(shapely.linestrings(lines_m.reshape(-1, 2, 2)))
    middle = shapely.points((edges_m[:, :2] + edges_m[:, 2:]) / 2)
    edge, line = tree.query(middle, predicate="dwithin", distance=LINE_SEARCH_M)
    # Where lines cross at a point, the edge's own line is the one that both its ends lie on.
    misfit = np.maximum(*(_from_segments(edges_m[edge, k : k + 2], lines_m[line]) for k in (0, 2)))
    good = misfit <= LINE_SEARCH_M
    edge, line, misfit = edge[good], line[good], misfit[good]
    order = np.lexsort((line, misfit, edge))[::-1]
    owner[edge[order]] = line[order]
    direction = lines_m[owner, 2:] - lines_m[owner, :2]
    direction /= np.maximum(np.hypot(direction[:, 0], direction[:, 1]), 1e-12)[:, None]
    along = [np.einsum("ij,ij->i", edges_m[:, k : k + 2] - lines_m[owner, :2], direction) for k in (0, 2)]
    length = shapely.length(tree.geometries[owner])
    start, end = np.minimum(*along), np.maximum(*along)
    return owner, np.clip(start, 0, length), np.clip(end, 0, length)


def _from_segments(points: FloatArray, segments_m: FloatArray) -> FloatArray:
    """Distance (N,) of points (N, 2) from segments (N, 4), each from its own, as GEOS tells it of objects."""
    (x, y), (x0, y0, x1, y1) = points.T, segments_m.T
    along_x, along_y = x1 - x0, y1 - y0
    square = along_x**2 + along_y**2
    square[square == 0] = 1.0  # a segment of no length: every share is 0
    share = ((x - x0) * along_x + (y - y0) * along_y) / square
    beside: FloatArray = np.abs((y0 - y) * along_x - (x0 - x) * along_y) / square * np.sqrt(square)
    beyond = [np.sqrt((x - end_x) ** 2 + (y - end_y) ** 2) for end_x, end_y in ((x0, y0), (x1, y1))]
    return np.where(share <= 0, beyond[0], np.where(share >= 1, beyond[1], beside))
