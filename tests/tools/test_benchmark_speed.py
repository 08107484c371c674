"""The benchmark of speed on a tiny log and tiny maps, and what it measures with."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from saved_maps import FREE, RESOLUTION_M, WALL, two_rooms

from rose2_logs.errors import Rose2LogsError
from rose2_logs.io import open_log

PROJECT = Path(__file__).parents[2]
needs_proc = pytest.mark.skipif(
    not Path("/proc/self/clear_refs").exists(), reason="the system does not tell what a process holds"
)


def cells() -> np.ndarray:
    image = two_rooms()
    return np.select([image == WALL, image == FREE], [100, 0], -1).astype(np.int8)


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    from benchmarking.scaling import write_growing_log

    path = tmp_path_factory.mktemp("growing") / "growing.mcap"
    write_growing_log(path, cells(), RESOLUTION_M, 3)
    return path


def test_a_growing_log_uncovers_the_map(log: Path):
    """Each map holds the one before and more; the last one is whole."""
    with open_log(log) as reader:
        maps = [snapshot.cells for snapshot in reader.snapshots()]
    assert len(maps) == 3
    np.testing.assert_array_equal(maps[-1], cells())
    for before, now in pairwise(maps):
        known = before >= 0
        np.testing.assert_array_equal(before[known], now[known])
        assert np.count_nonzero(now >= 0) > np.count_nonzero(known)


def test_everything_is_measured_and_reported(log: Path, tmp_path: Path):
    """The real thing with the least of all; the commands on logs are run by a test of their own."""
    from benchmarking.scaling import LogTimes
    from benchmarking.speed import Amount, SpeedOptions, measure_speed
    from benchmarking.speed_report import write_speed_report
    from test_benchmark import write_cases

    options = SpeedOptions(
        cases=(write_cases(tmp_path / "cases"),),
        logs=(log,),
        amount=Amount(1, 1, 1, (1, 4), (), 4_000_000, 100_000_000, 3, 1),
        skip=frozenset({"logs"}),
        against=PROJECT,
    )
    speed = measure_speed(options)
    (beside,) = speed.against.maps
    assert beside.group == "incremental_drawn"
    assert min(beside.other_s, *beside.ours_s.values()) > 0
    assert [times.group for times in speed.maps] == ["incremental_drawn", "logs"]
    for times in speed.maps:
        assert times.rooms == 2
        assert 0 < times.explored_cells <= times.cells
        assert 0 < sum(times.stages_s.values()) < 1.5 * times.analysis_s
        assert 0 < times.floor_s < times.analysis_s
        assert all(seconds > 0 for seconds in times.methods_s.values())
    assert [row.copies for row in speed.tiles] == [1, 4]
    assert speed.tiles[1].explored_cells == 4 * speed.tiles[0].explored_cells
    (costs,) = speed.outputs
    assert costs.maps == 3
    assert set(costs.sinks_s) == {"tables", "recording", "annotated log"}
    assert speed.copy.size_bytes > 3_000_000
    assert [row.command for row in speed.starts] == ["--help", "info growing.mcap"]
    assert speed.look.size_bytes > 99_000_000

    logs = (
        LogTimes(100, 1, 50.0, 48.0, 500_000_000, 4_000_000, 20_000_000),
        LogTimes(100, 2, 27.5, 51.0, 900_000_000, 4_000_000, 20_000_000),
    )
    speed = dataclasses.replace(speed, logs=logs, side_by_side=1.95)
    report = write_speed_report(speed, tmp_path / "out")
    text = report.read_text()
    assert "| 100 | 1 | 50.0 | 48.0 | 2.00 |  | 500 | 4.0 | 200 |" in text
    assert "| 100 | 2 | 27.5 | 51.0 | 3.64 | 1.82 (1.88) | 900 | 4.0 | 200 |" in text
    assert "side by side gain 1.95" in text
    for heading in (
        "Each map",
        "laid out",
        "Logs of maps",
        "Outputs",
        "annotated log",
        "Starting",
        "All maps",
    ):
        assert heading in text
    assert json.loads((tmp_path / "out" / "speed.json").read_text())["tiles"][1]["copies"] == 4
    assert (tmp_path / "out" / "speed.png").stat().st_size > 0


def test_a_log_is_analyzed_as_a_user_does(log: Path, tmp_path: Path):
    """Two worker processes beside the main one; what went wrong is told."""
    from benchmarking.scaling import time_log

    times = time_log(log, 3, 2, tmp_path / "out")
    assert times.recording_bytes > 0
    assert times.cpu_s > 0
    assert times.peak_bytes is None or times.peak_bytes > 300_000_000
    assert (tmp_path / "out" / "growing" / "summary.json").exists()
    with pytest.raises(Rose2LogsError, match=r"no\.mcap: analyze failed: .*no such file"):
        time_log(tmp_path / "no.mcap", 1, 1, tmp_path / "out")


def test_the_command_writes_a_report_of_what_is_left(tmp_path: Path):
    """With every part left out only the facts of machine and versions remain."""
    command = [sys.executable, PROJECT / "tools" / "benchmark.py", "speed", "--quick", "-o", tmp_path]
    command += ["--skip", "maps", "tiles", "logs", "outputs"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, str(tmp_path / "speed.md")), done.stderr
    text = (tmp_path / "speed.md").read_text()
    assert "numpy" in text
    assert "##" not in text
    assert "cores" in json.loads((tmp_path / "speed.json").read_text())["machine"]


@needs_proc
def test_peak_memory_is_that_of_the_call():
    """An array that comes and goes within a call is counted, one that was there before is not."""
    from benchmarking.gauges import peak_memory

    held = np.ones(4_000_000)
    peak = peak_memory(lambda: float(np.ones(8_000_000).sum() + held.sum()))
    assert peak == pytest.approx(64e6, rel=0.1)


@needs_proc
def test_bytes_read_are_those_of_the_call(tmp_path: Path):
    from benchmarking.gauges import bytes_read

    file = tmp_path / "file"
    file.write_bytes(bytes(1_000_000))
    assert bytes_read(file.read_bytes) == pytest.approx(1_000_000, rel=0.05)


@needs_proc
def test_memory_and_time_of_a_process_count_those_below_it():
    """A process that starts another, which starts one that holds 100 MB and works for a second."""
    from benchmarking.gauges import ProcessTree

    command = (
        "import time; held = bytearray(100_000_000)\nwhile time.process_time() < 1: pass\ntime.sleep(0.5)"
    )
    for _ in range(2):
        command = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {command!r}])"
    with subprocess.Popen([sys.executable, "-c", command]) as process:
        tree = ProcessTree(process.pid)
        process.wait()
    use = tree.stop()
    assert use.peak_bytes is not None
    assert 100e6 < use.peak_bytes < 200e6
    assert 0.9 < use.cpu_s < 2


def test_maps_of_a_group_are_spread_evenly():
    from benchmarking.map_times import MapToTime
    from benchmarking.robustness import sampled

    maps = [MapToTime(group, str(k), lambda: None) for group in "ab" for k in range(5)]
    assert [map_.name for map_ in sampled(maps, 3)] == ["0", "2", "4"] * 2
    assert len(sampled(maps, None)) == 10


def test_tiles_repeat_the_map():
    from benchmarking.scaling import tiled

    laid = tiled(cells(), 9, RESOLUTION_M)
    assert laid.cells.shape == (360, 720)
    np.testing.assert_array_equal(laid.cells[120:240, 480:], cells())


def test_the_floor_takes_any_map():
    from benchmarking.map_times import floor

    floor(cells() == 100)
    floor(np.zeros((1, 1), bool))
