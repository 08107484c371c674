"""Rooms of real maps against those that people have drawn: figures stay what they were."""

from __future__ import annotations

from functools import cache

import pytest
from reader_logs import SHARED

from rose2_logs.config.parameters import Parameters
from rose2_logs.evaluation.benchmark import evaluate_case
from rose2_logs.evaluation.cases import Case, load_cases

CASES = SHARED / "benchmark" / "cases.json"
MOST_DIFFERENCE = 0.5
"""Percent that versions of libraries may move a map's figure."""
IOU_SYM = {
    "full/NOGT-intel_map": 70.614,
    "full/freiburg_building101": 83.297,
    "full/freiburg_building79": 95.031,
    "full/g4s_y2": 58.803,
    "survey_empty/NLB": 92.748,
    "survey_furnished/Freiburg101_scan_furnitures": 87.872,
    "survey_furnished/office_b_furnitures": 90.751,
    "incremental_fr79/map06": 91.241,
    "incremental_intel/map12": 68.595,
    "homes/a11": 85.285,
    "homes/b09": 54.701,
    "places/depot": 52.559,
}
"""Mean IoU in both directions, in percent, by group and name of the map."""

pytestmark = pytest.mark.skipif(not CASES.is_file(), reason="the benchmark's maps are not beside the project")


@cache
def cases() -> dict[str, Case]:
    return {f"{case.group}/{case.name}": case for case in load_cases(CASES)}


@pytest.mark.parametrize("name", IOU_SYM)
def test_a_real_map_is_segmented_as_well_as_it_was(name: str):
    """Not better either: who improves a map writes down its new figure."""
    found = evaluate_case(cases()[name], "rose2", Parameters()).scores.iou_sym
    assert found == pytest.approx(IOU_SYM[name], abs=MOST_DIFFERENCE)
