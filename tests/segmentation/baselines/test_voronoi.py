"""Voronoi segmentation."""

import dataclasses

import numpy as np
import pytest
from drawn_maps import agreement
from free_masks import RESOLUTION_M, overlap_with_room, ring, two_rooms, with_pocket

from rose2_logs.config.baselines import VoronoiBaselineParameters, VoronoiMergeParameters
from rose2_logs.segmentation.baselines.voronoi import cut_rooms, segment_voronoi

PARAMETERS, MERGE = VoronoiBaselineParameters(), VoronoiMergeParameters()


def segment(free, **changes):
    return segment_voronoi(free, RESOLUTION_M, dataclasses.replace(PARAMETERS, **changes), MERGE)


def test_two_rooms_are_cut_at_their_door():
    free, rooms = two_rooms()
    labels = segment(free)
    assert labels.max() == 2
    assert agreement(labels, rooms) > 0.98
    assert (labels > 0).tolist() == free.tolist()


def test_pieces_are_smaller_than_rooms():
    """The cuts cross the rooms too; joining brings them together."""
    free, _ = two_rooms()
    assert cut_rooms(free, RESOLUTION_M, PARAMETERS).max() > 2


def test_a_corridor_around_rooms_leaves_them_what_they_are():
    """The corridor itself may be in pieces, as the method leaves them."""
    free, rooms = ring()
    labels = segment(free)
    assert min(overlap_with_room(labels, rooms, room) for room in range(1, 5)) > 0.95


def test_a_closed_part_of_the_least_area_is_a_room_and_a_smaller_one_is_not():
    free, where = with_pocket(two_rooms()[0], 8)
    assert segment(free)[where].min() > 0
    free, where = with_pocket(two_rooms()[0], 4)
    assert segment(free)[where].max() == 0


def test_without_neighborhoods_and_prunings_there_are_rooms_all_the_same():
    free, _ = two_rooms()
    assert segment(free, neighborhood_max_rounds=0, prune_passes=0).max() >= 1


@pytest.mark.parametrize("fill", [False, True])
def test_maps_without_walls_are_one_room_or_none(fill):
    assert segment(np.full((60, 60), fill)).max() == fill
