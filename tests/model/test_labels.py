"""Operations on label images: cells in straight runs."""

from __future__ import annotations

import numpy as np
import pytest

from rose2_logs.model.labels import straight_runs


@pytest.mark.parametrize("step", [(0, 1), (1, 0), (1, 1), (1, -1)])
def test_runs_hold_every_cell_once_and_cannot_be_longer(step):
    """Any mask: the cells from each first to its last one are those of the mask."""
    mask = np.random.default_rng(3).random((12, 15)) < 0.5
    first, last = straight_runs(*np.nonzero(mask), step)
    found = np.zeros(mask.shape, int)
    for begin, end in zip(first, last, strict=True):
        before = tuple(begin - step)
        assert not (min(before) >= 0 and before[1] < mask.shape[1] and mask[before])
        length = np.abs(end - begin).max() + 1
        cells = begin + np.arange(length)[:, None] * np.array(step)
        assert (cells[-1] == end).all()
        found[tuple(cells.T)] += 1
    assert (found == mask).all()


def test_no_cells_make_no_runs():
    first, last = straight_runs(np.zeros(0, int), np.zeros(0, int), (1, 1))
    assert first.shape == last.shape == (0, 2)
