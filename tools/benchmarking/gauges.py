"""What is measured with: time of one core, peak memory, bytes read, and what the machine is."""

from __future__ import annotations

import gc
import os
import platform
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from rose2_logs.system.workers import give_back_freed_memory

Result = TypeVar("Result")

PROC = Path("/proc")
SAMPLING_S = 0.1
"""How often a process and those below it are looked at; the kernel keeps the peak and the time of each."""


@dataclass(frozen=True)
class Took:
    """Seconds of processor time of this process, and of wall-clock time."""

    cpu_s: float
    wall_s: float


def timed(function: Callable[[], Result]) -> tuple[Result, Took]:
    """Call a function and tell how long it took."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = function()
    return result, Took(time.process_time() - cpu, time.perf_counter() - wall)


@contextmanager
def one_core() -> Iterator[None]:
    """Hold this process to one core and its libraries to one thread."""
    import cv2
    from threadpoolctl import threadpool_limits

    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    if cores is not None:
        os.sched_setaffinity(0, {max(cores)})
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(threads)
        if cores is not None:
            os.sched_setaffinity(0, cores)


def peak_memory(function: Callable[[], object]) -> int | None:
    """Bytes that a call needs at its peak above what the process held before; None where it cannot be told.

    The result of the call counts.
    """
    gc.collect()
    give_back_freed_memory()
    try:
        before = _status_bytes("self", "VmRSS")
        (PROC / "self" / "clear_refs").write_text("5")  # forget the peak so far
    except (OSError, KeyError):
        return None
    function()
    return _status_bytes("self", "VmHWM") - before


def memory_now() -> int:
    """Bytes of memory that this process holds."""
    return _status_bytes("self", "VmRSS")


def peak_now() -> int:
    """Bytes of memory that this process held at most so far."""
    return _status_bytes("self", "VmHWM")


def peak_allocated(function: Callable[[], object]) -> int:
    """Bytes that Python and numpy hold at the peak of a call, its result included."""
    tracemalloc.start()
    try:
        function()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def bytes_read(function: Callable[[], object]) -> int | None:
    """Bytes that a call reads by system calls; None where the system does not count them."""
    try:
        before = _characters_read()
    except (OSError, KeyError):
        return None
    function()
    return _characters_read() - before


@dataclass(frozen=True)
class TreeUse:
    """What a process and all below it took.

    Attributes
    ----------
    peak_bytes : int or None
        Sum of the peaks of their memory; None where it cannot be told.
    cpu_s : float
        Seconds of processor time, up to the last look at each.
    """

    peak_bytes: int | None
    cpu_s: float


class ProcessTree:
    """Memory and processor time of a process and all below it while it runs, sampled by a thread.

    The system's own account leaves out processes that nobody waits for, as copies of a fork server.

    Parameters
    ----------
    pid : int
        The process.
    """

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._peaks: dict[int, int] = {}
        self._cpu_s: dict[int, float] = {}
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def stop(self) -> TreeUse:
        """Return what they took."""
        self._done.set()
        self._thread.join()
        return TreeUse(sum(self._peaks.values()) or None, sum(self._cpu_s.values()))

    def _watch(self) -> None:
        while not self._done.wait(SAMPLING_S):
            for pid in _with_all_below(self._pid):
                with suppress(OSError, KeyError):
                    self._peaks[pid] = max(_status_bytes(str(pid), "VmHWM"), self._peaks.get(pid, 0))
                    self._cpu_s[pid] = _cpu_s(pid)


def machine() -> dict[str, str]:
    """What the figures depend on of the machine, without its name."""
    facts = {"system": f"{platform.system()} {platform.machine()}", "cores": str(os.cpu_count())}
    with suppress(OSError, StopIteration):
        lines = (PROC / "cpuinfo").read_text().splitlines()
        facts["processor"] = next(
            line.split(":")[1].strip() for line in lines if line.startswith("model name")
        )
    with suppress(OSError, KeyError):
        facts["memory"] = f"{_proc_bytes(PROC / 'meminfo', 'MemTotal') / 2**30:.0f} GiB"
    with suppress(OSError):
        facts["processes waiting at the start"] = f"{os.getloadavg()[0]:.1f}"
    return facts


def _status_bytes(pid: str, name: str) -> int:
    return _proc_bytes(PROC / pid / "status", name)


def _proc_bytes(path: Path, name: str) -> int:
    """Read a value in kilobytes of a file of the kernel's."""
    values = dict(line.split(":", 1) for line in path.read_text().splitlines() if ":" in line)
    return int(values[name].split()[0]) * 1024


def _characters_read() -> int:
    values = dict(line.split(": ") for line in (PROC / "self" / "io").read_text().splitlines())
    return int(values["rchar"])


def _with_all_below(pid: int) -> Iterator[int]:
    yield pid
    # Any thread may have started some.
    for children in PROC.glob(f"{pid}/task/*/children"):
        with suppress(OSError):
            for child in children.read_text().split():
                yield from _with_all_below(int(child))


def _cpu_s(pid: int) -> float:
    """Processor time of one process, without its children's."""
    after_name = (PROC / str(pid) / "stat").read_text().rpartition(")")[2].split()
    return sum(map(int, after_name[11:13])) / os.sysconf("SC_CLK_TCK")
