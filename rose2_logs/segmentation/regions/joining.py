"""The tree of joins: the strongest borders first, looked at again after each round."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.model.regions import root_of, roots_of
from rose2_logs.segmentation.regions.features import join_features, joinable
from rose2_logs.segmentation.regions.graph import RegionGraph

Strength = Callable[[FloatArray], FloatArray]
"""Log odds (K,) that two regions are one room, from the features (K, F) of their border."""

NEVER = -1e9
"""Strength of a border that no join removes."""


class Judge(Protocol):
    """Says which joins may be made; the fit asks the true rooms."""

    def allows(self, graph: RegionGraph, borders: NDArray[np.intp]) -> BoolArray:
        """Whether each of some borders (K,) may go; those refused are not asked about again."""

    def joined(self, number: NDArray[np.int64], count: int) -> None:
        """Take note of the new number of each region."""


@dataclass(frozen=True, eq=False)
class Joins:
    """The joins of a map in their order.

    Attributes
    ----------
    count : int
        Number of atoms.
    pairs : (J, 2) int
        An atom of each of the two regions.
    strength : (J,) float
        Log odds of each join when it was made.
    """

    count: int
    pairs: NDArray[np.int64]
    strength: FloatArray
    _known: dict[float, NDArray[np.int64]] = field(default_factory=dict, init=False, repr=False)

    def regions(self, least: float) -> NDArray[np.int64]:
        """Region 0.. of each atom when only joins of at least that strength are made.

        A join counts only where those below it in the tree, of either region, were made.
        """
        # Whatever is asked for below the weakest join, all are made.
        asked = max(least, float(self.strength.min(initial=np.inf)))
        if asked not in self._known:
            self._known[asked] = self._regions(least)
        return self._known[asked]

    def _regions(self, least: float) -> NDArray[np.int64]:
        above = list(range(self.count))
        """A step towards the root of the whole tree."""
        parent = list(range(self.count))
        """A step towards the root of the part of it that was made."""
        whole = [True] * self.count

        for (a, b), strength in zip(self.pairs.tolist(), self.strength.tolist(), strict=True):
            one, other = root_of(above, a), root_of(above, b)
            made = whole[one] and whole[other] and strength >= least
            above[other] = one
            whole[one] = made
            if made:
                parent[root_of(parent, b)] = root_of(parent, a)
        return np.unique(roots_of(np.array(parent, np.intp)), return_inverse=True)[1]

    def levels(self, one: NDArray[np.integer], other: NDArray[np.integer]) -> FloatArray:
        """Log odds (K,) down to which pairs of atoms (K,) are in different regions; -inf for always.

        They are those of the weakest join on the way to the region that holds both.
        """
        top = self.count + len(self.pairs)
        parent, level = np.full(top + 1, top), np.append(np.full(self.count, np.inf), self.strength)
        level = np.append(level, -np.inf)
        of_atom = list(range(self.count))
        node = list(range(self.count))
        """The tree's node that an atom stands for, of those that stand for themselves."""

        for number, pair in enumerate(self.pairs.tolist(), start=self.count):
            a, b = (root_of(of_atom, atom) for atom in pair)
            below = [node[a], node[b]]
            parent[below] = number
            level[number] = min(level[number], *level[below])
            of_atom[b], node[a] = a, number
        low, high = np.array(one, np.intp), np.array(other, np.intp)
        # A node above has a higher number: the lower one of two goes up until they meet.
        while (apart := low != high).any():
            low, high = np.minimum(low, high), np.maximum(low, high)
            low[apart] = parent[low[apart]]
        found: FloatArray = level[low]
        return found

    def then(self, later: Joins) -> Joins:
        """Add joins of the regions that all of these give."""
        first_atom = np.unique(self.regions(-np.inf), return_index=True)[1]
        pairs = np.concatenate([self.pairs, first_atom[later.pairs]])
        return Joins(self.count, pairs, np.concatenate([self.strength, later.strength]))


def join_regions(graph: RegionGraph, strength: Strength, least: float, judge: Judge | None = None) -> Joins:
    """Join until no border is stronger than `least`.

    It goes in rounds: in each, every border that is the strongest of both its regions is removed, and only
    what that has changed is looked at again. The result is that of joining one border at a time wherever a
    join does not make another border stronger than itself.

    Parameters
    ----------
    graph : RegionGraph
        The atoms.
    strength : callable
    least : float
        Log odds.
    judge : Judge, optional
        Refuses joins.
    """
    atom = np.arange(len(graph.node_sums))
    values = np.full(len(graph.ends), NEVER)
    refused = np.zeros(len(graph.ends), bool)
    stale = np.ones(len(graph.ends), bool)
    pairs, strengths = [np.zeros((0, 2), np.int64)], [np.zeros(0)]
    count = len(atom)
    while True:
        look = np.flatnonzero(stale & joinable(graph) & ~refused)
        values[look] = strength(join_features(graph, look)) if len(look) else 0.0
        best = _mutual_best(graph.ends, values, np.flatnonzero((values > least) & ~refused), len(atom))
        if len(best) == 0:
            return Joins(count, np.concatenate(pairs), np.concatenate(strengths))
        if judge is not None:
            allowed = judge.allows(graph, best)
            refused[best[~allowed]] = True
            best = best[allowed]
            if len(best) == 0:
                stale[:] = False
                continue
        best = best[np.argsort(-values[best], kind="stable")]
        pairs.append(atom[graph.ends[best]])
        strengths.append(values[best])
        root = np.arange(len(atom))
        root[graph.ends[best, 1]] = graph.ends[best, 0]
        kept, number = np.unique(root, return_inverse=True)
        touched = np.zeros(len(kept), bool)
        touched[number[graph.ends[best, 0]]] = True
        atom = atom[kept]
        graph, border = graph.joined(number)
        if judge is not None:
            judge.joined(number, len(kept))
        there = border >= 0
        merged = np.bincount(border[there], minlength=len(graph.ends)) > 1
        values = _carried(values, border, len(graph.ends), NEVER)
        was_refused = np.zeros(len(graph.ends), bool)
        np.logical_or.at(was_refused, border[there], refused[there])
        refused = was_refused
        stale = merged | touched[graph.ends].any(1)
        values[stale] = NEVER


def _carried(values: FloatArray, border: NDArray[np.int64], count: int, default: float) -> FloatArray:
    carried = np.full(count, default)
    carried[border[border >= 0]] = values[border >= 0]
    return carried


def _mutual_best(
    ends: NDArray[np.int64], values: FloatArray, usable: NDArray[np.intp], count: int
) -> NDArray[np.intp]:
    """Borders that are the strongest of both their regions; of equal ones the first."""
    order = usable[np.lexsort((usable, -values[usable]))]
    place = np.arange(len(order))
    rank = np.full(count, len(order))
    # Assigned from the weakest to the strongest, so that the strongest stays.
    rank[ends[order[::-1], 0]] = place[::-1]
    rank_1 = np.full(count, len(order))
    rank_1[ends[order[::-1], 1]] = place[::-1]
    rank = np.minimum(rank, rank_1)
    best: NDArray[np.intp] = order[(rank[ends[order, 0]] == place) & (rank[ends[order, 1]] == place)]
    return best
