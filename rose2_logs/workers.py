"""One function over a stream of items, by several processes: in order, with bounded memory."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeVar

from rose2_logs.errors import Rose2LogsError

Item = TypeVar("Item")
Result = TypeVar("Result")

LOOK_AHEAD_PER_WORKER = 2
"""Items handed out and not yet taken back, for each worker: one in work and one waiting."""
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")
"""Where OpenMP, the linear algebra libraries and Rerun look for the number of threads when loaded."""


class WorkerError(Rose2LogsError):
    """A worker process ended before its work was done."""


def ordered_map(
    function: Callable[[Item], Result], items: Iterable[Item], workers: int = 1
) -> Iterator[tuple[Item, Result]]:
    """Yield each item with its result, in the order of the items.

    Each call runs on a single thread, so that a result does not depend on the number of workers.

    Parameters
    ----------
    function : callable
        With more than one worker it must be picklable, like its argument and its result.
    items : iterable
        Taken as they are needed, never more than `LOOK_AHEAD_PER_WORKER` for each worker ahead.
    workers : int
        Processes; with 1 the work is done in this one.

    Raises
    ------
    WorkerError
        If a worker process is killed.
    """
    if workers <= 1:
        for item in items:
            yield item, _call_on_one_thread(function, item)
        return
    # Forking a process that already runs threads (Rerun, Arrow) may lock up; a fresh interpreter cannot.
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_ignore_interrupts)
    pending: deque[tuple[Item, Future[Result]]] = deque()
    try:
        for item in items:
            pending.append((item, pool.submit(_call_on_one_thread, function, item)))
            if len(pending) >= LOOK_AHEAD_PER_WORKER * workers:
                yield _taken(pending)
        while pending:
            yield _taken(pending)
    except BrokenProcessPool as error:
        raise WorkerError(
            f"one of {workers} worker processes was killed, likely for lack of memory; use fewer --workers"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _taken(pending: deque[tuple[Item, Future[Result]]]) -> tuple[Item, Result]:
    item, future = pending.popleft()
    return item, future.result()


def _ignore_interrupts() -> None:
    """Leave Ctrl-C to the parent, which then ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _call_on_one_thread(function: Callable[[Item], Result], item: Item) -> Result:
    with _one_thread():
        return function(item)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Hold OpenCV and the linear algebra libraries to one thread, and let them go afterwards."""
    import cv2
    from threadpoolctl import threadpool_limits

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(threads)


def limit_process_to_one_thread() -> None:
    """Hold the numeric libraries of this process to one thread from now on, also those not loaded yet.

    For worker processes that each do a whole log: several share the processors as it is.
    """
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    import cv2
    import pyarrow as pa
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    pa.set_cpu_count(1)
    threadpool_limits(1)
