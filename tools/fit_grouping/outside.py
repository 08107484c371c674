"""What counts as outside, told by a fitted rule: rays through windows, white around buildings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from fit_grouping.features import region_features
from fit_grouping.fit_tree import ROOM_MIN_M2, Example
from fit_grouping.joining import Strength
from fit_grouping.strengths import BoostedTrees

FloatArray = NDArray[np.float64]

TREES, LEAVES, LEAST_SAMPLES = 60, 6, 40
SURE_LOG_ODDS = 5.0
"""Answer of a rule that was fitted on maps without anything outside."""
ALL_OUTSIDE_SHARE = 0.8
"""Where more than this share of the map would be outside, the answer is not believed."""


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
    return BoostedTrees.of(model, np.arange(features.shape[1]))


def rooms_of(
    example: Example, region: NDArray[np.int64], is_room: Strength, least: float
) -> NDArray[np.int64]:
    """Room 1.. of each atom, 0 for those in regions that are too small or outside."""
    graph, _ = example.graph.joined(region)
    area = graph.node_sums[:, 0]
    inside = is_room(region_features(graph)) >= least
    if area[~inside].sum() > ALL_OUTSIDE_SHARE * area.sum():
        inside[:] = True
    room = inside & (area >= ROOM_MIN_M2)
    number: NDArray[np.int64] = np.where(room, np.cumsum(room), 0)[region]
    return number
