"""A figure of back-projected rooms, made from the results alone, shows what their table tells."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from finished_runs import SAMPLE_LOGS, run_of

from rose2_logs.runs.run import Run
from rose2_logs.workflows.figure import write_figure


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("back_projected") / "office"
    return Run(run_of(SAMPLE_LOGS / "office.mcap", folder, back_project=True))


def test_the_rooms_are_those_of_the_table(run: Run):
    """And so are the cells of the map, by the tracks."""
    table = pd.read_parquet(run.folder / "back_projected.parquet")
    for snapshot in (0, 2, 5):
        plan = run[snapshot].plan(back_projected=True)
        told = table[table.snapshot == snapshot].set_index("track").area_m2.to_dict()
        assert {room.number: room.area_m2 for room in plan.rooms} == pytest.approx(told)
        cells = np.bincount(plan.map.labels.ravel())
        assert {track: cells[track] * 0.05**2 for track in told} == pytest.approx(told)


def test_shapes_are_those_of_the_last_map(run: Run):
    first, last = run[0].plan(back_projected=True), run[5].plan()
    shapes = {room.number: room.shape for room in last.rooms}
    assert 0 < len(first.rooms) < len(last.rooms)
    assert all(room.shape.equals_exact(shapes[room.number], 1e-9) for room in first.rooms)
    numbers = {room.number for room in first.rooms}
    assert {door.rooms for door in first.doorways} == {
        door.rooms for door in last.doorways if set(door.rooms) <= numbers
    }


def test_the_command_draws_it_under_a_name_of_its_own(run: Run, tmp_path: Path):
    command = [sys.executable, "-m", "rose2_logs", "figure", str(run.folder)]
    subprocess.run([*command, "--snapshot", "2", "--back-projected"], check=True, capture_output=True)
    plain = write_figure(run.folder, tmp_path / "plain.png", 2)
    picture = run.folder / "office.snapshot2.back_projected.figure.png"
    assert picture.read_bytes() != plain.read_bytes()
    again = write_figure(run.folder, tmp_path / "again.png", 2, back_projected=True)
    assert picture.read_bytes() == again.read_bytes()
