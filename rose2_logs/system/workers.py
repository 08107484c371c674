"""One function over a stream of items, by several processes: in order, with bounded memory."""

from __future__ import annotations

import copy
import multiprocessing
import os
import shutil
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from multiprocessing.context import BaseContext
from types import ModuleType, TracebackType
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

from rose2_logs.errors import Rose2LogsError
from rose2_logs.system.shared_memory import Packed, pack, shared_memory_folders, unpack

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

Item = TypeVar("Item")
Result = TypeVar("Result")

LOOK_AHEAD_PER_WORKER = 2
"""Items handed out and not yet taken back, for each worker: one in work and one waiting."""
MOST_ON_WINDOWS = 61
"""Processes that one can wait for at once on Windows: 64 objects, less those of the pool itself."""
START_METHOD = "forkserver" if sys.platform == "linux" else "spawn"
"""How processes start. On Linux they are copies of a fresh process that has imported what the function needs,
once for all; on other systems libraries do not bear to be copied after their import."""
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")
"""Where OpenMP, the linear algebra libraries and Rerun look for the number of threads when loaded."""
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
"""Options of the GNU C library's `mallopt` (malloc.h)."""
KEPT_ARRAY_BYTES, KEPT_BYTES = 32 << 20, 1 << 30
"""Arrays up to the first size are kept when they are freed, the most that all versions of the library allow;
all together up to the second, far above what one map takes."""


class WorkerError(Rose2LogsError):
    """A worker process ended before its work was done."""


class Workers(Generic[Item, Result]):
    """Calls one function on items in several processes; a context manager that starts them and ends them.

    Each call runs on a single thread, so that a result does not depend on the number of workers. Items and
    results go through shared memory.

    Parameters
    ----------
    function : callable
        With more than one worker it must be picklable, like its argument and its result.
    count : int
        Processes, see `usable_processes`; with 1 the work is done in this one.
    """

    def __init__(self, function: Callable[[Item], Result], count: int = 1) -> None:
        self._function = function
        self._count = usable_processes(count)
        self._stack = ExitStack()
        self._pool: ProcessPoolExecutor | None = None
        self._folders: tuple[str, ...] = ()

    def __enter__(self) -> Self:
        if self._count > 1:
            self._folders = self._stack.enter_context(shared_memory_folders())
            context = _context(self._function)
            self._pool = ProcessPoolExecutor(
                self._count, context, initializer=_begin, initargs=(self._function, self._folders)
            )
            self._stack.callback(self._pool.shutdown, wait=True, cancel_futures=True)
            # A task starts a process: they import what they need while this one opens its files.
            for _ in range(self._count):
                self._pool.submit(_nothing)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stack.close()

    def map(
        self,
        items: Iterable[Item],
        is_same: Callable[[Item, Item], bool] | None = None,
        known: Callable[[Item], Result | None] | None = None,
    ) -> Iterator[tuple[Item, Result]]:
        """Yield each item with its result, in the order of the items.

        Parameters
        ----------
        items : iterable
            Taken as they are needed, never more than `LOOK_AHEAD_PER_WORKER` for each worker ahead.
        is_same : callable, optional
            Whether an item and the next one have the same result: then the function is not called again.
        known : callable, optional
            Gives results that are known already; None where the function is to be called.

        Raises
        ------
        WorkerError
            If a worker process is killed.
        """
        if self._pool is None:
            yield from self._map_here(items, is_same, known)
            return
        pending: deque[tuple[Item, _Task]] = deque()
        before: tuple[Item, _Task] | None = None
        try:
            for item in items:
                if before is not None and is_same is not None and is_same(before[0], item):
                    before = (item, before[1])
                elif known is not None and (result := known(item)) is not None:
                    before = (item, _Task(result=result))
                else:
                    packed = pack(item, self._folders)
                    before = (item, _Task(self._pool.submit(_work, packed)))
                pending.append(before)
                if len(pending) >= LOOK_AHEAD_PER_WORKER * self._count:
                    yield _taken(pending)
            while pending:
                yield _taken(pending)
        except BrokenProcessPool as error:
            raise WorkerError(
                f"one of {self._count} worker processes was killed, likely for lack of memory; "
                "use fewer workers"
            ) from error

    def _map_here(
        self,
        items: Iterable[Item],
        is_same: Callable[[Item, Item], bool] | None,
        known: Callable[[Item], Result | None] | None,
    ) -> Iterator[tuple[Item, Result]]:
        before: tuple[Item, Result] | None = None
        for item in items:
            if before is not None and is_same is not None and is_same(before[0], item):
                before = (item, before[1])
            else:
                before = None  # so that only one result is held
                result = None if known is None else known(item)
                if result is None:
                    result = _call_on_one_thread(self._function, item)
                before, result = (item, result), None
            yield before


def usable_processes(count: int, platform: str = sys.platform) -> int:
    """Return how many of so many worker processes the system lets one wait for at once."""
    return min(count, MOST_ON_WINDOWS) if platform == "win32" else count


def ordered_map(
    function: Callable[[Item], Result], items: Iterable[Item], workers: int = 1
) -> Iterator[tuple[Item, Result]]:
    """Yield each item with its result, in the order of the items: `Workers` for a single stream."""
    with Workers(function, workers) as processes:
        yield from processes.map(items)


_CONTEXT: Any = multiprocessing.get_context(START_METHOD)


class WorkerProcess(_CONTEXT.Process):  # type: ignore[misc]
    """A process that starts without the user's script, which nothing that it calls needs.

    Python's own way imports it once more in each process, so that a script without a ``__main__`` guard would
    start all its work again.
    """

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802 (the name that multiprocessing calls)
        script = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            return _CONTEXT.Process._Popen(process)
        finally:
            sys.modules["__main__"] = script


def _context(function: Callable[..., Any]) -> BaseContext:
    """Choose how processes start: never by a copy of this one, whose threads (Rerun, Arrow) might lock up."""
    context = copy.copy(_CONTEXT)
    if START_METHOD == "forkserver":
        context.set_forkserver_preload([getattr(function, "func", function).__module__])
    context.Process = WorkerProcess
    chosen: BaseContext = context
    return chosen


class _Task:
    """A result that comes once and may be asked for several times."""

    def __init__(self, future: Future[Packed] | None = None, result: Any = None) -> None:
        self._future = future
        self._result = result

    def result(self) -> Any:
        if self._future is not None:
            self._result = unpack(self._future.result())
            self._future = None
        return self._result


def _taken(pending: deque[tuple[Item, _Task]]) -> tuple[Item, Any]:
    item, task = pending.popleft()
    return item, task.result()


# What a worker process calls, and where its results go; set once in each.
_function: Callable[[Any], Any]
_folders: tuple[str, ...]


def _begin(function: Callable[[Any], Any], folders: tuple[str, ...]) -> None:
    """Get a worker process ready, and leave Ctrl-C to the parent, which then ends its workers."""
    global _function, _folders
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    keep_freed_memory()
    _function, _folders = function, folders
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End when the process that this one works for is killed; remove what waits in shared memory."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        for folder in _folders:
            shutil.rmtree(folder, ignore_errors=True)
        os._exit(1)


def keep_freed_memory() -> None:
    """Let this process keep the memory of large arrays that it has freed, for those that come next.

    The GNU C library gives it back, so that every map's arrays are made of fresh pages again, which the
    kernel clears: some percent of the time of an analysis. The peak stays what it is. Elsewhere this does
    nothing.
    """
    import ctypes

    with suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(M_MMAP_THRESHOLD, KEPT_ARRAY_BYTES)
        mallopt(M_TRIM_THRESHOLD, KEPT_BYTES)


def give_back_freed_memory() -> None:
    """Give back what `keep_freed_memory` made this process keep; elsewhere this does nothing.

    Over many maps, what is kept falls into pieces that fit no array, so that the process would grow.
    """
    import ctypes

    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def _nothing() -> None:
    return


def _work(packed: Packed) -> Packed:
    return pack(_call_on_one_thread(_function, unpack(packed)), _folders)


def _call_on_one_thread(function: Callable[[Item], Result], item: Item) -> Result:
    with _one_thread():
        return function(item)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Hold OpenCV and the linear algebra libraries to one thread, and let them go afterwards."""
    import cv2

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with _thread_pools(len(sys.modules)).limit(limits=1):
            yield
    finally:
        cv2.setNumThreads(threads)


@lru_cache(maxsize=1)
def _thread_pools(modules: int) -> ThreadpoolController:
    """Look the thread pools of the loaded libraries up, once for each number of imported modules."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


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
