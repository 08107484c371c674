"""A batch on a real Dask cluster: a scheduler and workers, each a process of its own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from batches import (
    Heard,
    WorkersHere,
    cluster_in,
    finish,
    make_logs,
    started_batch,
    summary,
    tree,
    worker_of,
)
from commands import wait_for
from saved_maps import save_run

from rose2_logs.batch import dask_workers, driver
from rose2_logs.batch.dask_workers import DaskWorkers
from rose2_logs.batch.driver import run_batch
from rose2_logs.batch.location import Location
from rose2_logs.batch.options import BatchOptions
from rose2_logs.batch.task import LogTask, Progress
from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import ParameterError

QUIET = RunOptions(recording=False, annotated_log=False)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """One for all tests that leave it as it is."""
    with cluster_in(tmp_path_factory.mktemp("dask")) as started:
        yield started


def all_tables(out: Path) -> dict[str, bytes]:
    """Bytes of the tables of all logs, beside the logs and in the data set."""
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in out.glob("*/**/*.parquet")}


@pytest.fixture
def undisturbed(tmp_path, monkeypatch):
    """Logs, and the tables of a batch over them by one process that nothing happens to."""
    logs = make_logs(tmp_path / "logs")
    with monkeypatch.context() as patch:
        patch.setattr(driver, "LocalWorkers", WorkersHere)
        run_batch([str(logs)], tmp_path / "undisturbed", BatchOptions(QUIET), Heard())
    return logs, all_tables(tmp_path / "undisturbed")


class Killer(Heard):
    """Kills the workers of some logs as soon as they begin, each as often as it says."""

    def __init__(self, out: Path, times: dict[str, int]) -> None:
        super().__init__()
        self._out, self._times = out, times
        self.killed: set[int] = set()

    def progress(self, told: Progress) -> None:
        super().progress(told)
        pid = worker_of(self._out, told.name, self.killed)
        if pid and self._times.get(told.name, 0):
            self._times[told.name] -= 1
            self.killed.add(pid)
            os.kill(pid, signal.SIGKILL)


def test_a_log_whose_worker_is_killed_is_done_by_another(cluster, undisturbed, tmp_path):
    """In the end every byte is as one process makes it; a bad log fails alone, and its warnings arrive."""
    (logs, expected), out = undisturbed, tmp_path / "out"
    (logs / "bad.mcap").write_bytes(b"\x89MCAP0\r\n")
    heard = Killer(out, {"slow": 1})
    result = run_batch([str(logs)], out, BatchOptions(QUIET, scheduler=cluster[0]), heard)
    assert len(heard.killed) == 1
    status = {state.name: state.status for state in result.states}
    assert status == dict.fromkeys(("one_run", "slow", "two_run"), "done") | {"bad": "failed"}
    assert "no topic has occupancy grids" in summary(out)["bad"]["reason"]
    (warning,) = heard.warnings
    assert "truncated or damaged" in warning
    assert not [path for path in tree(out) if path.startswith(".batch")]
    assert all_tables(out) == expected


def test_a_log_that_kills_every_worker_fails_alone(cluster, tmp_path):
    """Those that only waited behind it are done, though the scheduler blames them as well."""
    logs, out = tmp_path / "logs", tmp_path / "out"
    save_run(logs / "doomed")
    save_run(logs / "good", (150, 240))
    heard = Killer(out, {"doomed": 99})
    result = run_batch([str(logs)], out, BatchOptions(QUIET, scheduler=cluster[0], retries=1), heard)
    assert len(heard.killed) >= 2
    assert {state.name: state.status for state in result.states} == {"doomed": "failed", "good": "done"}
    assert "were lost one after the other" in summary(out)["doomed"]["reason"]


def test_the_scheduler_holds_only_the_next_logs(cluster, tmp_path, monkeypatch):
    """However many there are, it needs memory for a few for each worker; all are done, one kind of key."""
    for name in ("LEAST_LOGS", "LOGS_PER_THREAD"):
        monkeypatch.setattr(dask_workers, name, 1)
    (tmp_path / "work").mkdir()
    tasks = [LogTask(Location(f"/nowhere/{k}.mcap"), f"log{k}", tmp_path / "work", QUIET) for k in range(9)]
    done, most = [], 0
    with DaskWorkers(cluster[0]) as workers:
        for task in tasks:
            workers.submit(task)
        for told in workers.events():
            done.append(told.name)
            most = max(most, len(workers._tasks))
    assert sorted(done) == [task.name for task in tasks]
    assert most <= 2


def test_no_scheduler_is_one_line(monkeypatch):
    """With the command that starts one."""
    monkeypatch.setattr(dask_workers, "CONNECT_TIMEOUT_S", 1.0)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    with pytest.raises(ParameterError, match=f"{address}: no Dask scheduler answers; `dask sch"):
        DaskWorkers(address)


def test_without_the_extra_the_option_says_what_to_install(monkeypatch):
    """In one line."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ParameterError, match=r"pip install 'rose2-logs\[batch\]'"):
        DaskWorkers("127.0.0.1:8786")


def test_a_batch_that_is_killed_goes_on_with_the_same_cluster(cluster, undisturbed, tmp_path):
    """Its workers leave the log that they had, do the rest for the next call, and every byte is right."""
    (logs, expected), out = undisturbed, tmp_path / "out"
    with started_batch(logs, "-o", out, "--scheduler", cluster[0]) as process:
        wait_for(lambda: worker_of(out, "slow"))
        wait_for(lambda: list(out.glob("logs/*")))
        process.kill()
        finish(process)
    done = {path.name for path in out.glob("logs/*")}
    result = run_batch([str(logs)], out, BatchOptions(QUIET, scheduler=cluster[0]), Heard())
    assert done <= {state.name for state in result.states if state.status == "up to date"} | {"slow"}
    assert not result.failed
    assert all_tables(out) == expected
    assert not [path for path in tree(out) if path.startswith(".batch")]


def test_a_scheduler_that_is_lost_ends_the_batch_in_one_line(undisturbed, tmp_path):
    """What was finished stands; the same call with another scheduler does the rest, every byte right."""
    (logs, expected), out = undisturbed, tmp_path / "out"
    for place in ("first", "second"):
        (tmp_path / place).mkdir()
    with (
        cluster_in(tmp_path / "first") as (file, scheduler),
        started_batch(logs, "-o", out, "--scheduler", file) as process,
    ):
        wait_for(lambda: worker_of(out, "slow"))
        wait_for(lambda: list(out.glob("logs/*")))
        scheduler.kill()
        code, told, err = finish(process)
    assert (code, told) == (2, "")
    assert "Traceback" not in err
    assert err.splitlines()[-1].startswith("error: the Dask scheduler at")
    assert err.splitlines()[-1].endswith("is gone; the same call again analyzes the rest")
    done = {path.name for path in out.glob("logs/*")}
    assert set(summary(out)) == done
    written = {path: path.stat().st_mtime_ns for path in out.glob("logs/*/*.parquet")}
    heard = Heard()
    with cluster_in(tmp_path / "second") as (file, _):
        result = run_batch([str(logs)], out, BatchOptions(QUIET, scheduler=file), heard)
    assert not result.failed, result.failed
    status = {state.name: state.status for state in result.states}
    assert done < set(status)  # which one is first on a loaded machine, nobody knows
    assert {name for name in status if status[name] == "up to date"} == done
    assert set(heard.shares) == set(status) - done
    assert {path: path.stat().st_mtime_ns for path in written} == written
    assert all_tables(out) == expected
