"""Region growing: which seed takes a cell."""

import numpy as np
import pytest
from drawn_rooms import rows

from rose2_logs.segmentation.baselines.growing import grow
from rose2_logs.segmentation.baselines.regions import ranks_by_size


def grown_one_by_one(seeds, free):
    """The same in plain words: round by round, the first of the neighbors by size."""
    labels = np.where(free, seeds, 0)
    rank = ranks_by_size(labels)
    while True:
        framed, following = np.pad(labels, 1), labels.copy()
        for row, column in np.argwhere(free & (labels == 0)):
            around = np.unique(framed[row : row + 3, column : column + 3])
            if around.any():
                following[row, column] = min(around[around > 0], key=lambda label: rank[label])
        if (following == labels).all():
            return labels
        labels = following


def test_the_nearest_seed_takes_a_cell():
    seeds = rows("1.......2.")
    assert grow(seeds, np.ones(seeds.shape, bool))[0].tolist() == [1, 1, 1, 1, 1, 2, 2, 2, 2, 2]


@pytest.mark.parametrize(
    ("line", "middle"), [("1...2", 1), ("2...1", 1), ("1...22", 2), ("22...1", 2), ("1...2....3", 2)]
)
def test_of_equally_near_seeds_the_largest_takes_a_cell_and_then_the_most_central(line, middle):
    seeds = rows(line)
    gap = np.flatnonzero(seeds[0] == 0)
    assert grow(seeds, np.ones(seeds.shape, bool))[0, gap[1]] == middle


def test_labels_go_around_obstacles_and_through_corners():
    seeds = rows("1....", ".....", ".....")
    free = rows("11111", "00010", "11100") > 0
    assert (grow(seeds, free) == rows("11111", "...1.", "111..")).all()


def test_free_cells_that_no_seed_reaches_stay_without_a_label():
    seeds = rows("1....")
    free = rows("11011") > 0
    assert grow(seeds, free)[0].tolist() == [1, 1, 0, 0, 0]


def test_seeds_outside_the_free_cells_do_not_count():
    seeds = rows("1.2")
    free = rows("011") > 0
    assert grow(seeds, free)[0].tolist() == [0, 2, 2]


def test_no_seeds_and_no_cells_give_no_labels():
    assert grow(np.zeros((3, 4), np.int32), np.ones((3, 4), bool)).tolist() == np.zeros((3, 4)).tolist()
    assert grow(np.zeros((2, 2), np.int32), np.zeros((2, 2), bool)).max() == 0


@pytest.mark.parametrize("number", range(10))
def test_any_map_grows_as_the_rule_says(number):
    rng = np.random.default_rng(number)
    free = rng.random((14, 17)) < 0.7
    seeds = np.where(rng.random(free.shape) < 0.06, rng.integers(1, 6, free.shape), 0).astype(np.int32)
    assert (grow(seeds, free) == grown_one_by_one(seeds, free)).all()
