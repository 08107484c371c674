"""Wall cells sorted into strips along some directions: sorted once a map, read for any selection of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import WallParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray

SORTED_AT_ONCE = 2**21
"""Cells times directions that are sorted at once, and kept if that is all of them: 100 MB."""


@dataclass(frozen=True, eq=False)
class Runs:
    """Straight runs of cells: values (R,), lengths in meters.

    Attributes
    ----------
    slot : (P,) int32
        The cells of the runs, run after run: place in the flattened selection (directions, cells).
    of_cell : (P,) int
        Run of each of them.
    direction : (R,) int
        Index among the directions that were sorted together.
    strip : (R,) int
        Cells across the direction.
    start, end : (R,) float
        Along the direction.
    covered : (R,) bool
        Whether there are enough cells between start and end.
    """

    slot: NDArray[np.int32]
    of_cell: NDArray[np.intp]
    direction: NDArray[np.intp]
    strip: NDArray[np.intp]
    start: FloatArray
    end: FloatArray
    covered: BoolArray
    _across: Callable[[], FloatArray]

    @cached_property
    def offset(self) -> FloatArray:
        """Mean place (R,) across the direction."""
        count = np.bincount(self.of_cell, minlength=len(self.start))
        mean: FloatArray = np.bincount(self.of_cell, self._across(), minlength=len(self.start)) / count
        return mean


@dataclass(frozen=True, eq=False)
class SortedCells:
    """Cells sorted into strips along directions, by their place along the strip.

    Strips are two cells wide. They come in two sets, the second of which lies a cell further across, so that
    no wall falls between two strips; each cell is once in each set. What follows are the sets.

    Attributes
    ----------
    resolution_m : float
        Side of a cell.
    slot, key : tuple of (D P,) int32
        Of each cell in order: its place in a flattened array (D, P), and a number that each strip of each
        direction has for itself.
    along, across : tuple of (D P,) float
        Its place along and across the direction, meters.
    span : tuple of int
        How many keys each direction has.
    first_strip : tuple of (D,) int32
        Strip of the first key of each direction.
    """

    resolution_m: float
    slot: tuple[NDArray[np.int32], ...]
    key: tuple[NDArray[np.int32], ...]
    along: tuple[FloatArray, ...]
    across: tuple[FloatArray, ...]
    span: tuple[int, ...]
    first_strip: tuple[NDArray[np.int32], ...]

    @classmethod
    def of(cls, points: FloatArray, directions_rad: FloatArray, resolution_m: float) -> SortedCells:
        """Sort points (2, P), x and y in meters, along directions (D,)."""
        x, y = points
        c, s = np.cos(directions_rad)[:, None], np.sin(directions_rad)[:, None]
        along, across = x * c + y * s, y * c - x * s
        cell = np.floor(across / resolution_m).astype(np.int32)
        base = np.arange(len(directions_rad), dtype=np.int32)[:, None] * np.int32(len(x))
        by_place = np.stack([_order(places) for places in along])
        columns: list[tuple[NDArray[np.int32], NDArray[np.int32], FloatArray, FloatArray]] = []
        spans, lowest = [], []
        for shift in (0, 1):
            strip = (cell + shift) >> 1
            low = strip.min(1, keepdims=True)
            strip -= low
            span = int(strip.max()) + 1
            # Small integers are sorted by radix.
            rank = strip.astype(np.uint16) if span <= 2**16 else strip
            in_strips = np.argsort(np.take_along_axis(rank, by_place, 1), axis=1, kind="stable")
            slot = (np.take_along_axis(by_place, in_strips, 1) + base).astype(np.int32).ravel()
            strip += np.arange(len(directions_rad), dtype=np.int32)[:, None] * np.int32(span)
            columns.append((slot, strip.take(slot), along.take(slot), across.take(slot)))
            spans.append(span)
            lowest.append(low[:, 0])
        slots, keys, alongs, acrosses = zip(*columns, strict=True)
        return cls(resolution_m, slots, keys, alongs, acrosses, tuple(spans), tuple(lowest))

    def runs(self, chosen: BoolArray, parameters: WallParameters) -> Iterator[Runs]:
        """Cut the chosen (D, P) of the cells, set by set, where the gaps along a strip are too long."""
        flat = chosen.ravel()
        every = bool(flat.all())
        cell_m = self.resolution_m
        for shift, all_slots in enumerate(self.slot):
            place = slice(None) if every else np.flatnonzero(flat.take(all_slots))
            position, key = self.along[shift][place], self.key[shift][place]
            if len(position) == 0:
                continue
            gap = position[1:] - position[:-1]
            new = np.ones(len(position), bool)
            np.greater(gap, parameters.segment_max_gap_m + cell_m, out=new[1:])
            new[1:] |= key[1:] != key[:-1]
            run = np.cumsum(new)
            run -= 1
            first = np.flatnonzero(new)
            last = np.append(first[1:], len(position)) - 1
            cover = np.full(len(position), cell_m)
            most = parameters.segment_cover_cells * cell_m
            np.minimum(np.abs(gap, out=gap), most, out=cover[1:], where=~new[1:])
            start, end = position[first] - cell_m / 2, position[last] + cell_m / 2
            direction, strip = np.divmod(key[first].astype(np.intp), self.span[shift])
            strip += self.first_strip[shift][direction]
            yield Runs(
                all_slots[place],
                run,
                direction,
                2 * strip - shift,
                start,
                end,
                np.bincount(run, weights=cover) >= parameters.segment_min_fill * (end - start),
                partial(self.across[shift].__getitem__, place),
            )


def _order(places: FloatArray) -> NDArray[np.intp]:
    """Sort places as a stable sort does; the unstable one is three times as fast where no two are equal."""
    order = np.argsort(places)
    ascending = places[order]
    if (ascending[1:] == ascending[:-1]).any():
        return np.argsort(places, kind="stable")
    return order


@dataclass(frozen=True, eq=False)
class WallCells:
    """Cells that may be walls, and the directions along which their runs are asked for.

    Attributes
    ----------
    cells : (H, W) bool
    directions_rad : (D,) float
    resolution_m : float
    """

    cells: BoolArray
    directions_rad: FloatArray
    resolution_m: float

    @cached_property
    def index(self) -> NDArray[np.intp]:
        """Index (P,) of the cells into the flattened map."""
        return np.flatnonzero(self.cells)

    def sorted_parts(self) -> Iterator[tuple[slice, SortedCells]]:
        """Some of the directions after the other, with the cells sorted along them."""
        if len(self.index) == 0 or len(self.directions_rad) == 0:
            return
        at_once = max(1, SORTED_AT_ONCE // len(self.index))
        if at_once >= len(self.directions_rad):
            yield slice(0, len(self.directions_rad)), self._all_sorted
            return
        for begin in range(0, len(self.directions_rad), at_once):
            part = slice(begin, begin + at_once)
            yield part, SortedCells.of(self._points_m, self.directions_rad[part], self.resolution_m)

    @cached_property
    def _all_sorted(self) -> SortedCells:
        return SortedCells.of(self._points_m, self.directions_rad, self.resolution_m)

    @cached_property
    def _points_m(self) -> FloatArray:
        """Centers (2, P) of the cells."""
        points: FloatArray = np.stack(np.divmod(self.index, self.cells.shape[1])[::-1]).astype(float)
        points *= self.resolution_m
        points += self.resolution_m / 2
        return points
