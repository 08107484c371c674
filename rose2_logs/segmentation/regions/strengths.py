"""The fitted strength of a border: boosted trees as arrays, and the network's mean answer beside them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.regions import RegionParameters
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.segmentation.regions.features import FEATURES, NO_ANSWER, REGION_FEATURES

DIFFERENT, OUTSIDE = FEATURES.index("different"), REGION_FEATURES.index("outside")
UNASKED_ANSWER = -0.5
"""What the answer counts for regions that touch nowhere: they are in different rooms."""


STRENGTH_STEPS = 1000
"""Strengths are rounded to this many steps per unit of log odds, so that alike borders are equally strong."""


@dataclass(frozen=True, eq=False)
class BoostedTrees:
    """Trees as arrays with one row per tree.

    Attributes
    ----------
    feature : (T, K) int
        Feature that each node asks for; a leaf asks for feature 0 and sends both answers to itself.
    threshold : (T, K) float
        Values up to it go left.
    left, right : (T, K) int
        Nodes of the same tree.
    value : (T, K) float
        Of the leaves.
    start : float
        What the trees add to.
    depth : int
        Steps from the root to the deepest leaf.
    """

    feature: NDArray[np.intp]
    threshold: FloatArray
    left: NDArray[np.intp]
    right: NDArray[np.intp]
    value: FloatArray
    start: float
    depth: int

    def __call__(self, features: FloatArray) -> FloatArray:
        """Log odds (N,) for features (N, F)."""
        trees, nodes = self.feature.shape
        first = np.arange(trees) * nodes
        feature, threshold, value = self.feature.ravel(), self.threshold.ravel(), self.value.ravel()
        below = np.stack([(self.left + first[:, None]).ravel(), (self.right + first[:, None]).ravel()], 1)
        below = below.ravel()
        row = np.arange(len(features))[:, None] * features.shape[1]
        flat = features.ravel()
        node = np.broadcast_to(first, (len(features), trees))
        for _ in range(self.depth):
            goes_right = flat.take(row + feature.take(node)) > threshold.take(node)
            node = below.take(2 * node + goes_right)
        total: FloatArray = self.start + value.take(node).sum(1)
        return total

    @classmethod
    def constant(cls, log_odds: float) -> BoostedTrees:
        """One tree of one leaf: the same answer to everything."""
        leaf = np.zeros((1, 1), np.intp)
        return cls(leaf, np.full((1, 1), np.inf), leaf, leaf, np.zeros((1, 1)), log_odds, 0)


def read_trees(path: Path, names: tuple[str, ...] = FEATURES) -> BoostedTrees:
    """Trees of a file.

    Raises
    ------
    ValueError
        If they were fitted on other features than these.
    """
    with np.load(path) as numbers:
        if tuple(numbers["names"].tolist()) != names:
            raise ValueError(f"{path}: fitted on other features")
        index = {name: numbers[name].astype(np.intp) for name in ("feature", "left", "right")}
        return BoostedTrees(
            index["feature"],
            numbers["threshold"].astype(float),
            index["left"],
            index["right"],
            numbers["value"].astype(float),
            float(numbers["start"]),
            int(numbers["depth"]),
        )


@dataclass(frozen=True, eq=False)
class FittedStrength:
    """Log odds from trees and from the network's mean answer, weighed.

    Attributes
    ----------
    trees : BoostedTrees, optional
    answer : int
        Feature that holds the mean of the network's answers, which speak against.
    answer_weight : float
        Weight of the network's log odds beside the trees' 1.
    answer_scale : float
        Log odds of the network per difference of its mean answer from one half.
    margin : float
        Subtracted from the log odds: how much surer than even odds they must be.
    """

    trees: BoostedTrees | None
    answer: int
    answer_weight: float
    answer_scale: float
    margin: float = 0.0

    @classmethod
    def of_joins(cls, trees: BoostedTrees | None, parameters: RegionParameters) -> FittedStrength:
        """Log odds that two regions are one room, from `join_features`."""
        weight, scale = parameters.answer_weight, parameters.answer_scale
        return cls(trees, DIFFERENT, weight, scale, parameters.join_margin)

    @classmethod
    def of_rooms(cls, trees: BoostedTrees | None, parameters: RegionParameters) -> FittedStrength:
        """Log odds that a region is a room and not outside, from `region_features`."""
        return cls(trees, OUTSIDE, parameters.answer_weight, parameters.answer_scale)

    def __call__(self, features: FloatArray) -> FloatArray:
        """Strength (N,) for features (N, F)."""
        total, weight = np.zeros(len(features)), 0.0
        if self.trees is not None:
            total += self.trees(features)
            weight += 1.0
        if self.answer_weight:
            mean = features[:, self.answer]
            answer = np.where(mean == NO_ANSWER, UNASKED_ANSWER, 0.5 - mean)
            total += self.answer_weight * self.answer_scale * answer
            weight += self.answer_weight
        return np.rint((total / weight - self.margin) * STRENGTH_STEPS) / STRENGTH_STEPS
