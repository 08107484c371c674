"""How much two sets of regions have in common, whatever their numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import FloatArray

DIRECT_LABELS = 1000
"""Labels up to this one are counted directly: their table of pairs stays smaller than a map."""


@dataclass(frozen=True, eq=False)
class Overlap:
    """Sizes and common sizes of the regions of two label arrays, all in the same unit.

    Attributes
    ----------
    first_ids, second_ids : (A,) and (B,) int
        Labels that occur, ascending, without 0.
    first_size, second_size : (A,) and (B,) float
        Size of each region.
    common : (A, B) float
        Size of the intersection of each pair.
    """

    first_ids: NDArray[np.intp]
    second_ids: NDArray[np.intp]
    first_size: FloatArray
    second_size: FloatArray
    common: FloatArray

    @property
    def iou(self) -> FloatArray:
        """Intersection over union (A, B) of each pair; 0 where both are empty."""
        return share_of(self.common, self.first_size[:, None] + self.second_size[None] - self.common)


def share_of(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Each part over its whole, arrays of one shape; 0 where the whole is nothing."""
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)


def overlap_of(first: NDArray[np.integer], second: NDArray[np.integer]) -> Overlap:
    """Count the cells that the regions of two label arrays have in common.

    Parameters
    ----------
    first, second : int arrays of the same shape
        Labels, 0 = none; negative ones are not allowed.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    if first.shape != second.shape:
        raise ValueError(f"label arrays of different shape: {first.shape} and {second.shape}")
    (first_ids, first_index), (second_ids, second_index) = _numbered(first), _numbered(second)
    rows, columns = len(first_ids), len(second_ids)
    cells = np.bincount((first_index * columns + second_index).ravel(), minlength=rows * columns)
    table: FloatArray = cells.reshape(rows, columns).astype(np.float64)
    first_size, second_size = table.sum(axis=1), table.sum(axis=0)
    first_size[0] = second_size[0] = 0
    occur = np.flatnonzero(first_size), np.flatnonzero(second_size)
    return Overlap(
        first_ids[occur[0]],
        second_ids[occur[1]],
        first_size[occur[0]],
        second_size[occur[1]],
        table[np.ix_(*occur)],
    )


def _numbered(labels: NDArray[np.integer]) -> tuple[NDArray[np.intp], NDArray[np.integer]]:
    """Labels, 0 the first of them, and for each cell the position of its label; some may not occur."""
    highest = int(labels.max(initial=0))
    if highest <= DIRECT_LABELS:
        return np.arange(highest + 1), labels.astype(np.int32, copy=False)
    counts = np.bincount(labels.ravel())
    counts[0] = 1
    ids = np.flatnonzero(counts)
    index = np.zeros(len(counts), np.intp)
    index[ids] = np.arange(len(ids))
    return ids, index[labels]
