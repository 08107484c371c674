"""Which pieces are joined to rooms."""

import dataclasses

import numpy as np
from drawn_rooms import rows

from rose2_logs.config.baselines import VoronoiMergeParameters
from rose2_logs.segmentation.baselines.merging import merge_rooms

PARAMETERS = VoronoiMergeParameters()


def merged(labels, resolution_m=1.0, **changes):
    return merge_rooms(labels, resolution_m, dataclasses.replace(PARAMETERS, **changes))


def behind_a_door():
    """Two rooms of 6 x 6 cells that touch along one cell."""
    labels = np.zeros((8, 15), np.int32)
    labels[1:7, 1:7], labels[1:7, 8:14] = 1, 2
    labels[3, 7] = 1
    return labels


def test_rooms_behind_a_door_stay_apart():
    labels = behind_a_door()
    assert (merged(labels) == labels).all()


def test_pieces_that_share_a_wide_border_are_one_room():
    labels = rows("111222", "111222", "111222")
    assert (merged(labels) == rows("111111", "111111", "111111")).all()


def test_pieces_of_a_corridor_are_joined_until_they_are_long():
    """Then the border is a small share of their perimeter: long corridors stay in a few pieces."""
    labels = np.repeat(np.repeat(np.arange(1, 13, dtype=np.int32), 8)[None], 4, axis=0)
    assert merged(labels[:, :24]).max() == 1
    assert 3 < merged(labels).max() < 12


def test_a_small_room_in_a_niche_goes_to_the_room_beside_it():
    labels = np.zeros((14, 20), np.int32)
    labels[0:10] = 1
    labels[10:12, 5:8] = 2
    assert merged(labels, 0.05).max() == 1


def test_a_small_room_keeps_apart_from_one_within_walls():
    """A target nearly all of whose perimeter is wall is a room of its own: rule by rule."""
    labels = behind_a_door()
    labels[1:7, 8:14] = 0
    labels[3:5, 8:10] = 2
    assert merged(labels, 0.3, small_min_border=0.1).max() == 2
    assert merged(labels, 0.3, small_min_border=0.1, small_target_max_wall=1.0).max() == 1


def test_the_area_of_a_dead_end_decides():
    labels = behind_a_door()
    labels[3:5, 7] = 1
    loose = {"dead_end_max_wall": 1.0}
    assert merged(labels, 0.5, **loose).max() == 1
    assert merged(labels, 1.0, **loose).max() == 2
    assert merged(labels, 1.0, **loose, dead_end_max_area_m2=50.0).max() == 1


def test_the_smallest_room_goes_first_to_its_widest_neighbor():
    """A sliver between two rooms goes to the one with the longer common border."""
    labels = np.zeros((12, 23), np.int32)
    labels[1:11, 1:11], labels[1:11, 12:22] = 1, 3
    labels[1:11, 11] = 2
    labels[6:11, 12] = 0
    joined = merged(labels)
    assert joined[3, 11] == joined[3, 3]


def test_labels_may_have_gaps_and_rooms_no_neighbor():
    labels = rows("1..5", "1..5")
    assert (merged(labels, 5.0) == rows("1..2", "1..2")).all()
    assert merged(np.zeros((3, 3), np.int32)).max() == 0
