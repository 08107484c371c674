"""A log through reader, workers, tracker and tables, for real."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from finished_runs import SAMPLE_LOGS
from saved_maps import FREE, WALL, save_map, save_run, two_rooms

from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import LogError, OutputError
from rose2_logs.runs.provenance import fingerprint, log_files
from rose2_logs.runs.tables import TABLES
from rose2_logs.workflows.analyze import RunOptions, analyze_log, log_stem

SHARED_BAGS = Path(__file__).parents[3] / "shared" / "bags"
TABLES_ONLY = RunOptions(recording=False, annotated_log=False)


def table_bytes(folder: Path) -> list[bytes]:
    return [(folder / f"{name}.parquet").read_bytes() for name in TABLES]


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """Log in ``maps``, its results in ``out``."""
    folder = tmp_path_factory.mktemp("run")
    save_run(folder / "maps")
    analyze_log(folder / "maps", folder / "out", TABLES_ONLY)
    return folder


def test_coverage_rises_to_one(run: Path):
    """Coverage is the free area over that of the last map: the share of free cells drawn."""
    coverage = pq.read_table(run / "out" / "snapshots.parquet")["coverage"].to_pylist()
    free = [np.count_nonzero(two_rooms(columns) == 254) for columns in (115, 180, 240)]
    assert coverage == pytest.approx([count / free[-1] for count in free])
    assert coverage[-1] == 1.0


def test_both_rooms_are_found_and_keep_their_numbers(run: Path):
    """The first room is there from the beginning, the second is born later; 25 m2 each in the end."""
    rooms = pq.read_table(run / "out" / "rooms.parquet").to_pylist()
    last = {row["track"]: row for row in rooms if row["snapshot"] == 2}
    assert len(last) == 2
    assert all(row["area_m2"] == pytest.approx(26, rel=0.1) for row in last.values())
    assert last[1]["label_x_m"] < last[2]["label_x_m"]
    assert last[1]["neighbors"] == [2]
    assert {row["snapshot"] for row in rooms if row["track"] == 1} == {0, 1, 2}


def test_rooms_have_evidence_and_a_past(run: Path):
    """Walls back most of both outlines; the second room came later and was whole in the end."""
    tracks = pq.read_table(run / "out" / "tracks.parquet").to_pylist()
    assert [row["in_last_map"] for row in tracks] == [True, True]
    assert tracks[0]["first_coverage"] < tracks[1]["first_coverage"]
    assert all(row["wall_support"] > 0.8 for row in tracks)
    snapshots = pq.read_table(run / "out" / "snapshots.parquet").to_pylist()
    assert snapshots[0]["frontier_m"] > 2 > snapshots[2]["frontier_m"]
    assert snapshots[0]["final_iou"] < 0.6 < snapshots[2]["final_iou"] == 1.0
    assert [row["variation_bits"] is None for row in snapshots] == [True, False, False]
    layout = json.loads((run / "out" / "summary.json").read_text())["layout"]
    assert layout["final_since"]["coverage"] in [row["coverage"] for row in snapshots]
    assert layout["frontier_m"] == snapshots[2]["frontier_m"]


def test_the_summary_tells_what_the_run_was_made_of(run: Path):
    """Parameters, versions, fingerprint, counts; times only under seconds."""
    summary = json.loads((run / "out" / "summary.json").read_text())
    assert summary["parameters"]["tracking"]["match_min_iou"] > 0
    assert summary["versions"]["numpy"] == np.__version__
    assert len(summary["input"]["files"]) == 6
    assert summary["messages"]["messages"] == summary["results"]["snapshots"] == 3
    assert summary["results"]["tracks"] == 2
    assert summary["seconds"]["run"] > 0
    assert summary["files"] == [f"{name}.parquet" for name in TABLES]


def test_any_number_of_workers_gives_the_same_bytes(run: Path, tmp_path: Path):
    """Two worker processes write what one process wrote."""
    options = RunOptions(recording=False, annotated_log=False, workers=2)
    result = analyze_log(run / "maps", tmp_path, options)
    assert result.summary.totals.snapshots == 3
    assert table_bytes(tmp_path) == table_bytes(run / "out")


@pytest.mark.parametrize("workers", [1, 2])
def test_a_map_that_did_not_change_is_not_analyzed_again(tmp_path: Path, monkeypatch, workers: int):
    """Probabilities that pass no threshold change nothing: the same bytes as if each map were analyzed."""
    folder = tmp_path / "maps"
    for number, (columns, free) in enumerate([(180, 0), (180, 12), (180, 3), (240, 3), (240, 30)]):
        image = two_rooms(columns)
        percent = np.select([image == FREE, image == WALL], [free, 100 - free], 255).astype(np.uint8)
        path = save_map(folder, f"map{number}", percent)
        path.write_text(path.read_text() + "mode: raw\n")
    # Otherwise so many cells of 30 % would be taken for free ones of a map of probabilities.
    parameters = Parameters().replaced({"occupancy.values": "stored"})
    options = dataclasses.replace(TABLES_ONLY, workers=workers, parameters=parameters)
    result = analyze_log(folder, tmp_path / "out", options)
    assert (result.summary.totals.snapshots, result.summary.totals.unchanged) == (5, 2)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["results"]["unchanged_maps"] == 2
    monkeypatch.setattr("rose2_logs.runs.stream.is_same_to_analysis", lambda before, now, parameters: False)
    each = analyze_log(folder, tmp_path / "each", options)
    assert (each.summary.totals.snapshots, each.summary.totals.unchanged) == (5, 0)
    assert table_bytes(tmp_path / "out") == table_bytes(tmp_path / "each")


def test_a_run_of_large_maps_says_once_that_they_are_analyzed_coarser(run: Path, tmp_path: Path, caplog):
    small = {"occupancy": {"analyzed_max_cells": 20_000}}
    options = dataclasses.replace(TABLES_ONLY, parameters=Parameters().replaced(small))
    analyze_log(run / "maps", tmp_path, options)
    said = [record.getMessage() for record in caplog.records if "20000 explored cells" in record.getMessage()]
    assert len(said) == 1
    assert "analyzed at 0.1 m instead of 0.05 m" in said[0]
    snapshots = pq.read_table(tmp_path / "snapshots.parquet").to_pandas()
    assert snapshots["analyzed_resolution_m"].iloc[-1] == 0.1
    assert (snapshots["resolution_m"] == 0.05).all()


def test_progress_ends_at_one(run: Path, tmp_path: Path):
    """Each snapshot is told with the share of the log's time that is done."""
    told = []
    analyze_log(
        run / "maps", tmp_path, TABLES_ONLY, lambda step, share: told.append((step.snapshot.index, share))
    )
    assert told == [(0, 0.0), (1, 0.5), (2, 1.0)]


def test_earlier_results_are_not_replaced_unasked(run: Path):
    """The file that is in the way is named, and the option."""
    before = table_bytes(run / "out")
    with pytest.raises(OutputError, match=r"snapshots\.parquet: already exists.*overwrite=True"):
        analyze_log(run / "maps", run / "out", TABLES_ONLY)
    assert table_bytes(run / "out") == before


def test_a_selection_is_written_into_the_summary(run: Path, tmp_path: Path):
    """What was left out can be seen later."""
    options = RunOptions(recording=False, annotated_log=False, max_snapshots=2)
    analyze_log(run / "maps", tmp_path, options)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["selection"]["max_snapshots"] == 2
    assert summary["results"]["snapshots"] == 2


def test_names_of_results_come_from_the_log(tmp_path: Path):
    """Endings of formats go, other dots stay."""
    assert log_stem(tmp_path / "run.1.mcap") == "run.1"
    assert log_stem(tmp_path / "fr79.ros2_mcap") == "fr79.ros2_mcap"
    assert log_stem(tmp_path / "maps" / "*.yaml") == "maps"


def test_a_log_whose_name_looks_like_a_pattern_gives_its_results_its_own_name(tmp_path: Path):
    """Two of one folder would otherwise have one name."""
    for name in ("run[1]", "run[2]"):
        (tmp_path / f"{name}.mcap").touch()
        assert log_stem(tmp_path / f"{name}.mcap") == name


def test_seconds_into_a_log_are_counted_from_its_first_message(tmp_path: Path):
    """Also in a log without an index, which is counted within the limits of the run when it is opened."""
    log = save_run(tmp_path / "maps")
    options = dataclasses.replace(TABLES_ONLY, start_s=1.0, end_s=1.5)
    assert analyze_log(log, tmp_path / "out", options).summary.totals.snapshots == 1
    many = Parameters().replaced({"reading": {"map_max_messages": 2}})
    office = cut_off(SAMPLE_LOGS / "office.mcap", tmp_path)
    with pytest.raises(LogError, match="more than 2 map messages"):
        analyze_log(office, tmp_path / "office", dataclasses.replace(options, parameters=many))


def cut_off(log: Path, folder: Path) -> Path:
    """Copy a log without its end, where its index is."""
    short = folder / log.name
    short.write_bytes(log.read_bytes()[:-200])
    return short


def test_the_fingerprint_of_one_file_is_its_sha256(tmp_path: Path):
    """It can be checked with sha256sum; that of a folder changes with any of its files' names or bytes."""
    (tmp_path / "a").write_bytes(b"one")
    assert fingerprint(tmp_path / "a")["sha256"] == hashlib.sha256(b"one").hexdigest()
    whole = fingerprint(tmp_path)
    (tmp_path / "b").write_bytes(b"")
    assert fingerprint(tmp_path)["sha256"] != whole["sha256"]
    assert [path.name for path in log_files(tmp_path)] == ["a", "b"]


@pytest.mark.skipif(not SHARED_BAGS.exists(), reason="the shared logs are not beside the project")
def test_one_run_in_three_formats_gives_the_same_tables(tmp_path: Path):
    """A bag, an MCAP and a compressed sqlite3 bag of the same maps cannot be told apart by the tables."""
    options = RunOptions(recording=False, annotated_log=False, max_snapshots=3)
    written = []
    for name in ("fr79.bag", "fr79.ros2_mcap", "fr79.ros2_sqlite3_zstd"):
        analyze_log(SHARED_BAGS / name, tmp_path / name, options)
        written.append(table_bytes(tmp_path / name))
    assert written[0] == written[1] == written[2]


@pytest.mark.parametrize(
    ("origin_m", "told"), [((432100.37, 5412345.11), {"far_origin": 1}), ((1e4, 2e4), {})]
)
def test_a_map_in_a_frame_so_far_away_that_viewers_round_it_is_told_of(origin_m, told, tmp_path):
    saved = save_map(tmp_path, "map", two_rooms())
    text = saved.read_text().replace("[1.0, 2.0, 0.0]", f"[{origin_m[0]}, {origin_m[1]}, 0.0]")
    saved.write_text(text)
    result = analyze_log(saved, tmp_path / "out", RunOptions(recording=False, annotated_log=False))
    assert {kind: each.count for kind, each in result.warnings.kinds.items() if kind == "far_origin"} == told
