"""Boosted trees from scikit-learn's model to arrays, and to a file of named numbers."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.segmentation.regions.features import FEATURES
from rose2_logs.segmentation.regions.strengths import BoostedTrees


def trees_of(model: Any, columns: NDArray[np.intp]) -> BoostedTrees:
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
    for k, nodes in enumerate(trees):
        inner = np.flatnonzero(nodes["is_leaf"] == 0)
        feature[k, inner] = columns[nodes["feature_idx"][inner]]
        threshold[k, inner] = nodes["num_threshold"][inner]
        left[k, inner], right[k, inner] = nodes["left"][inner], nodes["right"][inner]
        value[k, : len(nodes)] = np.where(nodes["is_leaf"] == 1, nodes["value"], 0.0)
    start = float(np.ravel(model._baseline_prediction)[0])
    return BoostedTrees(feature, threshold, left, right, value, start)


def write_trees(path: Path, trees: BoostedTrees, names: tuple[str, ...] = FEATURES) -> None:
    """Keep trees as named numbers, with the names of the features that they ask for."""
    numbers = {field.name: np.asarray(getattr(trees, field.name)) for field in fields(trees)}
    small = {name: values.astype(np.uint8) for name, values in numbers.items() if values.dtype.kind == "i"}
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, **(numbers | small), names=np.array(names))  # type: ignore[arg-type]
