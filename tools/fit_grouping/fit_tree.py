"""Fits the strength of joins on prepared maps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from fit_grouping.preparing import PreparedMap
from fit_grouping.sampling import Samples, sample_joins
from fit_grouping.tree_files import trees_of
from rose2_logs.segmentation.regions.features import FEATURES
from rose2_logs.segmentation.regions.graph import RegionGraph
from rose2_logs.segmentation.regions.joining import Strength
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
