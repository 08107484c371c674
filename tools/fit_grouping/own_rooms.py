"""Whether a small region is a room of its own or part of the room beside it, told by a fitted rule."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from fit_grouping.fit_tree import ROOM_MIN_M2, Example
from fit_grouping.scores import best_ious
from fit_grouping.tree_files import trees_of
from rose2_logs.config.regions import RegionParameters
from rose2_logs.segmentation.regions.joining import Strength
from rose2_logs.segmentation.regions.own_rooms import LikeliestNeighbors
from rose2_logs.segmentation.regions.strengths import BoostedTrees

FloatArray = NDArray[np.float64]

TREES, LEAVES, LEAST_SAMPLES, FEATURES_AT_ONCE = 80, 6, 15, 0.4
OWN_ROOM_MIN_IOU = 0.5
"""A region is a room of its own if it overlaps a true room by more than this: no other can then do so."""
SIMULATED_PART = 0.13
"""Simulated maps weigh this part of what they weigh for joins: their closets are not those of real homes."""
SURE_LOG_ODDS = 5.0
"""Answer of a rule that was fitted on maps without a small region that is part of another."""


def own_room_samples(
    example: Example, region: NDArray[np.int64], strength: Strength, parameters: RegionParameters
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Features of the small regions of a map that have a larger neighbor, and whether each is a true room."""
    graph, _ = example.graph.joined(region)
    found = LikeliestNeighbors.of(graph, strength)
    area = graph.node_sums[:, 0]
    small = (area >= ROOM_MIN_M2) & (area < parameters.small_room_max_m2) & (found.region >= 0)
    return found.features[small], best_ious(example.one.tables, region)[small] > OWN_ROOM_MIN_IOU


def fit_own_rooms(
    examples: Sequence[Example],
    regions: Sequence[NDArray[np.int64]],
    strength: Strength,
    parameters: RegionParameters,
    seed: int,
) -> BoostedTrees:
    """Log odds that a small region is a room of its own, from the regions at even odds of maps."""
    parts = []
    for example, region in zip(examples, regions, strict=True):
        features, own = own_room_samples(example, region, strength, parameters)
        weight = example.weight * (SIMULATED_PART if example.one.fold < 0 else 1.0)
        parts.append((features, own, np.full(len(own), weight)))
    features, own, weights = (np.concatenate(p) for p in zip(*parts, strict=True))
    if own.all() or not own.any():
        return BoostedTrees.constant(SURE_LOG_ODDS)
    model = HistGradientBoostingClassifier(
        max_iter=TREES, learning_rate=0.06, max_leaf_nodes=LEAVES, min_samples_leaf=LEAST_SAMPLES,
        l2_regularization=3.0, max_features=FEATURES_AT_ONCE, early_stopping=False, random_state=seed,
    )  # fmt: skip
    model.fit(features, own, sample_weight=weights / weights.mean())
    return trees_of(model, np.arange(features.shape[1]))
