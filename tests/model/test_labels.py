"""Operations on label images: cells in straight runs, where labels meet."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from drawn_rooms import rows
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy import ndimage
from skimage import measure

from rose2_logs.model.labels import (
    LabelRuns,
    contacts,
    distinct_labels,
    equal_pieces,
    known_window,
    label_sizes,
    labels_near,
    narrow,
    narrow_labels,
    numbered,
    straight_runs,
    wide_labels,
)


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


def test_the_nearest_label_is_found_within_reach():
    line = np.array([[5, 0, 0, 0, 0, 2, 0]], np.int32)
    assert labels_near(line, np.array([6, 1, 2, 3, 0]), 1.5).tolist() == [2, 5, 0, 0, 5]
    assert labels_near(np.zeros((2, 3), np.int32), np.arange(6), 9.0).tolist() == [0] * 6


@given(arrays.arrays(np.int32, (9, 11), elements=st.integers(0, 3)))
def test_a_cell_with_a_label_is_its_own_nearest(labels):
    """Any labels, also without a cell between them: OpenCV's numbers of cells are put to the right ones."""
    assert np.array_equal(labels_near(labels, np.arange(labels.size), 0.0), labels.ravel())


@given(arrays.arrays(np.int64, st.integers(0, 30), elements=st.integers(-3, 3)))
def test_distinct_values_are_numbered_as_numpy_does(values):
    distinct, index = np.unique(values, return_inverse=True)
    assert np.array_equal(numbered(values)[0], distinct)
    assert np.array_equal(numbered(values)[1], index)


def test_contacts_are_counted_by_sides_of_cells():
    meet = contacts(rows("112", "132"))
    pairs, pair = meet.pairs()
    assert pairs == [(1, 2), (1, 3), (2, 3)]
    assert np.bincount(pair).tolist() == [1, 2, 1]


def test_contacts_say_between_which_cells():
    """Within rows first, each in reading order, as indices of the flattened image."""
    meet = contacts(rows("11", "22", "23"))
    assert list(zip(meet.first.tolist(), meet.second.tolist(), strict=True)) == [
        (4, 5),
        (0, 2),
        (1, 3),
        (3, 5),
    ]
    chosen = meet.chosen(meet.low == 1)
    assert chosen.high.tolist() == [2, 2]


def test_an_image_of_one_label_has_no_contacts():
    pairs, pair = contacts(np.ones((3, 4), np.int32)).pairs()
    assert pairs == []
    assert len(pair) == 0


@given(
    arrays.arrays(
        np.int32, arrays.array_shapes(min_dims=2, max_dims=2, max_side=6), elements=st.integers(0, 3)
    )
)
def test_contacts_are_those_of_a_loop_over_all_cells(labels: np.ndarray):
    height, width = labels.shape
    expected = []
    for row in range(height):
        for column in range(width):
            for other in ((row, column + 1), (row + 1, column)):
                if other[0] < height and other[1] < width and labels[row, column] != labels[other]:
                    expected.append(tuple(sorted((int(labels[row, column]), int(labels[other])))))
    meet = contacts(labels)
    assert sorted(zip(meet.low.tolist(), meet.high.tolist(), strict=True)) == sorted(expected)


@given(arrays.arrays(np.int32, st.tuples(st.integers(0, 5), st.integers(0, 5)), elements=st.integers(0, 3)))
def test_distinct_labels_are_those_of_numpy_also_of_an_image_without_cells(labels: np.ndarray):
    values, first = distinct_labels(labels)
    expected_values, expected_first = np.unique(labels, return_index=True)
    assert values.tolist() == expected_values.tolist()
    assert first.tolist() == expected_first.tolist()


@given(arrays.arrays(np.int32, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=st.integers(0, 3)))
def test_runs_of_labels_tell_what_their_cells_do(labels: np.ndarray):
    """Windows as SciPy finds them, sizes as NumPy counts; a run may go on in the next row."""
    runs, count = LabelRuns.of(labels), int(labels.max())
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    assert runs.sizes(count).tolist() == label_sizes(labels, count).tolist() == sizes.tolist()
    assert runs.windows() == ndimage.find_objects(labels)
    number = np.arange(count + 1, dtype=np.int32)[::-1] * 7
    assert np.array_equal(runs.renumbered(number), number[labels])
    firsts = [
        int(np.argmax(labels.ravel() == label)) if sizes[label] else labels.size for label in range(count + 1)
    ]
    assert runs.firsts(count).tolist() == firsts
    values = np.random.default_rng(0).random(labels.shape, np.float32)
    greatest = [values[labels == label].max(initial=0) for label in range(count + 1)]
    assert runs.greatest(values, count).tolist() == greatest


@pytest.mark.parametrize(
    ("highest", "kind"), [(0, np.uint8), (254, np.uint8), (255, np.uint16), (65535, np.int32)]
)
def test_narrow_labels_have_room_for_one_more(highest, kind):
    labels = np.array([[0, highest]], np.int32)
    assert narrow(labels).dtype == kind
    assert np.array_equal(narrow(labels), labels)


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 9))
def test_equal_pieces_are_those_of_each_pair_of_values(seed, height, width):
    """Any two images: their pieces are those of an image that tells both, and numbered alike."""
    draw = np.random.default_rng(seed)
    mask = draw.random((height, width)) < 0.8
    one, other = draw.integers(0, 2, (2, height, width), np.int32)
    expected = measure.label(np.where(mask, 1 + one + 2 * other, 0), connectivity=1, background=0)
    found = equal_pieces(mask, one, other)
    assert found.dtype == np.int32
    assert found.tolist() == expected.tolist()


@given(arrays.arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_the_known_window_is_the_smallest_that_holds_all_of_a_mask(mask):
    rows, columns = known_window(mask)
    if mask.any():
        assert np.count_nonzero(mask[rows, columns]) == np.count_nonzero(mask)
        assert all(
            side.any() for part in (mask[rows, columns], mask[rows, columns].T) for side in part[[0, -1]]
        )
    else:
        assert (rows, columns) == (slice(0, 1), slice(0, 1))


@pytest.mark.parametrize(
    ("least_cells", "wide"),
    [(2, [True] * 4), (3, [True, True, False, False]), (5, [True] + [False] * 3), (11, [False] * 4)],
)
def test_labels_are_as_wide_as_drawn_but_for_a_cell(least_cells, wide):
    labels = np.zeros((40, 60), np.int32)
    labels[0:9, 0:30] = 1  # along the edge of the image
    labels[20:24, 5:50] = 2
    labels[24:25, 5:50] = 3  # beside another label
    labels[30:37, 10:12] = 4
    assert wide_labels(labels, 4, least_cells).tolist() == wide


def test_a_label_without_cells_is_not_wide():
    assert wide_labels(np.ones((9, 9), np.int32), 2, 3.0).tolist() == [True, False]


@pytest.mark.parametrize("degrees", [0, 17, 45, 90])
def test_a_square_is_as_wide_however_it_is_turned(degrees):
    corners = cv2.boxPoints(((40, 40), (20, 20), degrees)).round().astype(np.int32)
    square = cv2.fillConvexPoly(np.zeros((80, 80), np.int32), corners, 1)
    assert wide_labels(square, 1, 18)[0]
    assert not wide_labels(square, 1, 24)[0]


def test_specks_do_not_narrow_a_label_and_lines_do():
    speckled = np.ones((60, 60), np.int32)
    speckled[np.random.default_rng(0).random(speckled.shape) < 0.1] = 0
    lined = np.ones((60, 60), np.int32)
    lined[::8] = 0
    assert not wide_labels(speckled, 1, 12.0)[0]
    assert not narrow_labels(speckled, 1, 12.0, 5.0)[0]
    assert narrow_labels(lined, 1, 12.0, 5.0)[0]


@pytest.mark.parametrize("margin", [0, 3])
def test_gaps_between_spikes_at_the_edge_of_an_image_are_no_specks(margin):
    ragged = np.zeros((14, 60), np.int32)
    ragged[2:11, 5:55] = 1
    ragged[11:14, 5:55:3] = 1
    assert narrow_labels(np.pad(ragged, margin), 1, 12.0, 5.0)[0]


@pytest.mark.parametrize("shape", [(0, 0), (5, 0), (0, 5)])
def test_an_image_without_cells_has_no_pieces(shape):
    assert equal_pieces(np.zeros(shape, bool), np.zeros(shape, np.int32)).shape == shape
    assert wide_labels(np.zeros(shape, np.int32), 2, 3.0).tolist() == [False, False]
