"""Whole runs over faulty logs: tables, summary and an annotated MCAP that others can read."""

from __future__ import annotations

import json
from collections import Counter

import pyarrow.parquet as pq
import pytest
from fault_table import make
from faulty_logs import COUNT, INPUTS
from mcap.reader import make_reader

from rose2_logs.errors import InvalidMapError
from rose2_logs.workflows.analyze import RunOptions, analyze_log

CASES = [
    # table, fault, kind of log, maps that are analyzed, messages of the log in the annotated MCAP
    ("messages", "resolution NaN", "MCAP, zstd", 4, 10),
    ("messages", "upside down", "ROS 1 bag", 4, 10),
    ("messages", "cells out of range", "ROS 2, sqlite3", 5, 10),
    ("messages", "frame changes", "MCAP, zstd", 5, 10),
    ("messages", "log times all zero", "MCAP, no index", 5, 10),
    ("messages", "clock set back", "ROS 1 bag", 5, 10),
    ("messages", "maps of 1 x 1", "MCAP, zstd", 3, 3),
    ("messages", "all maps unknown", "ROS 2, sqlite3", 3, 3),
    ("messages", "all maps occupied", "MCAP, zstd", 3, 3),
    ("messages", "definition is no definition", "ROS 1 bag", 5, 10),
    ("messages", "definition is no definition", "ROS 2, sqlite3", 5, 10),
    ("files", "cut at 60 %", "MCAP, zstd", 3, 6),
    ("files", "cut at 60 %", "ROS 1 bag, bz2", 3, 6),
    ("files", "cut before the index", "MCAP, lz4", 5, 10),
    ("files", "cut in the index", "ROS 1 bag", 5, 10),
    ("files", "no metadata.yaml", "ROS 2, mcap", 5, 10),
    ("files", "wrong suffix", "ROS 1 bag", 5, 10),
]


@pytest.mark.parametrize(
    ("table", "fault", "kind", "maps", "copied"), CASES, ids=[" / ".join(case[1:3]) for case in CASES]
)
def test_what_is_whole_is_analyzed_and_copied(table, fault, kind, maps, copied, tmp_path):
    log = make(table, (fault, kind), tmp_path)
    before = [(file, file.read_bytes()) for file in ([log] if log.is_file() else sorted(log.iterdir()))]
    result = analyze_log(log, tmp_path / "out", RunOptions(recording=False))
    assert result.summary.totals.snapshots == maps
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["warnings"] == result.warnings.as_json()
    assert pq.read_metadata(tmp_path / "out" / "snapshots.parquet").num_rows == maps
    (annotated,) = [file for file in result.files if file.suffix == ".mcap"]
    with annotated.open("rb") as stream:
        counts = Counter(channel.topic for _, channel, _ in make_reader(stream).iter_messages())
    assert counts["/rose2/rooms"] == maps
    assert sum(count for topic, count in counts.items() if not topic.startswith("/rose2/")) == copied
    assert [(file, file.read_bytes()) for file, _ in before] == before


def test_a_log_of_which_nothing_can_be_analyzed_leaves_nothing_behind(tmp_path):
    log = make("messages", ("all maps invalid", "MCAP, zstd"), tmp_path)
    with pytest.raises(InvalidMapError, match="3 maps are inconsistent"):
        analyze_log(log, tmp_path / "out", RunOptions())
    assert not list((tmp_path / "out").rglob("*.*"))


def test_the_same_faults_give_the_same_summary_whatever_the_number_of_workers(tmp_path):
    log = INPUTS["ROS 1 bag"].make(tmp_path)
    log.write_bytes(log.read_bytes()[: log.stat().st_size * 7 // 10])
    summaries = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        options = RunOptions(recording=False, annotated_log=False, workers=workers)
        assert 0 < analyze_log(log, folder, options).summary.totals.snapshots < COUNT
        summary = json.loads((folder / "summary.json").read_text())
        summaries.append({key: value for key, value in summary.items() if key != "seconds"})
    assert summaries[0] == summaries[1]
