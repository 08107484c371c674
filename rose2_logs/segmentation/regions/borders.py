"""How sure the borders between rooms are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.segmentation.regions.features import FACING_MIN_M, join_features, joinable
from rose2_logs.segmentation.regions.graph import BORDER_SUMS, RegionGraph
from rose2_logs.segmentation.regions.joining import Strength

STEPS = 1000
"""Strengths are rounded to this many steps."""


def border_strengths(
    graph: RegionGraph, room: NDArray[np.int64], strength: Strength, margin: float
) -> dict[tuple[int, int], float]:
    """Probability that two neighboring rooms are different ones, by their numbers, the smaller one first.

    Rooms are neighbors if something is open between them, or if they face one another across a wall; then
    nothing says that they are one, and the probability is 1.

    Parameters
    ----------
    graph : RegionGraph
        The final regions.
    room : (N,) int64
        Room 1.. of each region, 0 for none.
    strength : callable
        Log odds that two regions are one room, less a margin.
    margin : float
        That margin: it decides which joins are made, and is no part of the probability.
    """
    ends = room[graph.ends]
    faces_wall = graph.border_sums[:, BORDER_SUMS.index("facing_wall")] >= FACING_MIN_M
    is_open = joinable(graph)
    which = np.flatnonzero((ends > 0).all(1) & (is_open | faces_wall))
    opens = is_open[which]
    probability = np.ones(len(which))
    if opens.any():
        log_odds = strength(join_features(graph, which[opens])) + margin
        probability[opens] = np.rint(STEPS / (1 + np.exp(log_odds))) / STEPS
    pairs = np.sort(ends[which], axis=1).tolist()
    return {(one, other): p for (one, other), p in zip(pairs, probability.tolist(), strict=True)}
