"""Line segments of the clean map and the direction that each belongs to (paper, III-B).

The paper draws its segments by the probabilistic Hough transform, whose result depends on the order in which
it draws cells: a mirrored map gives other walls. Here the directions are known from the spectrum, so the
transform is read at these directions only, and every straight run of cells is found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import WallParameters
from rose2_logs.model.labels import Pieces
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.walls.strips import WallCells


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
    among: WallCells, clean: BoolArray, min_length_m: float, parameters: WallParameters
) -> tuple[Segments, BoolArray]:
    """Find the straight runs of cells along some directions.

    A cell belongs to the direction of the longest run through it, so that the cells of a thick wall make no
    segments across it. Where two directions fit alike, the earlier one wins.

    Parameters
    ----------
    among : WallCells
        Cells that those of walls are chosen from, and the directions, from 0 to pi.
    clean : (H, W) bool
        Cells of walls.
    min_length_m : float
        Shortest segment.
    parameters : WallParameters
        Gaps that a segment bridges, and how much of it must be covered.

    Returns
    -------
    segments : Segments
        By direction, offset and place.
    members : (H, W) bool
        The cells on segments.
    """
    chosen = clean.take(among.index)
    count = len(chosen)
    longest, best = np.zeros(count), np.zeros(count, np.int32)
    least_better = longest + among.resolution_m / 2
    # What is shorter than this decides nothing: each direction moves the longest run by half a cell at most
    # without taking its place.
    least_m = min_length_m - (len(among.directions_rad) + 1) * among.resolution_m / 2
    for part, cells in among.sorted_parts():
        directions = range(len(among.directions_rad))[part]
        reached = np.zeros(len(directions) * count)
        for runs in cells.runs(np.tile(chosen, len(directions)), least_m, parameters):
            length = np.where(runs.covered, runs.end - runs.start, 0.0).take(runs.of_cell)
            reached[runs.slot] = np.maximum(reached.take(runs.slot), length)
        for number, reach in zip(directions, reached.reshape(len(directions), count), strict=True):
            better = np.flatnonzero(reach > least_better)
            best[better], longest[better] = number, reach.take(better)
            least_better[better] = longest.take(better) + among.resolution_m / 2
    chosen &= longest >= min_length_m
    members = np.zeros(clean.shape, bool)
    rows = [np.zeros((0, 5))]
    for part, cells in among.sorted_parts():
        own = chosen & (best == np.arange(len(among.directions_rad))[part, None])
        if not own.any():
            continue
        on_segments = np.zeros(own.size, bool)
        for runs in cells.runs(own, min_length_m, parameters):
            keep = runs.covered
            direction, strip, offset = cells.lines(runs)
            rows.append(np.column_stack([direction + part.start, strip, offset, runs.start, runs.end])[keep])
            on_segments[runs.slot.compress(keep.take(runs.of_cell))] = True
        members.reshape(-1)[among.index.compress(on_segments.reshape(own.shape).any(0))] = True
    found = np.concatenate(rows)
    direction, _, offset, start, end = found[np.lexsort((found[:, 3], found[:, 1], found[:, 0]))].T
    return Segments(among.directions_rad, direction.astype(np.int32), offset, start, end), members


def long_pieces(
    occupied: BoolArray, resolution_m: float, min_length_m: float, parameters: WallParameters
) -> BoolArray:
    """Leave out pieces of cells (H, W) that no segment of `min_length_m` fits into.

    A piece is what hangs together over gaps at least as wide as a segment bridges.
    """
    pieces = Pieces.of(occupied, int(np.ceil((parameters.segment_max_gap_m / resolution_m + 1) / 2)))
    # A segment ends at the far sides of cells, and a cell further where it is rounded up to steps.
    sides_m = (pieces.sides + 1) * resolution_m
    return pieces.cells(np.hypot(*sides_m.T) >= min_length_m, occupied.shape)


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
