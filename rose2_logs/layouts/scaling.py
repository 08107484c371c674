"""At what scale a map would lie over another, where the cell size that one of them states is only nominal."""

from __future__ import annotations

import math

import numpy as np

from rose2_logs.layouts.placing import PlacedMap, place
from rose2_logs.occupancy import FloatArray

SIDES_WITHIN = (0.01, 0.99)
"""A building reaches from the first to the last percent of its walls: what was seen through a window does not
count."""
SCALE_MIN_CHANGE = 0.03
"""Scales nearer to 1 are no other than the one that was tried."""

SCALED_SCORE = 0.6
"""Placements at another scale need this score. Of the benchmark's maps two of different buildings reach 0.43
where the scale is free, two that differ by their scale alone 0.93."""


def fitting_scale(moving: PlacedMap, fixed: PlacedMap, least_score: float = SCALED_SCORE) -> float | None:
    """Find how many times larger a map has to be to lie over another.

    The lengths and the widths of the two, along the strongest direction of their walls and across it, give
    the scales that are tried.

    Parameters
    ----------
    moving, fixed : PlacedMap
    least_score : float
        What a placement has to reach.

    Returns
    -------
    float or None
        The scale of the best placement, None where none is good enough.
    """
    ratios = _extents_m(fixed) / np.maximum(_extents_m(moving), moving.resolution_m)
    best, found = least_score, None
    for scale in sorted({*ratios.tolist(), math.sqrt(float(ratios.prod()))}):
        if abs(scale - 1) < SCALE_MIN_CHANGE:
            continue
        placement = place(moving.scaled(scale), fixed)
        if placement is not None and placement.score >= best:
            best, found = placement.score, scale
    return found


def _extents_m(map_: PlacedMap) -> FloatArray:
    """Length and width (2,) of what a map's walls enclose, the longer first."""
    energy = map_.energy()
    turn = float(energy.argmax()) * math.pi / len(energy)
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    low, high = np.quantile(map_.walls @ axes.T, SIDES_WITHIN, axis=0)
    extents: FloatArray = np.sort(high - low)[::-1]
    return extents
