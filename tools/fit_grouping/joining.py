"""The tree of joins: the strongest border first, looked at again after each join."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fit_grouping.features import join_features, joinable
from fit_grouping.regions import RegionGraph

FloatArray = NDArray[np.float64]
Strength = Callable[[FloatArray], FloatArray]

NEVER = -1e9


@dataclass(frozen=True, eq=False)
class Joins:
    """The joins of a map in their order.

    Attributes
    ----------
    pairs : (J, 2) int
        An atom of each of the two regions.
    strength : (J,) float
        Log odds of each join when it was made.
    """

    pairs: NDArray[np.int64]
    strength: FloatArray

    def regions(self, count: int, least: float) -> NDArray[np.int64]:
        """Region 0.. of each of `count` atoms when only joins of at least that strength are made.

        A join counts only where those below it in the tree, of either region, were made.
        """
        parent = np.arange(count)
        whole = np.ones(count, bool)

        def find(n: int) -> int:
            while parent[n] != n:
                parent[n] = parent[parent[n]]
                n = int(parent[n])
            return n

        shadow = np.arange(count)

        def find_shadow(n: int) -> int:
            while shadow[n] != n:
                shadow[n] = shadow[shadow[n]]
                n = int(shadow[n])
            return n

        for (a, b), strength in zip(self.pairs.tolist(), self.strength.tolist(), strict=True):
            one, other = find_shadow(a), find_shadow(b)
            fits = whole[one] and whole[other] and strength >= least
            shadow[other] = one
            whole[one] = fits
            if fits:
                parent[find(b)] = find(a)
        return np.unique([find(n) for n in range(count)], return_inverse=True)[1]


@dataclass(frozen=True, eq=False)
class Samples:
    """Decisions for fitting: features (S, F), whether the join is right (S,), weights (S,)."""

    features: FloatArray
    right: NDArray[np.bool_]
    weight: FloatArray


def join_regions(graph: RegionGraph, strength: Strength, least: float = NEVER / 2) -> Joins:
    """Join until no border is stronger than `least`."""
    joins, _ = _run(graph, strength, least, None, 0.0, 0)
    return joins


def sample_joins(
    graph: RegionGraph, tables: tuple[FloatArray, ...], strength: Strength, noise: float, seed: int
) -> Samples:
    """Join as the truth says, in the order of the strengths, and keep every decision once.

    Parameters
    ----------
    graph : RegionGraph
    tables : tuple of (N, T + 1) float
        Cells that each atom shares with each true room, column 0 none; one or two truths.
    strength : callable
    noise : float
        Standard deviation that is added to the strengths, for other orders.
    seed : int
    """
    _, samples = _run(graph, strength, NEVER / 2, tables, noise, seed)
    assert samples is not None
    return samples


def _run(
    graph: RegionGraph,
    strength: Strength,
    least: float,
    tables: tuple[FloatArray, ...] | None,
    noise: float,
    seed: int,
) -> tuple[Joins, Samples | None]:
    """Rounds of joins: in each, every border that is the strongest of both its regions."""
    rng = np.random.default_rng(seed)
    representative = np.arange(len(graph.node_sums))
    values = np.full(len(graph.ends), NEVER)
    features = np.zeros((0, 0))
    refused = np.zeros(len(graph.ends), bool)
    stale = np.ones(len(graph.ends), bool)
    pairs, strengths, kept = [], [], []
    sizes = None if tables is None else [np.maximum(t.sum(0), 1) for t in tables]
    while True:
        look = np.flatnonzero(stale & joinable(graph) & ~refused)
        if len(look):
            found = join_features(graph, look)
            if features.shape[0] != len(graph.ends):
                features = np.zeros((len(graph.ends), found.shape[1]))
            features[look] = found
            values[look] = strength(found)
            if noise:
                values[look] += rng.normal(0, noise, len(look))
        stale[:] = False
        usable = np.flatnonzero((values > least) & ~refused)
        if len(usable) == 0:
            break
        best = _mutual_best(graph.ends, values, usable, len(graph.node_sums))
        if tables is not None and sizes is not None:
            right, weight, sure = _judged(graph, tables, sizes, best)
            kept.append((features[best[sure]], right[sure], weight[sure]))
            refused[best[~right]] = True
            best = best[right]
            if len(best) == 0:
                continue
        joined = graph.ends[best]
        order = np.argsort(-values[best], kind="stable")
        pairs.append(representative[joined[order]])
        strengths.append(values[best][order])
        root = np.arange(len(graph.node_sums))
        root[joined[:, 1]] = joined[:, 0]
        number = np.unique(root, return_index=True)
        new = np.searchsorted(number[0], root)
        touched = np.zeros(len(number[0]), bool)
        touched[new[joined[:, 0]]] = True
        graph, border = graph.joined(new)
        representative = representative[number[0]]
        if tables is not None:
            tables = tuple(_grouped(t, new, len(number[0])) for t in tables)
        there = border >= 0
        count = len(graph.ends)
        merged = np.bincount(border[there], minlength=count) > 1
        new_values = np.full(count, NEVER)
        new_values[border[there]] = values[there]
        new_refused = np.zeros(count, bool)
        np.logical_or.at(new_refused, border[there], refused[there])
        new_features = np.zeros((count, features.shape[1]))
        new_features[border[there]] = features[there]
        values, refused, features = new_values, new_refused, new_features
        stale = merged | touched[graph.ends].any(1)
        values[stale] = NEVER
    joins = Joins(
        np.concatenate(pairs) if pairs else np.zeros((0, 2), np.int64),
        np.concatenate(strengths) if strengths else np.zeros(0),
    )
    if tables is None:
        return joins, None
    if not kept:
        return joins, Samples(np.zeros((0, features.shape[1])), np.zeros(0, bool), np.zeros(0))
    parts = [np.concatenate(part) for part in zip(*kept, strict=True)]
    return joins, Samples(parts[0], parts[1], parts[2])


def _mutual_best(
    ends: NDArray[np.int64], values: FloatArray, usable: NDArray[np.intp], count: int
) -> NDArray[np.intp]:
    """Borders that are the strongest of both their regions; of equal ones the first."""
    order = usable[np.lexsort((usable, -values[usable]))]
    rank = np.full(count, len(order))
    np.minimum.at(rank, ends[order, 0], np.arange(len(order)))
    np.minimum.at(rank, ends[order, 1], np.arange(len(order)))
    place = np.arange(len(order))
    best: NDArray[np.intp] = order[(rank[ends[order, 0]] == place) & (rank[ends[order, 1]] == place)]
    return best


def _grouped(table: FloatArray, number: NDArray[np.int64], count: int) -> FloatArray:
    out = np.zeros((count, table.shape[1]))
    np.add.at(out, number, table)
    return out


def _judged(
    graph: RegionGraph, tables: tuple[FloatArray, ...], sizes: list[FloatArray], borders: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], FloatArray, NDArray[np.bool_]]:
    """Whether joins are right by the first truth, their weights, and whether the truths agree on them."""
    ends = graph.ends[borders]
    area = graph.node_sums[:, 0]
    swap = area[ends[:, 0]] > area[ends[:, 1]]
    small, large = np.where(swap, ends[:, 1], ends[:, 0]), np.where(swap, ends[:, 0], ends[:, 1])
    verdicts = []
    for table in tables:
        room = table.argmax(1)
        verdicts.append(room[small] == room[large])
    table, size = tables[0], sizes[0]
    room = table.argmax(1)
    room_small, room_large = room[small], room[large]
    right = verdicts[0]
    share = table[small, room_small] / size[room_small]
    share_large = table[large, room_large] / size[room_large]
    relative = np.minimum(1.0, area[small] / area[large])
    weight = np.where(
        (room_small == 0) & (room_large == 0),
        0.1,
        np.where(
            room_small == 0,
            0.7 * np.minimum(1.0, table[small, 0] / size[room_large]),
            np.where(right | (room_large == 0), share, np.maximum(share, relative * share_large)),
        ),
    )
    agree = np.logical_and.reduce([v == verdicts[0] for v in verdicts])
    return right, weight + 0.02, agree
