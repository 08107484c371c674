"""The Rerun recording, verified and read back by Rerun itself, and looked at in its viewer."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from http import HTTPStatus
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import rerun as rr
from commands import WAIT_S, wait_for
from looking import free_port, needs_vulkan
from saved_maps import save_run

from rose2_logs.config.run_options import RECORDING_LAYERS
from rose2_logs.drawing.sheet import legend
from rose2_logs.errors import OutputError
from rose2_logs.model.borders import UNSURE_BORDER_BELOW
from rose2_logs.model.room_names import TrackNames
from rose2_logs.outputs.rerun.blueprint import PLAY_S, make_blueprint
from rose2_logs.outputs.rerun.legend import (
    CURVES_WIDTH_EM,
    MAP_WIDTH_EM,
    curve_keys,
    legend_text,
    map_keys,
)
from rose2_logs.outputs.rerun.recording import _event_level
from rose2_logs.outputs.rerun.world import direction_name, room_label
from rose2_logs.system.text import percent
from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.tracked_snapshot import MAP_TRACK, RoomEvent
from rose2_logs.workflows.analyze import RunOptions, analyze_log

PROJECT = Path(__file__).parents[3]
BIN = Path(sys.executable).parent


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    options = RunOptions(max_snapshots=8, annotated_log=False)
    return analyze_log(PROJECT / "sample_logs" / "office.mcap", tmp_path_factory.mktemp("out"), options)


@pytest.fixture(scope="module")
def recording(result):
    (path,) = [file for file in result.files if file.suffix == ".rrd"]
    return path


def values(recording: Path, entity: str) -> dict[int, float]:
    """Scalars of an entity by snapshot."""
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(str(recording)).stream():
        batch = chunk.to_record_batch()
        if str(chunk.entity_path) == entity and {"snapshot", "Scalars:scalars"} <= set(batch.schema.names):
            assert {"coverage_percent", "message_log_time", "ros2_timestamp"} <= set(batch.schema.names)
            rows = zip(
                batch.column("snapshot").to_pylist(), batch.column("Scalars:scalars").to_pylist(), strict=True
            )
            found |= {number: value[0] for number, value in rows if value}
    return found


def test_rerun_finds_the_file_whole(recording):
    done = subprocess.run(
        [BIN / "rerun", "rrd", "verify", recording], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_viewer_that_still_loads_the_file_has_the_layout_already(recording):
    """It stands before the first map, and once more at the end, when all that is to be in view is known."""
    done = subprocess.run(
        [BIN / "rerun", "rrd", "print", recording], capture_output=True, text=True, check=True
    )
    first, *_, last = (each.start() for each in re.finditer(r"^ +Blueprint,$", done.stdout, re.MULTILINE))
    maps = [each.start() for each in re.finditer(r" - /world/map ", done.stdout)]
    assert first < maps[0] < maps[-1] < last


def test_the_logged_values_are_those_of_the_tables(result, recording):
    snapshots = pq.read_table(result.folder / "snapshots.parquet").to_pylist()
    coverage = values(recording, "/run/coverage")
    assert coverage == {row["snapshot"]: pytest.approx(100 * row["coverage"]) for row in snapshots}
    rooms = pq.read_table(result.folder / "rooms.parquet").to_pylist()
    track = rooms[-1]["track"]
    areas = {row["snapshot"]: row["area_m2"] for row in rooms if row["track"] == track}
    assert values(recording, f"/run/area/{track}") == pytest.approx(areas)


def test_how_right_the_layout_was_is_that_of_the_tables(result, recording):
    snapshots = pq.read_table(result.folder / "snapshots.parquet").to_pylist()
    for figure, unit in (("final_share", 100), ("final_iou", 100), ("variation_bits", 1)):
        told = {row["snapshot"]: unit * row[figure] for row in snapshots if row[figure] is not None}
        assert len(told) > 5
        assert values(recording, f"/run/{figure}") == pytest.approx(told)


def test_layers_that_were_not_asked_for_are_not_written(tmp_path):
    """And what was asked for is; map, rooms and doorways always."""
    from rerun.chunk import RrdReader

    layers = ("path", "lines")
    options = RunOptions(max_snapshots=2, annotated_log=False, layers=layers)
    done = analyze_log(PROJECT / "sample_logs" / "office.mcap", tmp_path, options)
    logged = {
        str(chunk.entity_path)
        for chunk in RrdReader(str(done.folder / "office.rrd")).stream()
        if "snapshot" in chunk.to_record_batch().schema.names
    }
    world = {path.split("/")[2] for path in logged if path.startswith("/world/")}
    assert world == {"map", "room_fills", "rooms", "doorways", "path", "robot", "lines"}
    assert not any(path.startswith("/spectrum") for path in logged)


def test_unsure_borders_are_named_in_their_layer(tmp_path):
    """At the greatest detail all borders that would be joined are there."""
    from rerun.chunk import RrdReader

    options = RunOptions(max_snapshots=2, annotated_log=False, layers=("borders",), detail=20.0)
    done = analyze_log(PROJECT / "sample_logs" / "office.mcap", tmp_path, options)
    borders = pq.read_table(done.folder / "borders.parquet").to_pylist()
    doors = pq.read_table(done.folder / "doorways.parquet").to_pylist()
    strength = {(each["snapshot"], each["track_a"], each["track_b"]): each["strength"] for each in borders}
    wanted = set()
    for door in doors:
        one, other = door["track_a"], door["track_b"]
        sure = strength[door["snapshot"], one, other]
        if sure < UNSURE_BORDER_BELOW:
            wanted.add(f"{one} | {other}: {percent(sure)}")
    named = set()
    for chunk in RrdReader(str(done.folder / "office.rrd")).stream():
        batch = chunk.to_record_batch()
        if str(chunk.entity_path).startswith("/world/borders/unsure/") and (
            "Points3D:labels" in batch.schema.names
        ):
            named |= {row[0] for row in batch.column("Points3D:labels").to_pylist() if row}
    assert named == wanted
    assert len(wanted) > 10


def test_a_run_that_fails_leaves_no_recording(tmp_path):
    from rose2_logs.config.parameters import Parameters
    from rose2_logs.outputs.rerun.recording import RerunRecording
    from rose2_logs.runs.sink import RunInfo, abandoned_on_error

    path = tmp_path / "run.rrd"
    info = RunInfo(save_run(tmp_path / "maps"), "/map", "rose2", Parameters(), {}, {})
    recording = RerunRecording(path)
    with pytest.raises(RuntimeError, match="stopped"), abandoned_on_error([recording]):  # noqa: PT012
        recording.begin(info)
        raise RuntimeError("stopped")
    assert [file.name for file in tmp_path.iterdir()] == ["maps"]


@needs_vulkan
def test_a_run_is_shown_in_the_viewer_that_is_open_and_stored_too(tmp_path, monkeypatch):
    from rerun.experimental import ViewerClient

    port = free_port()
    monkeypatch.setattr("rose2_logs.outputs.rerun.viewer.VIEWER_PORT", port)
    monkeypatch.setenv("PATH", f"{BIN}:/usr/bin:/bin")
    monkeypatch.setenv("HOME", str(tmp_path))
    with ViewerClient.spawn(headless=True, port=port, detach_process=False) as viewer:
        options = RunOptions(max_snapshots=3, annotated_log=False, live=True)
        log = PROJECT / "sample_logs" / "office.mcap"
        done = analyze_log(log, tmp_path / "out", options)
        wait_for(lambda: viewer.get_state().views)
    assert (done.folder / "office.rrd").stat().st_size > 0


@needs_vulkan
def test_a_viewer_that_is_closed_along_the_way_does_not_stop_the_run(tmp_path, monkeypatch):
    from rerun.experimental import ViewerClient

    port = free_port()
    monkeypatch.setattr("rose2_logs.outputs.rerun.viewer.VIEWER_PORT", port)
    monkeypatch.setenv("PATH", f"{BIN}:/usr/bin:/bin")
    monkeypatch.setenv("HOME", str(tmp_path))
    seen = []
    with ExitStack() as stack:
        stack.enter_context(ViewerClient.spawn(headless=True, port=port, detach_process=False))

        def close_after_two(step, share):
            seen.append(step.snapshot.index)
            if len(seen) == 2:
                stack.close()

        options = RunOptions(max_snapshots=4, annotated_log=False, live=True)
        log = PROJECT / "sample_logs" / "office.mcap"
        done = analyze_log(log, tmp_path / "out", options, close_after_two)
    assert seen == [0, 1, 2, 3]
    assert set(values(done.folder / "office.rrd", "/run/coverage")) == set(seen)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the viewer opens its window all the same")
def test_live_without_a_viewer_or_a_screen_says_what_to_do(tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    # A port of its own: the one of the viewers may be in use by another test.
    monkeypatch.setattr("rose2_logs.outputs.rerun.viewer.VIEWER_PORT", free_port())
    options = RunOptions(max_snapshots=1, annotated_log=False, live=True)
    with pytest.raises(OutputError, match="no Rerun viewer is open"):
        analyze_log(PROJECT / "sample_logs" / "office.mcap", tmp_path / "out", options)
    assert not list((tmp_path / "out").glob("*.rrd"))


@pytest.mark.skipif(sys.platform == "win32", reason="there only the command itself is ended")
def test_a_viewer_that_does_not_come_up_in_time_is_ended(monkeypatch):
    """With what it started: nothing is left behind."""
    from rose2_logs.outputs.rerun import viewer as rerun_viewer

    elsewhere = free_port()
    server = f"import socket, time; s = socket.create_server(('127.0.0.1', {elsewhere})); time.sleep(90)"
    start = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {server!r}])"
    monkeypatch.setattr(rerun_viewer, "RERUN", (sys.executable, "-c", start))
    monkeypatch.setattr(rerun_viewer, "VIEWER_START_S", 3.0)
    with pytest.raises(OutputError, match="no Rerun viewer is open"):
        rerun_viewer.open_viewer(free_port())
    wait_for(lambda: not rerun_viewer.listens(elsewhere))


def test_a_shift_of_the_map_is_told_in_metres_and_degrees():
    from rose2_logs.drawing.event_text import event_text

    motion = RigidMotion((3.0, 4.0), (0.204, -0.05), np.deg2rad(1.2))
    text = event_text(RoomEvent("shifted", 5, MAP_TRACK, motion=motion))
    assert text == "the map shifted by +0.20, -0.05 m and turned by +1.2°"


@pytest.mark.parametrize(
    ("kind", "others", "text"),
    [
        ("lost", (), "Kitchen lost"),
        ("split", (3, 4), "Kitchen split: now also Room 3, Room 4"),
        ("merged", (3,), "Kitchen merged with Room 3"),
        ("merged", (), "Kitchen merged"),
    ],
)
def test_events_call_rooms_by_their_names(kind: str, others: tuple[int, ...], text: str):
    from rose2_logs.drawing.event_text import event_text

    names = TrackNames()
    names.add((2,), ("Kitchen",))
    assert event_text(RoomEvent(kind, 5, 2, others), names) == text


def test_names_of_rooms_are_short_enough_for_their_place_in_the_view():
    """Number and area in one line; of a room that is small in the view the number; a sign if unsure."""
    assert room_label("7", 22.4, 40.0) == "7: 22 m²"
    assert room_label("Kitchen", 22.4, 40.0, unsure=True) == "Kitchen?: 22 m²"
    assert room_label("7", 22.4, 40.0, text="51%") == "7: 51%"
    assert room_label("7", 22.4, 100.0, unsure=True) == "7?"


@pytest.mark.parametrize(
    ("angle_deg", "name"),
    [(0.0, "0.0°"), (179.94, "179.9°"), (179.96, "0.0°"), (180.0, "0.0°"), (-0.01, "0.0°"), (-90.0, "90.0°")],
)
def test_directions_of_walls_are_below_half_a_turn(angle_deg: float, name: str):
    assert direction_name(np.deg2rad(angle_deg)) == f"walls at {name}"


def test_only_a_shift_of_the_whole_map_is_a_warning():
    """Rooms split, merge and go in any run."""
    levels = {kind: _event_level(RoomEvent(kind, 5, 1)) for kind in ("born", "split", "merged", "lost")}
    assert set(levels.values()) == {"INFO"}
    assert _event_level(RoomEvent("shifted", 5, MAP_TRACK)) == "WARN"


@pytest.mark.parametrize("layers", [(), ("predicted",), ("path",), RECORDING_LAYERS])
def test_the_legend_tells_of_what_the_recording_shows(layers):
    """No sign of a layer that is not there; the strips are one row each."""
    names = {key.text for key in map_keys(layers)}
    assert ("predicted" in names) == ("predicted" in layers)
    assert ("robot" in names) == ("path" in layers)
    text = legend_text(layers)
    assert ("hatched" in text) == ("predicted" in layers)
    assert ("**Spectrum**" in text) == ("spectrum" in layers)
    for keys, width_em in ((map_keys(layers), MAP_WIDTH_EM), (curve_keys(), CURVES_WIDTH_EM)):
        assert legend(keys, width_em, 1.0).height == legend(keys[:1], width_em, 1.0).height


def test_a_run_opens_on_its_last_map_and_plays_in_some_seconds():
    """Whatever coverage it begins with."""
    for first in (0, 28, 100):
        panel = make_blueprint(np.zeros(2), np.ones(2), first_percent=first).time_panel
        assert panel.play_state == "following"
        assert panel.timeline == "coverage_percent"
        assert (100 - first) / panel.fps <= PLAY_S
    assert (100 - 28) / make_blueprint(np.zeros(2), np.ones(2), first_percent=28).time_panel.fps == PLAY_S


def test_pages_that_are_served_at_the_same_time_have_ports_of_their_own(tmp_path):
    """Each finds the usual port free, and only one of them gets it."""
    from rose2_logs.outputs.rerun import viewer

    recording = tmp_path / "empty.rrd"
    with rr.RecordingStream("test") as stream:
        stream.save(recording)
    all_serve = threading.Barrier(3)

    def serve(_: int) -> str:
        with viewer.served_page(str(recording)) as (url, server):
            all_serve.wait(timeout=WAIT_S)
            assert server.poll() is None
            assert urllib.request.urlopen(url).status == HTTPStatus.OK
            all_serve.wait(timeout=WAIT_S)
            return url.partition("?")[0]

    with ThreadPoolExecutor(3) as pool:
        assert len(set(pool.map(serve, range(3)))) == 3
