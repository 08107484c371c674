"""One log as one task: what is sent to a worker, what the worker does, what it sends back."""

from __future__ import annotations

import dataclasses
import errno
import json
import logging
import os
import platform
import shutil
import tempfile
import time
import traceback
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from rose2_logs import __version__
from rose2_logs.batch.folders import RUNNING
from rose2_logs.batch.location import Location
from rose2_logs.batch.record import Record, Signature, deciding_settings, signature_of
from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import LogError, OutputError, Rose2LogsError
from rose2_logs.system.warnings import PACKAGE, WarningLog, collect_warnings

RETRY_PAUSE_S = 2.0
"""Before the second try after a fault of storage or network; doubled for each further one."""
REPORT_EVERY_S = 0.5
"""Minimum time between two reports of a log's progress: what an eye can follow."""
MOST_WARNINGS = 5
"""Maximum number of warnings of one log that are shown; the rest are counted."""
TRANSIENT = frozenset(
    {
        errno.EIO,
        errno.EAGAIN,
        errno.EINTR,
        errno.EBUSY,
        errno.ESTALE,
        errno.ETIMEDOUT,
        errno.EPIPE,
        errno.ENOTCONN,
        errno.ECONNRESET,
        errno.ECONNABORTED,
        errno.ECONNREFUSED,
        errno.ENETDOWN,
        errno.ENETUNREACH,
        errno.ENETRESET,
        errno.EHOSTDOWN,
        errno.EHOSTUNREACH,
    }
)
"""Faults of storage and network that may pass; a missing file, no permission or a full disk will not."""


@dataclass(frozen=True, slots=True)
class LogTask:
    """A log to analyze, as it is sent to a worker: plain values only, which reach another process or machine.

    Attributes
    ----------
    log : Location
        The log.
    name : str
        Name of its folder of results.
    work : path
        Folder for unfinished results of this batch. Its file `RUNNING` exists as long as the batch runs.
    options : RunOptions
        What to take from the log, how to analyze it, what to write.
    known : Record, optional
        Record of earlier results: nothing is done if they are those of this very log.
    known_name : str
        Name of their folder. If it is not `name`, the log may have moved since, or be a new one.
    is_whole : bool
        Whether the earlier results have all the files that are wanted now.
    may_replace : bool
        Whether the earlier results may be replaced if the log has changed.
    attempt : int
        Number of the try, from 1.
    store : str
        URL that results are uploaded to by the worker; empty if they are put in place from `work`.
    version : str
        Version of rose2-logs that made the task.
    """

    log: Location
    name: str
    work: Path
    options: RunOptions
    known: Record | None = None
    known_name: str = ""
    is_whole: bool = False
    may_replace: bool = False
    attempt: int = 1
    store: str = ""
    version: str = __version__

    def stands_by(self, signature: Signature | None) -> bool:
        """Whether the signature of the log is enough to know that its earlier results are still right."""
        if self.known is None or signature is None or not self.is_whole or self.known_name != self.name:
            return False
        return signature.proves_unchanged_since(self.known.signature)


@dataclass(frozen=True)
class Progress:
    """How far a log is: the share of its duration, in [0, 1], that has been analyzed."""

    name: str
    share: float


@dataclass(frozen=True, slots=True)
class LogOutcome:
    """How a log ended.

    Attributes
    ----------
    name : str
        Name of its folder of results.
    status : str
        ``done``: there are new results; ``unchanged``: the earlier ones are those of this very log; or
        ``failed``.
    results : path, optional
        Folder with the new results, complete, to be put in place.
    record : Record, optional
        The new record of an unchanged log, or of one whose results were uploaded.
    summary : dict, optional
        What ``summary.json`` of uploaded results holds.
    reason : str
        Why it failed, in one line.
    is_transient : bool
        Whether it may succeed if it is tried again.
    tries : int
        Number of times the log was begun for this outcome.
    details : str
        The traceback of a failure.
    warnings : tuple of str
        Warnings about the log.
    host : str
        Name of the machine that did the work.
    """

    name: str
    status: Literal["done", "unchanged", "failed"]
    results: Path | None = None
    record: Record | None = None
    summary: dict[str, Any] | None = None
    reason: str = ""
    is_transient: bool = False
    tries: int = 1
    details: str = ""
    warnings: tuple[str, ...] = ()
    host: str = field(default_factory=platform.node)


class BatchOverError(Rose2LogsError):
    """The batch that this task belongs to has ended."""


Report = Callable[[Progress], None]


def analyze_task(task: LogTask, report: Report) -> LogOutcome:
    """Carry out a task; whatever goes wrong becomes part of the outcome.

    Parameters
    ----------
    task : LogTask
        The log and what to do with it.
    report : callable
        Called with the progress.
    """
    with collect_warnings() as warning_log, _own_messages():
        try:
            outcome = _analyze(task, report, warning_log)
        except Exception as error:
            known = isinstance(error, Rose2LogsError)
            outcome = LogOutcome(
                task.name,
                "failed",
                reason=str(error)
                if known
                else f"{type(error).__name__}: {error} (internal error of rose2-logs)",
                is_transient=is_transient(error),
                details=traceback.format_exc(),
            )
    texts = warning_log.texts()[:MOST_WARNINGS]
    if warning_log.count > len(texts):
        texts.append(f"{warning_log.count - len(texts)} more warnings")
    return dataclasses.replace(outcome, warnings=tuple(texts))


def is_transient(error: BaseException | None) -> bool:
    """Whether an error, or what caused it, is a fault of storage, network or memory that may pass."""
    from rose2_logs.batch.remote import TransferError

    while error is not None:
        if isinstance(error, TransferError | ConnectionError | TimeoutError | MemoryError):
            return True
        if isinstance(error, OSError) and error.errno in TRANSIENT:
            return True
        error = error.__cause__ or error.__context__
    return False


def _analyze(task: LogTask, report: Report, warning_log: WarningLog) -> LogOutcome:
    if task.version != __version__:
        raise Rose2LogsError(f"the worker runs rose2-logs {__version__}, the batch {task.version}")
    if task.attempt > 1:
        time.sleep(RETRY_PAUSE_S * 2 ** (task.attempt - 2))
    signature = signature_of(task.log)
    if task.known is not None and task.stands_by(signature):
        return LogOutcome(task.name, "unchanged", record=_confirmed(task, task.known, signature))
    with _local_copy(task.log) as path:
        try:
            return _analyze_local(task, path, signature, report)
        except Rose2LogsError as error:
            # Where the copy lay is of no use to anybody.
            if task.log.is_remote and str(path) in str(error):
                raise type(error)(str(error).replace(str(path), task.log.address)) from error
            raise
        finally:
            if task.log.is_remote:
                warning_log.rename(str(path), task.log.address)


def _analyze_local(task: LogTask, path: Path, signature: Signature, report: Report) -> LogOutcome:
    from rose2_logs.batch.store import Store
    from rose2_logs.runs.provenance import fingerprint
    from rose2_logs.runs.summary import SUMMARY
    from rose2_logs.workflows.analyze import analyze_log

    if task.known is not None:
        is_same = fingerprint(path)["sha256"] == task.known.sha256
        if is_same and task.is_whole:
            return LogOutcome(task.name, "unchanged", record=_confirmed(task, task.known, signature))
        if not is_same and task.known_name == task.name and not task.may_replace:
            raise OutputError(
                f"{task.log.address}: has changed since its results; overwrite=True replaces them"
            )
    with _attempt_folder(task) as folder:
        # A log that was stopped is analyzed anew, in another folder: nothing is to be kept for it.
        options = dataclasses.replace(task.options, journal=False, origin=task.log.address)
        reported = 0.0

        def on_snapshot(_: object, share: float) -> None:
            nonlocal reported
            if time.monotonic() - reported >= REPORT_EVERY_S:
                if not (task.store or (task.work / RUNNING).exists()):
                    raise BatchOverError("the batch has ended")
                reported = time.monotonic()
                report(Progress(task.name, share))

        report(Progress(task.name, 0.0))
        analyze_log(path, folder, options, on_snapshot)
        if not task.log.is_remote and signature_of(task.log).files != signature.files:
            raise LogError(f"{task.log.address}: changed while it was read; run again when it is whole")
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        record = _record(task, signature, summary["input"]["sha256"])
        record.write(folder)
        if not task.store:
            return LogOutcome(task.name, "done", results=folder)
        store = Store(task.store, task.work.name)
        if not store.is_open():
            raise BatchOverError("the batch has ended")
        store.upload(folder, task.name)
        return LogOutcome(task.name, "done", record=record, summary=summary)


def _confirmed(task: LogTask, known: Record, signature: Signature) -> Record:
    """Record of earlier results with the address and signature that their log has now."""
    return dataclasses.replace(_record(task, signature, known.sha256), layers=known.layers)


def _record(task: LogTask, signature: Signature, sha256: str) -> Record:
    asked = task.options
    return Record(task.log.address, signature, sha256, deciding_settings(asked), asked.layers)


@contextmanager
def _local_copy(log: Location) -> Iterator[Path]:
    """Give the path of a log on this machine: for one behind a URL that of a copy, deleted afterwards."""
    if not log.is_remote:
        yield Path(log.target)
        return
    from rose2_logs.batch.remote import describe, fetch

    with tempfile.TemporaryDirectory(prefix="rose2_logs_", ignore_cleanup_errors=True) as scratch:
        yield fetch(log.target, describe(log.target), Path(scratch))


@contextmanager
def _attempt_folder(task: LogTask) -> Iterator[Path]:
    """Make a folder for this try alone, which is deleted if the try fails.

    Its name holds those of the machine and the process, for people who look for them.
    """
    if task.store:
        with tempfile.TemporaryDirectory(prefix="rose2_logs_", ignore_cleanup_errors=True) as scratch:
            yield Path(scratch)
        return
    if not (task.work / RUNNING).exists():
        raise OutputError(
            f"{task.work.parents[2]}: not seen from {platform.node()}; workers must share that folder"
        )
    folder = task.work / task.name / f"{platform.node()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"
    try:
        folder.parent.mkdir(exist_ok=True)
        folder.mkdir()
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made: {error.strerror}") from error
    try:
        yield folder
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


@contextmanager
def _own_messages() -> Iterator[None]:
    """Keep the messages of this package from other handlers in this process: they are sent back instead."""
    logger = logging.getLogger(PACKAGE)
    before, logger.propagate = logger.propagate, False
    try:
        yield
    finally:
        logger.propagate = before
