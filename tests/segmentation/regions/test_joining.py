"""The tree of joins: surest first, the same whatever the numbers of the atoms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rose2_logs.segmentation.regions.features import SHAPE_FEATURES
from rose2_logs.segmentation.regions.graph import BORDER_SUMS, NODE_MAXIMA, NODE_SUMS, RegionGraph
from rose2_logs.segmentation.regions.joining import Joins, join_regions


def by_contact(features):
    """The longer two regions touch, the likelier they are one room: even odds at 1 m."""
    return features[:, SHAPE_FEATURES.index("log_contact")] - np.log(1.05)


def graph_of(contacts, count):
    """Regions of 1 m2 that touch along the given lengths."""
    ends = np.array(sorted(contacts), np.int64).reshape(-1, 2)
    node_sums = np.zeros((count, len(NODE_SUMS)))
    node_sums[:, 0] = 1.0
    border_sums = np.zeros((len(ends), len(BORDER_SUMS)))
    border_sums[:, 0] = [contacts[pair] for pair in sorted(contacts)]
    return RegionGraph(
        node_sums, np.ones((count, len(NODE_MAXIMA))), ends, border_sums, np.zeros((len(ends), 6))
    )


def groups(region):
    """The groups of atoms, whatever their numbers."""
    return {frozenset(np.flatnonzero(region == number).tolist()) for number in np.unique(region)}


def test_borders_of_more_than_even_odds_go():
    graph = graph_of({(0, 1): 1.2, (1, 2): 0.8, (2, 3): 1.0001}, 4)
    region = join_regions(graph, by_contact, 0.0).regions(0.0)
    assert groups(region) == {frozenset({0, 1}), frozenset({2, 3})}


def test_borders_are_looked_at_again_after_a_join():
    """Of each half, the contact with 2 is too short; of the whole it is not."""
    graph = graph_of({(0, 1): 3.0, (0, 2): 0.6, (1, 2): 0.6}, 3)
    joins = join_regions(graph, by_contact, 0.0)
    assert groups(joins.regions(0.0)) == {frozenset({0, 1, 2})}
    assert joins.strength.tolist() == pytest.approx([np.log(3.05 / 1.05), np.log(1.25 / 1.05)])


def test_a_higher_level_undoes_the_weak_joins_and_all_above_them():
    joins = Joins(4, np.array([(0, 1), (0, 2), (0, 3)]), np.array([3.0, 1.0, 2.0]))
    assert groups(joins.regions(0.5)) == {frozenset({0, 1, 2, 3})}
    assert groups(joins.regions(1.5)) == {frozenset({0, 1}), frozenset({2}), frozenset({3})}
    assert len(groups(joins.regions(5.0))) == 4


def test_without_a_region_nothing_is_joined():
    assert join_regions(graph_of({}, 0), by_contact, 0.0).regions(0.0).shape == (0,)


@st.composite
def graphs(draw):
    """Contacts of up to 9 regions, no two alike."""
    count = draw(st.integers(1, 9))
    pairs = [(a, b) for a in range(count) for b in range(a + 1, count)]
    chosen = [pair for pair in pairs if draw(st.booleans())]
    order = draw(st.permutations(range(len(chosen))))
    return {pair: 0.3 + 0.1 * 1.37**place for pair, place in zip(chosen, order, strict=True)}, count


@given(graphs(), st.data())
@settings(max_examples=60)
def test_other_numbers_of_the_atoms_give_the_same_regions(drawn, data):
    contacts, count = drawn
    number = data.draw(st.permutations(range(count)))
    renamed = {tuple(sorted((number[a], number[b]))): value for (a, b), value in contacts.items()}
    region = join_regions(graph_of(contacts, count), by_contact, 0.0).regions(0.0)
    other = join_regions(graph_of(renamed, count), by_contact, 0.0).regions(0.0)
    assert groups(region) == groups(other[np.array(number, int)])


@given(graphs())
@settings(max_examples=60)
def test_a_lower_level_only_joins_more(drawn):
    contacts, count = drawn
    joins = join_regions(graph_of(contacts, count), by_contact, -5.0)
    finer = joins.regions(5.0)
    for level in (1.0, 0.5, 0.0, -0.5, -5.0):
        coarser = joins.regions(level)
        assert all(any(small <= large for large in groups(coarser)) for small in groups(finer))
        finer = coarser


def test_joined_rooms_of_real_atoms_do_not_cross_the_wall(atoms, two_rooms):
    """By contact alone: doors are shorter than sides of atoms."""
    region = join_regions(atoms.graph(None), by_contact, 0.0).regions(0.0)
    found = np.concatenate([[0], region + 1])[atoms.cells]
    assert found.max() == 2
    inside = two_rooms.rooms > 0
    assert np.mean((found == found[two_rooms.rooms == 1][0])[inside] == (two_rooms.rooms == 1)[inside]) > 0.97
