"""Where a segmentation differs from the true rooms, cell by cell."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from rose2_logs.tracking.overlap import overlap_of


class Mark(IntEnum):
    """What a cell shows about its room.

    The partner of a found room is the true room that it overlaps most, and the other way round, as in the
    figures; two rooms are partners of each other only where both choose the other.
    """

    NONE = 0
    """In no room, neither a true nor a found one."""
    RIGHT = 1
    """In a found and a true room that are partners of each other."""
    MERGED = 2
    """In a found room whose partner is another true room than this cell's."""
    SPLIT = 3
    """In the right true room, but that one's partner is another found room: this is a further part of it."""
    LEAKED = 4
    """In a found room, outside every true room."""
    MISSED = 5
    """In a true room, in no found one."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Found rooms against true rooms.

    Attributes
    ----------
    truth, found : (H, W) int
        Labels, 0 = no room.
    partner_of_found : (max(found) + 1,) int
        True room of each found room where both are partners of each other, else 0.
    marks : (H, W) uint8
        A `Mark` for each cell.
    """

    truth: NDArray[np.integer]
    found: NDArray[np.integer]
    partner_of_found: NDArray[np.intp]
    marks: NDArray[np.uint8]

    def count(self, mark: Mark) -> int:
        """Return the number of cells with a mark."""
        return int(np.count_nonzero(self.marks == mark))


def compare(truth: NDArray[np.integer], found: NDArray[np.integer]) -> Comparison:
    """Find the partners of rooms and mark each cell.

    Parameters
    ----------
    truth, found : (H, W) int
        Labels, 0 = no room.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    table = overlap_of(found, truth)
    true_of_found = _partners(table.first_ids, table.second_ids, table.common)
    found_of_true = _partners(table.second_ids, table.first_ids, table.common.T)
    mutual = found_of_true[true_of_found] == np.arange(len(true_of_found))
    in_found, in_true = found > 0, truth > 0
    marks = np.zeros(truth.shape, np.uint8)
    marks[in_found & ~in_true] = Mark.LEAKED
    marks[in_true & ~in_found] = Mark.MISSED
    both = in_found & in_true
    marks[both] = Mark.RIGHT
    marks[both & (found_of_true[truth] != found)] = Mark.SPLIT
    marks[both & (true_of_found[found] != truth)] = Mark.MERGED
    return Comparison(truth, found, np.where(mutual, true_of_found, 0), marks)


def _partners(
    ids: NDArray[np.intp], others: NDArray[np.intp], common: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Look-up from a label to the other side's label that it overlaps most; 0 for one that overlaps none."""
    partners = np.zeros(int(ids.max(initial=0)) + 1, np.intp)
    if len(ids) and len(others):
        partners[ids] = np.where(common.max(axis=1) > 0, others[common.argmax(axis=1)], 0)
    return partners
