"""Decisions along the tree of joins, judged by the true rooms: what the trees are fitted on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.segmentation.regions.features import FEATURES, join_features
from rose2_logs.segmentation.regions.graph import RegionGraph
from rose2_logs.segmentation.regions.joining import NEVER, Strength, join_regions

FloatArray = NDArray[np.float64]

BOTH_OUTSIDE_WEIGHT, ONE_OUTSIDE_WEIGHT, LEAST_WEIGHT = 0.1, 0.7, 0.02
"""Joins beyond the true rooms count less, and every join a little."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Decisions for fitting: features (S, F), whether the join is right (S,), weights (S,)."""

    features: FloatArray
    right: NDArray[np.bool_]
    weight: FloatArray


class TruthJudge:
    """Allows the joins that the true rooms allow, and keeps every decision once."""

    def __init__(self, tables: tuple[FloatArray, ...]) -> None:
        self.tables = tables
        self._size = np.maximum(tables[0].sum(0), 1)
        self.kept: list[tuple[FloatArray, NDArray[np.bool_], FloatArray]] = []

    def allows(self, graph: RegionGraph, borders: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether the joins are right by the first truth; those on which two truths differ are not kept."""
        right, weight, sure = self._judged(graph, borders)
        self.kept.append((join_features(graph, borders)[sure], right[sure], weight[sure]))
        return right

    def joined(self, number: NDArray[np.int64], count: int) -> None:
        """Add up the tables of regions that became one."""
        tables = []
        for table in self.tables:
            out = np.zeros((count, table.shape[1]))
            np.add.at(out, number, table)
            tables.append(out)
        self.tables = tuple(tables)

    def _judged(
        self, graph: RegionGraph, borders: NDArray[np.intp]
    ) -> tuple[NDArray[np.bool_], FloatArray, NDArray[np.bool_]]:
        """Whether joins are right, their weights, and whether the truths agree on them."""
        ends, area = graph.ends[borders], graph.node_sums[:, 0]
        swap = area[ends[:, 0]] > area[ends[:, 1]]
        small, large = np.where(swap, ends[:, 1], ends[:, 0]), np.where(swap, ends[:, 0], ends[:, 1])
        verdicts = []
        for table in self.tables:
            room = table.argmax(1)
            verdicts.append(room[small] == room[large])
        table, size, right = self.tables[0], self._size, verdicts[0]
        room = table.argmax(1)
        room_small, room_large = room[small], room[large]
        share = table[small, room_small] / size[room_small]
        share_large = table[large, room_large] / size[room_large]
        relative = np.minimum(1.0, area[small] / area[large])
        beside = ONE_OUTSIDE_WEIGHT * np.minimum(1.0, table[small, 0] / size[room_large])
        weight = np.where(right | (room_large == 0), share, np.maximum(share, relative * share_large))
        weight = np.where(room_small == 0, beside, weight)
        weight = np.where((room_small == 0) & (room_large == 0), BOTH_OUTSIDE_WEIGHT, weight)
        agree = np.logical_and.reduce([v == right for v in verdicts])
        return right, weight + LEAST_WEIGHT, agree


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
    rng = np.random.default_rng(seed)

    def noisy(features: FloatArray) -> FloatArray:
        return strength(features) + rng.normal(0, noise, len(features))

    judge = TruthJudge(tables)
    join_regions(graph, noisy if noise else strength, NEVER / 2, judge)
    if not judge.kept:
        return Samples(np.zeros((0, len(FEATURES))), np.zeros(0, bool), np.zeros(0))
    features, right, weight = (np.concatenate(part) for part in zip(*judge.kept, strict=True))
    return Samples(features, right, weight)


def by_hand(features: FloatArray) -> FloatArray:
    """A strength to begin with, before anything is fitted: contact, openness, narrowness."""
    index = {name: k for k, name in enumerate(FEATURES)}
    total: FloatArray = 3 * (
        2 * features[:, index["contact_per_outline_small"]]
        + features[:, index["openness"]]
        + np.minimum(features[:, index["saddle_per_clear_low"]], 1.0)
        - 1.6
    )
    return total
