"""Distance transform segmentation."""

import dataclasses

import numpy as np
from drawn_maps import agreement
from free_masks import RESOLUTION_M, ring, two_rooms, with_pocket

from rose2_logs.config.baselines import DistanceParameters
from rose2_logs.segmentation.baselines.distance import segment_distance

PARAMETERS = DistanceParameters()


def segment(free, **changes):
    return segment_distance(free, RESOLUTION_M, dataclasses.replace(PARAMETERS, **changes))


def test_two_rooms_are_two_hills_of_the_distance():
    free, rooms = two_rooms()
    labels = segment(free)
    assert labels.max() == 2
    assert agreement(labels, rooms) > 0.98
    assert (labels > 0).tolist() == free.tolist()


def test_small_rooms_come_apart_too():
    free, rooms = two_rooms((60, 70))
    assert agreement(segment(free), rooms) > 0.97


def test_a_corridor_around_rooms_leaves_them_what_they_are():
    free, rooms = ring()
    labels = segment(free)
    assert labels.max() == 5
    assert agreement(labels, rooms) > 0.95


def test_of_several_distances_with_as_many_rooms_the_least_counts():
    """Two rooms come apart where a narrow third one is no hill any more; that one comes first."""
    free, where = with_pocket(two_rooms()[0], 25)
    assert segment(free).max() == 2
    assert segment(free)[where].min() > 0
    free, _ = with_pocket(two_rooms()[0], 45)
    assert segment(free).max() == 3


def test_a_part_below_the_least_area_is_no_room():
    free, where = with_pocket(two_rooms()[0], 14)
    assert segment(free)[where].max() == 0


def test_a_part_above_the_greatest_area_is_no_room():
    """Both rooms and the door are 60 m2; where each room's hill is apart it has some 20 m2."""
    free, _ = two_rooms()
    assert segment(free, room_max_area_m2=30.0).max() == 2
    assert segment(free, room_min_area_m2=30.0, room_max_area_m2=40.0).max() <= 1
    assert segment(free, room_min_area_m2=61.0).max() == 0


def test_nothing_gives_nothing():
    assert segment(np.zeros((20, 30), bool)).max() == 0
