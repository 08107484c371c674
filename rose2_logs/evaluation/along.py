"""The figures of one run's maps over its coverage."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.cases import Truth
from rose2_logs.evaluation.scores import Scores


@dataclass(frozen=True)
class RunPoint:
    """One map of a run.

    Attributes
    ----------
    name : str
        Name of the case.
    coverage : float
        Known free area of its map over that of the run's last map; above 1 where a later map lost some.
    scores : Scores
        Its figures.
    truth : {"rooms", "rooms_other"}
        The truth that they are against.
    """

    name: str
    coverage: float
    scores: Scores
    truth: Truth = "rooms"


def along_runs(results: Sequence[CaseResult]) -> dict[str, tuple[RunPoint, ...]]:
    """Take the cases of each group, in their order, as the maps of one run.

    Returns
    -------
    dict
        For each group, in the order in which the groups occur, its points. Coverage is 0 throughout where the
        last map has no free cell.
    """
    runs: dict[str, list[CaseResult]] = {}
    for result in results:
        runs.setdefault(result.case.group, []).append(result)
    return {group: tuple(_points(members)) for group, members in runs.items()}


def _points(members: Sequence[CaseResult]) -> list[RunPoint]:
    whole = members[-1].free_area_m2
    return [
        RunPoint(
            result.case.name,
            result.free_area_m2 / whole if whole > 0 else 0.0,
            result.scores,
            result.truth,
        )
        for result in members
    ]


def along_as_json(runs: Mapping[str, Sequence[RunPoint]]) -> dict[str, list[dict[str, Any]]]:
    """Return the points of each run as JSON values."""
    return {
        group: [
            {"name": point.name, "truth": point.truth, "coverage": point.coverage}
            | dataclasses.asdict(point.scores)
            for point in points
        ]
        for group, points in runs.items()
    }
