"""Wall cells sorted into strips along some directions: sorted once a map, read for any selection of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import WallParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray

SORTED_AT_ONCE = 2**16
"""Cells times directions that are sorted at once: what this takes stays in a CPU's cache."""
PLACE_STEPS = 2.0**32 - 1
"""Places along directions are sorted in so many steps: 32 bits, far finer than cells lie."""
KEPT_SORTED = 2**21
"""Cells times directions that are kept sorted: 100 MB."""


@dataclass(frozen=True, eq=False)
class Runs:
    """Straight runs of cells: values (R,), lengths in meters.

    Attributes
    ----------
    shift : int
        In which set of strips they lie.
    slot : (P,) int
        The cells of the runs, run after run: place in the flattened selection (directions, cells).
    of_cell : (P,) int
        Run of each of them.
    key : (R,) int32
        Number of the strip, see `SortedCells`.
    start, end : (R,) float
        Along the direction.
    covered : (R,) bool
        Whether there are enough cells between start and end.
    """

    shift: int
    slot: NDArray[np.intp]
    of_cell: NDArray[np.intp]
    key: NDArray[np.int32]
    start: FloatArray
    end: FloatArray
    covered: BoolArray


@dataclass(frozen=True, eq=False)
class SortedCells:
    """Cells sorted into strips along directions, by their place along the strip.

    Strips are two cells wide. They come in two sets, the second of which lies a cell further across, so that
    no wall falls between two strips; each cell is once in each set. Tuples hold one entry for each set.

    Attributes
    ----------
    resolution_m : float
        Side of a cell.
    across : (D P,) float
        Place of each cell across each direction, meters; directions are laid out one after the other.
    slot, key : tuple of (D P,) int and int32
        Of each cell in order: its place in a flattened array (D, P), and a number that each strip of each
        direction has for itself.
    along : tuple of (D P,) float
        Its place along the direction, meters.
    span : tuple of int
        How many keys each direction has.
    first_strip : tuple of (D,) int32
        Strip of the first key of each direction.
    """

    resolution_m: float
    across: FloatArray
    slot: tuple[NDArray[np.intp], ...]
    key: tuple[NDArray[np.int32], ...]
    along: tuple[FloatArray, ...]
    span: tuple[int, ...]
    first_strip: tuple[NDArray[np.int32], ...]

    @classmethod
    def of(cls, points: FloatArray, directions_rad: FloatArray, resolution_m: float) -> SortedCells:
        """Sort points (2, P), x and y in meters, along directions (D,)."""
        x, y = points
        c, s = np.cos(directions_rad)[:, None], np.sin(directions_rad)[:, None]
        along, across = x * c + y * s, y * c - x * s
        cell = np.floor(across / resolution_m).astype(np.int32)
        strips = [(cell + shift) >> 1 for shift in (0, 1)]
        lowest = [strip.min(1, keepdims=True) for strip in strips]
        strips = [strip - low for strip, low in zip(strips, lowest, strict=True)]
        spans = [int(strip.max()) + 1 for strip in strips]
        order = _Order.of(along)
        number = np.arange(len(directions_rad))[:, None]
        slots, keys, alongs = [], [], []
        for strip, span in zip(strips, spans, strict=True):
            slot, place = order.by_strip(strip)
            slots.append(slot.ravel())
            keys.append((strip + (number * span).astype(np.int32)).take(slot).ravel())
            alongs.append(place.ravel())
        first_strip = tuple(low[:, 0] for low in lowest)
        return cls(
            resolution_m, across.ravel(), tuple(slots), tuple(keys), tuple(alongs), tuple(spans), first_strip
        )

    def runs(self, chosen: BoolArray, least_m: float, parameters: WallParameters) -> Iterator[Runs]:
        """Cut the chosen (D, P) of the cells, set by set, where the gaps along a strip are too long.

        Runs shorter than `least_m` are left out: nearly all are, since few walls are along a direction.
        """
        flat = chosen.ravel()
        every = bool(flat.all())
        cell_m = self.resolution_m
        for shift in range(len(self.slot)):
            slot, position, key = self.slot[shift], self.along[shift], self.key[shift]
            if not every:
                place = np.flatnonzero(flat.take(slot))
                slot, position, key = slot.take(place), position.take(place), key.take(place)
            if len(slot) == 0:
                continue
            gap = np.empty(len(slot))
            gap[0] = np.inf
            np.subtract(position[1:], position[:-1], out=gap[1:])
            new = gap > parameters.segment_max_gap_m + cell_m
            new[1:] |= key[1:] != key[:-1]
            first = np.flatnonzero(new)
            last = np.append(first[1:], len(slot))
            last -= 1
            start, end = position.take(first), position.take(last)
            start -= cell_m / 2
            end += cell_m / 2
            long = np.flatnonzero(end - start >= least_m)
            first, start, end = first[long], start[long], end[long]
            cells = last[long] - first + 1
            begin = np.cumsum(cells) - cells
            run = np.repeat(np.arange(len(long)), cells)
            place = np.arange(len(run)) + (first - begin).take(run)
            cover = np.minimum(gap.take(place), parameters.segment_cover_cells * cell_m)
            cover[begin] = cell_m
            total = np.bincount(run, weights=cover, minlength=len(long))
            covered = total >= parameters.segment_min_fill * (end - start)
            yield Runs(shift, slot.take(place), run, key[first], start, end, covered)

    def lines(self, runs: Runs) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
        """Direction of each run (R,), by index, and its place across: in cells, and the mean in meters."""
        direction, strip = np.divmod(runs.key.astype(np.intp), self.span[runs.shift])
        strip += self.first_strip[runs.shift][direction]
        total = np.bincount(runs.of_cell, self.across.take(runs.slot))
        return direction, 2 * strip - runs.shift, total / np.bincount(runs.of_cell)


@dataclass(frozen=True, eq=False)
class _Order:
    """Sorts cells by their strip and then by their place along it; equal ones stay as they come.

    NumPy sorts numbers of 16 bits by their digits, several times as fast as it compares longer ones. So
    places are told in steps of 32 bits, sorted by the lower and then by the upper half of these, and then by
    strip: the order of the places serves for both sets of strips.

    Attributes
    ----------
    along : (D, P) float
        Places of the cells along each direction.
    slot : (D, P) int
        The cells by their place, as places in the flattened array.
    """

    along: FloatArray
    slot: NDArray[np.intp]

    @classmethod
    def of(cls, along: FloatArray) -> _Order:
        """Order cells by their places."""
        step = along - along.min()
        step *= PLACE_STEPS / (float(np.ptp(along)) + 1.0)
        whole = step.astype(np.uint32)
        slot = np.argsort(whole.astype(np.uint16), axis=1, kind="stable")
        slot += _row_starts(slot)
        return cls(along, _sorted_by((whole >> 16).astype(np.uint16), slot))

    def by_strip(self, strip: NDArray[np.int32]) -> tuple[NDArray[np.intp], FloatArray]:
        """Place (D, P) of each cell in the flattened array, in order, and `along` in this order."""
        narrow = strip.astype(np.uint16) if strip.max() <= np.iinfo(np.uint16).max else strip
        slot = _sorted_by(narrow, self.slot)
        place = self.along.take(slot)
        # Places within one step may still be in the wrong order; those of a strip before the next are not.
        wrong = place[:, 1:] < place[:, :-1]
        if wrong.any():
            in_order = narrow.take(slot)
            if (wrong & (in_order[:, 1:] == in_order[:, :-1])).any():
                slot = np.lexsort((self.along, strip)) + _row_starts(strip)
                place = self.along.take(slot)
        return slot, place


def _sorted_by(keys: NDArray[np.integer], slot: NDArray[np.intp]) -> NDArray[np.intp]:
    """Order `slot` (D, P), cells as places in the flattened array, by their keys (D, P), row by row."""
    order = np.argsort(keys.take(slot), axis=1, kind="stable")
    order += _row_starts(slot)
    return slot.take(order)


def _row_starts(values: NDArray[np.integer]) -> NDArray[np.intp]:
    """Place (D, 1) of the first cell of each row of values (D, P) in the flattened array."""
    starts: NDArray[np.intp] = np.arange(len(values))[:, None] * values.shape[1]
    return starts


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

    def sorted_parts(self) -> Iterable[tuple[slice, SortedCells]]:
        """Some of the directions after the other, with the cells sorted along them."""
        if len(self.index) * len(self.directions_rad) <= KEPT_SORTED:
            return self._kept_parts
        return self._sorted()

    @cached_property
    def _kept_parts(self) -> tuple[tuple[slice, SortedCells], ...]:
        return tuple(self._sorted())

    def _sorted(self) -> Iterator[tuple[slice, SortedCells]]:
        if len(self.index) == 0:
            return
        at_once = max(1, SORTED_AT_ONCE // len(self.index))
        for begin in range(0, len(self.directions_rad), at_once):
            part = slice(begin, begin + at_once)
            yield part, SortedCells.of(self._points_m, self.directions_rad[part], self.resolution_m)

    @cached_property
    def _points_m(self) -> FloatArray:
        """Centers (2, P) of the cells."""
        points: FloatArray = np.stack(np.divmod(self.index, self.cells.shape[1])[::-1]).astype(float)
        points *= self.resolution_m
        points += self.resolution_m / 2
        return points
