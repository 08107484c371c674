"""Running the real command line, and looking into a batch while it runs."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from collections import deque
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from commands import ROSE2_LOGS, WAIT_S, started, wait_for
from saved_maps import save_run

from rose2_logs.batch.driver import LogState
from rose2_logs.batch.task import LogOutcome, LogTask, Progress, analyze_task
from rose2_logs.runs.tables import TABLES

DASK = (sys.executable, "-m", "dask")
SLOW = tuple(range(116, 222, 4))
"""Of how many columns the maps of a log know, that takes long enough to be caught while it is analyzed."""


def make_logs(folder: Path) -> Path:
    """Write a slow log and two quick ones, of one name in two folders."""
    save_run(folder / "slow", SLOW)
    save_run(folder / "one" / "run")
    save_run(folder / "two" / "run", (150, 240))
    return folder


@contextmanager
def started_batch(*arguments: object) -> Iterator[subprocess.Popen[str]]:
    """Start ``rose2-logs batch`` as a process group of its own, which does not outlive the block."""
    with started(*ROSE2_LOGS, "batch", *arguments, "--no-mcap", "--no-rrd") as process:
        yield process


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    """Wait for it; return exit code, stdout and stderr."""
    out, err = process.communicate(timeout=WAIT_S)
    return process.returncode, out, err


def run_batch(*arguments: object) -> tuple[int, str, str]:
    """Run ``rose2-logs batch``."""
    with started_batch(*arguments) as process:
        return finish(process)


@contextmanager
def running(*arguments: object):
    """A process of Dask, which is ended whatever happens."""
    # The scheduler gives a log up at its second loss instead of its fourth.
    settings = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with started(*DASK, *arguments, "--no-dashboard", env=os.environ | settings, **silent) as process:
        yield process
        process.terminate()
        process.wait(WAIT_S)


@contextmanager
def cluster_in(folder: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A scheduler, as its file and its process, with two workers, which are started again when they die."""
    file = folder / "scheduler.json"
    starting = ("scheduler", "--host", "127.0.0.1", "--port", 0, "--scheduler-file", file)
    with running(*starting) as scheduler:
        wait_for(file.exists)
        with running("worker", "--scheduler-file", file, "--nworkers", 2, "--nthreads", 1):
            yield str(file), scheduler


class Heard:
    """Keeps what a listener hears."""

    def __init__(self) -> None:
        self.begun = (0, 0)
        self.shares: dict[str, list[float]] = {}
        self.retries: list[tuple[str, str]] = []
        self.ended: list[str] = []
        self.warnings: list[str] = []

    def begin(self, logs: int, up_to_date: int) -> None:
        self.begun = (logs, up_to_date)

    def progress(self, told: Progress) -> None:
        self.shares.setdefault(told.name, []).append(told.share)

    def retry(self, name: str, reason: str) -> None:
        self.retries.append((name, reason))

    def finished(self, state: LogState, outcome: LogOutcome) -> None:
        self.ended.append(state.name)
        self.warnings += outcome.warnings


class WorkersHere:
    """Does the tasks in this process, which starts at once."""

    def __init__(self, count: int) -> None:
        self._waiting: deque[LogTask] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def submit(self, task: LogTask) -> None:
        self._waiting.append(task)

    def events(self) -> Iterator[Progress | LogOutcome]:
        while self._waiting:
            told: list[Progress] = []
            outcome = analyze_task(self._waiting.popleft(), told.append)
            yield from told
            yield outcome


def worker_of(out: Path, name: str, but_not: Collection[int] = ()) -> int | None:
    """Process id of the worker that has a log in work, from the name of the folder for its results."""
    for folder in out.glob(f".batch/unfinished/*/{name}/*"):
        if (pid := int(folder.name.split("-")[-2])) not in but_not:
            return pid
    return None


def summary(out: Path) -> dict[str, dict[str, str]]:
    """Rows of the summary by log."""
    with (out / "summary.csv").open(encoding="utf-8", newline="") as file:
        return {row["log"]: row for row in csv.DictReader(file)}


def table_bytes(folder: Path) -> list[bytes]:
    """Return the bytes of a log's tables."""
    return [(folder / f"{name}.parquet").read_bytes() for name in TABLES]


def tree(out: Path) -> set[str]:
    """Files below a folder but for the lock."""
    files = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    return files - {".batch/lock"}
