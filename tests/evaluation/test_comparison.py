"""Errors of a segmentation on label images drawn by hand: every marked cell is known."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_rooms import rows
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rose2_logs.evaluation.case_errors import Mark, compare

label_arrays = hnp.arrays(np.int32, (5, 6), elements=st.integers(0, 4))


def marked(comparison, mark: Mark) -> list[list[int]]:
    return np.argwhere(comparison.marks == mark).tolist()


def test_cells_of_a_merged_room_are_those_that_belong_to_another_true_room():
    """Room 7 takes most of room 1 and all of room 2: the cells of room 2 are wrong, and no others."""
    comparison = compare(rows("11122"), rows("77777"))
    assert marked(comparison, Mark.MERGED) == [[0, 3], [0, 4]]
    assert marked(comparison, Mark.RIGHT) == [[0, 0], [0, 1], [0, 2]]
    assert comparison.partner_of_found[7] == 1


def test_further_parts_of_a_room_are_split():
    """Of two found rooms in one true room, the smaller one has no partner."""
    comparison = compare(rows("11111"), rows("33344"))
    assert marked(comparison, Mark.SPLIT) == [[0, 3], [0, 4]]
    assert comparison.partner_of_found.tolist() == [0, 0, 0, 1, 0]


def test_leaked_missed_and_empty_cells():
    """Outside every true room, in no found room, in neither."""
    comparison = compare(rows(".11.", ".11."), rows("22..", ".22."))
    assert marked(comparison, Mark.LEAKED) == [[0, 0]]
    assert marked(comparison, Mark.MISSED) == [[0, 2]]
    assert marked(comparison, Mark.NONE) == [[0, 3], [1, 0], [1, 3]]
    assert comparison.count(Mark.RIGHT) == 3


def test_a_found_room_outside_every_true_room_has_no_partner():
    """It leaks as a whole, and is nobody's color."""
    comparison = compare(rows("11.."), rows("5566"))
    assert comparison.partner_of_found[[5, 6]].tolist() == [1, 0]
    assert comparison.count(Mark.LEAKED) == 2


@pytest.mark.parametrize("side", ["truth", "found"])
def test_a_side_without_rooms(side: str):
    """All is missed, or all leaks."""
    some, none = rows("11"), rows("..")
    comparison = compare(none, some) if side == "truth" else compare(some, none)
    assert set(comparison.marks.ravel()) == {Mark.LEAKED if side == "truth" else Mark.MISSED}


def test_different_shapes_are_refused():
    """Nothing is broadcast."""
    with pytest.raises(ValueError, match="different shape"):
        compare(rows("11"), rows("1"))


@given(label_arrays, label_arrays)
@settings(max_examples=50)
def test_every_cell_has_the_mark_of_its_side(truth, found):
    """Cells in both, one and none are told apart; partners are one to one; the truth itself is right."""
    comparison = compare(truth, found)
    both = np.isin(comparison.marks, [Mark.RIGHT, Mark.MERGED, Mark.SPLIT])
    assert np.array_equal(both, (truth > 0) & (found > 0))
    assert np.array_equal(comparison.marks == Mark.LEAKED, (found > 0) & (truth == 0))
    assert np.array_equal(comparison.marks == Mark.MISSED, (truth > 0) & (found == 0))
    partners = comparison.partner_of_found[comparison.partner_of_found > 0]
    assert len(np.unique(partners)) == len(partners)
    right = comparison.marks == Mark.RIGHT
    assert np.array_equal(comparison.partner_of_found[found[right]], truth[right])
    assert set(compare(truth, truth).marks.ravel()) <= {Mark.NONE, Mark.RIGHT}
