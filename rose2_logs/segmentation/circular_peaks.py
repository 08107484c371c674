"""Peaks of values that lie on a circle.

SciPy finds peaks of values along a line; on a circle no peak is cut, and none needs values laid out thrice.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def circular_peaks(values: FloatArray, min_gap: int = 1, min_prominence: float = 0.0) -> IntArray:
    """Find the values that are higher than their neighbors on both sides.

    Parameters
    ----------
    values : (B,) float
        The last is a neighbor of the first.
    min_gap : int
        Least number of steps between two peaks: the higher one stays, of equal ones the first.
    min_prominence : float
        How far one has to go down, at least, from a peak to reach a higher value; of the highest: from it to
        the lowest value.

    Returns
    -------
    peaks : (P,) int
        Ascending indices; of a run of equal values its middle.
    """
    peaks = _maxima(values)
    peaks = _apart(peaks, values, min_gap)
    if min_prominence > 0:
        peaks = peaks[[_prominence(values, peak) >= min_prominence for peak in peaks]]
    return peaks


def _maxima(values: FloatArray) -> IntArray:
    count = len(values)
    steps = np.flatnonzero(values != np.roll(values, 1))  # where a run of equal values begins
    if len(steps) < 2:
        return np.zeros(0, np.intp)
    runs = values[steps]
    lengths = np.diff(np.append(steps, steps[0] + count))
    highest = (runs > np.roll(runs, 1)) & (runs > np.roll(runs, -1))
    return np.sort((steps + (lengths - 1) // 2)[highest] % count)


def _apart(peaks: IntArray, values: FloatArray, min_gap: int) -> IntArray:
    kept = []
    is_free = np.ones(len(values), bool)
    for peak in peaks[np.argsort(-values[peaks], kind="stable")].tolist():
        if is_free[peak]:
            kept.append(peak)
            is_free[np.arange(peak - min_gap + 1, peak + min_gap) % len(values)] = False
    return np.sort(np.array(kept, np.intp))


def _prominence(values: FloatArray, peak: int) -> float:
    """Height of a peak above the higher of the lowest values on either side before one that is higher."""
    onwards = np.roll(values, -peak)
    bases = []
    for side in (onwards, np.roll(onwards[::-1], 1)):
        higher = np.flatnonzero(side > side[0])
        bases.append(side[: higher[0] if len(higher) else None].min())
    return float(values[peak] - max(bases))
