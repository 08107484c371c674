"""Line segments of the clean map and the direction that each belongs to (paper, III-B).

The paper draws its segments by the probabilistic Hough transform, whose result depends on the order in which
it draws cells: a mirrored map gives other walls. Here the directions are known from the spectrum, so the
transform is read at these directions only, and every straight run of cells is found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import WallParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Segments:
    """Line segments, each along one of some directions. Meters, grid frame.

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
        From 0 to pi; where two fit alike, the earlier one wins.
    resolution_m : float
        Side of a cell.
    min_length_m : float
        Shortest segment.
    parameters : WallParameters
        Gaps that a segment bridges, and how much of it must be covered.

    Returns
    -------
    segments : Segments
        Along `directions_rad`, by direction, offset and place.
    members : (H, W) bool
        The cells on segments.
    """
    cell = np.flatnonzero(clean)
    points = np.column_stack(np.divmod(cell, clean.shape[1])[::-1]).astype(float)
    points *= resolution_m
    points += resolution_m / 2
    members = np.zeros(clean.shape, bool)
    longest = np.zeros(len(points))
    best = np.zeros(len(points), np.int32)
    for number, angle in enumerate(directions_rad.tolist()):
        reached = np.zeros(len(points))
        for runs in _straight_runs(points, angle, resolution_m, parameters):
            length = np.where(runs.covered, runs.end - runs.start, 0.0)
            reached[runs.point] = np.maximum(reached[runs.point], length[runs.run])
        better = reached > longest + resolution_m / 2
        best[better], longest[better] = number, reached[better]
    segments = [np.zeros((0, 4))]
    for number, angle in enumerate(directions_rad.tolist()):
        own = np.flatnonzero((best == number) & (longest >= min_length_m))
        rows = [np.zeros((0, 4))]
        for runs in _straight_runs(points[own], angle, resolution_m, parameters):
            keep = runs.covered & (runs.end - runs.start >= min_length_m)
            rows.append(np.column_stack([runs.strip, runs.offset, runs.start, runs.end])[keep])
            on_run = own[runs.point[keep[runs.run]]]
            members.ravel()[cell[on_run]] = True
        of_strip = np.concatenate(rows)
        of_strip = of_strip[np.lexsort((of_strip[:, 2], of_strip[:, 0]))]
        of_strip[:, 0] = number
        segments.append(of_strip)
    direction, offset, start, end = np.concatenate(segments).T
    return Segments(directions_rad, direction.astype(np.int32), offset, start, end), members


@dataclass(frozen=True, eq=False)
class _Runs:
    """Runs of points in the strips along one direction: values (R,), lengths in meters.

    `point` (P,) are the points' indices, run after run, and `run` (P,) the run of each.
    """

    strip: NDArray[np.intp]
    offset: FloatArray
    start: FloatArray
    end: FloatArray
    covered: BoolArray
    point: NDArray[np.intp]
    run: NDArray[np.intp]


def _straight_runs(
    points: FloatArray, angle: float, resolution_m: float, parameters: WallParameters
) -> Iterator[_Runs]:
    """Cut the points (P, 2), meters, sorted into strips along a direction, where the gaps are too long.

    The strips are two cells wide. They come in two sets, the second of which lies a cell further across, so
    that no wall falls between two strips; each point is once in each set.
    """
    if len(points) == 0:
        return
    c, s = np.cos(angle), np.sin(angle)
    x, y = points.T
    along, across = x * c + y * s, y * c - x * s
    cell = np.floor(across / resolution_m).astype(np.int32)
    by_place = np.argsort(along, kind="stable")
    for shift in (0, 1):
        strip = (cell + shift) // 2
        # Small integers are sorted by radix.
        rank = (strip - strip.min()).astype(np.uint16 if np.ptp(strip) < 2**16 else np.int32)
        point = by_place[np.argsort(rank[by_place], kind="stable")]
        position, strip = along[point], strip[point]
        gap = position[1:] - position[:-1]
        new = np.ones(len(point), bool)
        new[1:] = (gap > parameters.segment_max_gap_m + resolution_m) | (strip[1:] != strip[:-1])
        run = np.cumsum(new) - 1
        first = np.flatnonzero(new)
        last = np.append(first[1:], len(point)) - 1
        cover = np.full(len(point), resolution_m)
        np.minimum(np.abs(gap), parameters.segment_cover_cells * resolution_m, out=cover[1:], where=~new[1:])
        covered = np.bincount(run, weights=cover)
        start, end = position[first] - resolution_m / 2, position[last] + resolution_m / 2
        yield _Runs(
            2 * strip[first] - shift,
            np.bincount(run, weights=across[point]) / (last - first + 1),
            start,
            end,
            covered >= parameters.segment_min_fill * (end - start),
            point,
            run,
        )


def long_pieces(
    occupied: BoolArray, resolution_m: float, min_length_m: float, parameters: WallParameters
) -> BoolArray:
    """Leave out pieces of cells (H, W) that no segment of `min_length_m` fits into.

    A piece is what hangs together over gaps at least as wide as a segment bridges.
    """
    side = 2 * int(np.ceil((parameters.segment_max_gap_m / resolution_m + 1) / 2)) + 1
    joined = cv2.dilate(occupied.astype(np.uint8), np.ones((side, side), np.uint8))
    _, piece, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    # The box of a dilated piece is wider than the piece, at whose cells' far sides a segment ends.
    sides = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]] * resolution_m
    long = np.hypot(*sides.T) >= min_length_m
    pieces: BoolArray = occupied & long[piece]
    return pieces


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
