"""One task: what a worker makes of what it is told."""

from __future__ import annotations

import errno
import logging
import pickle
from pathlib import Path

import pytest
from saved_maps import save_run

from rose2_logs.batch import task
from rose2_logs.batch.location import Location
from rose2_logs.batch.remote import TransferError
from rose2_logs.batch.task import MOST_WARNINGS, RUNNING, LogTask, Progress, analyze_task, is_transient
from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import LogError

QUIET = RunOptions(recording=False, annotated_log=False)


@pytest.fixture
def work(tmp_path: Path) -> Path:
    folder = tmp_path / "out" / ".batch" / "unfinished" / "one"
    folder.mkdir(parents=True)
    (folder / RUNNING).touch()
    return folder


@pytest.fixture
def log(tmp_path: Path) -> Location:
    return Location(str(save_run(tmp_path / "maps")))


def ignore(_: Progress) -> None:
    pass


def test_tasks_and_outcomes_reach_other_processes(work, log):
    """As they are."""
    given = LogTask(log, "maps", work, QUIET)
    outcome = analyze_task(given, ignore)
    assert outcome.status == "done"
    assert outcome.results is not None
    assert outcome.results.parent == work / "maps"
    assert pickle.loads(pickle.dumps((given, outcome))) == (given, outcome)


def test_a_worker_of_another_version_refuses(work, log):
    """Its results would not be those of the batch."""
    outcome = analyze_task(LogTask(log, "maps", work, QUIET, version="0.0.1"), ignore)
    assert outcome.status == "failed"
    assert outcome.reason.startswith("the worker runs rose2-logs ")
    assert outcome.reason.endswith(", the batch 0.0.1")


def test_a_worker_that_does_not_see_the_folder_for_results_says_so(work, log):
    """As a machine on which it is not mounted; nothing is made there."""
    (work / RUNNING).unlink()
    outcome = analyze_task(LogTask(log, "maps", work, QUIET), ignore)
    assert outcome.reason.startswith(f"{work.parents[2]}: not seen from ")
    assert list(work.iterdir()) == []


def test_work_ends_soon_after_its_batch(work, log, monkeypatch):
    """A worker on another machine cannot be killed: it looks."""
    monkeypatch.setattr(task, "REPORT_EVERY_S", 0.0)

    def report(told: Progress) -> None:
        (work / RUNNING).unlink(missing_ok=True)

    outcome = analyze_task(LogTask(log, "maps", work, QUIET), report)
    assert outcome.reason == "the batch has ended"
    assert not [path for path in work.rglob("*") if path.is_file()]


def test_warnings_are_gathered_and_counted(work, log, monkeypatch):
    """Those of the log, wherever it is analyzed; the first of them, and how many more."""
    count = MOST_WARNINGS + 3

    def analyze(*_: object) -> None:
        for number in range(count):
            logging.getLogger("rose2_logs.io").warning("trouble %d", number)
        raise LogError("no more")

    monkeypatch.setattr("rose2_logs.workflows.analyze.analyze_log", analyze)
    outcome = analyze_task(LogTask(log, "maps", work, QUIET), ignore)
    assert outcome.reason == "no more"
    assert outcome.warnings == (*(f"trouble {number}" for number in range(MOST_WARNINGS)), "3 more warnings")


def test_an_internal_error_is_told_as_one_with_its_traceback(work, log, monkeypatch):
    """For --debug."""
    monkeypatch.setattr("rose2_logs.workflows.analyze.analyze_log", lambda *_: 1 // 0)
    outcome = analyze_task(LogTask(log, "maps", work, QUIET), ignore)
    assert outcome.reason.startswith("ZeroDivisionError: ")
    assert outcome.reason.endswith("(internal error of rose2-logs)")
    assert "Traceback" in outcome.details
    assert not outcome.is_transient


def caused(error: Exception, cause: Exception) -> Exception:
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (OSError(errno.EIO, "Input/output error"), True),
        (OSError(errno.ESTALE, "Stale file handle"), True),
        (ConnectionResetError(), True),
        (MemoryError(), True),
        (TransferError("cut"), True),
        (caused(LogError("run.mcap: cannot be read"), OSError(errno.ETIMEDOUT, "timed out")), True),
        (LogError("run.mcap: is not a log"), False),
        (caused(LogError("run.mcap: cannot be read"), PermissionError(errno.EACCES, "denied")), False),
        (FileNotFoundError(errno.ENOENT, "no such file"), False),
        (OSError(errno.ENOSPC, "No space left on device"), False),
        (ValueError(), False),
    ],
)
def test_only_faults_that_may_pass_are_worth_another_try(error: Exception, expected: bool):
    """Of storage, network and memory, also beneath an error of ours."""
    assert is_transient(error) == expected
