"""How sure borders are: probabilities of different rooms, from log odds of one room."""

import numpy as np
import pytest
from test_graph import drawn_graph

from rose2_logs.segmentation.regions.borders import border_strengths

MARGIN = 0.75


@pytest.mark.parametrize(("log_odds", "probability"), [(-2.0, 0.881), (0.0, 0.5), (2.0, 0.119)])
def test_the_surer_that_two_regions_are_one_room_the_less_sure_is_their_border(log_odds, probability):
    graph = drawn_graph(["11112222"] * 4)
    less = log_odds - MARGIN
    found = border_strengths(graph, np.array([2, 1]), lambda features: np.full(len(features), less), MARGIN)
    assert found == {(1, 2): pytest.approx(probability)}


def test_rooms_on_both_sides_of_a_wall_are_different_for_sure_and_regions_without_room_have_no_border():
    graph = drawn_graph(["1111#22223"] * 4)
    found = border_strengths(graph, np.array([1, 2, 0]), lambda features: np.full(len(features), 2.0), MARGIN)
    assert found == {(1, 2): 1.0}
