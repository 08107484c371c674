"""Worker processes on this machine: each analyzes log after log; one that dies fails only its own log."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from types import TracebackType
from typing import Self

from rose2_logs.batch.task import LogOutcome, LogTask, Progress, analyze_task
from rose2_logs.system import signals
from rose2_logs.system.workers import limit_process_to_one_thread, usable_processes

DEATH_TIMEOUT_S = 5.0
"""Waited for a process that has closed its pipe to end, so that its exit code is known."""


class LocalWorkers:
    """A pool of worker processes, started when needed; a context manager that ends them.

    Parameters
    ----------
    count : int
        Maximum number of processes, see `usable_processes`.
    """

    def __init__(self, count: int) -> None:
        self._count = usable_processes(count)
        self._waiting: deque[LogTask] = deque()
        self._idle: list[_Worker] = []
        self._busy: list[_Worker] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for worker in (*self._idle, *self._busy):
            worker.end()

    def submit(self, task: LogTask) -> None:
        """Accept a task; tasks are begun in their order."""
        self._waiting.append(task)

    def events(self) -> Iterator[Progress | LogOutcome]:
        """Yield what the workers report until no task is left; more may be submitted in the meantime."""
        while self._waiting or self._busy:
            while self._waiting and len(self._busy) < self._count:
                worker = self._idle.pop() if self._idle else _Worker()
                self._busy.append(worker)
                worker.begin(self._waiting.popleft())
            ready = wait([worker.connection for worker in self._busy])
            for worker in [each for each in self._busy if each.connection in ready]:
                news = worker.news()
                if isinstance(news, LogOutcome):
                    self._busy.remove(worker)
                    if worker.is_alive:
                        self._idle.append(worker)
                yield news


class _Worker:
    """One process, and the pipe to it."""

    def __init__(self) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        # A forked process would share threads and locks of Arrow and Rerun that do not survive it.
        self._process: SpawnProcess = multiprocessing.get_context("spawn").Process(
            target=_serve, args=(theirs,), daemon=True
        )
        self._process.start()
        theirs.close()
        self._task: LogTask | None = None
        self.is_alive = True

    def begin(self, task: LogTask) -> None:
        self._task = task
        # The process may have just died, which `news` will notice.
        with suppress(OSError):
            self.connection.send(task)

    def news(self) -> Progress | LogOutcome:
        """Receive what the process reports; if it died, the outcome of its task."""
        try:
            news: Progress | LogOutcome = self.connection.recv()
        except (EOFError, OSError):
            self._process.join(DEATH_TIMEOUT_S)
            self.end()
            assert self._task is not None
            return LogOutcome(self._task.name, "failed", reason=self._cause_of_death(), is_transient=True)
        return news

    def end(self) -> None:
        self._process.kill()
        self._process.join()
        self.connection.close()
        self.is_alive = False

    def _cause_of_death(self) -> str:
        code = self._process.exitcode or 0
        if code >= 0:
            return f"its worker process ended with exit code {code}"
        name = signal.Signals(-code).name
        return f"its worker process was killed ({name}), likely for lack of memory; use fewer workers"


def _serve(connection: Connection) -> None:
    """Carry out the tasks that come through a pipe, one by one, until it is closed."""
    # Ctrl-C reaches the whole group of processes; the parent ends its workers itself.
    signals.ignore()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    limit_process_to_one_thread()
    while True:
        try:
            task = connection.recv()
        except EOFError:
            return
        connection.send(analyze_task(task, connection.send))


def _end_with_parent() -> None:
    """End this process as soon as the one that started it is gone, however that ended."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
