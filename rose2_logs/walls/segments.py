"""Line segments of the clean map and the direction that each belongs to (paper, III-B).

The paper draws its segments by the probabilistic Hough transform, whose result depends on the order in which
it draws cells: a mirrored map gives other walls. Here the directions are known from the spectrum, so the
transform is read at these directions only, and every straight run of cells is found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import BoolArray, FloatArray
from rose2_logs.parameters import WallParameters

COVER_CELLS = 1.5
"""Two cells that follow one another on a line cover it without a gap: up to a cell's diagonal, rounded up."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Line segments, each along one of some directions. Metres, grid frame.

    Attributes
    ----------
    directions_rad : (D,) float
        The dominant directions, then local ones in use.
    direction : (N,) int32
        Index of each segment's direction.
    offset : (N,) float
        Distance of its line from the origin, along the direction turned by a quarter.
    start, end : (N,) float
        Where along the direction it begins and ends.
    """

    directions_rad: FloatArray
    direction: NDArray[np.int32]
    offset: FloatArray
    start: FloatArray
    end: FloatArray

    @property
    def ends_m(self) -> FloatArray:
        """Ends (N, 4) as x0, y0, x1, y1."""
        return line_ends(self.directions_rad[self.direction], self.offset, self.start, self.end)


def line_ends(angle_rad: FloatArray, offset: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Ends (N, 4) of lines given by direction, offset across it and interval along it."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.column_stack(
        [start * c - offset * s, start * s + offset * c, end * c - offset * s, end * s + offset * c]
    )


def detect_segments(
    clean: BoolArray,
    directions_rad: FloatArray,
    resolution_m: float,
    min_length_m: float,
    parameters: WallParameters,
) -> tuple[Segments, BoolArray]:
    """Find the straight runs of cells along some directions.

    A cell belongs to the direction of the longest run through it, so that the cells of a thick wall make no
    segments across it.

    Parameters
    ----------
    clean : (H, W) bool
        Cells of walls.
    directions_rad : (D,) float
    min_length_m : float
        Shortest segment.

    Returns
    -------
    segments : Segments
        Along `directions_rad`, by direction, offset and place.
    members : (H, W) bool
        The cells on segments.
    """
    row, column = np.nonzero(clean)
    points: FloatArray = np.column_stack([column, row]).astype(float) * resolution_m + resolution_m / 2
    every = np.arange(len(points))
    members = np.zeros(clean.shape, bool)
    longest = np.zeros(len(points))
    best = np.zeros(len(points), np.int32)
    for number, angle in enumerate(directions_rad.tolist()):
        runs = _straight_runs(points, every, angle, resolution_m, parameters)
        length = np.where(runs.covered, runs.end - runs.start, 0.0)
        reached = np.zeros(len(points))
        np.maximum.at(reached, runs.point, length[runs.run])
        better = reached > longest + resolution_m / 2
        best[better], longest[better] = number, reached[better]
    found = []
    for number, angle in enumerate(directions_rad.tolist()):
        own = np.flatnonzero((best == number) & (longest >= min_length_m))
        runs = _straight_runs(points, own, angle, resolution_m, parameters)
        keep = runs.covered & (runs.end - runs.start >= min_length_m)
        found.append(
            np.column_stack(
                [np.full(keep.sum(), number), runs.offset[keep], runs.start[keep], runs.end[keep]]
            )
        )
        on_run = runs.point[keep[runs.run]]
        members[row[on_run], column[on_run]] = True
    direction, offset, start, end = np.concatenate([np.zeros((0, 4)), *found]).T
    return Segments(directions_rad, direction.astype(np.int32), offset, start, end), members


@dataclass(frozen=True, eq=False)
class _Runs:
    """Runs of points along one direction: line parameters (R,), and the run of each `point` (P,)."""

    offset: FloatArray
    start: FloatArray
    end: FloatArray
    covered: BoolArray
    point: NDArray[np.intp]
    run: NDArray[np.intp]


def _straight_runs(
    points: FloatArray,
    chosen: NDArray[np.intp],
    angle: float,
    resolution_m: float,
    parameters: WallParameters,
) -> _Runs:
    """Cut the chosen points, sorted into strips along a direction, where the gaps are too long.

    The strips are two cells wide and overlap by one, so that no wall falls between two of them.
    """
    c, s = np.cos(angle), np.sin(angle)
    x, y = points[chosen].T
    along, across = x * c + y * s, y * c - x * s
    lattice = np.floor(across / resolution_m).astype(np.int64)
    strip = np.concatenate([2 * (lattice // 2), 2 * ((lattice + 1) // 2) - 1])
    point = np.concatenate([np.arange(len(chosen))] * 2)
    # One number sorts by strip, then along it.
    span = float(np.ptp(along)) + 1.0 if len(along) else 1.0
    order = np.argsort(strip * span + (along[point] - along.min(initial=0.0)), kind="stable")
    strip, point = strip[order], point[order]
    position = along[point]
    gap = np.diff(position, prepend=-np.inf)
    new = gap > parameters.segment_max_gap_m + resolution_m
    new[1:] |= strip[1:] != strip[:-1]
    run = np.cumsum(new) - 1
    first = np.flatnonzero(new)
    count = len(first)
    last = np.append(first[1:], len(point))[:count] - 1
    covered = np.bincount(
        run,
        weights=np.where(new, resolution_m, np.minimum(np.abs(gap), COVER_CELLS * resolution_m)),
        minlength=count,
    )
    start, end = position[first] - resolution_m / 2, position[last] + resolution_m / 2
    offset = np.bincount(run, weights=across[point], minlength=count) / np.bincount(run, minlength=count)
    return _Runs(
        offset, start, end, covered >= parameters.segment_min_fill * (end - start), chosen[point], run
    )


def local_directions(dominant_rad: FloatArray, parameters: WallParameters) -> FloatArray:
    """Directions for walls that follow no dominant one: curved and slanted walls.

    They lie on a lattice counted from the strongest dominant direction, so that they turn with the map; those
    within `direction_tolerance_rad` of a dominant one are left out.
    """
    count = round(np.pi / parameters.local_direction_step_rad)
    base = dominant_rad[0] if len(dominant_rad) else 0.0
    lattice = np.mod(base + np.arange(count) * np.pi / count, np.pi)
    away = np.abs(lattice[:, None] - dominant_rad[None])
    away = np.minimum(away, np.pi - away).min(1, initial=np.pi)
    chosen: FloatArray = lattice[away > parameters.direction_tolerance_rad]
    return chosen


def join_segments(one: Segments, other: Segments) -> Segments:
    """Put the segments of two sets of directions together; directions of the second in use are kept."""
    used, direction = np.unique(other.direction, return_inverse=True)
    return Segments(
        np.concatenate([one.directions_rad, other.directions_rad[used]]),
        np.concatenate([one.direction, len(one.directions_rad) + direction]).astype(np.int32),
        np.concatenate([one.offset, other.offset]),
        np.concatenate([one.start, other.start]),
        np.concatenate([one.end, other.end]),
    )
