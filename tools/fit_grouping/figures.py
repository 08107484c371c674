"""Figures with the building left out: by group and by building, with bootstrap intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from benchmarking.bootstrap import bootstrap_interval
from numpy.typing import NDArray

from fit_grouping.maps_with_truth import TruthMap

FloatArray = NDArray[np.float64]


def building_means(maps: Sequence[TruthMap], scores: FloatArray) -> dict[str, float]:
    """Mean score of each building."""
    buildings = np.array([one.building for one in maps])
    return {name: float(scores[buildings == name].mean()) for name in dict.fromkeys(buildings.tolist())}


def interval(maps: Sequence[TruthMap], scores: FloatArray, seed: int = 0) -> tuple[float, float]:
    """Range of the mean over maps when buildings are drawn again and again, with return."""
    return bootstrap_interval([one.building for one in maps], scores, seed=seed)


def figures_table(maps: Sequence[TruthMap], rows: dict[str, FloatArray]) -> str:
    """Markdown table of the means of groups; below, the intervals of the last row.

    Parameters
    ----------
    maps : sequence of PreparedMap
    rows : dict
        Scores (maps,) by the name of what they are of.
    """
    group = np.array([one.group for one in maps])
    groups = list(dict.fromkeys(group.tolist()))
    heads = [*(g.removeprefix("survey_").removeprefix("incremental_") for g in groups), "mean", "buildings"]
    lines = ["| | " + " | ".join(heads) + " |", "|---" * (len(heads) + 1) + "|"]
    for name, scores in rows.items():
        means = [float(scores[group == g].mean()) for g in groups]
        last = [float(np.mean(means)), float(np.mean(list(building_means(maps, scores).values())))]
        lines.append(f"| {name} | " + " | ".join(f"{v:.1f}" for v in means + last) + " |")
    scores = list(rows.values())[-1]
    ranges = []
    for g in groups:
        inside = np.flatnonzero(group == g).tolist()
        ranges.append(interval([maps[i] for i in inside], scores[inside]))
    ranges.append(interval(maps, scores))
    lines.append("| 95 % | " + " | ".join(f"{a:.1f} to {b:.1f}" for a, b in ranges) + " | |")
    return "\n".join(lines)
