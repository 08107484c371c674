"""Fits the strength of joins on prepared maps, and measures it with buildings left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from fit_grouping.preparing import PreparedMap
from fit_grouping.sampling import Samples, by_hand, sample_joins
from fit_grouping.scores import best_iou_sym
from fit_grouping.tree_files import trees_of
from rose2_logs.segmentation.regions.features import FEATURES
from rose2_logs.segmentation.regions.graph import RegionGraph
from rose2_logs.segmentation.regions.joining import Joins, Strength, join_regions
from rose2_logs.segmentation.regions.strengths import BoostedTrees

FloatArray = NDArray[np.float64]

ROOM_MIN_M2 = 1.0
"""Regions below are no rooms."""


@dataclass(frozen=True)
class TreeParameters:
    """How the trees are fitted."""

    trees: int = 150
    leaves: int = 12
    rate: float = 0.06
    least_samples: int = 60
    penalty: float = 5.0
    features_at_once: float = 0.5
    rounds: int = 2
    noise: float = 1.5


@dataclass(frozen=True, eq=False)
class Example:
    """A map to fit on: its graph, its truth tables without row 0, and how much it counts."""

    one: PreparedMap
    graph: RegionGraph
    weight: float

    @property
    def tables(self) -> tuple[FloatArray, ...]:
        """Cells of each atom in each true room."""
        return tuple(table[1:] for table in self.one.tables)


def examples_of(
    maps: Sequence[PreparedMap], answers: Sequence[NDArray[np.float32] | None], simulated_weight: float = 0.3
) -> list[Example]:
    """Graphs of maps; the maps of a building share a weight that grows with the root of their number."""
    counts = Counter(one.building for one in maps)
    return [
        Example(one, one.graph(answer), simulated_weight if one.fold < 0 else counts[one.building] ** -0.5)
        for one, answer in zip(maps, answers, strict=True)
    ]


def gather(examples: Sequence[Example], strength: Strength, noise: float, seed: int) -> Samples:
    """Decisions of all maps; those of a map weigh as much as the map together."""
    parts = []
    for k, example in enumerate(examples):
        s = sample_joins(example.graph, example.tables, strength, noise, seed + k)
        if len(s.right):
            parts.append((s.features, s.right, s.weight * example.weight / s.weight.sum()))
    if not parts:
        return Samples(np.zeros((0, len(FEATURES))), np.zeros(0, bool), np.zeros(0))
    features, right, weight = (np.concatenate(p) for p in zip(*parts, strict=True))
    return Samples(features, right, weight)


def fit_trees(
    samples: Samples, columns: NDArray[np.intp], parameters: TreeParameters, seed: int
) -> BoostedTrees:
    """Boosted trees on some of the features; light samples are thinned out rather than weighed down."""
    weight = samples.weight / samples.weight.mean()
    rng = np.random.default_rng(seed)
    keep_share = np.clip(weight / np.quantile(weight, 0.75), 0.08, 1.0)
    kept = rng.random(len(weight)) < keep_share
    model = HistGradientBoostingClassifier(
        max_iter=parameters.trees,
        learning_rate=parameters.rate,
        max_leaf_nodes=parameters.leaves,
        min_samples_leaf=parameters.least_samples,
        l2_regularization=parameters.penalty,
        max_features=parameters.features_at_once,
        early_stopping=False,
        max_bins=128,
        random_state=seed,
    )
    model.fit(
        samples.features[kept][:, columns], samples.right[kept], sample_weight=(weight / keep_share)[kept]
    )
    return trees_of(model, columns)


def columns_of(names: Sequence[str]) -> NDArray[np.intp]:
    """Numbers of features by name."""
    return np.array([FEATURES.index(name) for name in names])


def fit_along_joins(
    examples: Sequence[Example], columns: NDArray[np.intp], parameters: TreeParameters, seed: int = 0
) -> BoostedTrees:
    """Fit on the decisions of a strength by hand, then also on those of what was fitted."""
    gathered = [gather(examples, by_hand, 0.0, 0), gather(examples, by_hand, parameters.noise, seed + 1)]
    for round_ in range(parameters.rounds):
        samples = Samples(
            *(np.concatenate([getattr(s, f) for s in gathered]) for f in ("features", "right", "weight"))
        )
        trees = fit_trees(samples, columns, parameters, seed)
        if round_ + 1 < parameters.rounds:
            gathered.append(gather(examples, trees, 0.0, seed + round_ + 2))
    return trees


def regions_at(example: Example, joins: Joins, least: float, outside_max: float = 0.5) -> NDArray[np.int64]:
    """Room 1.. of each atom (N,), 0 for regions that are too small or outside.

    Where nearly all is outside, that answer is not believed.
    """
    region = joins.regions(least)
    sums = np.stack([np.bincount(region, example.graph.node_sums[:, k]) for k in (0, 4)])
    outside = sums[1] / sums[0] > outside_max
    if sums[0][outside].sum() > 0.8 * sums[0].sum():
        outside[:] = False
    room = (sums[0] >= ROOM_MIN_M2) & ~outside
    number = np.where(room, np.cumsum(room), 0)
    found: NDArray[np.int64] = number[region]
    return found


def scores_at(
    examples: Sequence[Example], strengths: Sequence[Strength], levels: Sequence[float]
) -> FloatArray:
    """iou_sym (maps, levels) of each map joined by its strength down to each level."""
    out = np.zeros((len(examples), len(levels)))
    for k, (example, strength) in enumerate(zip(examples, strengths, strict=True)):
        joins = join_regions(example.graph, strength, min(levels))
        for j, level in enumerate(levels):
            out[k, j] = best_iou_sym(example.one.tables, regions_at(example, joins, level))
    return out


def group_means(maps: Sequence[PreparedMap], scores: FloatArray) -> dict[str, float]:
    """Mean score of each group, and of the groups."""
    groups = list(dict.fromkeys(one.group for one in maps))
    means = {
        g: float(np.mean([s for one, s in zip(maps, scores, strict=True) if one.group == g])) for g in groups
    }
    return means | {"mean": float(np.mean(list(means.values())))}


def left_out_scores(maps: Sequence[PreparedMap], table: FloatArray) -> tuple[FloatArray, dict[int, int]]:
    """Scores at the level that is best for the other folds (mean of groups), and that level by fold."""
    chosen, best = np.zeros(len(maps)), {}
    fold = np.array([one.fold for one in maps])
    for k in sorted(set(fold.tolist())):
        others = np.flatnonzero(fold != k).tolist()
        means = [
            group_means([maps[i] for i in others], table[others, j])["mean"] for j in range(table.shape[1])
        ]
        best[k] = int(np.argmax(means))
        chosen[fold == k] = table[fold == k, best[k]]
    return chosen, best
