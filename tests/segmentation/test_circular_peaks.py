"""Peaks on a circle against drawn values, and against SciPy's on the same circle laid out along a line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from rose2_logs.segmentation.circular_peaks import circular_peaks

HEIGHTS = st.lists(st.integers(0, 30), min_size=3, max_size=40, unique=True)


def test_a_peak_over_the_seam() -> None:
    assert circular_peaks(np.array([5.0, 1, 2, 1, 4])).tolist() == [0, 2]
    assert circular_peaks(np.array([5.0, 1, 0, 1, 5])).tolist() == [4]  # a run of two, across the seam


def test_the_middle_of_a_run_of_equal_values() -> None:
    assert circular_peaks(np.array([0.0, 3, 3, 3, 0, 1, 0])).tolist() == [2, 5]
    assert circular_peaks(np.zeros(8)).tolist() == []


def test_the_higher_of_near_peaks_stays() -> None:
    values = np.array([0.0, 5, 0, 6, 0, 0, 0, 4, 0, 0])
    assert circular_peaks(values, min_gap=3).tolist() == [3, 7]
    assert circular_peaks(np.array([0.0, 5, 0, 5, 0, 0]), min_gap=3).tolist() == [1]


def test_prominence_is_the_way_down_to_a_higher_value() -> None:
    values = np.array([0.0, 5, 4, 6, 0, 2, 1, 0])
    assert circular_peaks(values, min_prominence=1).tolist() == [1, 3, 5]
    assert circular_peaks(values, min_prominence=1.5).tolist() == [3, 5]
    assert circular_peaks(values, min_prominence=6).tolist() == [3]
    assert circular_peaks(values, min_prominence=6.5).tolist() == []


@given(HEIGHTS, st.integers(1, 8), st.integers(0, 12), st.integers(0, 40))
def test_as_scipy_on_three_turns_of_the_circle(
    heights: list[int], gap: int, prominence: int, turn: int
) -> None:
    values = np.array(heights, float)
    count = len(values)
    expected, _ = signal.find_peaks(np.tile(values, 3), distance=gap, prominence=prominence)
    expected = expected[(expected >= count) & (expected < 2 * count)] - count
    if gap > count // 2:
        return  # copies of a peak are then near each other along the line
    assert circular_peaks(values, gap, prominence).tolist() == expected.tolist()
    turned = circular_peaks(np.roll(values, turn), gap, prominence)
    assert turned.tolist() == np.sort((expected + turn) % count).tolist()


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 1.0]])
def test_no_peak_without_a_lower_neighbor(values: list[float]) -> None:
    assert len(circular_peaks(np.array(values))) == 0
