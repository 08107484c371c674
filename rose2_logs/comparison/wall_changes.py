"""Which walls of two layouts are missing, new or moved.

A wall counts as gone only where the other map shows free space in its place and on both its sides: not
where it was never seen, nor where the view ended before it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.config.comparison import ComparisonParameters
from rose2_logs.model.analysis import Walls
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.tracking.matching import assign
from rose2_logs.tracking.registration import RigidMotion

WallStatus = Literal["missing", "new", "moved"]
WALL_STATUSES: dict[WallStatus, str] = {
    "missing": "a wall of A where B shows free space",
    "new": "a wall of B where A shows free space",
    "moved": "a missing wall and a new one along it, side by side",
}
"""How walls may have changed, and what each status means; in the order of the tables."""


@dataclass(frozen=True, eq=False)
class WallChange:
    """One wall that differs, in A's frame.

    Attributes
    ----------
    status : WallStatus
        How it changed.
    ends_a_m, ends_b_m : (4,) float or None
        Ends x0, y0, x1, y1 of the stretch in each layout, meters.
    shift_m : float or None
        How far a moved wall is from where it was, across it.
    """

    status: WallStatus
    ends_a_m: FloatArray | None
    ends_b_m: FloatArray | None
    shift_m: float | None = None

    @property
    def length_m(self) -> float:
        """Length in meters; of a moved wall, that of the longer stretch."""
        return max(float(_lengths(ends)) for ends in (self.ends_a_m, self.ends_b_m) if ends is not None)


@dataclass(frozen=True, eq=False)
class WallComparison:
    """What differs, and how much was compared.

    Attributes
    ----------
    changes : tuple of WallChange
        By `WALL_STATUSES`, the longest first.
    compared_m : float
        Length of the walls of both layouts whose place the other map shows.
    kept_m : float
        Length of those that the other map has as well.
    """

    changes: tuple[WallChange, ...]
    compared_m: float
    kept_m: float

    @property
    def lengths_m(self) -> dict[WallStatus, float]:
        """Length of the walls of each status that occurs, meters."""
        lengths: dict[WallStatus, float] = {}
        for change in self.changes:
            lengths[change.status] = lengths.get(change.status, 0.0) + change.length_m
        return lengths


def compare_walls(a: FinalLayout, b: FinalLayout, b_to_a: RigidMotion) -> WallComparison | None:
    """Look for each wall of a layout in the map of the other.

    Parameters
    ----------
    a, b : FinalLayout
    b_to_a : RigidMotion
        Brings B's frame into A's.

    Returns
    -------
    WallComparison or None
        None where a method found no walls.
    """
    if a.walls is None or b.walls is None:
        return None
    gone_a, compared_a, kept_a = _look_up(a.walls, b, a, b_to_a.inverse())
    gone_b, compared_b, kept_b = _look_up(b.walls, a, b, b_to_a)
    gone_b = b_to_a.points(gone_b.reshape(-1, 2, 2)).reshape(-1, 4)
    pairs = _side_by_side(gone_a, gone_b, a.map.parameters.comparison)
    changes = [WallChange("moved", gone_a[one], gone_b[two], shift) for one, two, shift in pairs]
    moved_a, moved_b = {one for one, _, _ in pairs}, {two for _, two, _ in pairs}
    changes += [WallChange("missing", gone_a[row], None) for row in range(len(gone_a)) if row not in moved_a]
    changes += [WallChange("new", None, gone_b[row]) for row in range(len(gone_b)) if row not in moved_b]
    order = list(WALL_STATUSES)
    changes.sort(key=lambda change: (order.index(change.status), -change.length_m))
    return WallComparison(tuple(changes), compared_a + compared_b, kept_a + kept_b)


def _look_up(
    walls: Walls, other: FinalLayout, own: FinalLayout, to_other: RigidMotion
) -> tuple[FloatArray, float, float]:
    """Stretches (K, 4) of walls where the other map is free; the lengths compared and kept, meters."""
    if len(walls.segments_m) == 0:
        return np.zeros((0, 4)), 0.0, 0.0
    parameters = own.map.parameters.comparison
    points, segment, beyond = _along(walls.segments_m, parameters)
    real = ~beyond | own.map.on_wall(points, own.map.resolution_m)
    points, segment = points[real], segment[real]
    placed = to_other.points(points)
    reach_m = max(own.map.reach_m, other.map.reach_m)
    on = other.map.on_wall(placed, reach_m)
    along = walls.segments_m[segment]
    forward = (along[:, 2:] - along[:, :2]) / np.maximum(_lengths(along), 1e-9)[:, None]
    aside = reach_m * np.column_stack([-forward[:, 1], forward[:, 0]])
    free = ~on
    for seen in (points, points + aside, points - aside):
        free &= other.map.is_free(to_other.points(seen))
    cluster = _clusters(walls)[segment]
    by_cluster = np.argsort(cluster, kind="stable")
    gone = []
    compared = kept = 0
    for chosen in np.split(by_cluster, np.flatnonzero(np.diff(cluster[by_cluster])) + 1):
        longest = _longest(walls.segments_m[np.unique(segment[chosen])])
        stretches, steps, there = _stretches(
            points[chosen], on[chosen], free[chosen], longest, reach_m, parameters
        )
        gone.append(stretches)
        compared, kept = compared + steps, kept + there
    return np.concatenate(gone), compared * parameters.wall_step_m, kept * parameters.wall_step_m


def _along(
    segments_m: FloatArray, parameters: ComparisonParameters
) -> tuple[FloatArray, NDArray[np.intp], BoolArray]:
    """Points (K, 2) along segments and some way beyond, the segment of each, and which lie beyond it."""
    start, end = segments_m[:, :2], segments_m[:, 2:]
    counts = np.maximum(np.ceil(_lengths(segments_m) / parameters.wall_step_m).astype(int), 1)
    more = round(parameters.beyond_m / parameters.wall_step_m)
    longer = counts + 2 * more
    segment = np.repeat(np.arange(len(counts)), longer)
    position = np.arange(len(segment)) - np.repeat(np.cumsum(longer) - longer, longer) - more
    share = ((position + 0.5) / counts[segment])[:, None]
    points: FloatArray = start[segment] * (1 - share) + end[segment] * share
    return points, segment, (position < 0) | (position >= counts[segment])


def _clusters(walls: Walls) -> NDArray[np.int64]:
    """Cluster of each segment; a segment without one gets a new cluster."""
    own = len(walls.lines_m) + np.arange(len(walls.segments_m))
    return np.where(walls.segment_cluster >= 0, walls.segment_cluster, own)


def _longest(segments_m: FloatArray) -> FloatArray:
    longest: FloatArray = segments_m[int(_lengths(segments_m).argmax())]
    return longest


def _stretches(
    points: FloatArray,
    on: BoolArray,
    free: BoolArray,
    line: FloatArray,
    reach_m: float,
    parameters: ComparisonParameters,
) -> tuple[FloatArray, int, int]:
    """Stretches (K, 4) along a wall that are gone, and the numbers of its steps compared and kept.

    A wall's faces are one wall: it is there where any of them is. What lies within reach of a wall that goes
    on or crosses seems to be there, so stretches are longer by this at both ends, as far as the wall reached.
    """
    along = (line[2:] - line[:2]) / max(float(_lengths(line)), 1e-9)
    across = np.array([-along[1], along[0]])
    t, lateral = (points - line[:2]) @ along, (points - line[:2]) @ across
    step_m = parameters.wall_step_m
    step = np.floor(t / step_m).astype(int)
    first = int(step.min())
    count = int(step.max()) - first + 1
    there, gone = np.zeros(count, bool), np.zeros(count, bool)
    there[step[on] - first] = True
    gone[step[free] - first] = True
    gone &= ~there
    hidden = round(reach_m / step_m)
    stretches = []
    for begin, end in _runs(gone, there, parameters):
        if (end - begin) * step_m < parameters.change_min_length_m:
            continue
        inside = free & (step - first >= begin) & (step - first < end)
        base = line[:2] + across * float(lateral[inside].mean())
        ends = [
            base + along * ((first + at) * step_m)
            for at in (max(begin - hidden, 0), min(end + hidden, count))
        ]
        stretches.append(np.concatenate(ends))
    return np.reshape(stretches, (-1, 4)), int(np.count_nonzero(there | gone)), int(np.count_nonzero(there))


def _runs(gone: BoolArray, there: BoolArray, parameters: ComparisonParameters) -> list[tuple[int, int]]:
    """Begin and end of runs; runs separated by a short undecided gap count as one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], gone.astype(np.int8), [0]])))
    runs: list[tuple[int, int]] = []
    for begin, end in edges.reshape(-1, 2).tolist():
        gap_m = (begin - runs[-1][1]) * parameters.wall_step_m if runs else np.inf
        if gap_m <= parameters.gap_max_m and not there[runs[-1][1] : begin].any():
            runs[-1] = (runs[-1][0], end)
        else:
            runs.append((begin, end))
    return runs


def _side_by_side(
    ones: FloatArray, others: FloatArray, parameters: ComparisonParameters
) -> list[tuple[int, int, float]]:
    """Pairs of stretches (A, 4) and (B, 4) that may be one wall that moved, and how far it did, meters."""
    lengths, other_lengths = _lengths(ones)[:, None], _lengths(others)
    along = (ones[:, 2:] - ones[:, :2]) / lengths
    across = np.column_stack([-along[:, 1], along[:, 0]])
    # Both ends (A, B, 2) of every other stretch, along each one and across it.
    ends = others.reshape(-1, 2, 2) - ones[:, None, None, :2]
    t, lateral = ((ends @ axis[:, None, :, None])[..., 0] for axis in (along, across))
    overlap = np.minimum(lengths, t.max(axis=2)) - np.maximum(0.0, t.min(axis=2))
    turn = np.arctan2(np.abs(np.diff(lateral)), np.abs(np.diff(t)))[..., 0]
    apart = np.abs(lateral.mean(axis=2))
    fits = (turn <= parameters.moved_max_turn_rad) & (apart <= parameters.moved_max_m)
    fits &= overlap >= parameters.moved_min_overlap * np.minimum(lengths, other_lengths)
    weight = overlap / np.maximum(lengths, other_lengths) / (1 + apart)
    return [(row, column, float(apart[row, column])) for row, column in assign(weight, fits)]


def _lengths(ends: FloatArray) -> FloatArray:
    """Length of each of some stretches (..., 4), meters."""
    lengths: FloatArray = np.hypot(ends[..., 2] - ends[..., 0], ends[..., 3] - ends[..., 1])
    return lengths
