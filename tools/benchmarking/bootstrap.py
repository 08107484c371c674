"""Intervals of means over maps, when the buildings are drawn again and again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rose2_logs.model.occupancy import FloatArray

DRAWS = 2000
"""Draws of as many buildings as there are, with return."""
PERCENTILES = (2.5, 97.5)


def bootstrap_interval(
    buildings: Sequence[str], scores: FloatArray, groups: Sequence[str] | None = None, seed: int = 0
) -> tuple[float, float]:
    """Range of 95 % of the means over maps when as many buildings are drawn again and again, with return.

    Parameters
    ----------
    buildings : sequence of str
        Building of each map; all maps of a building are drawn together.
    scores : (N,) float
        Figure of each map.
    groups : sequence of str, optional
        Group of each map: the range is that of the mean of groups, without those that have no map in a draw.
        By default all maps are one group.
    seed : int
        Of the draws.
    """
    names, building = np.unique(np.asarray(buildings), return_inverse=True)
    kinds, kind = np.unique(np.asarray(groups or ["all"] * len(scores)), return_inverse=True)
    sums, counts = np.zeros((2, len(names), len(kinds)))
    np.add.at(sums, (building, kind), scores)
    np.add.at(counts, (building, kind), 1.0)
    drawn = np.random.default_rng(seed).integers(0, len(names), (DRAWS, len(names)))
    maps = counts[drawn].sum(1)
    means = np.divide(sums[drawn].sum(1), maps, out=np.full(maps.shape, np.nan), where=maps > 0)
    low, high = np.percentile(np.nanmean(means, axis=1), PERCENTILES)
    return float(low), float(high)
