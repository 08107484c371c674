"""The text that a recording opens with."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import shapely

from rose2_logs.config.parameters import Parameters
from rose2_logs.outputs.rerun.summary import summary_text
from rose2_logs.runs.history import RunSummary, RunTotals
from rose2_logs.runs.sink import RunInfo
from rose2_logs.tracking.convergence import Convergence
from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.track_history import SnapshotRef, TrackHistories, TrackHistory


def told(info: RunInfo, histories: TrackHistories, convergence: Convergence, maps: int) -> str:
    return summary_text(info, RunSummary(RunTotals(snapshots=maps), histories, convergence))


def test_the_summary_tells_rooms_and_since_when_they_were_right():
    first, last = SnapshotRef(0, 0.0, 0.25), SnapshotRef(9, 90.0, 1.0)
    histories = TrackHistories()
    histories.tracks = {
        1: TrackHistory(first, last, area_m2=20.04, polygon=shapely.box(0, 0, 5, 5), wall_support=0.9),
        2: TrackHistory(first, first),
    }
    histories.in_last_map, histories.last = (1,), last
    convergence = Convergence(
        area_settled={1: last},
        shape_right={1: SnapshotRef(3, 30.0, 0.5)},
        layout_final=SnapshotRef(7, 75.0, 0.8),
    )
    info = RunInfo(Path("a|b.mcap"), "/map", "rose2", Parameters(), {"tool": "1"}, {})
    text = told(info, histories, convergence, 10)
    assert text.startswith("### a/b.mcap\n")
    assert "**1 room** at the end, 2 over the run; 10 maps, 1 min 30 s." in text
    assert "**from 80 % coverage on** (1 min 15 s)" in text
    assert "| 1 | 20.0 | 25 % | 50 % | 100 % | 90 % |" in text
    assert "| version of tool | 1 |" in text
    summary = RunSummary(RunTotals(snapshots=10), histories, convergence)
    assert "| Sam's \\<den\\> | 20.0 |" in summary_text(info, summary, {1: "Sam's <den>"}.__getitem__)
    assert "known" not in text
    known = dataclasses.replace(convergence, known_final=SnapshotRef(2, 20.0, 0.4), brief=(2,))
    text = told(info, histories, known, 10)
    assert "2 over the run, 1 only briefly; 10 maps" in text
    assert "What was known of it was right **from 40 % coverage on** (20 s)." in text
    late = dataclasses.replace(convergence, layout_final=last)
    for never in (late, dataclasses.replace(convergence, layout_final=None)):
        assert "still changed up to the last map" in told(info, histories, never, 10)
    assert "**from 100 % coverage on**" in told(info, histories, late, 1)


def test_the_summary_names_unsure_rooms_and_the_largest_shift():
    """The least sure first, six at most by number; nothing of it where there is none."""
    first, last = SnapshotRef(0, 0.0, 0.25), SnapshotRef(9, 90.0, 1.0)
    histories = TrackHistories()
    histories.tracks = {
        track: TrackHistory(first, last, wall_support=share)
        for track, share in enumerate((0.9, 0.5, 0.31, 0.69, 0.7, 0.6, 0.6, 0.6, 0.6, None), start=1)
    }
    histories.in_last_map, histories.last = tuple(histories.tracks), last
    info = RunInfo(Path("a.mcap"), "/map", "rose2", Parameters(), {}, {})
    text = told(info, histories, Convergence(), 1)
    assert "room 3? (31 %), 2? (50 %), 6? (60 %), 7? (60 %), 8? (60 %), 9? (60 %) and 1 more." in text
    assert "1 map, 1 min" in text
    assert "shifted" not in text
    histories.shifts, histories.largest_shift = (
        2,
        (SnapshotRef(4, 40.0, 0.4), RigidMotion((0.0, 0.0), (0.3, -0.4), 0.02)),
    )
    text = told(info, histories, Convergence(), 10)
    assert "shifted** 2 times, most by 0.50 m and +1.1° at 40 % coverage" in text
    histories.in_last_map = (1,)
    assert "Unsure" not in told(info, histories, Convergence(), 10)
