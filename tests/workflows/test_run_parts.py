"""A log in which the map is begun anew is one run in parts, each with its own coverage and tracks."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scan_logs
from reader_logs import SHARED, START_NS, Map, McapLog
from rerun.chunk import RrdReader
from rosbags.highlevel import AnyReader
from scan_logs import Move

import rose2_logs as rl
from rose2_logs.errors import ParameterError, ResultsError
from rose2_logs.outputs.report.overview import write_reports
from rose2_logs.outputs.report.page import write_report
from rose2_logs.runs.run import Run
from rose2_logs.runs.table_schemas import SCHEMAS
from rose2_logs.runs.tables import BACK_PROJECTED, TABLES

FIRST, SECOND = (60, 110, 170), (40, 90, 130, 150)


def two_rooms(columns: int, left: float = 0.0) -> Map:
    """Two rooms, of which so many columns are seen."""
    cells = np.full((100, 200), -1, np.int8)
    cells[9:91, 5:columns] = 100
    cells[10:90, 6:columns] = 0
    cells[10:90, 85] = np.where(np.abs(np.arange(10, 90) - 50) < 9, 0, 100) if columns > 85 else -1
    return Map(cells, origin=(left, 0.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("parts")
    log = McapLog(place / "run.mcap")
    for k, (columns, left) in enumerate([(each, 0.0) for each in FIRST] + [(each, 30.0) for each in SECOND]):
        log.add("/map", START_NS + k * 10**9, two_rooms(columns, left))
    return rl.analyze(log.close(), place / "run", back_project=True, layers=()).folder


def test_each_part_has_its_own_coverage_tracks_and_last_map(folder: Path):
    run = Run(folder)
    snapshots, tracks, events = (run.table(name).to_pylist() for name in ("snapshots", "tracks", "events"))
    assert [row["part"] for row in snapshots] == [1] * 3 + [2] * 4
    free = np.array([row["free_area_m2"] for row in snapshots])
    assert [row["coverage"] for row in snapshots] == pytest.approx([*free[:3] / free[2], *free[3:] / free[6]])
    begun = [row for row in events if row["kind"] == "part_begun"]
    assert [(row["snapshot"], row["part"], row["track"]) for row in begun] == [(3, 2, 0)]
    assert not [row for row in events if row["kind"] in ("lost", "shifted")]
    # Numbers go on: none is of both parts.
    assert [row["track"] for row in tracks] == list(range(1, len(tracks) + 1))
    for number, last in ((1, 2), (2, 6)):
        of_part = [row for row in tracks if row["part"] == number]
        assert {row["last_snapshot"] for row in of_part if row["in_last_map"]} == {last}
        assert sum(row["in_last_map"] for row in of_part) == snapshots[last]["rooms"] > 0
    assert [snapshots[last]["final_iou"] for last in (2, 6)] == pytest.approx([1, 1])


def test_every_table_says_the_part(folder: Path):
    run = Run(folder)
    for name in (*TABLES, BACK_PROJECTED):
        table = run.table(name)
        assert table.column_names == SCHEMAS[name].names
        key = "first_snapshot" if name == "tracks" else "snapshot"
        assert {(row[key] >= 3, row["part"]) for row in table.select([key, "part"]).to_pylist()} == {
            (False, 1),
            (True, 2),
        }


def test_points_name_rooms_of_the_last_part_and_tracks_those_of_any(folder: Path, tmp_path: Path, caplog):
    """Where the map was begun anew, a point is another place than it was before."""
    names = tmp_path / "names.csv"
    names.write_text("name,track,x,y\nHall,1,,\nOld,,2,2\nNew,,32,2\n")
    told = "no room has these names: 'Old'"

    def named(run: Run) -> set[tuple[int, str]]:
        parts = {row["track"]: row["part"] for row in run.table("tracks").to_pylist()}
        return {(parts[track], name) for track, name in run.names.items() if track in parts}

    stored = rl.analyze(
        folder.parent / "run.mcap", tmp_path / "run", names=str(names), layers=(), annotated_log=False
    )
    assert named(stored) == {(1, "Hall"), (2, "New")}
    assert [text for text in caplog.messages if "has these names" in text] == [f"{names}: {told}"]
    for part, expected in ((None, {(1, "Hall"), (2, "New")}), (2, {(2, "New")}), (1, {(1, "Hall")})):
        caplog.clear()
        run = Run(folder, part=part)
        run.rename(names)
        assert named(run) == expected
        assert ("'Hall'" in caplog.text, told in caplog.text) == (False, part != 1)


def test_a_part_taken_alone_is_what_an_analysis_of_it_finds(folder: Path, tmp_path: Path):
    whole = Run(folder)
    assert whole.parts == (1, 2)
    for number, more in ((1, 0), (2, len(Run(folder, part=1).tracks))):
        alone = rl.analyze(
            folder.parent / "run.mcap",
            tmp_path / f"{number}",
            part=number,
            recording=False,
            annotated_log=False,
        )
        part = Run(folder, part=number)
        assert part.summary["layout"].keys() == alone.summary["layout"].keys()
        for name in ("rooms_last", "tracks", "coverage_first", "brief_tracks", "snapshots"):
            assert part.summary["results"][name] == alone.summary["results"][name]
        for name in ("area_m2", "shape_right_coverage", "area_settled_coverage", "in_last_map", "part"):
            assert part.tracks[name].tolist() == alone.tracks[name].tolist()
        assert (part.tracks["track"] - more).tolist() == alone.tracks["track"].tolist()
        assert part[-1].coverage == 1
    for wrong in (3, "1"):
        with pytest.raises(ParameterError, match=f"no part {wrong!r}; it has 1, 2"):
            Run(folder, part=wrong)


def test_pictures_and_reports_are_of_the_last_part_unless_another_is_named(folder: Path, tmp_path: Path):
    run = Run(folder)
    assert run.at_coverage(0.01).number == 3
    assert run.at().number == 6
    assert rl.load(folder, part=1).at_coverage(0.01).number == 0
    page = write_report(folder, tmp_path / "last.html").read_text("utf-8")
    assert "2 of 2, maps 3 to 6" in page
    assert "the map was begun anew" in page
    assert "part 1 can have a report of its own" in page
    assert write_report(folder, part=1).name == "report_part_1.html"
    assert "1 of 2, maps 0 to 2" in (folder / "report_part_1.html").read_text("utf-8")
    with pytest.raises(ParameterError, match=r"no part 9; it has 1, 2"):
        write_report(folder, tmp_path / "none.html", part=9)
    (tmp_path / "many").mkdir()
    for name in "ab":
        (tmp_path / "many" / name).symlink_to(folder)
    with pytest.raises((ParameterError, ResultsError)):
        write_reports(tmp_path / "many", part=1)


def test_a_recording_shows_one_part_behind_the_other_along_coverage(folder: Path):
    coverage = Run(folder).columns["coverage"]
    batches = [
        chunk.to_record_batch()
        for chunk in RrdReader(str(folder / "run.rrd")).stream()
        if str(chunk.entity_path) == "/run/coverage"
    ]
    steps = [
        step
        for batch in batches
        if "coverage_percent" in batch.schema.names
        for step in batch["coverage_percent"].to_pylist()
    ]
    assert sorted(steps) == [int(100 * each) + 100 * (k > 2) for k, each in enumerate(coverage)]


def driven(path: Path, frame: str) -> Path:
    """The two parts with the robot's way, the second 30 m beside the first, in a frame 100 m off or not."""
    left = 30.0 if frame == "map" else 130.0
    log, store = McapLog(path), scan_logs.typestore(2)
    schema = (Move.kind, "ros2msg", store.generate_msgdef(Move.kind, ros_version=2)[0].encode())
    maps = [(each, 0.0, "map") for each in FIRST] + [(each, left, frame) for each in SECOND]
    for k, (columns, at, of) in enumerate(maps):
        for time_s in (k - 0.9, k - 0.6, k - 0.3):
            x = time_s + (1.0 if k < len(FIRST) else 31.0 - len(FIRST))
            moves = (
                Move(time_s, "map", "base_link", (x, 2.0, 0.0)),
                Move(time_s, "upstairs", "map", (100.0, 0.0, 0.0)),
            )
            for move in moves:
                data = bytes(store.serialize_cdr(scan_logs.made(move, 2), Move.kind))
                log.raw("/tf", START_NS + round(time_s * 1e9), schema, "cdr", data)
        log.add("/map", START_NS + k * 10**9, replace(two_rooms(columns, at), frame=of))
    return log.close()


@pytest.mark.parametrize("frame", ["map", "upstairs"])
def test_the_robots_path_is_of_each_part_in_the_frame_of_its_map(tmp_path: Path, frame: str):
    """In the annotated MCAP and in the recording: no map shows the path on a map that no longer is."""
    folder = rl.analyze(driven(tmp_path / "run.mcap", frame), tmp_path / "run", layers=("path",)).folder
    marked, recorded = [], {}
    with AnyReader([folder / "run.rose2.mcap"]) as log:
        of_markers = [each for each in log.connections if each.topic == "/rose2/markers"]
        for _, _, data in log.messages(of_markers):
            markers = log.deserialize(data, "visualization_msgs/msg/MarkerArray").markers
            path = [point.x for each in markers if each.ns == "path" for point in each.points]
            marked.append((markers[1].header.frame_id, min(path), max(path)))
    for chunk in RrdReader(str(folder / "run.rrd")).stream():
        batch = chunk.to_record_batch()
        assert str(chunk.entity_path) != "/world/path" or "snapshot" not in batch.schema.names
        if str(chunk.entity_path) == "/world/path_in_part" and "snapshot" in batch.schema.names:
            rows = zip(batch["snapshot"].to_pylist(), batch["LineStrips3D:strips"].to_pylist(), strict=True)
            recorded |= {number: np.concatenate(strips)[:, 0] for number, strips in rows}
    low = 30.1 if frame == "map" else 130.1
    expected = [("map", 0.1, k + 0.7) for k in range(3)] + [(frame, low, low + k + 0.6) for k in range(4)]
    assert [each[0] for each in marked] == [each[0] for each in expected]
    np.testing.assert_allclose([each[1:] for each in marked], [each[1:] for each in expected])
    assert sorted(recorded) == list(range(7))
    found = [(recorded[k].min(), recorded[k].max()) for k in range(7)]
    np.testing.assert_allclose(found, [each[1:] for each in expected], rtol=1e-6)


def test_a_log_in_one_piece_is_part_1_in_its_tables(tmp_path: Path):
    """So that the tables of many logs have the same columns, and none is lost where they are grouped."""
    log = McapLog(tmp_path / "run.mcap")
    for k, columns in enumerate(FIRST):
        log.add("/map", START_NS + k * 10**9, two_rooms(columns))
    run = rl.analyze(log.close(), back_project=True)
    assert run.parts == ()
    assert "parts" not in run.summary
    for name in (*TABLES, BACK_PROJECTED):
        assert set(run.table(name)["part"].to_pylist()) <= {1}
    whole = Run(run.folder, part=1)
    assert whole.part is None
    assert whole.tracks["track"].tolist() == run.tracks["track"].tolist()
    for wrong in (2, "1"):
        with pytest.raises(ParameterError, match=f"no part {wrong!r}; it has 1"):
            Run(run.folder, part=wrong)


def test_damaged_parts_of_a_summary_are_told(folder: Path, tmp_path: Path):
    summary = json.loads((folder / "summary.json").read_text("utf-8"))
    for damaged in ([{}], {"1": 2}, [{"part": "1", "results": {}, "layout": {}}]):
        (tmp_path / "summary.json").write_text(json.dumps(summary | {"parts": damaged}))
        with pytest.raises(ResultsError, match="its parts"):
            Run(tmp_path)


@pytest.mark.skipif(not (SHARED / "faults").is_dir(), reason="needs ../shared/faults")
@pytest.mark.parametrize(("name", "first"), [("reset_moved", 6), ("gazebo_reset", 4)])
def test_resets_as_users_have_them_lead_to_seven_rooms_in_the_last_part(name, first):
    run = rl.analyze(SHARED / "faults" / f"{name}.mcap")
    assert [each["results"]["snapshots"] for each in run.summary["parts"]] == [first, 6]
    assert run.summary["results"]["events"]["part_begun"] == 1
    last = Run(run.folder, part=2)
    assert last.summary["results"]["rooms_last"] == last.summary["results"]["tracks"] == 7
    assert last.columns["coverage"][0] == pytest.approx(0.108, abs=0.001)
