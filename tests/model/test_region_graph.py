"""Joining regions: borders add up, and the best of what is left comes next."""

from __future__ import annotations

import operator

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from rose2_logs.model.regions import RegionGraph, best_first, connected


@given(st.integers(0, 2**32 - 1), st.integers(0, 40), st.integers(0, 60))
def test_what_hangs_together_is_what_scipy_finds(seed, count, pairs):
    """Any pairs, also twice and with themselves."""
    one, other = np.random.default_rng(seed).integers(0, max(count, 1), (2, pairs if count else 0))
    graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(count, count))
    expected = connected_components(graph, directed=False) if count else (0, np.zeros(0, np.int32))
    groups, group = connected(count, one, other)
    assert (groups, group.tolist()) == (expected[0], expected[1].tolist())


def test_a_long_chain_hangs_together_in_whatever_order_it_comes():
    order = np.random.default_rng(1).permutation(5000)
    assert connected(5000, order[:-1], order[1:])[0] == 1


def test_borders_of_a_joined_region_go_to_its_target():
    graph = RegionGraph(4, {(0, 1): 1, (1, 2): 2, (0, 2): 4, (2, 3): 8}, operator.add)
    assert sorted(graph.join(1, 0)) == [2]
    assert graph.borders == [{2: 6}, {}, {0: 6, 3: 8}, {2: 8}]
    assert [graph.exists(region) for region in range(4)] == [True, False, True, True]
    assert graph.join(0, 2) == []
    assert graph.borders == [{}, {}, {3: 8}, {2: 8}]
    assert graph.holders().tolist() == [2, 2, 2, 3]


def test_the_least_key_comes_next_as_keys_change():
    keys = {"a": 3, "b": 1, "c": 2, "d": None}
    order = []

    def act(item: str) -> list[str]:
        order.append((item, keys[item]))
        keys[item] = None
        if item == "b":
            keys.update(a=0, d=5)
            return ["a", "d"]
        return []

    best_first(sorted(keys), keys.get, act)
    assert order == [("b", 1), ("a", 0), ("c", 2), ("d", 5)]


def test_of_equal_keys_the_lesser_item_comes_first():
    order = []
    left = {3, 1, 2}

    def act(item: int) -> list[int]:
        order.append(item)
        left.remove(item)
        return []

    best_first([3, 1, 2], lambda item: 0 if item in left else None, act)
    assert order == [1, 2, 3]
