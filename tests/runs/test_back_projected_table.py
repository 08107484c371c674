"""`analyze --back-project` by the command line: the last map's rooms on all maps of a sample log."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from finished_runs import SAMPLE_LOGS


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("back_projected")
    arguments = ["analyze", SAMPLE_LOGS / "office.mcap", "-o", out, "--max-snapshots", 6]
    command = [sys.executable, "-m", "rose2_logs", *arguments, "--back-project", "--no-rrd", "--no-mcap"]
    subprocess.run(list(map(str, command)), check=True, capture_output=True)
    return out / "office"


def test_the_last_map_shows_its_own_rooms(folder: Path):
    back_projected = pq.read_table(folder / "back_projected.parquet").to_pandas()
    rooms = pq.read_table(folder / "rooms.parquet").to_pandas()
    last = back_projected[back_projected.snapshot == back_projected.snapshot.max()].set_index("track")
    expected = rooms[rooms.snapshot == rooms.snapshot.max()].set_index("track").area_m2
    assert set(last.index) == set(expected.index)
    # Small pieces, cut off by clutter, count to the room around them.
    assert np.allclose(last.area_m2[expected.index], expected, rtol=0.05)
    assert np.allclose(last.last_area_share, 1, atol=0.05)


def test_rooms_are_uncovered_as_the_run_goes_on(folder: Path):
    """Nearly every free cell of a map is in one of the last map's rooms, of which ever more are seen."""
    back_projected = pq.read_table(folder / "back_projected.parquet").to_pandas()
    snapshots = pq.read_table(folder / "snapshots.parquet").to_pandas().set_index("snapshot")
    seen = back_projected.groupby("snapshot").area_m2.sum()
    assert list(seen.index) == list(snapshots.index)
    assert len(seen) > 3
    assert np.allclose(seen, snapshots.free_area_m2, rtol=0.03)
    assert back_projected.groupby("snapshot").track.nunique().is_monotonic_increasing


def test_the_summary_names_the_table(folder: Path):
    assert "back_projected.parquet" in json.dumps(json.loads((folder / "summary.json").read_text()))


def test_without_the_option_there_is_none(office_results: Path):
    assert not list(office_results.rglob("back_projected.parquet"))
