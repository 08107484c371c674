"""Masks: what lies outside the image is obstacle, distances are whole cells."""

import numpy as np
from drawn_rooms import rows

from rose2_logs.segmentation.baselines.regions import (
    cells_on_lines,
    connected_parts,
    eroded,
    middle_of,
    nearest_cells,
    obstacle_distance,
    opened,
    ranks_by_size,
)


def test_erosion_takes_cells_at_the_edge_of_the_image_too():
    assert (
        eroded(np.ones((5, 6), bool)) == (rows("......", ".1111.", ".1111.", ".1111.", "......") > 0)
    ).all()
    assert not eroded(np.ones((5, 6), bool), rounds=3).any()


def test_opening_takes_what_is_narrower_than_three_cells():
    mask = rows("111....", "1111111", "111....") > 0
    assert (opened(mask) == (rows("111....", "111....", "111....") > 0)).all()


def test_the_distance_from_obstacles_is_in_whole_cells():
    distance = obstacle_distance(np.ones((7, 7), bool))
    assert distance[3].tolist() == [1, 2, 3, 4, 3, 2, 1]
    corner = np.ones((7, 7), bool)
    corner[0, 0] = False
    assert obstacle_distance(corner)[1, 1] == 1
    assert obstacle_distance(np.zeros((2, 2), bool)).max() == 0


def test_parts_touch_at_corners_or_not():
    mask = rows("11..", "..11", "...1") > 0
    part, size = connected_parts(mask)
    assert (part.max(), size.tolist()) == (1, [0, 5])
    part, size = connected_parts(mask, connectivity=4)
    assert (part.max(), sorted(size.tolist())) == (2, [0, 2, 3])


def test_a_line_of_cells_has_no_gap():
    first, last = np.array([(2.0, 1.0), (5.0, 5.0)]), np.array([(7.0, 14.0), (5.0, 5.0)])
    cells = cells_on_lines(first, last, np.zeros(2))
    assert cells[0].tolist() == [2, 1]
    assert cells[-2].tolist() == [7, 14]
    assert cells[-1].tolist() == [5, 5]
    assert np.abs(np.diff(cells[:-1], axis=0)).max() == 1


def test_labels_are_ranked_by_size_then_by_their_place_then_by_number():
    assert ranks_by_size(rows("1.22.")).tolist() == [2, 1, 0]
    assert ranks_by_size(rows("1...2....3")).tolist() == [3, 1, 0, 2]
    assert ranks_by_size(rows("2.......1")).tolist() == [2, 0, 1]
    assert ranks_by_size(rows("3.........")).tolist() == [3, 1, 2, 0]
    assert ranks_by_size(rows("....")).tolist() == [0]


def test_half_way_between_cells_the_one_towards_the_middle_is_nearest():
    points = np.array([(2.5, 7.5), (3.2, 6.8)])
    assert nearest_cells(points, np.array([5.0, 5.0])).tolist() == [[3, 7], [3, 7]]
    assert nearest_cells(points, np.array([0.0, 9.0])).tolist() == [[2, 8], [3, 7]]


def test_the_middle_of_a_mask_is_that_of_its_cells():
    assert middle_of(rows("11..", "....", "11..") > 0).tolist() == [1.0, 0.5]
    assert np.isnan(middle_of(np.zeros((2, 3), bool))).all()
