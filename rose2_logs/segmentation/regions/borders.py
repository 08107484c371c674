"""What parts two rooms: a wall, a door or a wide opening, and how sure the border is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import RegionParameters
from rose2_logs.model.borders import Border
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.segmentation.regions.features import FACING_MIN_M, join_features, joinable
from rose2_logs.segmentation.regions.graph import BORDER_MAXIMA, BORDER_SUMS, RegionGraph
from rose2_logs.segmentation.regions.joining import Strength

STEPS = 1000
"""Strengths are rounded to this many steps."""


def borders_of(
    graph: RegionGraph, room: NDArray[np.int64], strength: Strength, parameters: RegionParameters
) -> tuple[Border, ...]:
    """Borders between rooms, in the order of the rooms' numbers.

    Parameters
    ----------
    graph : RegionGraph
        The final regions.
    room : (N,) int64
        Room 1.. of each region, 0 for none.
    strength : callable
        Log odds that two regions are one room.
    parameters : RegionParameters
    """
    ends = room[graph.ends]
    sums = {name: graph.border_sums[:, k] for k, name in enumerate(BORDER_SUMS)}
    shown = (ends > 0).all(1) & (joinable(graph) | (sums["facing_wall"] >= FACING_MIN_M))
    which = np.flatnonzero(shown)
    opens = joinable(graph)[which]
    probability = np.ones(len(which))
    if opens.any():
        log_odds = strength(join_features(graph, which[opens]))
        probability[opens] = np.rint(STEPS / (1 + np.exp(log_odds))) / STEPS
    width = np.where(opens, _chords(graph.border_maxima[which]), 0.0)
    kinds = np.where(width == 0, "wall", np.where(width <= parameters.door_max_width_m, "door", "opening"))
    pairs = np.sort(ends[which], axis=1)
    found = [
        Border((int(a), int(b)), str(kind), float(w), float(p))
        for (a, b), kind, w, p in zip(pairs, kinds, width, probability, strict=True)
    ]
    return tuple(sorted(found, key=lambda border: border.rooms))


def _chords(maxima: FloatArray) -> FloatArray:
    """Distance (M,) between the ends of the contact of each border, 0 where nothing touches."""
    top = {name: maxima[:, k] for k, name in enumerate(BORDER_MAXIMA)}
    width, height = (top[f"{axis}_high"] + top[f"{axis}_low"] for axis in "xy")
    chord = np.hypot(width, height)
    return np.where(np.isfinite(chord), chord, 0.0)
