"""A batch by local worker processes, as a user runs it: from start to end, stopped, killed."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import duckdb
import numpy as np
import pandas as pd
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest
from batches import (
    SLOW,
    Heard,
    WorkersHere,
    finish,
    make_logs,
    run_batch,
    started_batch,
    summary,
    table_bytes,
    tree,
    worker_of,
)
from commands import is_running, wait_for
from finished_runs import SAMPLE_LOGS
from reader_logs import START_NS, Map, McapLog
from saved_maps import save_run

from rose2_logs.batch import driver
from rose2_logs.batch.dataset import publish_tables
from rose2_logs.batch.folders import locked
from rose2_logs.batch.options import BatchOptions
from rose2_logs.batch.record import RECORD
from rose2_logs.batch.task import Progress
from rose2_logs.errors import OutputError
from rose2_logs.runs.tables import TABLES
from rose2_logs.workflows.analyze import RunOptions, analyze_log

GOOD = {"slow", "one_run", "two_run"}


@pytest.fixture(scope="module")
def batch(tmp_path_factory):
    """Logs in ``logs``, results in ``out``; one of them cannot be read. Not to be changed by tests."""
    folder = tmp_path_factory.mktemp("batch")
    make_logs(folder / "logs")
    (folder / "logs" / "bad.mcap").write_bytes(b"\x89MCAP0\r\n")
    told = run_batch(folder / "logs", "-o", folder / "out", "--workers", 2)
    return folder, told


def test_one_bad_log_does_not_stop_the_others(batch):
    """They are done; its reason stands in one line, in the table, in the summary; the exit code tells."""
    folder, (code, out, err) = batch
    assert code == 2
    assert "3 done, 1 failed" in out
    (error,) = [line for line in err.splitlines() if line.startswith("error:")]
    assert "no topic has occupancy grids" in error
    rows = summary(folder / "out")
    assert {name for name, row in rows.items() if row["status"] == "done"} == GOOD
    assert "no topic has occupancy grids" in rows["bad"]["reason"]
    assert rows["bad"]["source"] == str(folder / "logs" / "bad.mcap")
    assert (rows["slow"]["snapshots"], rows["slow"]["rooms_last"]) == (str(len(SLOW)), "2")


def test_a_logs_folder_is_what_analyze_writes(batch, tmp_path):
    """The same files and the same bytes of tables, so that all other commands work on it."""
    folder, _ = batch
    options = RunOptions(recording=False, annotated_log=False)
    analyze_log(folder / "logs" / "one" / "run", tmp_path, options)
    results = folder / "out" / "logs" / "one_run"
    assert table_bytes(results) == table_bytes(tmp_path)
    assert {path.name for path in results.iterdir()} == {path.name for path in tmp_path.iterdir()} | {RECORD}
    ours, theirs = (json.loads((path / "summary.json").read_text()) for path in (results, tmp_path))
    del ours["seconds"], theirs["seconds"]
    assert ours == theirs


def test_nothing_unfinished_is_left(batch):
    """Only logs, tables and the summary."""
    folder, _ = batch
    assert {path.split("/")[0] for path in tree(folder / "out")} == {
        "logs",
        "tables",
        "summary.csv",
        "summary.parquet",
    }


@pytest.mark.parametrize("table", TABLES)
def test_the_data_set_holds_the_rows_of_all_logs(batch, table):
    """Read in one line by each of the usual libraries, with the log as a column."""
    folder, _ = batch
    root = folder / "out" / "tables" / table
    expected = {
        name: pq.read_metadata(folder / "out" / "logs" / name / f"{table}.parquet").num_rows for name in GOOD
    }
    frame = pd.read_parquet(root)
    assert {name: int((frame["log"] == name).sum()) for name in GOOD} == expected
    arrow = ds.dataset(root, partitioning="hive").to_table()
    assert len(arrow) == sum(expected.values())
    rows = duckdb.sql(
        f"select log, count(*) from read_parquet('{root}/*/*.parquet', hive_partitioning=true) group by log"
    ).fetchall()
    assert dict(rows) == {name: count for name, count in expected.items() if count}


def test_a_log_in_parts_is_read_with_others_by_the_usual_libraries(tmp_path: Path):
    """Some take the columns of the first log, which is in one piece; grouping by part loses no log."""
    for name, widths in (("a", (60, 110)), ("b", (60, 170, 60, 110, 150))):
        log = McapLog(tmp_path / f"{name}.mcap")
        for k, columns in enumerate(widths):
            cells = np.full((100, 200), -1, np.int8)
            cells[9:91, 5:columns] = 100
            cells[10:90, 6 : columns - 1] = 0
            log.add("/map", START_NS + k * 10**9, Map(cells))
        options = RunOptions(recording=False, annotated_log=False)
        analyze_log(log.close(), tmp_path / "logs" / name, options)
        publish_tables(tmp_path, name)
    root = tmp_path / "tables" / "snapshots"
    expected = {("a", 1): 2, ("b", 1): 2, ("b", 2): 3}
    assert dict(pd.read_parquet(root).groupby(["log", "part"], observed=True).size()) == expected
    assert ds.dataset(root, partitioning="hive").to_table()["part"].to_pylist() == [1, 1, 1, 1, 2, 2, 2]
    rows = duckdb.sql(
        f"select log, part, count(*) from read_parquet('{root}/*/*.parquet', hive_partitioning=true) "
        "group by log, part"
    ).fetchall()
    assert {(log, part): count for log, part, count in rows} == expected


def test_the_summary_is_the_same_as_csv_and_parquet(batch):
    """Sorted by log, each column with its meaning."""
    folder, _ = batch
    table = pq.read_table(folder / "out" / "summary.parquet")
    rows = {row["log"]: row for row in table.to_pylist()}
    assert list(rows) == sorted({*GOOD, "bad"})
    text = summary(folder / "out")
    for name, row in rows.items():
        assert text[name] == {key: "" if value is None else str(value) for key, value in row.items()}
    assert all(b"description" in field.metadata for field in table.schema)


def test_a_log_that_fails_now_is_told_to_have_earlier_results(tmp_path: Path):
    """They stay in the data set, and what is wrong with the log is counted in the summary."""
    log, out = tmp_path / "logs" / "office.mcap", tmp_path / "out"
    log.parent.mkdir()
    whole = (SAMPLE_LOGS / "office.mcap").read_bytes()
    log.write_bytes(whole[:100_000])
    code, printed, _ = run_batch(log.parent, "-o", out, "--workers", 1, "--max-snapshots", 2)
    (row,) = summary(out).values()
    assert (code, row["status"]) == (0, "done")
    assert int(row["warnings"]) > 0
    assert "warnings" in printed
    log.write_bytes(b"broken")
    code, _, _ = run_batch(log.parent, "-o", out, "--workers", 1, "--max-snapshots", 2)
    (row,) = summary(out).values()
    assert (code, row["status"]) == (2, "failed")
    assert row["reason"].endswith("; the tables hold its earlier results")
    assert set(pd.read_parquet(out / "tables" / "rooms")["log"]) == {"office"}


class Killer(Heard):
    """Kills the worker of one log once, that of another whenever it begins."""

    def __init__(self, out: Path) -> None:
        super().__init__()
        self._out = out

    def progress(self, told: Progress) -> None:
        if told.name == "doomed" or (told.name == "slow" and told.name not in self.shares):
            os.kill(worker_of(self._out, told.name) or 0, signal.SIGKILL)
        super().progress(told)


def test_a_killed_worker_takes_only_its_try_with_it(tmp_path):
    """The log is tried again; one whose workers are killed every time fails alone."""
    logs, out = make_logs(tmp_path / "logs"), tmp_path / "out"
    save_run(logs / "doomed")
    heard = Killer(out)
    options = BatchOptions(RunOptions(recording=False, annotated_log=False), workers=2, retries=1)
    result = driver.run_batch([str(logs)], out, options, heard)
    assert {state.name for state in result.failed} == {"doomed"}
    assert sorted(name for name, _ in heard.retries) == ["doomed", "slow"]
    assert all("was killed (SIGKILL)" in reason for _, reason in heard.retries)
    rows = summary(out)
    assert rows["slow"]["snapshots"] == str(len(SLOW))
    assert "fewer workers" in rows["doomed"]["reason"]
    assert not [path for path in tree(out) if path.startswith(".batch") or "doomed" in path]


def test_a_batch_that_is_killed_leaves_whole_results_and_goes_on(tmp_path, monkeypatch):
    """Its workers end with it; what was done is not done again."""
    logs, out = make_logs(tmp_path / "logs"), tmp_path / "out"
    with started_batch(logs, "-o", out, "--workers", 2) as process:
        worker = wait_for(lambda: worker_of(out, "slow"))
        wait_for(lambda: list(out.glob("logs/*")))
        process.kill()
        finish(process)
        wait_for(lambda: not is_running(worker))
    done = {path.name for path in out.glob("logs/*")}
    assert done
    assert "slow" not in done
    for name in done:
        assert all((out / "logs" / name / f"{table}.parquet").exists() for table in TABLES)
    assert list(out.glob(".batch/unfinished/*/slow/*"))
    monkeypatch.setattr(driver, "LocalWorkers", WorkersHere)
    options = BatchOptions(RunOptions(recording=False, annotated_log=False))
    result = driver.run_batch([str(logs)], out, options, Heard())
    assert {state.name for state in result.states if state.status == "up to date"} == done
    assert len(summary(out)) == 3
    assert not result.failed
    assert not [path for path in tree(out) if path.startswith(".batch")]


def test_ctrl_c_ends_at_once_and_cleans_up(tmp_path):
    """And meanwhile no other batch writes to the folder."""
    logs, out = make_logs(tmp_path / "logs"), tmp_path / "out"
    with started_batch(logs, "-o", out) as process:
        worker = wait_for(lambda: worker_of(out, "slow"))
        with pytest.raises(OutputError, match="another batch is writing to this folder"), locked(out):
            pass
        os.killpg(process.pid, signal.SIGINT)
        code, told, err = finish(process)
        assert (code, told) == (130, "")
        assert err.splitlines()[-1] == "error: interrupted; unfinished results were removed"
        wait_for(lambda: not is_running(worker))
    assert not [path for path in tree(out) if path.startswith(".batch")]
    assert set(summary(out)) == {path.name for path in out.glob("logs/*")}
