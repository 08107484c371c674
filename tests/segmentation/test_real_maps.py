"""Rooms of real maps against those that people have drawn: figures stay what they were."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cv2
import pytest
from reader_logs import SHARED

from rose2_logs.config.parameters import Parameters
from rose2_logs.evaluation.benchmark import evaluate_case
from rose2_logs.evaluation.cases import Case, load_cases

CASES = SHARED / "benchmark" / "cases.json"
MOST_DIFFERENCE = 0.5
"""Percent that versions of libraries may move a map's figure."""
OTHER_OPENCV_DIFFERENCE = 3.0
"""The same for OpenCV 4, in which a few answers of the network are rounded otherwise than in 5."""
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
    "places/depot": 53.666,
}
"""Mean IoU in both directions, in percent, by group and name of the map, of rooms by walls."""
REGIONS = Path(__file__).parent / "regions"
LEFT_OUT: dict[str, float] = json.loads((REGIONS / "left_out.json").read_text("utf-8"))
"""The same of rooms by borders that were fitted without these buildings."""

pytestmark = pytest.mark.skipif(not CASES.is_file(), reason="the benchmark's maps are not beside the project")


@cache
def cases() -> dict[str, Case]:
    return {f"{case.group}/{case.name}": case for case in load_cases(CASES)}


@pytest.mark.parametrize("name", IOU_SYM)
def test_a_real_map_is_segmented_as_well_as_it_was(name: str):
    """Not better either: who improves a map writes down its new figure."""
    parameters = Parameters.from_any({"floor_plan.grouping": "walls"})
    found = evaluate_case(cases()[name], "rose2", parameters).scores.iou_sym
    assert found == pytest.approx(IOU_SYM[name], abs=MOST_DIFFERENCE)


@pytest.mark.parametrize("name", LEFT_OUT)
def test_a_real_map_is_segmented_as_well_by_what_never_saw_it(name: str, without_a_fold: None):
    """As on the accuracy page: the building was left out of all that was fitted."""
    found = evaluate_case(cases()[name], "rose2", Parameters()).scores.iou_sym
    most = MOST_DIFFERENCE if cv2.__version__ >= "5" else OTHER_OPENCV_DIFFERENCE
    assert found == pytest.approx(LEFT_OUT[name], abs=most)


@pytest.fixture(scope="module")
def without_a_fold() -> Iterator[None]:
    """What was fitted without the buildings of the second fold."""
    from fit_grouping.left_out_figures import fitted_from

    with fitted_from(REGIONS / "without_fold_1"):
        yield
