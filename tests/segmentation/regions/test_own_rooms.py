"""Small regions: rooms of their own, or part of the neighbor that they are likeliest one room with."""

from dataclasses import replace

import numpy as np
import pytest
from test_graph import drawn_graph

from rose2_logs.config.regions import RegionParameters
from rose2_logs.segmentation.regions.features import FEATURES
from rose2_logs.segmentation.regions.own_rooms import (
    NO_NEIGHBOR,
    OWN_ROOM_FEATURES,
    LikeliestNeighbors,
    small_region_joins,
    typical_area,
)

PARAMETERS = RegionParameters()
TWO_ROOMS_AND_A_CLOSET = ["111111#222222", "111111#222222", "111111322222#", "111111#222222"]
"""Rooms 1 and 2 (larger than 3) touch only 3; 2 is one cell smaller than 1."""


def by_contact(features):
    """A longer contact is a likelier join."""
    return features[:, FEATURES.index("log_contact")]


def joins(graph, own_log_odds, outside=None, **changed):
    none = np.zeros(len(graph.node_sums), bool)
    found = small_region_joins(
        graph,
        none if outside is None else np.array(outside),
        by_contact,
        lambda features: np.full(len(features), own_log_odds),
        replace(PARAMETERS, **changed),
    )
    return found.pairs.tolist(), found.strength.tolist()


@pytest.fixture(scope="module")
def closet():
    return drawn_graph(TWO_ROOMS_AND_A_CLOSET)


def test_the_likeliest_neighbor_is_larger(closet):
    found = LikeliestNeighbors.of(closet, by_contact)
    assert found.region.tolist()[2] in (0, 1)
    assert found.region[0] == -1
    assert found.features.shape == (3, len(OWN_ROOM_FEATURES))
    no_join = found.features[0, OWN_ROOM_FEATURES.index("join_log_contact")]
    assert no_join == NO_NEIGHBOR


@pytest.mark.parametrize(("log_odds", "joined"), [(-0.49, False), (-0.51, True)])
def test_a_small_region_is_a_room_of_its_own_from_the_least_odds_on(closet, log_odds, joined):
    pairs, strength = joins(closet, log_odds, small_room_max_m2=0.05)
    assert [small for _, small in pairs] == ([2] if joined else [])
    assert strength == pytest.approx([0.01] if joined else [])


@pytest.mark.parametrize(("share", "joined"), [(0.99, False), (1.01, True)])
def test_regions_of_the_greatest_size_are_not_looked_at(closet, share, joined):
    area = closet.node_sums[2, 0]
    pairs, _ = joins(closet, -9.0, small_room_max_m2=share * area)
    assert [small for _, small in pairs] == ([2] if joined else [])


def test_what_is_outside_stays_by_itself(closet):
    assert joins(closet, -9.0, outside=[False, False, True], small_room_max_m2=0.05) == ([], [])


@pytest.mark.parametrize(
    ("odds_of_closet", "joined"),
    [(9.0, []), (-9.0, [[0, 1], [1, 2]])],
    ids=["beside a room", "beside a pocket"],
)
def test_a_small_region_is_joined_to_another_only_where_that_is_no_room(odds_of_closet, joined):
    """Closet 2 opens to room 1, and closet 3, which is smaller, to closet 2 alone."""
    graph = drawn_graph(["111111######", "111111######", "111111222233", "111111222233", "111111######"])
    found = small_region_joins(
        graph,
        np.zeros(len(graph.node_sums), bool),
        by_contact,
        lambda features: np.array([odds_of_closet, -9.0]),
        replace(PARAMETERS, small_room_max_m2=0.1, room_min_area_m2=0.01),
    )
    assert sorted(found.pairs.tolist()) == joined


def test_what_is_too_small_for_a_room_takes_its_pockets_along():
    """Closet 2 may be taken for a room by its odds, but not where the least room is larger."""
    graph = drawn_graph(["111111######", "111111######", "111111222233", "111111222233", "111111######"])
    for least_m2, joined in ((0.07, []), (0.09, [[1, 2]])):
        found = small_region_joins(
            graph,
            np.zeros(len(graph.node_sums), bool),
            by_contact,
            lambda features: np.array([9.0, -9.0]),
            replace(PARAMETERS, small_room_max_m2=0.1, room_min_area_m2=least_m2),
        )
        assert found.pairs.tolist() == joined


def test_half_of_all_floor_lies_in_regions_up_to_the_typical_area():
    assert typical_area(np.array([1.0, 1.0, 2.0, 10.0])) == 10.0
    assert typical_area(np.array([4.0, 4.0, 4.0])) == 4.0
