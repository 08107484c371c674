"""Label images and masks: windows, counts, numbers, runs."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import BoolArray, Scalar
from rose2_logs.model.regions import connected

Label = TypeVar("Label", bound=np.integer)

COUNTED_AT_ONCE = 2**16
"""Cells whose labels are counted at once."""


def known_window(known: BoolArray) -> tuple[slice, slice]:
    """Rows and columns of the smallest part of a mask that holds all of it; the first cell if it is empty."""
    import cv2

    left, top, width, height = cv2.boundingRect(np.ascontiguousarray(known).view(np.uint8))
    return slice(top, top + max(height, 1)), slice(left, left + max(width, 1))


def row_ends(mask: BoolArray) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Rows (N,) that hold some of a mask (H, W), and the first and last column of it in each.

    Whatever is convex around the mask is so around these cells.
    """
    rows = np.flatnonzero(mask.any(1))
    return rows, mask[rows].argmax(1), mask.shape[1] - 1 - mask[rows, ::-1].argmax(1)


def distance_from(mask: BoolArray) -> NDArray[np.float32]:
    """Distance (H, W) of each cell from the nearest one of a mask, in cells."""
    import cv2

    distance = cv2.distanceTransform((~mask).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return np.asarray(distance, np.float32)


def cells_where(values: NDArray[Scalar], which: Callable[[NDArray[Scalar]], BoolArray]) -> NDArray[np.intp]:
    """Index of the chosen cells into a flattened image, in reading order, without a mask of a large image.

    Parameters
    ----------
    values : array
        Contiguous; of any shape.
    which : callable
        Makes the mask of some of the cells.
    """
    flat = values.reshape(-1)
    begins = range(0, flat.size, COUNTED_AT_ONCE)
    found = [np.flatnonzero(which(flat[begin : begin + COUNTED_AT_ONCE])) + begin for begin in begins]
    return np.concatenate([np.zeros(0, np.intp), *found])


def run_starts(values: NDArray[Any]) -> NDArray[np.intp]:
    """Index (K,) of the first of each run of equal values (N,): of labels there are few, and many cells."""
    is_first = np.ones(len(values), bool)
    np.not_equal(values[1:], values[:-1], out=is_first[1:])
    return np.flatnonzero(is_first)


def distinct_labels(labels: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Find the distinct values of a label image and where each comes first in reading order.

    The same as ``numpy.unique`` with ``return_index``, but it sorts the runs of equal labels only.

    Returns
    -------
    values : (K,) int64
        Ascending.
    first : (K,) int
        Index into the flattened image.
    """
    flat = labels.ravel()
    starts = run_starts(flat)
    values, index = np.unique(flat[starts], return_index=True)
    return values.astype(np.int64), starts[index]


def numbered(values: NDArray[Scalar]) -> tuple[NDArray[Scalar], NDArray[np.intp]]:
    """Find the distinct values (K,) of some (N,), ascending, and the position (N,) of each there.

    The same as ``numpy.unique`` with ``return_inverse``, but it sorts the runs of equal values only.
    """
    starts = run_starts(values)
    distinct, index = np.unique(values[starts], return_inverse=True)
    return distinct, np.repeat(index, np.diff(starts, append=len(values)))


def narrow(labels: NDArray[np.int32]) -> NDArray[np.integer]:
    """Return labels from 0 on in the narrowest type that holds them and one more: a byte is read fastest."""
    highest = int(labels.max(initial=0)) + 1
    for kind in (np.uint8, np.uint16):
        if highest <= np.iinfo(kind).max:
            return labels.astype(kind)
    return labels


@dataclass(frozen=True, eq=False)
class LabelRuns:
    """A label image as runs of equal labels in reading order: there are few of them, and many cells.

    Attributes
    ----------
    shape : (int, int)
        Of the image.
    start : (K,) int
        Index into the flattened image of the first cell of each run.
    label, cells : (K,) int
        Its label and number of cells.
    """

    shape: tuple[int, ...]
    start: NDArray[np.intp]
    label: NDArray[np.integer]
    cells: NDArray[np.intp]

    @classmethod
    def of(cls, labels: NDArray[np.integer]) -> LabelRuns:
        """Find the runs of an image (H, W)."""
        flat = labels.ravel()
        start = run_starts(flat)
        return cls(labels.shape, start, flat[start], np.diff(start, append=flat.size))

    def sizes(self, count: int) -> NDArray[np.int64]:
        """Number of cells (count + 1,) of each label 0..count."""
        return np.bincount(self.label, self.cells, minlength=count + 1).astype(np.int64)

    def firsts(self, count: int) -> NDArray[np.intp]:
        """First cell (count + 1,) of each label 0..count; behind the last cell for those without one."""
        first = np.full(count + 1, int(np.prod(self.shape)))
        # Assigned from the last to the first, so that the first stays.
        first[self.label[::-1]] = self.start[::-1]
        return first

    def windows(self) -> list[tuple[slice, slice] | None]:
        """Rows and columns that hold the cells of each label 1.., None for one without cells."""
        count, width = int(self.label.max(initial=0)) + 1, self.shape[1]
        last = self.start + self.cells - 1
        (top, left), (bottom, right) = np.divmod(self.start, width), np.divmod(last, width)
        # A run that goes on in the next row has cells at both sides.
        left, right = np.where(top < bottom, 0, left), np.where(top < bottom, width - 1, right)
        lows, highs = np.full((2, count), self.shape[0] + width), np.full((2, count), -1)
        for low, high, first, end in zip(lows, highs, (top, left), (bottom, right), strict=True):
            np.minimum.at(low, self.label, first)
            np.maximum.at(high, self.label, end)
        return [
            (slice(low[0], high[0] + 1), slice(low[1], high[1] + 1)) if high[0] >= 0 else None
            for low, high in zip(lows.T.tolist()[1:], highs.T.tolist()[1:], strict=True)
        ]

    def greatest(self, values: NDArray[np.float32], count: int) -> NDArray[np.float32]:
        """Greatest of some values (H, W), 0 or more, among the cells of each label 0..count."""
        found = np.zeros(count + 1, np.float32)
        np.maximum.at(found, self.label, np.maximum.reduceat(values.ravel(), self.start))
        return found

    def renumbered(self, number: NDArray[Label]) -> NDArray[Label]:
        """Return the image ``number[labels]``."""
        return np.repeat(number[self.label], self.cells).reshape(self.shape)


def label_sizes(labels: NDArray[np.integer], count: int) -> NDArray[np.int64]:
    """Number of cells (count + 1,) of each label 0..count of an image.

    The same as ``numpy.bincount``, which would make a copy of the image in its own type and count every cell.
    """
    sizes = np.zeros(count + 1, np.int64)
    rows = max(1, COUNTED_AT_ONCE * len(labels) // max(labels.size, 1))
    for begin in range(0, len(labels), rows):
        sizes += LabelRuns.of(labels[begin : begin + rows]).sizes(count)
    return sizes


def wide_labels(labels: NDArray[np.int32], count: int, least_cells: float) -> BoolArray:
    """Whether each label 1.. is at least `least_cells` wide somewhere: a disk of that width fits on it.

    A width is twice the distance of a cell from those of other labels: up to a cell more than there is. A
    single cell without the label counts as an edge, too.

    Parameters
    ----------
    labels : (H, W) int32
        0 for none, as is what lies beyond the image.
    count : int
        Greatest label.
    least_cells : float
        Width that is looked for.

    Returns
    -------
    wide : (count,) bool
    """
    import cv2

    if labels.size == 0:
        return np.zeros(count, bool)
    small = narrow(labels)
    # OpenCV has no extremes of 32-bit integers; there never are so many labels that a float confuses them.
    image = small.astype(np.float32) if small.dtype.itemsize > np.dtype(np.uint16).itemsize else small
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    low, high = (
        extreme(image, cross, borderType=cv2.BORDER_CONSTANT, borderValue=0)
        for extreme in (cv2.erode, cv2.dilate)
    )
    # Cells along the edge of a label are one from what lies beyond.
    edge = (low != high) | (small == 0)
    deep = np.flatnonzero(distance_from(edge) >= least_cells / 2 - 1)
    wide = np.zeros(count + 1, bool)
    wide[labels.take(deep)] = True
    return wide[1:]


def narrow_labels(labels: NDArray[np.int32], count: int, least_cells: float, speck_cells: float) -> BoolArray:
    """Whether each label 1.. is nowhere `least_cells` wide, whatever specks without a label there are in it.

    Parameters
    ----------
    labels : (H, W) int32
        0 for none.
    count : int
        Greatest label.
    least_cells : float
        Width that is looked for, see `wide_labels`.
    speck_cells : float
        Pieces without a label that are shorter than this have the label beside them.

    Returns
    -------
    narrow : (count,) bool
    """
    too_narrow = ~wide_labels(labels, count, least_cells)
    if too_narrow.any():
        # Beyond the image there is no label: what reaches its edge is no speck.
        without = np.pad(labels == 0, 1, constant_values=True)
        pieces = Pieces.of(without)
        is_speck = pieces.cells(pieces.sides.max(1) < speck_cells, without.shape)
        specks = np.flatnonzero(is_speck[1:-1, 1:-1])
        filled = labels.copy()
        filled.reshape(-1)[specks] = labels_near(labels, specks, speck_cells)
        too_narrow &= ~wide_labels(filled, count, least_cells)
    return too_narrow


def labels_near(labels: NDArray[Label], cells: NDArray[np.intp], reach_cells: float) -> NDArray[Label]:
    """Label (N,) nearest to each of some cells of an image, 0 where none is within reach.

    Parameters
    ----------
    labels : (H, W) int
        0 for none.
    cells : (N,) int
        Index into the flattened image.
    reach_cells : float
        Distance in cells.
    """
    import cv2

    if not labels.any():
        return np.zeros(len(cells), labels.dtype)
    distance, nearest = cv2.distanceTransformWithLabels(
        (labels == 0).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    # OpenCV numbers the cells that have a label in reading order, from 1 on.
    labeled = np.flatnonzero(labels > 0)
    near: NDArray[Label] = labels.take(labeled.take(nearest.take(cells) - 1))
    near[distance.take(cells) > reach_cells] = 0
    return near


@dataclass(frozen=True, eq=False)
class Pieces:
    """What hangs together in a mask, with diagonals.

    Attributes
    ----------
    cell : (N,) int
        The cells of the mask, index into the flattened image, in reading order.
    number : (N,) int32
        Piece 1.. of each.
    count : int
        One more than the highest number.
    sides : (count, 2) int
        Width and height in cells of each piece's box; 0 for number 0.
    """

    cell: NDArray[np.intp]
    number: NDArray[np.int32]
    count: int
    sides: NDArray[np.int64]

    @classmethod
    def of(cls, mask: BoolArray, margin: int = 0) -> Pieces:
        """Find the pieces of a mask (H, W) over gaps that growing it by a margin of cells closes."""
        import cv2

        kernel = np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
        grown = cv2.dilate(mask.astype(np.uint8), kernel) if margin else mask.astype(np.uint8)
        count, piece = cv2.connectedComponents(grown, connectivity=8)
        cell = np.flatnonzero(mask)
        number = piece.take(cell).astype(np.int32, copy=False)
        row, column = np.divmod(cell, mask.shape[1])
        sides = np.zeros((count, 2), np.int64)
        for axis, (place, size) in enumerate(((column, mask.shape[1]), (row, mask.shape[0]))):
            low, high = np.full(count, size), np.zeros(count, np.int64)
            np.minimum.at(low, number, place)
            np.maximum.at(high, number, place)
            sides[:, axis] = high - low + 1
        sides[0] = 0
        return cls(cell, number, count, sides)

    def cells(self, chosen: BoolArray, shape: tuple[int, ...]) -> BoolArray:
        """Mask of the pieces of a choice (count,)."""
        mask = np.zeros(shape, bool)
        mask.reshape(-1)[self.cell.compress(chosen.take(self.number))] = True
        return mask


def equal_pieces(mask: BoolArray, *images: NDArray[Any]) -> NDArray[np.int32]:
    """Number the pieces (H, W) of a mask that hang together by sides and in which some images are the same.

    They are numbered from 1 by their first cells in reading order; beside the mask there is 0. What is joined
    are the runs of equal cells within rows: there are few of them, and many cells.
    """
    if mask.size == 0:
        return np.zeros(mask.shape, np.int32)
    width = mask.shape[1]
    flats = [image.ravel() for image in (mask, *images)]
    is_first = np.zeros(mask.size, bool)
    is_first[::width] = True
    for flat in flats:
        is_first[1:] |= flat[1:] != flat[:-1]
    is_first &= flats[0]
    # What is beside the mask are runs, too, which nothing is joined to.
    is_first[1:] |= flats[0][:-1] & ~flats[0][1:]
    is_first[0] = True
    start = np.flatnonzero(is_first)
    cells = np.diff(start, append=mask.size)
    run = np.repeat(np.arange(len(start), dtype=np.int32), cells)
    # Where two runs lie one above the other, the one or the other of them begins.
    begin = start.compress(flats[0].take(start))
    below, above = begin.compress(begin >= width), begin.compress(begin < mask.size - width)
    upper, lower = np.concatenate([below - width, above]), np.concatenate([below, above + width])
    same = functools.reduce(np.logical_and, (flat.take(upper) == flat.take(lower) for flat in flats))
    ends = run.take(upper.compress(same)), run.take(lower.compress(same))
    pieces, piece = connected(len(start), *ends)
    counts = np.zeros(pieces, bool)
    counts[piece.take(run.take(begin))] = True
    number = (np.cumsum(counts) * counts).astype(np.int32)
    return np.repeat(number.take(piece), cells).reshape(mask.shape)


@dataclass(frozen=True, eq=False)
class Contacts:
    """Sides of cells at which two labels of an image meet, one entry per side.

    Attributes
    ----------
    low, high : (N,) int
        The two labels, the lower one first.
    first, second : (N,) int
        Index into the flattened image of the cell before the side and of the one behind it, in its row or
        column: sides within rows come before sides within columns, each in reading order.
    """

    low: NDArray[np.integer]
    high: NDArray[np.integer]
    first: NDArray[np.intp]
    second: NDArray[np.intp]

    def chosen(self, which: BoolArray) -> Contacts:
        """Return some of them, by a mask (N,)."""
        # Indices are looked up several times as fast as a mask.
        at = np.flatnonzero(which)
        return Contacts(self.low.take(at), self.high.take(at), self.first.take(at), self.second.take(at))

    def pairs(self) -> tuple[list[tuple[int, int]], NDArray[np.intp]]:
        """Distinct pairs of labels that meet, ascending, and the position (N,) of each side's pair there."""
        span = int(self.high.max(initial=0)) + 1
        keys, pair = np.unique(self.low.astype(np.int64) * span + self.high, return_inverse=True)
        low, high = np.divmod(keys, span)
        return list(zip(low.tolist(), high.tolist(), strict=True)), pair


def contacts(labels: NDArray[np.integer]) -> Contacts:
    """Find where labels of an image (H, W) meet; 0 counts as any other label."""
    width = labels.shape[1]
    flat = labels.ravel()
    within_rows = np.flatnonzero(flat[:-1] != flat[1:])
    # Not from the end of a row to the beginning of the next.
    within_rows = within_rows.compress((within_rows + 1) % width != 0)
    within_columns = np.flatnonzero(flat[:-width] != flat[width:])
    first = np.concatenate([within_rows, within_columns])
    second = np.concatenate([within_rows + 1, within_columns + width])
    one, other = flat.take(first), flat.take(second)
    return Contacts(np.minimum(one, other), np.maximum(one, other), first, second)


def straight_runs(
    row: NDArray[np.integer], column: NDArray[np.integer], step: tuple[int, int]
) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """Join cells that follow one another along a direction.

    Parameters
    ----------
    row, column : (N,) int
        The cells, each once.
    step : (int, int)
        From a cell to the next of its run: (0, 1), or 1 row with any number of columns.

    Returns
    -------
    first, last : (K, 2) int
        Row and column of the ends of each run; a lone cell is both.
    """
    down, right = step
    place, line = (row, column - right * row) if down else (column, row)
    order = np.lexsort((place, line))
    cells = np.column_stack([row, column])[order]
    is_first = np.ones(len(cells), bool)
    is_first[1:] = (np.diff(line[order]) != 0) | (np.diff(place[order]) != 1)
    is_last = np.append(is_first[1:], True)[: len(cells)]
    return cells[is_first], cells[is_last]


def number_rooms(runs: LabelRuns, highest: int, minimum_m2: float, resolution_m: float) -> NDArray[np.int32]:
    """Number the labels of an image up to `highest` by their first cell; those of less area get 0.

    Returns
    -------
    number : (N,) int32
        Number of each label: `runs.renumbered` gives the image with new numbers.
    """
    size = runs.sizes(highest)
    keep = (size * resolution_m**2 >= minimum_m2) & (size > 0)
    keep[0] = False
    order = np.argsort(runs.firsts(highest), kind="stable")
    order = order[keep[order]]
    number = np.zeros(len(size), np.int32)
    number[order] = np.arange(1, len(order) + 1)
    return number
