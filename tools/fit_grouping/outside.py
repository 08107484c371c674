"""What counts as outside, told by a fitted rule: rays through windows, white around buildings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from fit_grouping.fit_tree import ROOM_MIN_M2, Example
from fit_grouping.tree_files import trees_of
from rose2_logs.segmentation.regions.features import region_features
from rose2_logs.segmentation.regions.strengths import BoostedTrees

FloatArray = NDArray[np.float64]

TREES, LEAVES, LEAST_SAMPLES = 60, 6, 40
SURE_LOG_ODDS = 5.0
"""Answer of a rule that was fitted on maps without anything outside."""


def region_samples(
    example: Example, region: NDArray[np.int64]
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Features of the regions of a map, whether each is a true room, and weights."""
    graph, _ = example.graph.joined(region)
    room = np.zeros(len(graph.node_sums), bool)
    for table in example.tables:
        joined = np.zeros((len(graph.node_sums), table.shape[1]))
        np.add.at(joined, region, table)
        room |= joined[:, 0] < 0.5 * joined.sum(1)
    large = graph.node_sums[:, 0] >= ROOM_MIN_M2
    weight = np.full(int(large.sum()), example.weight / max(int(large.sum()), 1))
    return region_features(graph)[large], room[large], weight


def fit_outside(examples: Sequence[Example], regions: Sequence[NDArray[np.int64]], seed: int) -> BoostedTrees:
    """Log odds that a region is a room, from the final regions of maps."""
    parts = [region_samples(e, r) for e, r in zip(examples, regions, strict=True)]
    features, room, weight = (np.concatenate(p) for p in zip(*parts, strict=True))
    if room.all():
        return BoostedTrees.constant(SURE_LOG_ODDS)
    model = HistGradientBoostingClassifier(
        max_iter=TREES, learning_rate=0.08, max_leaf_nodes=LEAVES, min_samples_leaf=LEAST_SAMPLES,
        l2_regularization=5.0, early_stopping=False, random_state=seed,
    )  # fmt: skip
    model.fit(features, room, sample_weight=weight / weight.mean())
    return trees_of(model, np.arange(features.shape[1]))
