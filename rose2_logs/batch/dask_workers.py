"""Workers of a Dask cluster, whose scheduler gives the log of a lost worker to another one."""

from __future__ import annotations

import logging
import queue
import time
import uuid
from collections import deque
from collections.abc import Iterator
from concurrent.futures import CancelledError
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rose2_logs.batch.remote import EXTRA
from rose2_logs.batch.task import LogOutcome, LogTask, Progress, analyze_task
from rose2_logs.errors import ParameterError
from rose2_logs.system.workers import WorkerError, keep_freed_memory, limit_process_to_one_thread

logger = logging.getLogger(__name__)

CONNECT_TIMEOUT_S = 10.0
"""Maximum time for the scheduler to answer."""
LOOK_EVERY_S = 2.0
"""Time between two checks whether the scheduler still answers and has workers."""
LOGS_PER_THREAD = 4
"""Logs that the scheduler holds for each thread of its workers: one in work, the others so that none waits
for this process. The rest of a large batch stays here, so that the scheduler needs no more memory for it."""
LEAST_LOGS = 16
"""As many at least, also while no worker has joined: a cluster that grows by itself must see that there is
work."""


class DaskWorkers:
    """The workers of a Dask cluster; a context manager that cancels what is left and disconnects.

    Parameters
    ----------
    address : str
        Address of the scheduler, ``tcp://HOST:8786`` or ``HOST:8786``, or the path of its scheduler file.

    Raises
    ------
    ParameterError
        If Dask is not installed, or no scheduler answers.
    """

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError as error:
            raise ParameterError(f"a scheduler needs Dask: {EXTRA}") from error
        # What its client logs about a lost scheduler, traceback and all, is reported here in one line.
        for name in ("distributed", "distributed.client", "distributed.core"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._address = address
        self._topic = f"rose2-logs-{uuid.uuid4().hex}"
        self._news: queue.Queue[Progress | Any] = queue.Queue()
        self._waiting: deque[LogTask] = deque()
        self._tasks: dict[Any, LogTask] = {}
        self._most = LEAST_LOGS
        self._looked = False
        where: dict[str, Any] = (
            {"scheduler_file": address} if Path(address).is_file() else {"address": address}
        )
        try:
            connect: Any = distributed.Client
            self._client: Any = connect(
                **where, timeout=CONNECT_TIMEOUT_S, set_as_default=False, name="rose2-logs"
            )
        except (OSError, ValueError) as error:
            raise ParameterError(
                f"{address}: no Dask scheduler answers; `dask scheduler` prints its address"
            ) from error
        self._killed_worker = distributed.KilledWorker
        self._client.subscribe_topic(self._topic, lambda event: self._news.put(Progress(*event[1])))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._tasks and self._client.status == "running":
            self._client.cancel(list(self._tasks))
        self._client.close(timeout=CONNECT_TIMEOUT_S)

    def submit(self, task: LogTask) -> None:
        """Accept a task; tasks are begun in their order."""
        self._waiting.append(task)

    def events(self) -> Iterator[Progress | LogOutcome]:
        """Yield what the workers report until no task is left; more may be submitted in the meantime.

        Raises
        ------
        WorkerError
            If the scheduler is lost.
        """
        looked = 0.0
        while self._waiting or self._tasks:
            if time.monotonic() - looked >= LOOK_EVERY_S:
                self._look()
                looked = time.monotonic()
            while self._waiting and len(self._tasks) < self._most:
                self._send(self._waiting.popleft())
            try:
                news = self._news.get(timeout=LOOK_EVERY_S)
            except queue.Empty:
                continue
            if isinstance(news, Progress):
                yield news
            elif news in self._tasks:
                yield self._outcome(news, self._tasks.pop(news))

    def _send(self, task: LogTask) -> None:
        # The scheduler keeps statistics for each beginning of a key, so it must be the same for all logs.
        key = f"rose2-logs-{uuid.uuid4().hex}"
        future = self._client.submit(analyze_on_worker, task, self._topic, key=key, pure=False)
        self._tasks[future] = task
        future.add_done_callback(self._news.put)

    def _look(self) -> None:
        """Notice what would make the wait endless, and how many logs the workers can take."""
        lost = any(future.status in ("lost", "cancelled") for future in self._tasks)
        if lost or self._client.status in ("closing", "closed"):
            raise self._is_gone()
        if self._client.status != "running":
            return
        try:
            threads = self._client.nthreads()
        except OSError:
            # It was lost just now; what the client makes of that is seen next time.
            return
        self._most = max(LEAST_LOGS, LOGS_PER_THREAD * sum(threads.values()))
        if self._looked:
            return
        self._looked = True
        if not threads:
            logger.warning(
                "no worker has joined the scheduler yet: `dask worker %s` starts one", self._address
            )
        if any(count > 1 for count in threads.values()):
            logger.warning("workers with several threads share one Python: start them with one thread each")

    def _is_gone(self) -> WorkerError:
        return WorkerError(
            f"the Dask scheduler at {self._address} is gone; the same call again analyzes the rest"
        )

    def _outcome(self, future: Any, task: LogTask) -> LogOutcome:
        if future.status in ("lost", "cancelled"):
            raise self._is_gone()
        error = future.exception() if future.status == "error" else None
        if error is None:
            try:
                outcome: LogOutcome = future.result()
            except (OSError, CancelledError) as lost:
                raise self._is_gone() from lost
            return outcome
        if isinstance(error, self._killed_worker):
            # The scheduler counts also losses of workers where the log only waited behind the one to blame.
            begun = len(list((task.work / task.name).glob("*")))
            return LogOutcome(
                task.name,
                "failed",
                reason="the workers that tried it were lost one after the other, likely for lack of memory",
                is_transient=True,
                tries=max(begun, 1),
                details=str(error),
            )
        reason = (
            f"the worker could not run it ({type(error).__name__}: {error}); is rose2-logs installed there?"
        )
        return LogOutcome(task.name, "failed", reason=reason, details=str(error))


@cache
def _make_ready() -> None:
    """Give each log one thread, as the other processors have logs of their own, and keep freed memory.

    Dask lets its workers return all freed memory to the system at once, which takes a third of the time of
    an analysis.
    """
    limit_process_to_one_thread()
    keep_freed_memory()


def analyze_on_worker(task: LogTask, topic: str) -> LogOutcome:
    """Carry out a task in a Dask worker; its progress is reported through the scheduler."""
    from distributed import get_worker

    _make_ready()
    worker = get_worker()
    return analyze_task(task, lambda news: worker.log_event(topic, [news.name, news.share]))
