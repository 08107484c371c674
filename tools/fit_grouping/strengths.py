"""The strength of a join as log odds: boosted trees as arrays, and the network's mean answer beside them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fit_grouping.features import FEATURES, NO_ANSWER

FloatArray = NDArray[np.float64]

DIFFERENT = FEATURES.index("different")


@dataclass(frozen=True, eq=False)
class BoostedTrees:
    """Trees of equal depth or less, as arrays with one row per tree.

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
        tree = np.arange(len(self.feature))[None, :]
        rows = np.arange(len(features))[:, None]
        node = np.zeros((len(features), len(self.feature)), np.intp)
        for _ in range(self.depth):
            goes_left = features[rows, self.feature[tree, node]] <= self.threshold[tree, node]
            node = np.where(goes_left, self.left[tree, node], self.right[tree, node])
        total: FloatArray = self.start + self.value[tree, node].sum(1)
        return total

    @classmethod
    def constant(cls, log_odds: float) -> BoostedTrees:
        """One tree of one leaf: the same answer to everything."""
        leaf = np.zeros((1, 1), np.intp)
        return cls(leaf, np.full((1, 1), np.inf), leaf, leaf, np.zeros((1, 1)), log_odds, 0)

    @classmethod
    def of(cls, model: Any, columns: NDArray[np.intp]) -> BoostedTrees:
        """Take the trees of scikit-learn's histogram gradient boosting, fitted on some of the features.

        Raises
        ------
        ValueError
            If all that they were fitted on was right, or all wrong: there is nothing to tell apart.
        """
        if len(model.classes_) != 2:
            raise ValueError(f"all decisions were of one kind ({model.classes_[0]})")
        trees = [predictors[0].nodes for predictors in model._predictors]
        size = max(len(nodes) for nodes in trees)
        feature = np.zeros((len(trees), size), np.intp)
        threshold = np.full((len(trees), size), np.inf)
        left = np.tile(np.arange(size), (len(trees), 1))
        right = left.copy()
        value = np.zeros((len(trees), size))
        depth = 0
        for k, nodes in enumerate(trees):
            inner = np.flatnonzero(nodes["is_leaf"] == 0)
            feature[k, inner] = columns[nodes["feature_idx"][inner]]
            threshold[k, inner] = nodes["num_threshold"][inner]
            left[k, inner], right[k, inner] = nodes["left"][inner], nodes["right"][inner]
            value[k, : len(nodes)] = np.where(nodes["is_leaf"] == 1, nodes["value"], 0.0)
            depth = max(depth, int(nodes["depth"].max()))
        return cls(
            feature, threshold, left, right, value, float(np.ravel(model._baseline_prediction)[0]), depth
        )


def write_trees(path: Path, trees: BoostedTrees, names: tuple[str, ...] = FEATURES) -> None:
    """Keep trees as named numbers, with the names of the features that they ask for."""
    numbers = {field.name: np.asarray(getattr(trees, field.name)) for field in fields(trees)}
    small = {name: values.astype(np.uint8) for name, values in numbers.items() if values.dtype.kind == "i"}
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, **(numbers | small), names=np.array(names))  # type: ignore[arg-type]


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
            numbers["threshold"],
            index["left"],
            index["right"],
            numbers["value"],
            float(numbers["start"]),
            int(numbers["depth"]),
        )


@dataclass(frozen=True, eq=False)
class JoinStrength:
    """Log odds that two regions are one room: the trees' and the network's, weighed.

    Attributes
    ----------
    trees : BoostedTrees, optional
    answer_weight : float
        Weight of the network's log odds beside the trees' 1.
    answer_scale : float
        Log odds of the network per difference of its mean answer from one half.
    offset : float
        Subtracted, so that regions are joined from 0.
    """

    trees: BoostedTrees | None
    answer_weight: float = 0.0
    answer_scale: float = 12.0
    offset: float = 0.0

    def __call__(self, features: FloatArray) -> FloatArray:
        """Strength (N,) for features (N, F)."""
        total = np.zeros(len(features))
        weight = 0.0
        if self.trees is not None:
            total += self.trees(features)
            weight += 1.0
        if self.answer_weight:
            mean = features[:, DIFFERENT]
            answer = np.where(mean == NO_ANSWER, -0.5, 0.5 - mean)
            total += self.answer_weight * self.answer_scale * answer
            weight += self.answer_weight
        return total / weight - self.offset


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
