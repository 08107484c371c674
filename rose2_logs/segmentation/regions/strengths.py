"""The fitted strength of a border: boosted trees as arrays, and the network's mean answer beside them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.regions import RegionParameters
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.segmentation.regions.features import FEATURES, NO_ANSWER, REGION_FEATURES

DIFFERENT, OUTSIDE = FEATURES.index("different"), REGION_FEATURES.index("outside")
ROWS_AT_ONCE = 64
"""Rows whose answers to all nodes are held at once, in a CPU's cache."""
LEAVES_MAX = 16
"""Most leaves of a tree: one bit each."""
ALL_LEAVES = 2**LEAVES_MAX - 1
FIRST_BIT = np.zeros(ALL_LEAVES + 1, np.uint8)
"""Number of the lowest bit of each set of leaves."""
for _bit in reversed(range(LEAVES_MAX)):
    FIRST_BIT[1 << _bit :: 2 << _bit] = _bit
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
    """

    feature: NDArray[np.intp]
    threshold: FloatArray
    left: NDArray[np.intp]
    right: NDArray[np.intp]
    value: FloatArray
    start: float

    def __call__(self, features: FloatArray) -> FloatArray:
        """Log odds (N,) for features (N, F)."""
        total = np.empty(len(features))
        of_leaves = self._of_leaves
        for begin in range(0, len(features), ROWS_AT_ONCE):
            rows = slice(begin, begin + ROWS_AT_ONCE)
            total[rows] = self.start + of_leaves(features[rows]).sum(1)
        return total

    @cached_property
    def _of_leaves(self) -> _LeafMasks:
        return _LeafMasks.of(self)

    @classmethod
    def constant(cls, log_odds: float) -> BoostedTrees:
        """One tree of one leaf: the same answer to everything."""
        leaf = np.zeros((1, 1), np.intp)
        return cls(leaf, np.full((1, 1), np.inf), leaf, leaf, np.zeros((1, 1)), log_odds)


@dataclass(frozen=True, eq=False)
class _LeafMasks:
    """Trees in the form in which all nodes are asked at once, and what several nodes ask once.

    The leaves of a tree are numbered from left to right. A node that sends a row to its right rules out the
    leaves on its left, and of the leaves that no node rules out, the row's is the first (Lucchese et al.,
    QuickScorer, SIGIR 2015).

    Attributes
    ----------
    feature, threshold : (Q,) int, float
        What is asked.
    question : (I T,) int
        What each inner node asks, the first of all trees, then the second of all trees, and so on.
    kept : (I T,) uint16
        Bits of the leaves that remain where a row goes right.
    value : (T LEAVES_MAX,) float
        Of the leaves.
    trees : int
    """

    feature: NDArray[np.intp]
    threshold: FloatArray
    question: NDArray[np.intp]
    kept: NDArray[np.uint16]
    value: FloatArray
    trees: int

    @classmethod
    def of(cls, trees: BoostedTrees) -> _LeafMasks:
        """Number the leaves of trees and note what each node rules out.

        Raises
        ------
        ValueError
            If a tree has more leaves than `LEAVES_MAX`.
        """
        count, nodes = trees.feature.shape
        most = int((trees.left != np.arange(nodes)).sum(1).max())
        feature = np.zeros((most, count), np.intp)
        threshold = np.full((most, count), np.inf)
        kept = np.full((most, count), ALL_LEAVES, np.uint16)
        value = np.zeros((count, LEAVES_MAX))
        for tree in range(count):
            leaves, ruled_out = _numbered_leaves(trees.left[tree].tolist(), trees.right[tree].tolist())
            if len(leaves) > LEAVES_MAX:
                raise ValueError(f"a tree has {len(leaves)} leaves; {LEAVES_MAX} is the most")
            asked = list(ruled_out)
            feature[: len(asked), tree] = trees.feature[tree, asked]
            threshold[: len(asked), tree] = trees.threshold[tree, asked]
            kept[: len(asked), tree] = [ALL_LEAVES & ~bits for bits in ruled_out.values()]
            value[tree, : len(leaves)] = trees.value[tree, leaves]
        questions, question = np.unique(
            np.column_stack([feature.ravel(), threshold.ravel()]), axis=0, return_inverse=True
        )
        of_question = questions[:, 0].astype(np.intp), questions[:, 1].copy()
        return cls(*of_question, question.ravel(), kept.ravel(), value.ravel(), count)

    def __call__(self, features: FloatArray) -> FloatArray:
        """Value (N, T) of the leaf of each tree that each row comes to."""
        columns = np.ascontiguousarray(features.T)
        goes_right = columns.take(self.feature, axis=0) > self.threshold[:, None]
        all_where_left = goes_right.astype(np.uint16)
        all_where_left -= np.uint16(1)
        left_over = all_where_left.take(self.question, axis=0)
        left_over |= self.kept[:, None]
        remaining = np.bitwise_and.reduce(left_over.reshape(-1, self.trees, len(features)), axis=0)
        leaf = FIRST_BIT.take(remaining.T) + np.arange(self.trees) * LEAVES_MAX
        return np.asarray(self.value.take(leaf))


def _numbered_leaves(left: list[int], right: list[int]) -> tuple[list[int], dict[int, int]]:
    """Leaves of a tree from left to right, and bits of those on the left of each inner node."""
    leaves: list[int] = []
    on_left: dict[int, int] = {}

    def bits_below(node: int) -> int:
        if left[node] == node:
            leaves.append(node)
            return 1 << (len(leaves) - 1)
        on_left[node] = bits_below(left[node])
        return on_left[node] | bits_below(right[node])

    bits_below(0)
    return leaves, on_left


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
    answer_least : float
        Added to the mean answer and to its opposite before their log odds are taken.
    margin : float
        Subtracted from the log odds: how much surer than even odds they must be.
    """

    trees: BoostedTrees | None
    answer: int
    answer_weight: float
    answer_least: float
    margin: float = 0.0

    @classmethod
    def of_joins(cls, trees: BoostedTrees | None, parameters: RegionParameters) -> FittedStrength:
        """Log odds that two regions are one room, from `join_features`."""
        weight, least = parameters.answer_weight, parameters.answer_least
        return cls(trees, DIFFERENT, weight, least, parameters.join_margin)

    @classmethod
    def of_rooms(cls, trees: BoostedTrees | None, parameters: RegionParameters) -> FittedStrength:
        """Log odds that a region is a room and not outside, from `region_features`."""
        return cls(trees, OUTSIDE, parameters.answer_weight, parameters.answer_least)

    def __call__(self, features: FloatArray) -> FloatArray:
        """Strength (N,) for features (N, F)."""
        total, weight = np.zeros(len(features)), 0.0
        if self.trees is not None:
            total += self.trees(features)
            weight += 1.0
        if self.answer_weight:
            # What the network was not asked about touches nowhere: these are different rooms.
            against = np.where(features[:, self.answer] == NO_ANSWER, 1.0, features[:, self.answer])
            odds = (1 - against + self.answer_least) / (against + self.answer_least)
            total += self.answer_weight * np.log(odds)
            weight += self.answer_weight
        return np.rint((total / weight - self.margin) * STRENGTH_STEPS) / STRENGTH_STEPS
