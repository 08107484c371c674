"""Morphological segmentation."""

import dataclasses

import numpy as np
from drawn_maps import agreement
from free_masks import RESOLUTION_M, ring, two_rooms, with_pocket

from rose2_logs.config.baselines import MorphologicalParameters
from rose2_logs.segmentation.baselines.morphological import segment_morphological

PARAMETERS = MorphologicalParameters()


def segment(free, **changes):
    return segment_morphological(free, RESOLUTION_M, dataclasses.replace(PARAMETERS, **changes))


def test_two_rooms_come_apart_at_their_door():
    free, rooms = two_rooms((120, 130))
    labels = segment(free)
    assert labels.max() == 2
    assert agreement(labels, rooms) > 0.98
    assert (labels > 0).tolist() == free.tolist()


def test_rooms_that_are_small_together_are_one():
    """The erosion stops as soon as a part is smaller than the largest room."""
    free, _ = two_rooms((60, 70))
    assert segment(free).max() == 1
    assert segment(free, room_max_area_m2=10.0).max() == 2


def test_a_corridor_around_rooms_leaves_them_what_they_are():
    """The corridor comes apart from its rooms, and what it encloses stays theirs."""
    free, rooms = ring()
    labels = segment(free)
    assert labels.max() == 5
    assert agreement(labels, rooms) > 0.95


def test_a_part_below_the_least_area_is_no_room():
    free, where = with_pocket(two_rooms()[0], 15)
    assert segment(free)[where].max() == 0
    assert segment(free, room_min_area_m2=0.3)[where].min() > 0


def test_rounds_end_where_they_are_told_to():
    """A part too large stays too large for the first rounds."""
    free, _ = two_rooms((120, 130))
    assert segment(free, max_rounds=0).max() == 0
    assert segment(free, max_rounds=5).max() == 0


def test_nothing_gives_nothing():
    assert segment(np.zeros((20, 30), bool)).max() == 0
