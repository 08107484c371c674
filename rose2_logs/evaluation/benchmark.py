"""A method's segmentations of benchmark cases, and their figures."""

from __future__ import annotations

import dataclasses
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import CasesError
from rose2_logs.evaluation.cases import Case, Truth
from rose2_logs.evaluation.scores import Scores, mean_scores, score_against
from rose2_logs.system.text import counted
from rose2_logs.system.workers import ordered_map


@dataclass(frozen=True, eq=False)
class CaseResult:
    """Result of a method on one case.

    Attributes
    ----------
    case : Case
        The case.
    labels : (H, W) int32
        The segmented rooms, row 0 at the top as in the case's images.
    scores : Scores
        Figures against the true rooms, where there are two truths against the one that agrees better.
    free_area_m2 : float
        Area of the map's known free cells.
    seconds : float
        Time of the segmentation.
    truth : {"rooms", "rooms_other"}
        The truth that the figures are against.
    """

    case: Case
    labels: NDArray[np.int32]
    scores: Scores
    free_area_m2: float
    seconds: float
    truth: Truth = "rooms"

    def __repr__(self) -> str:
        rooms = counted(round(self.scores.rooms_seg), "room")
        return f"CaseResult('{self.case.group}/{self.case.name}', {rooms}, iou_sym={self.scores.iou_sym:.1f})"

    def without_labels(self) -> CaseResult:
        """Return the same with an empty label image, to be kept for a table of many."""
        return dataclasses.replace(self, labels=np.zeros((0, 0), np.int32))


def evaluate_cases(
    cases: Sequence[Case], method: str, parameters: Parameters, workers: int = 1
) -> Iterator[CaseResult]:
    """Segment each case and score it; results in the order of the cases.

    Raises
    ------
    CasesError
        If an image cannot be read or the images of a case differ in size.
    """
    for _, result in ordered_map(
        partial(evaluate_case, method=method, parameters=parameters), cases, workers
    ):
        yield result


def evaluate_case(case: Case, method: str, parameters: Parameters) -> CaseResult:
    """Segment and score one case."""
    from rose2_logs.segmentation.pipeline import analyze

    snapshot, truths = case.snapshot(), case.truths()
    if snapshot.cells.shape != (shape := truths["rooms"].shape):
        raise CasesError(f"{case.rooms_path}: of shape {shape}, but its map is {snapshot.cells.shape}")
    start = time.perf_counter()
    analysis = analyze(snapshot, parameters, method)
    seconds = time.perf_counter() - start
    labels = np.ascontiguousarray(np.flipud(analysis.rooms.labels))
    truth, scores = score_against(truths, labels)
    return CaseResult(case, labels, scores, analysis.free_area_m2, seconds, truth)


def figures(results: Sequence[CaseResult]) -> dict[str, Any]:
    """Return the figures of each map and the means of each group as JSON values."""
    maps = [
        {"group": result.case.group, "name": result.case.name, "truth": result.truth}
        | dataclasses.asdict(result.scores)
        | {"free_area_m2": result.free_area_m2, "seconds": result.seconds}
        for result in results
    ]
    counts = Counter(result.case.group for result in results)
    groups = {
        group: dataclasses.asdict(mean) | {"maps": counts[group]}
        for group, mean in group_means(results).items()
    }
    return {"maps": maps, "groups": groups}


def group_means(results: Sequence[CaseResult]) -> dict[str, Scores]:
    """Mean figures of each group, in the order in which the groups occur."""
    groups = dict.fromkeys(result.case.group for result in results)
    return {
        group: mean_scores(result.scores for result in results if result.case.group == group)
        for group in groups
    }
