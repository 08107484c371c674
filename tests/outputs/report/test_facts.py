"""What is worth a look is said in words."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import pytest
from drawn_plans import two_rooms_plan

from rose2_logs.outputs.report.facts import NOT_FINAL, notes, tiles
from rose2_logs.runs.run import Run


@pytest.fixture
def changed(office_results: Path, tmp_path: Path):
    """Results whose summary says something else."""

    def change(**parts) -> Run:
        folder = shutil.copytree(office_results, tmp_path / "changed", dirs_exist_ok=True)
        summary = json.loads((folder / "summary.json").read_text())
        for part, values in parts.items():
            summary[part] |= values
        (folder / "summary.json").write_text(json.dumps(summary))
        return Run(folder)

    return change


def told(results: Run, plan=None) -> str:
    return "\n".join(note.text for note in notes(results, plan or two_rooms_plan()))


def test_what_is_lost_is_said(changed):
    text = told(changed(results={"invalid_maps": 2}, messages={"damaged": 3, "skipped": 4, "messages": 9}))
    assert "2 maps could not be analyzed" in text
    assert "3 messages of the log were damaged" in text
    assert "4 of 9 map messages were skipped" in text


@pytest.mark.parametrize(
    ("final", "said", "on_tile"),
    [
        (None, "changed up to the last map", NOT_FINAL),
        ({"snapshot": 5, "time_s": 9.0, "coverage": 1.0}, "changed up to the last map", NOT_FINAL),
        ({"snapshot": 4, "time_s": 9.0, "coverage": 0.97}, "final only at 97% coverage", "97% coverage"),
        ({"snapshot": 2, "time_s": 9.0, "coverage": 0.6}, None, "60% coverage"),
    ],
)
def test_a_layout_that_came_late_is_said(changed, final, said, on_tile):
    results = changed(layout={"final_since": final})
    text = told(results)
    assert said is None or said in text
    assert ("layout" in text) == (said is not None)
    (tile,) = [tile for tile in tiles(results, two_rooms_plan()) if tile.name == "Layout final from"]
    assert tile.value == on_tile


@pytest.mark.parametrize("final", [None, {"snapshot": 4, "time_s": 9.0, "coverage": 0.97}])
def test_a_layout_that_came_late_though_what_was_known_was_right_is_said(changed, final):
    """It was seen late; where the known part was late, too, nothing is said for it."""
    early = {"snapshot": 2, "time_s": 9.0, "coverage": 0.6}
    results = changed(layout={"final_since": final, "known_final_since": early})
    assert "What was known of it was right from 60% coverage on" in told(results)
    (tile,) = [tile for tile in tiles(results, two_rooms_plan()) if tile.name == "Known part final from"]
    assert tile.value == "60% coverage"
    for late in (None, early | {"coverage": 0.96}, early | {"snapshot": 5}):
        assert "known of it" not in told(changed(layout={"final_since": final, "known_final_since": late}))


def test_tracks_that_were_soon_gone_are_counted_apart(changed):
    """Nothing is said of none."""
    for brief, said in ((2, "19 followed over the run, 2 only briefly"), (0, "19 followed over the run")):
        results = changed(results={"brief_tracks": brief})
        (tile,) = [tile for tile in tiles(results, two_rooms_plan()) if tile.name == "Rooms at the end"]
        assert tile.more == said


def test_rooms_that_are_unsure_or_unseen_are_named(changed):
    """Also one without any wall; the right room was half seen, the left one wholly."""
    plan = two_rooms_plan()
    bare = dataclasses.replace(plan.rooms[0], wall_support=0.0, frontier_m=0.5)
    text = told(changed(), dataclasses.replace(plan, rooms=(bare, plan.rooms[1])))
    assert "unsure (?): Room 3 (0%)." in text
    assert "open frontier, not explored to the end: Room 120 (3.0 m)." in text
    assert "never seen (predicted, or behind furniture): Room 120 (50%)." in text


def test_shifts_of_the_map_are_said(tmp_path: Path, changed):
    """The largest of them, where it was."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    results = changed()
    path = results.folder / "events.parquet"
    events = pq.read_table(path)
    rows = events.slice(0, 2).to_pylist()
    for row, shift_m, snapshot in zip(rows, (0.3, 0.5), (1, 3), strict=True):
        row |= {"kind": "shifted", "track": 0, "snapshot": snapshot, "shift_x_m": 0.0, "shift_y_m": shift_m}
        row |= {"turn_rad": 0.01}
    pq.write_table(pa.Table.from_pylist(rows, events.schema), path)
    assert "shifted 2 times, most by 0.50 m at map 3" in told(results)
    pq.write_table(pa.Table.from_pylist(rows[:1], events.schema), path)
    assert "shifted once, by 0.30 m at map 1" in told(results)
