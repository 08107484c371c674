"""One function applied to a stream of items by several processes: in order, with bounded memory."""

from __future__ import annotations

import copy
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, lru_cache
from itertools import islice
from multiprocessing.context import BaseContext
from multiprocessing.reduction import ForkingPickler
from multiprocessing.util import Finalize
from types import ModuleType, TracebackType
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

from rose2_logs.errors import Rose2LogsError
from rose2_logs.system import signals
from rose2_logs.system.shared_memory import Packed, pack, shared_memory_folders, unpack
from rose2_logs.system.signals import STOPPING, held_back

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

Item = TypeVar("Item")
Result = TypeVar("Result")

LOOK_AHEAD_PER_WORKER = 2
"""Items submitted ahead for each worker: one being processed and one waiting."""
PROCESSES_PER_CPU = 2
"""More do not work faster: while one waits for its next map, the other keeps the processor busy."""
MOST_ON_WINDOWS = 61
"""Processes that Windows can wait for at once: 64 objects, minus those of the pool itself."""
START_METHOD = "forkserver" if sys.platform == "linux" else "spawn"
"""How processes start. On Linux they are forked from a fresh process that has imported the function's module
once for all of them; on other systems, forking after imports is not safe for all libraries."""
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")
"""Where OpenMP, the linear algebra libraries and Rerun read the number of threads when they are loaded."""
SOCKET_NAME_BYTES = 107
"""The longest name of a socket on Linux (unix(7))."""
NAME_IN_FOLDER = "/pymp-12345678/listener-12345678"
"""How multiprocessing names its sockets in the folder for temporary files."""
SHORT_FOLDERS = ("/tmp", "/var/tmp", "/dev/shm")
"""Where sockets lie if the folder for temporary files has too long a name for them."""
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
"""Options of the GNU C library's `mallopt` (malloc.h)."""
KEPT_ARRAY_BYTES, KEPT_BYTES = 32 << 20, 1 << 30
"""Freed arrays up to the first size are kept for reuse (the largest value that all versions of the library
accept), and up to the second size in total, which is far more than one map needs."""


class WorkerError(Rose2LogsError):
    """A worker process ended before its work was finished."""


class Workers(Generic[Item, Result]):
    """Calls one function on items in several processes; a context manager that starts and ends them.

    Each call runs on a single thread, so that results do not depend on the number of workers. Items and
    results are passed through shared memory.

    Parameters
    ----------
    function : callable
        With more than one worker it must be picklable, and so must its argument and its result.
    count : int
        Number of processes, see `usable_processes`; with 1 the work is done in this process.
    """

    def __init__(self, function: Callable[[Item], Result], count: int = 1) -> None:
        self._function = function
        self._count = usable_processes(count)
        self._stack = ExitStack()
        self._pool: ProcessPoolExecutor | None = None
        self._processes: list[WorkerProcess] = []
        self._folders: tuple[str, ...] = ()

    def __enter__(self) -> Self:
        try:
            if self._count > 1:
                self._start()
        except BaseException as error:
            self.__exit__(type(error), error, None)
            if isinstance(error, OSError):  # no space for semaphores, too few files allowed
                raise self._not_started(error) from error
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is not None:
            # Nobody takes what they are still at; one that is just starting would have to be waited for.
            for process in self._processes:
                if process.pid is not None:
                    process.kill()
        self._stack.close()

    def _start(self) -> None:
        self._folders = self._stack.enter_context(shared_memory_folders())
        self._pool = ProcessPoolExecutor(
            self._count,
            _context(self._function, self._processes),
            initializer=_begin,
            initargs=(self._function, self._folders),
        )
        self._stack.callback(self._pool.shutdown, wait=True, cancel_futures=True)

    def _submitted(self, pool: ProcessPoolExecutor, item: Item) -> _Task:
        """Hand an item to the workers.

        This starts one if none is idle. The first has to wait until what it is forked from has imported its
        modules, which is done while this process opens files and imports its own.
        """
        packed = pack(item, self._folders)
        try:
            return _Task(pool.submit(_work, packed))
        except OSError as error:  # too few processes or files allowed
            raise self._not_started(error) from error

    def _not_started(self, error: OSError) -> WorkerError:
        return WorkerError(
            f"{self._count} worker processes cannot start: {error.strerror or error}; "
            "give them space in /dev/shm and higher limits, or take workers=1"
        )

    def map(
        self,
        items: Iterable[Item],
        is_same: Callable[[Item, Item], bool] | None = None,
        known: Callable[[Item], Result | None] | None = None,
    ) -> Iterator[tuple[Item, Result]]:
        """Return each item with its result, in the order of the items.

        With several processes, they begin at once with the first items, and not when the first result is
        asked for.

        Parameters
        ----------
        items : iterable
            Read as needed, at most `LOOK_AHEAD_PER_WORKER` items per worker ahead.
        is_same : callable, optional
            Whether an item and the next one have the same result; then the function is not called again.
        known : callable, optional
            Returns a result that is already known, or None if the function must be called.

        Raises
        ------
        WorkerError
            If a worker process is killed.
        """
        if self._pool is None:
            return self._map_here(items, is_same, known)
        tasks = self._tasks(self._pool, items, is_same, known)
        return self._results(tasks, deque(islice(tasks, LOOK_AHEAD_PER_WORKER * self._count)))

    def _tasks(
        self,
        pool: ProcessPoolExecutor,
        items: Iterable[Item],
        is_same: Callable[[Item, Item], bool] | None,
        known: Callable[[Item], Result | None] | None,
    ) -> Iterator[tuple[Item, _Task]]:
        """Hand out items one after the other."""
        before: tuple[Item, _Task] | None = None
        for item in items:
            if before is not None and is_same is not None and is_same(before[0], item):
                before = (item, before[1])
            elif known is not None and (result := known(item)) is not None:
                before = (item, _Task(result=result))
            else:
                with self._killed_is_told():
                    before = (item, self._submitted(pool, item))
            yield before

    def _results(
        self, tasks: Iterator[tuple[Item, _Task]], pending: deque[tuple[Item, _Task]]
    ) -> Iterator[tuple[Item, Result]]:
        """Yield results in order, and hand out an item for each that was taken."""
        while pending:
            with self._killed_is_told():
                taken = _taken(pending)
            yield taken
            del taken  # an item and its result are not kept while the next one is waited for
            pending.extend(islice(tasks, 1))

    @contextmanager
    def _killed_is_told(self) -> Iterator[None]:
        try:
            yield
        except BrokenProcessPool as error:
            raise WorkerError(
                f"one of {self._count} worker processes was killed, probably because memory ran out; "
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
                before = None  # so that only one result is in memory
                result = None if known is None else known(item)
                if result is None:
                    result = _call_on_one_thread(self._function, item)
                before, result = (item, result), None
            yield before


def usable_cpus() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def usable_processes(count: int, platform: str = sys.platform, cpus: int | None = None) -> int:
    """Reduce a number of worker processes to what is of use and what the operating system supports.

    Parameters
    ----------
    count : int
        As many as were asked for.
    platform : str
        Name of the operating system, as in `sys.platform`.
    cpus : int, optional
        Number of processors; by default those that this process may use.
    """
    if multiprocessing.current_process().daemon:
        return 1  # a process of a pool may not start any
    useful = PROCESSES_PER_CPU * (cpus or usable_cpus())
    return min(count, useful, MOST_ON_WINDOWS) if platform == "win32" else min(count, useful)


def ordered_map(
    function: Callable[[Item], Result], items: Iterable[Item], workers: int = 1
) -> Iterator[tuple[Item, Result]]:
    """Yield each item with its result, in the order of the items: `Workers` for a single stream."""
    with Workers(function, workers) as processes:
        yield from processes.map(items)


def threaded_map(
    function: Callable[[Item], Result], items: Iterable[Item], threads: int = 1
) -> Iterator[tuple[Item, Result]]:
    """Yield each item with its result, in the order of the items, by several threads of this process.

    For functions that spend their time in libraries which let other threads run meanwhile. Items are read as
    needed, at most one for each thread ahead; with one thread the work is done in the calling one.
    """
    if threads == 1:
        yield from ((item, function(item)) for item in items)
        return
    pending: deque[tuple[Item, Future[Result]]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        for item in items:
            pending.append((item, pool.submit(function, item)))
            if len(pending) > threads:
                done, future = pending.popleft()
                yield done, future.result()
        for done, future in pending:
            yield done, future.result()


_CONTEXT: Any = multiprocessing.get_context(START_METHOD)


_STARTING = threading.Lock()
"""Held while a process starts: two threads that start some would put each other's script back."""


class WorkerProcess(_CONTEXT.Process):  # type: ignore[misc]
    """A process that starts without importing the user's script, which its work does not need.

    By default Python imports the script again in each process, so that a script without a ``__main__`` guard
    would start all its work again.
    """

    def start(self) -> None:
        """Start the process; signals come after it, when it can be ended, not while it is half started."""
        with held_back():
            super().start()

    def terminate(self) -> None:
        """End the process, which leaves all other signals to the one that started it."""
        self.kill()

    def __reduce__(self) -> tuple[Any, ...]:
        return _awakened, (bytes(ForkingPickler.dumps(self.__dict__)),)

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802 (the name that multiprocessing calls)
        with _STARTING:
            script = sys.modules["__main__"]
            sys.modules["__main__"] = ModuleType("__main__")
            try:
                return _CONTEXT.Process._Popen(process)
            finally:
                sys.modules["__main__"] = script


def _awakened(state: bytes) -> WorkerProcess:
    """Unpack, in a process that starts, what it is to do; if its parent is gone by now, end it silently."""
    signals.ignore()
    try:
        known = ForkingPickler.loads(state)
    except (OSError, EOFError):
        # The parent's locks went with it.
        parent = multiprocessing.parent_process()
        if parent is None or not parent.is_alive():
            os._exit(1)
        raise
    process = WorkerProcess.__new__(WorkerProcess)
    process.__dict__.update(known)
    return process


def _context(function: Callable[..., Any], started: list[WorkerProcess]) -> BaseContext:
    """Choose how processes start: never by forking this one, whose threads (Rerun, Arrow) could deadlock.

    Parameters
    ----------
    function : callable
        What they are going to call.
    started : list of WorkerProcess
        Receives every process before it starts.
    """

    def process(*arguments: Any, **named: Any) -> WorkerProcess:
        started.append(WorkerProcess(*arguments, **named))
        return started[-1]

    context = copy.copy(_CONTEXT)
    start_importing(getattr(function, "func", function).__module__)
    context.Process = process
    chosen: BaseContext = context
    return chosen


def start_importing(module: str) -> None:
    """Start the process that workers are forked from, unless it runs, and let it import what they need.

    Whoever knows early that there will be workers calls this before importing anything large, so that both
    processes import at the same time. The new process imports with signals blocked.

    Parameters
    ----------
    module : str
        The module of the function that the workers will call.
    """
    if START_METHOD != "forkserver":
        return
    from multiprocessing import forkserver, resource_tracker

    _CONTEXT.set_forkserver_preload([module, "rose2_logs.system.fork_server"])

    _keep_socket_names_short()
    with held_back():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, STOPPING)
        try:
            # It ends with this process. Of the signals it unblocks those that it knows itself: not HUP, which
            # would end it before what it tracks is removed.
            resource_tracker.ensure_running()
            signal.pthread_sigmask(signal.SIG_BLOCK, STOPPING)
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _keep_socket_names_short() -> None:
    """Give multiprocessing a private folder for its sockets where their names would be too long otherwise."""
    config: dict[str, Any] = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    longest = os.fsencode(tempfile.gettempdir() + NAME_IN_FOLDER)
    if config.get("tempdir") is not None or len(longest) <= SOCKET_NAME_BYTES:
        return
    for place in SHORT_FOLDERS:
        with suppress(OSError):
            folder = tempfile.mkdtemp(prefix="rose2_logs_", dir=place)
            # Removed when multiprocessing would remove its own: after what uses the sockets.
            Finalize(None, shutil.rmtree, (folder, True), exitpriority=-100)
            config["tempdir"] = folder
            return


class _Task:
    """A result that is unpacked once and may be read several times."""

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


# The function of a worker process, and the folders for its results; set once in each process.
_function: Callable[[Any], Any]
_folders: tuple[str, ...]


def _begin(function: Callable[[Any], Any], folders: tuple[str, ...]) -> None:
    """Initialize a worker process; stopping is left to the parent, which then ends its workers."""
    global _function, _folders
    signals.ignore()
    keep_freed_memory()
    _function, _folders = function, folders
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when its parent is killed, and remove what is left in shared memory."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        for folder in _folders:
            shutil.rmtree(folder, ignore_errors=True)
        os._exit(1)


def keep_freed_memory() -> None:
    """Let this process keep the memory of freed large arrays for the next ones.

    By default the GNU C library returns it to the system, and the arrays of every map need fresh pages that
    the kernel must clear, which takes a few percent of the time of an analysis. Peak memory does not change.
    With other C libraries this does nothing.
    """
    import ctypes

    with suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(M_MMAP_THRESHOLD, KEPT_ARRAY_BYTES)
        mallopt(M_TRIM_THRESHOLD, KEPT_BYTES)


def give_back_freed_memory() -> None:
    """Return the memory kept by `keep_freed_memory` to the system; with other C libraries this does nothing.

    Over many maps the kept memory becomes fragmented and no longer fits new arrays, so the process would
    grow.
    """
    import ctypes

    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def _work(packed: Packed) -> Packed:
    return pack(_call_on_one_thread(_function, unpack(packed)), _folders)


def _call_on_one_thread(function: Callable[[Item], Result], item: Item) -> Result:
    with _limit():
        return function(item)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Limit OpenCV and the linear algebra libraries to one thread while the context lasts."""
    import cv2

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with _thread_pools(len(sys.modules)).limit(limits=1):
            yield
    finally:
        cv2.setNumThreads(threads)


class _OneThreadLimit:
    """Limits the libraries as `_one_thread` does while any thread of this process is within.

    They are limits of the process: the first thread sets them, and the last one puts back what was there.
    """

    def __init__(self) -> None:
        self._counting = threading.Lock()
        self._within = 0
        self._limit = ExitStack()

    def __enter__(self) -> None:
        with self._counting:
            if self._within == 0:
                self._limit.enter_context(_one_thread())
            self._within += 1

    def __exit__(self, *_error: object) -> None:
        with self._counting:
            self._within -= 1
            if self._within == 0:
                self._limit.close()

    def begin_anew(self) -> None:
        """Put back what was there in a copy of the process, in which no thread is within any more."""
        self._limit.close()
        self.__init__()  # type: ignore[misc]

    def hold_forks(self) -> None:
        """Let OpenCV end its threads while this process is copied: the copy would wait for them forever."""
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(
                before=self.__enter__, after_in_parent=self.__exit__, after_in_child=self.begin_anew
            )


@cache
def _limit() -> _OneThreadLimit:
    """The limit of this process."""
    limit = _OneThreadLimit()
    limit.hold_forks()
    return limit


@lru_cache(maxsize=1)
def _thread_pools(modules: int) -> ThreadpoolController:
    """Find the thread pools of the loaded libraries, again whenever the number of modules has changed."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def limit_process_to_one_thread() -> None:
    """Limit the numeric libraries of this process to one thread from now on, including those not loaded yet.

    For worker processes that each analyze a whole log: several of them already share the processors.
    """
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    import cv2
    import pyarrow as pa
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    pa.set_cpu_count(1)
    threadpool_limits(1)
