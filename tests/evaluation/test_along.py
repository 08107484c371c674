"""The maps of a run over its coverage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rose2_logs.evaluation.along import along_as_json, along_runs
from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.cases import Case
from rose2_logs.evaluation.scores import Scores


def result(group: str, name: str, free_area_m2: float) -> CaseResult:
    scores = Scores(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7, 8)
    truth = "rooms_other" if name == "other" else "rooms"
    case = Case(group, name, Path("map.png"), Path("rooms.png"), 0.05)
    return CaseResult(case, np.zeros((0, 0), np.int32), scores, free_area_m2, 0.1, truth)


def test_coverage_is_the_free_area_over_that_of_the_groups_last_map():
    """Each group is a run of its own, in the order of its cases."""
    runs = along_runs([result("a", "1", 2.0), result("b", "1", 9.0), result("a", "2", 8.0)])
    assert list(runs) == ["a", "b"]
    assert [(point.name, point.coverage) for point in runs["a"]] == [("1", 0.25), ("2", 1.0)]
    assert [point.coverage for point in runs["b"]] == [1.0]


def test_a_run_that_ends_in_an_empty_map_has_no_coverage():
    """No division by zero."""
    assert [point.coverage for point in along_runs([result("a", "1", 2.0), result("a", "2", 0.0)])["a"]] == [
        0.0,
        0.0,
    ]


def test_json_holds_coverage_and_every_figure():
    """As written beside the figures of the maps, with the truth that they are against."""
    (point,) = along_as_json(along_runs([result("a", "1", 2.0)]))["a"]
    assert point["coverage"] == pytest.approx(1.0)
    assert (point["name"], point["iou_sym"], point["rooms_seg"], point["rooms_gt"]) == ("1", 5.0, 7, 8)
    assert point["truth"] == "rooms"
    (point,) = along_as_json(along_runs([result("a", "other", 2.0)]))["a"]
    assert point["truth"] == "rooms_other"
