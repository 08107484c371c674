"""The Parquet tables say what was given to them, document themselves, and are whole or absent."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from drawn_rooms import drawn, rows

from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.errors import OutputError
from rose2_logs.model.borders import Border
from rose2_logs.model.rooms import Doorway
from rose2_logs.runs import parquet_table
from rose2_logs.runs.history import RunHistory
from rose2_logs.runs.store import RunStore
from rose2_logs.runs.tables import TABLES
from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.tracked_snapshot import MAP_TRACK, RoomEvent, TrackedSnapshot
from rose2_logs.tracking.tracker import RoomTracker


def steps() -> list[TrackedSnapshot]:
    """Three maps: two rooms with a door, one lost, and back with swapped labels."""
    door = Doorway((1, 2), np.array([[2.0, 0.0], [2.0, 0.9]]))
    tracker = RoomTracker(TrackingParameters())
    result = []
    for index, (labels, doors) in enumerate([("1122", (door,)), ("11..", ()), ("2211", (door,))]):
        snapshot, analysis = drawn(rows(labels, labels), index, doorways=doors)
        ids, events = tracker.update(snapshot, analysis)
        result.append(TrackedSnapshot(snapshot, analysis, analysis.free_area_m2 / 8, ids, events))
    return result


def store_run(folder: Path, written: Iterable[TrackedSnapshot]) -> None:
    history = RunHistory(Parameters())
    with RunStore(folder, OccupancyParameters()) as store:
        for step in written:
            history.add(step)
            store.write(step, history)
        store.finish(history)


def write(folder: Path) -> dict[str, list[dict]]:
    store_run(folder, steps())
    return {name: pq.read_table(folder / f"{name}.parquet").to_pylist() for name in TABLES}


def test_snapshots_have_one_row_a_map(tmp_path: Path):
    """Times, coverage and sums are those of the run."""
    table = write(tmp_path)["snapshots"]
    assert [row["snapshot"] for row in table] == [0, 1, 2]
    assert [row["time_s"] for row in table] == [0.0, 1.0, 2.0]
    assert [row["coverage"] for row in table] == [1.0, 0.5, 1.0]
    assert [row["rooms_area_m2"] for row in table] == [8.0, 4.0, 8.0]
    assert [row["doorways"] for row in table] == [1, 0, 1]


def test_rooms_are_told_by_track_with_their_shape_in_the_world(tmp_path: Path):
    """Rows are ordered by track; polygon, label point and neighbors belong to the track, not the label."""
    table = write(tmp_path)["rooms"]
    assert [(row["snapshot"], row["track"], row["room"]) for row in table] == [
        (0, 1, 1),
        (0, 2, 2),
        (1, 1, 1),
        (2, 1, 2),
        (2, 2, 1),
    ]
    last = table[-1]
    polygon = shapely.from_wkb(last["polygon_wkb"])
    assert polygon.equals(shapely.box(2, 0, 4, 2))
    assert polygon.contains(shapely.Point(last["label_x_m"], last["label_y_m"]))
    assert last["neighbors"] == [1]
    assert last["area_m2"] == last["predicted_area_m2"] == 4.0


def test_events_are_one_flat_table(tmp_path: Path):
    """Every event of every map, with the other tracks that it concerns."""
    told = [(row["snapshot"], row["kind"], row["track"]) for row in write(tmp_path)["events"]]
    assert told == [
        (0, "born", 1),
        (0, "born", 2),
        (1, "continued", 1),
        (1, "lost", 2),
        (2, "continued", 1),
        (2, "returned", 2),
    ]


def test_doorways_name_the_tracks_on_both_sides(tmp_path: Path):
    """The smaller track first, whatever the labels."""
    table = write(tmp_path)["doorways"]
    assert [(row["snapshot"], row["track_a"], row["track_b"]) for row in table] == [(0, 1, 2), (2, 1, 2)]
    assert table[0]["width_m"] == pytest.approx(0.9)


def test_borders_name_the_tracks_on_both_sides_and_come_back_as_they_were(tmp_path: Path):
    """One row per pair of neighbors and map, by track, whatever the labels; a plan has them again."""
    border = Border((1, 2), "door", 0.9, 0.61)
    first, second, third = steps()
    with_border = [
        dataclasses.replace(step, analysis=dataclasses.replace(step.analysis, borders=(border,)))
        for step in (first, third)
    ]
    store_run(tmp_path, [with_border[0], second, with_border[1]])
    told = pq.read_table(tmp_path / "borders.parquet").to_pylist()
    assert [(row["snapshot"], row["log_time_ns"]) for row in told] == [(0, 10**9), (2, 3 * 10**9)]
    for row in told:
        assert (row["track_a"], row["track_b"], row["kind"]) == (1, 2, "door")
        assert (row["width_m"], row["strength"]) == (0.9, 0.61)


def test_what_was_left_out_stands_with_each_map(tmp_path: Path):
    """And the last map's in the totals."""
    history = RunHistory(Parameters())
    left_out = [
        dataclasses.replace(step, analysis=dataclasses.replace(step.analysis, outside_m2=outside_m2))
        for step, outside_m2 in zip(steps(), (3.5, 0.0, 1.25), strict=True)
    ]
    store_run(tmp_path, left_out)
    for step in left_out:
        history.add(step)
    assert pq.read_table(tmp_path / "snapshots.parquet")["outside_m2"].to_pylist() == [3.5, 0.0, 1.25]
    assert (history.totals.outside_m2_last, history.totals.free_m2_last) == (1.25, 8.0)


def test_tracks_have_one_row_a_room_over_the_run(tmp_path: Path):
    """First, last, since when it was right, how often it was lost, and its last shape."""
    one, two = write(tmp_path)["tracks"]
    assert [(row["track"], row["maps"], row["losses"], row["in_last_map"]) for row in (one, two)] == [
        (1, 3, 0, True),
        (2, 2, 1, True),
    ]
    assert (two["first_snapshot"], two["last_snapshot"], two["last_time_s"]) == (0, 2, 2.0)
    assert (two["area_settled_snapshot"], two["shape_right_coverage"]) == (0, 1.0)
    assert shapely.from_wkb(two["polygon_wkb"]).equals(shapely.box(2, 0, 4, 2))
    # These steps carry no evidence: not measured is not zero.
    assert one["wall_support"] is None


def test_snapshots_are_compared_with_the_last_one(tmp_path: Path):
    """Half of the last layout is missing in the second map; what was not measured is null."""
    table = write(tmp_path)["snapshots"]
    assert [row["final_iou"] for row in table] == [1.0, 0.5, 1.0]
    assert [row["final_share"] for row in table] == [1.0, 0.5, 1.0]
    assert [row["known_final_share"] for row in table] == [1.0, 1.0, 1.0]
    assert [row["variation_bits"] for row in table] == [None] * 3


def test_a_shift_of_the_map_is_an_event_of_no_track(tmp_path: Path):
    """How far it moved and turned; other events have no motion."""
    step = steps()[0]
    shift = RoomEvent("shifted", 0, MAP_TRACK, motion=RigidMotion((9.0, 9.0), (0.5, -0.25), 0.01))
    store_run(tmp_path, [dataclasses.replace(step, events=(shift, *step.events))])
    first, *others = pq.read_table(tmp_path / "events.parquet").to_pylist()
    assert (first["kind"], first["track"]) == ("shifted", 0)
    assert (first["shift_x_m"], first["shift_y_m"], first["turn_rad"]) == (0.5, -0.25, 0.01)
    assert {row["shift_x_m"] for row in others} == {None}


def test_every_column_says_what_it_is(tmp_path: Path):
    """Each field has a description, and GeoParquet's metadata names the polygons."""
    write(tmp_path)
    for name in TABLES:
        for field in pq.read_schema(tmp_path / f"{name}.parquet"):
            assert field.metadata[b"description"], field.name
    for name in ("rooms", "tracks"):
        schema = pq.read_schema(tmp_path / f"{name}.parquet")
        assert json.loads(schema.metadata[b"geo"])["primary_column"] in schema.names


def test_row_groups_are_written_along_the_way_and_twice_the_same(tmp_path: Path, monkeypatch):
    """Memory does not grow: rows leave in groups. The same run gives the same bytes."""
    monkeypatch.setattr(parquet_table, "ROWS_PER_GROUP", 2)
    monkeypatch.setattr(parquet_table, "ROWS_PER_BATCH", 1)
    write(tmp_path / "a")
    write(tmp_path / "b")
    assert pq.ParquetFile(tmp_path / "a" / "events.parquet").num_row_groups == 3
    for name in TABLES:
        first, second = ((tmp_path / run / f"{name}.parquet").read_bytes() for run in "ab")
        assert first == second


def test_a_run_that_breaks_off_leaves_nothing(tmp_path: Path):
    """Neither half tables nor parts of files remain, and earlier results stay."""
    (tmp_path / "rooms.parquet").write_text("earlier")

    def broken_off():
        yield steps()[0]
        raise RuntimeError("broken off")

    with pytest.raises(RuntimeError, match="broken off"):
        store_run(tmp_path, broken_off())
    assert [path.name for path in tmp_path.iterdir()] == ["rooms.parquet"]
    assert (tmp_path / "rooms.parquet").read_text() == "earlier"


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path):
    """A file where the folder should be is one clear line."""
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"file/snapshots.*\.parquet"):
        store_run(tmp_path / "file", [])
