"""Figures against hand-counted examples, their invariances, and an independent implementation."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.evaluation.cases import load_cases
from rose2_logs.evaluation.scores import FIGURES, Scores, mean_scores, score, score_against

BENCHMARK = Path(__file__).parents[3] / "shared" / "benchmark"

label_arrays = hnp.arrays(np.int32, (6, 7), elements=st.integers(0, 4))


def test_two_true_rooms_merged_into_one():
    """Merging keeps iou_seg high and halves iou_gt: counted by hand."""
    truth = np.array([[1, 1, 1, 2]])
    scores = score(truth, np.array([[7, 7, 7, 7]]))
    assert scores.precision == pytest.approx(75)
    assert scores.recall == pytest.approx(100)
    assert scores.iou_seg == pytest.approx(75)
    assert scores.iou_gt == pytest.approx(100 * (3 / 4 + 1 / 4) / 2)
    assert scores.iou_sym == pytest.approx((75 + 50) / 2)
    assert scores.pq == pytest.approx(100 * 0.75 / 1.5)
    assert (scores.rooms_seg, scores.rooms_gt) == (1, 2)


def test_exactly_one_half_is_no_match():
    """A pair whose intersection over union is one half does not count for panoptic quality."""
    assert score(np.array([[1, 1]]), np.array([[1, 0]])).pq == 0


@pytest.mark.parametrize("empty", ["truth", "segmented"])
def test_a_map_without_rooms_scores_zero(empty: str):
    """No rooms on one side gives zeros, not a division by zero."""
    some, none = np.ones((2, 2), int), np.zeros((2, 2), int)
    scores = score(none, some) if empty == "truth" else score(some, none)
    assert all(getattr(scores, name) == 0 for name in FIGURES)


def test_different_shapes_are_refused_with_both_shapes():
    """A wrongly sized prediction must not be broadcast."""
    with pytest.raises(ValueError, match=r"\(2, 2\) and \(3, 2\)"):
        score(np.ones((3, 2), int), np.ones((2, 2), int))


@given(label_arrays, label_arrays, st.permutations(range(1, 5)))
@settings(max_examples=50)
def test_figures_do_not_depend_on_numbers_and_mirror_each_other(truth, segmented, numbers):
    """Renumbering rooms changes nothing; swapping the two maps swaps precision/recall and iou_seg/iou_gt.

    Renumbering may change which of two partners with equal overlap is taken, so only figures without ties
    are compared there: panoptic quality needs no partner.
    """
    scores, swapped = score(truth, segmented), score(segmented, truth)
    assert scores.precision == pytest.approx(swapped.recall)
    assert scores.iou_seg == pytest.approx(swapped.iou_gt)
    assert scores.iou_sym == pytest.approx(swapped.iou_sym)
    renumber_in_place = np.array([0, *(n * 1000 for n in numbers)])[segmented]
    assert score(truth, renumber_in_place).pq == pytest.approx(scores.pq)
    assert score(truth, renumber_in_place).precision == pytest.approx(scores.precision)


@given(label_arrays)
@settings(max_examples=25)
def test_the_truth_itself_scores_100(truth):
    """A perfect segmentation reaches 100 in every figure."""
    truth[0, 0] = 1
    assert all(getattr(score(truth, truth), name) == pytest.approx(100) for name in FIGURES)


def test_the_better_of_two_truths_counts_and_of_equal_ones_the_first():
    """By iou_sym, even where a figure of the other one is higher."""
    found = np.array([[1, 1, 2, 2, 0, 0]])
    merged, near = np.array([[1, 1, 1, 1, 0, 0]]), np.array([[1, 1, 2, 2, 2, 2]])
    name, scores = score_against({"merged": merged, "near": near}, found)
    assert (name, scores) == ("near", score(near, found))
    assert score(merged, found).precision == score(near, found).precision == 100
    assert score(merged, found).iou_sym == 50
    assert score_against({"a": near, "b": near}, found)[0] == "a"
    none = np.zeros((1, 6), int)
    assert score_against({"a": near, "b": near}, none)[0] == "a"


def test_means_count_each_map_once():
    """The mean over maps is not weighted by rooms."""
    mean = mean_scores([Scores(0, 0, 0, 0, 0, 0, 1, 1), Scores(100, 100, 100, 100, 100, 100, 99, 9)])
    assert all(getattr(mean, name) == 50 for name in FIGURES)


@pytest.mark.skipif(not BENCHMARK.exists(), reason="the benchmark is not beside the project")
def test_figures_agree_with_the_benchmark_scorer(tmp_path: Path):
    """On the benchmark's own truths, shifted and merged, every figure equals its scorer's to 0.01."""
    cases = load_cases(BENCHMARK / "cases.json", "incremental_fr79")
    ours = {}
    for number, case in enumerate(cases):
        truth = case.truth()
        wrong = np.roll(np.where(truth % 3 == number % 3, truth, truth // 2), (4 + number, 7), (0, 1))
        write_label_image(tmp_path / case.group / f"{case.name}.png", wrong)
        ours[case.name] = score(truth, wrong)
    report = tmp_path / "report.json"
    subprocess.run(
        [sys.executable, BENCHMARK / "score.py", tmp_path, "--group", "incremental_fr79", "--json", report],
        check=True,
        capture_output=True,
    )
    theirs = json.loads(report.read_text())
    for row in theirs["maps"]:
        for name in FIGURES:
            assert getattr(ours[row["name"]], name) == pytest.approx(row[name], abs=0.01)
    mean = mean_scores(ours.values())
    for name in FIGURES:
        assert getattr(mean, name) == pytest.approx(theirs["groups"]["incremental_fr79"][name], abs=0.01)


@pytest.mark.skipif(not BENCHMARK.exists(), reason="the benchmark is not beside the project")
@pytest.mark.parametrize("group", ["homes", "places"])
def test_maps_with_two_truths_agree_with_the_benchmark_scorer(tmp_path: Path, group: str):
    """What one truth or the other says, with a strip lost: each counts on some maps, as the scorer has it."""
    ours = {}
    for number, case in enumerate(load_cases(BENCHMARK / "cases.json", group)):
        truths = case.truths()
        found = list(truths.values())[number % len(truths)].copy()
        found[:, : found.shape[1] // 2] *= found[:, : found.shape[1] // 2] % 5 > 0
        write_label_image(tmp_path / group / f"{case.name}.png", found)
        ours[case.name] = score_against(truths, found)
    report = tmp_path / "report.json"
    command = [sys.executable, BENCHMARK / "score.py", tmp_path, "--group", group, "--json", report]
    subprocess.run(command, check=True, capture_output=True)
    assert {name for name, _ in ours.values()} == {"rooms", "rooms_other"}
    for row in json.loads(report.read_text())["maps"]:
        _, scores = ours[row["name"]]
        for name in FIGURES:
            assert getattr(scores, name) == pytest.approx(row[name], abs=0.05)
        assert scores.rooms_gt == row["rooms_gt"]
