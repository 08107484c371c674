"""A batch: plan it, run it, put its results in place. A stopped one leaves only complete results."""

from __future__ import annotations

import dataclasses
import fnmatch
import logging
import os
import re
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from rose2_logs.batch import dataset
from rose2_logs.batch.finding import find_logs
from rose2_logs.batch.folders import LOGS_FOLDER, assign_names, locked, put_in_place, work_folder
from rose2_logs.batch.local_workers import LocalWorkers
from rose2_logs.batch.location import Location, require_place
from rose2_logs.batch.options import BatchOptions
from rose2_logs.batch.record import (
    RECORD,
    Record,
    Signature,
    deciding_settings,
    local_signature,
    read_record,
)
from rose2_logs.batch.task import LogOutcome, LogTask, Progress
from rose2_logs.errors import LogError, OutputError, ParameterError
from rose2_logs.io.discovery import BAG_DESCRIPTION
from rose2_logs.runs.summary import SUMMARY, write_json
from rose2_logs.runs.tables import BACK_PROJECTED, TABLES
from rose2_logs.system.files import OnFailure, expanded, require_local, require_utf8
from rose2_logs.system.workers import usable_cpus

if TYPE_CHECKING:
    from rose2_logs.batch.store import Store

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class LogState:
    """How one log of a batch ended.

    Attributes
    ----------
    name : str
        Name of its folder and of its partition of the data set.
    status : str
        ``done``, ``up to date`` or ``failed``.
    row : dict
        Its row of the summary.
    """

    name: str
    status: str
    row: dataset.Row


@dataclass(frozen=True)
class BatchResult:
    """The outcome of a batch: where its results are, how each log ended, sorted by name, and its summary."""

    out: str
    states: tuple[LogState, ...]
    files: tuple[Path, ...]

    @property
    def failed(self) -> tuple[LogState, ...]:
        """Logs that could not be analyzed."""
        return tuple(state for state in self.states if state.status == "failed")


class Listener(Protocol):
    """Shows the progress of a batch."""

    def begin(self, logs: int, up_to_date: int) -> None:
        """Show how many logs there are and how many of them are up to date; called once, first."""
        ...

    def progress(self, told: Progress) -> None:
        """Show how far a log is."""
        ...

    def retry(self, name: str, reason: str) -> None:
        """Show that a log is tried again, and why."""
        ...

    def finished(self, state: LogState, outcome: LogOutcome) -> None:
        """Show how a log ended, and what its worker reported."""
        ...


class Workers(AbstractContextManager["Workers"], Protocol):
    """Processes, here or on other machines, that analyze logs."""

    def submit(self, task: LogTask) -> None:
        """Accept a task."""
        ...

    def events(self) -> Iterator[Progress | LogOutcome]:
        """Yield what the workers report until no task is left; more may be submitted in the meantime."""
        ...


def run_batch(
    arguments: Sequence[str], out: str | Path, options: BatchOptions, listener: Listener
) -> BatchResult:
    """Analyze many logs, each into its own folder, with one data set and one summary of all.

    Each log's results go to ``out/logs/NAME``, as `analyze_log` writes them; the tables of all logs to
    ``out/tables``, partitioned by log; one row per log to ``out/summary.parquet`` and ``out/summary.csv``.
    Logs with results of the same content and options are left as they are. A log that
    fails does not stop the others, and leaves what was there before.

    Parameters
    ----------
    arguments : sequence of str
        Logs, folders, patterns, URLs; see `find_logs`.
    out : str or path
        Output folder, created if needed. Workers on other machines must see it at the same path. Or a URL of
        an object store, to which the workers upload their results.
    options : BatchOptions
        What to take from each log, how to analyze it, and by which workers.
    listener : Listener
        To show progress.

    Raises
    ------
    LogError
        If there are no logs, or a URL for results cannot be written to.
    ParameterError
        If the scheduler does not answer, or a URL for results names no place in an object store.
    OutputError
        If the folder cannot be used, another batch is writing to it, or it holds results of other options
        that may not be replaced.
    WorkerError
        If the scheduler is lost.
    """
    # A path holds one of the two slashes of a URL.
    if url := re.fullmatch(r"([a-z][a-z0-9+.-]+):/+(.*)", str(out)):
        place = f"{url[1]}://{url[2].rstrip('/')}"
        if url[1] in ("http", "https", "file"):
            raise ParameterError(f"{out}: results go to a folder or to an object store")
        require_place(place)
        with tempfile.TemporaryDirectory(prefix="rose2_logs_") as scratch:
            return _run_batch(arguments, Path(scratch), place, options, listener)
    require_local(Path(out))
    out = Path(os.path.abspath(expanded(Path(out))))  # noqa: PTH100 (as in find_logs)
    require_utf8(out)
    return _run_batch(arguments, out, "", options, listener)


def _run_batch(
    arguments: Sequence[str], out: Path, url: str, options: BatchOptions, listener: Listener
) -> BatchResult:
    """Run a batch whose results go to a folder, or by way of its workers to a URL.

    Then the folder holds only records and summaries of the logs.
    """
    logs = find_logs(arguments, out)
    if url:
        logs = [log for log in logs if not log.target.startswith(f"{url}/{LOGS_FOLDER}/")]
        if not logs:
            raise LogError(
                f"{url}: no log there but results; name the logs, or choose another place for results"
            )
    with locked(out), work_folder(out) as work, _opened(url, work.name) as store:
        batch = _Batch(out, work, options, listener, store)
        tasks = batch.plan(logs)
        with OnFailure(batch.sum_up):
            batch.carry_out(tasks)
        files = batch.sum_up()
    return BatchResult(url or str(out), tuple(sorted(batch.states, key=lambda state: state.name)), files)


@contextmanager
def _opened(url: str, run: str) -> Iterator[Store | None]:
    """Open a store for results, where there is a URL of one."""
    if not url:
        yield None
        return
    from rose2_logs.batch.store import Store

    store = Store(url, run)
    store.open()
    with OnFailure(store.close):
        yield store
    store.close()


class _Batch:
    """A running batch: earlier results, tasks under way, and how the logs so far ended."""

    def __init__(
        self, out: Path, work: Path, options: BatchOptions, listener: Listener, store: Store | None = None
    ) -> None:
        self.states: list[LogState] = []
        self._out = out
        self._store = store
        self._url = store.url if store else ""
        self._in_store = store.fetch(out) if store else {}
        self._work = work
        self._options = options
        self._listener = listener
        self._settings = deciding_settings(options.run)
        self._may_replace = options.overwrite or options.rerun
        folders = sorted(folder for folder in (out / LOGS_FOLDER).glob("*") if folder.is_dir())
        self._records = {folder.name: read_record(folder) for folder in folders}

    def plan(self, logs: Sequence[Location]) -> list[LogTask]:
        """Name the logs, and make a task of each that is not up to date."""
        by_address = {record.address: name for name, record in self._records.items() if record is not None}
        looks = {log: _local_look(log) for log in logs}
        names = assign_names(logs, by_address, self._records)
        moved = self._moved(looks, by_address)
        self._check_settings({*names.values(), *moved.values()})
        tasks: list[tuple[int, LogTask]] = []
        for log, name in names.items():
            look, known_name = looks[log], moved.get(log, name)
            known = self._standing(known_name)
            task = LogTask(log, name, self._work, self._options.run, known, known_name)
            task = dataclasses.replace(
                task,
                is_whole=self._is_whole(known_name),
                may_replace=self._may_replace,
                store=self._url,
            )
            if task.stands_by(look):
                self.states.append(LogState(name, "up to date", dataset.summary_row(self._out, name)))
            else:
                tasks.append((look.size_bytes if look else 0, task))
        self._listener.begin(len(logs), len(self.states))
        # Large logs first, so that none is left alone at the end.
        return [task for _, task in sorted(tasks, key=lambda each: -each[0])]

    def carry_out(self, tasks: Sequence[LogTask]) -> None:
        """Run the tasks, and put their results in place."""
        if not tasks:
            return
        under_way = {task.name: task for task in tasks}
        tries = Counter[str]()
        with self._workers() as workers:
            for task in tasks:
                workers.submit(task)
            for told in workers.events():
                if isinstance(told, Progress):
                    self._listener.progress(told)
                    continue
                task = under_way[told.name]
                tries[told.name] += told.tries
                if told.is_transient and tries[told.name] <= self._options.retries:
                    self._listener.retry(told.name, told.reason)
                    shutil.rmtree(self._work / told.name, ignore_errors=True)
                    under_way[told.name] = dataclasses.replace(task, attempt=task.attempt + 1)
                    workers.submit(under_way[told.name])
                else:
                    self._take(task, told)

    def sum_up(self) -> tuple[Path, ...]:
        """Bring data set and summary up to date with the finished logs and the failures of this batch."""
        finished = [name for name, record in self._records.items() if record is not None]
        rows = {state.name: state.row for state in self.states}
        new = {state.name for state in self.states if state.status == "done"}
        if self._store is None:
            for name in finished:
                if name not in new:
                    dataset.publish_tables(self._out, name)
            dataset.withdraw_tables(self._out, finished)
        else:
            self._store.withdraw_tables(finished)
        others = [dataset.summary_row(self._out, name) for name in finished if name not in rows]
        files = dataset.write_summary_tables(self._out, [*rows.values(), *others])
        if self._store is not None:
            for file in files:
                self._store.put(file, file.name)
        return files

    def _moved(self, looks: dict[Location, Signature | None], known: dict[str, str]) -> dict[Location, str]:
        """Earlier results of logs that seem to have moved, by name and size; the workers make sure."""
        here = {log.address for log in looks}
        gone = {
            (Location(record.address).parts[-1], record.signature.size_bytes): name
            for name, record in self._records.items()
            if record is not None and record.address not in here
        }
        return {
            log: gone.pop((log.parts[-1], look.size_bytes))
            for log, look in looks.items()
            if look and log.address not in known and (log.parts[-1], look.size_bytes) in gone
        }

    def _standing(self, name: str) -> Record | None:
        """Record of earlier results that were made with the same options."""
        record = self._records.get(name)
        if record is None or self._options.rerun or record.difference(self._settings):
            return None
        return record

    def _is_whole(self, name: str) -> bool:
        """Whether earlier results have all the files that are wanted now."""
        wanted = [SUMMARY, *(f"{table}.parquet" for table in TABLES)]
        asked, record = self._options.run, self._records.get(name)
        if asked.recording and record is not None and record.layers != asked.layers:
            return False
        wanted += ["*.rrd"] if asked.recording else []
        wanted += ["*.rose2.mcap"] if asked.annotated_log else []
        wanted += [f"{BACK_PROJECTED}.parquet"] if asked.back_project else []
        wanted += [BAG_DESCRIPTION] if asked.bag else []
        folder = self._out / LOGS_FOLDER / name
        there = self._in_store.get(name, []) if self._store else _names_in(folder)
        return all(fnmatch.filter(there, each) for each in wanted)

    def _check_settings(self, names: set[str]) -> None:
        """Refuse to mix results of different options in one data set, unless they may be replaced."""
        others = {
            name: difference
            for name, record in self._records.items()
            if record is not None and (difference := record.difference(self._settings))
        }
        if others and not self._may_replace:
            name, difference = next(iter(others.items()))
            raise OutputError(
                f"{self._url or self._out}: holds results of other options "
                f"({len(others)} logs; {name}: {difference}); "
                "choose another folder, or allow overwriting to analyze the logs given now again "
                "(overwrite=True)"
            )
        if left := sorted(set(others) - names):
            logger.warning(
                "%d logs that are not among those given now keep results of other options (%s: %s)",
                len(left),
                left[0],
                others[left[0]],
            )

    def _workers(self) -> Workers:
        if self._options.scheduler is None:
            return LocalWorkers(self._options.workers or usable_cpus())
        from rose2_logs.batch.dask_workers import DaskWorkers

        return DaskWorkers(self._options.scheduler)

    def _take(self, task: LogTask, outcome: LogOutcome) -> None:
        """Put the results of a task in place and report it."""
        name = task.known_name if outcome.status == "unchanged" else task.name
        folder = self._out / LOGS_FOLDER / name
        try:
            if outcome.results is not None:
                put_in_place(outcome.results, self._out, name)
            elif outcome.record is not None:
                folder.mkdir(parents=True, exist_ok=True)
                outcome.record.write(folder)
            if self._store is not None and outcome.summary is not None:
                write_json(folder / SUMMARY, outcome.summary)
            elif self._store is not None and outcome.record is not None:
                self._store.put(folder / RECORD, f"{LOGS_FOLDER}/{name}/{RECORD}")
            if outcome.status != "failed":
                self._records[name] = read_record(folder)
                if self._store is None:
                    dataset.publish_tables(self._out, name)
        except (OSError, OutputError, LogError) as error:
            outcome = dataclasses.replace(outcome, status="failed", reason=f"{folder}: {error}")
        # With what lost workers may have left of it.
        shutil.rmtree(self._work / task.name, ignore_errors=True)
        if outcome.status == "failed":
            kept = "; the tables hold its earlier results" if self._records.get(name) is not None else ""
            row = dataset.failed_row(name, task.log.address, f"{outcome.reason}{kept}")
        else:
            row = dataset.summary_row(self._out, name)
        status = "up to date" if outcome.status == "unchanged" else outcome.status
        self.states.append(LogState(name, status, row))
        self._listener.finished(self.states[-1], outcome)


def _names_in(folder: Path) -> list[str]:
    try:
        return os.listdir(folder)  # noqa: PTH208 (names alone)
    except OSError:
        return []


def _local_look(log: Location) -> Signature | None:
    """Signature of a log on this machine; None if it is elsewhere or cannot be read: a worker will see."""
    if log.is_remote:
        return None
    try:
        return local_signature(Path(log.target))
    except LogError:
        return None
