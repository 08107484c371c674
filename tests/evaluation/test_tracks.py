"""Figures of tracks against hand-counted examples and against py-motmetrics."""

from __future__ import annotations

import motmetrics
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rose2_logs.evaluation.tracks import MATCH_IOU, TrackComparison, TrackScores

Frame = tuple[list[int], list[int], np.ndarray]


def compared(frames: list[Frame]) -> TrackScores:
    comparison = TrackComparison()
    for true_ids, ids, iou in frames:
        comparison.add(np.array(true_ids, int), np.array(ids, int), iou)
    return comparison.scores()


def one_room(*tracks: int | None) -> list[Frame]:
    """A true room 1 that is found under these tracks, map by map; None where it is missed."""
    return [([1], [] if track is None else [track], np.ones((1, int(track is not None)))) for track in tracks]


def test_a_room_found_under_one_number_is_right():
    """All figures at their best."""
    assert compared(one_room(7, 7, 7)) == TrackScores(100.0, 100.0, 100.0, 100.0, 0, 0, 1, 1)


def test_a_change_of_number_is_a_switch_and_costs_the_shorter_part():
    """Of four maps three are under the track that counts."""
    scores = compared(one_room(7, 7, 8, 7))
    assert (scores.id_switches, scores.fragmentations) == (2, 0)
    assert scores.idf1 == pytest.approx(75)
    assert scores.idf1_bound == pytest.approx(100)


def test_a_room_missed_for_some_maps_is_one_fragmentation():
    """Two maps without it in a row count once, and not at all at either end."""
    scores = compared(one_room(None, 7, None, None, 7, None))
    assert (scores.id_switches, scores.fragmentations) == (0, 1)
    assert (scores.idp, scores.idr) == pytest.approx((100, 100 * 2 / 6))
    assert scores.idf1 == scores.idf1_bound == pytest.approx(100 * 4 / 8)


def test_half_of_overlap_is_enough_and_less_is_not():
    """The gate of the MOTChallenge benchmarks."""
    assert compared([([1], [1], np.array([[MATCH_IOU]]))]).idf1 == 100
    assert compared([([1], [1], np.array([[0.49]]))]).idf1_bound == 0


def test_nothing_at_all_is_zero():
    """No division by zero."""
    assert compared([]) == compared([([], [], np.zeros((0, 0)))]) == TrackScores(0, 0, 0, 0, 0, 0, 0, 0)


@st.composite
def runs(draw: st.DrawFn) -> list[Frame]:
    frames = []
    for _ in range(draw(st.integers(1, 8))):
        true_ids = draw(st.lists(st.integers(1, 5), unique=True, max_size=4))
        ids = draw(st.lists(st.integers(1, 6), unique=True, max_size=4))
        rng = np.random.default_rng(draw(st.integers(0, 2**31)))
        # Ties are broken differently by different solvers, so there are none.
        frames.append((true_ids, ids, rng.uniform(0.2, 1.0, (len(true_ids), len(ids)))))
    return frames


@given(runs())
@settings(max_examples=60)
def test_the_figures_are_those_of_py_motmetrics(frames: list[Frame]):
    """Whatever overlaps whatever: identity figures, switches and fragmentations are the same."""
    accumulator = motmetrics.MOTAccumulator(auto_id=True)
    for true_ids, ids, iou in frames:
        accumulator.update(true_ids, ids, np.where(iou >= MATCH_IOU, 1 - iou, np.nan))
    names = ["idf1", "idp", "idr", "num_switches", "num_fragmentations"]
    theirs = motmetrics.metrics.create().compute(
        accumulator, metrics=[*names, "num_unique_objects"], return_dataframe=False
    )
    ours = compared(frames)
    assert (ours.id_switches, ours.fragmentations) == (
        theirs["num_switches"],
        theirs["num_fragmentations"],
    )
    assert ours.true_tracks == theirs["num_unique_objects"]
    for name in ("idf1", "idp", "idr"):
        assert getattr(ours, name) == pytest.approx(100 * np.nan_to_num(theirs[name]))
