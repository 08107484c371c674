"""The benchmark's iou_sym from tables of cells, so that a grouping of atoms is scored without drawing it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def overlap_table(labels: NDArray[np.int32], truth: NDArray[np.int32]) -> FloatArray:
    """Cells (S + 1, T + 1) that each label shares with each true room; row and column 0 are none."""
    rows, columns = int(labels.max(initial=0)) + 1, int(truth.max(initial=0)) + 1
    key = labels.ravel().astype(np.int64) * columns + truth.ravel()
    return np.bincount(key, minlength=rows * columns).reshape(rows, columns).astype(float)


def iou_sym(table: FloatArray) -> float:
    """Mean of the IoU of segmented rooms with their partner and of true rooms with theirs, percent."""
    segment, truth = table.sum(1)[1:], table.sum(0)[1:]
    overlap = table[1:, 1:][segment > 0][:, truth > 0]
    if overlap.size == 0:
        return 0.0
    iou = overlap / (segment[segment > 0][:, None] + truth[truth > 0][None] - overlap)
    of_segment = iou[np.arange(len(overlap)), overlap.argmax(1)].mean()
    of_truth = iou[overlap.argmax(0), np.arange(overlap.shape[1])].mean()
    return float(50 * (of_segment + of_truth))


def grouped(table: FloatArray, region_of_atom: NDArray[np.integer]) -> FloatArray:
    """Table of regions from a table of atoms.

    Parameters
    ----------
    table : (A + 1, T + 1) float
        Row 0 is no atom.
    region_of_atom : (A,) int
        Region 1.. of each atom, 0 for none.
    """
    out = np.zeros((int(region_of_atom.max(initial=0)) + 1, table.shape[1]))
    np.add.at(out, region_of_atom, table[1:])
    out[0] += table[0]
    return out


def best_ious(tables: Iterable[FloatArray], region_of_atom: NDArray[np.integer]) -> FloatArray:
    """Greatest IoU of each region (R,) with a true room of any truth.

    Parameters
    ----------
    tables : iterable of (A + 1, T + 1) float
        Row 0 is no atom.
    region_of_atom : (A,) int
        Region 0.. of each atom.
    """
    best = np.zeros(int(region_of_atom.max(initial=-1)) + 1)
    for table in tables:
        regions = grouped(table, region_of_atom + 1)
        overlap, sizes = regions[1:, 1:], regions[1:].sum(1)
        whole = sizes[:, None] + regions[:, 1:].sum(0) - overlap
        best = np.maximum(best, (overlap / np.maximum(whole, 1)).max(1, initial=0.0))
    return best


def perfect_grouping(table: FloatArray) -> NDArray[np.intp]:
    """True room of each atom (A,), 0 for none: the one that holds most of its cells."""
    room: NDArray[np.intp] = table[1:].argmax(1)
    return room


def upper_bound(tables: Iterable[FloatArray]) -> float:
    """iou_sym of the atoms grouped perfectly."""
    return max(iou_sym(grouped(table, perfect_grouping(table))) for table in tables)
