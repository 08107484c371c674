"""Order, look-ahead and failures of the worker pool, with real processes."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pytest

from rose2_logs.errors import InvalidMapError
from rose2_logs.system import shared_memory as packed
from rose2_logs.system.workers import (
    LOOK_AHEAD_PER_WORKER,
    WorkerError,
    WorkerProcess,
    Workers,
    _limit,
    ordered_map,
    threaded_map,
    usable_cpus,
    usable_processes,
)


def slow_square(number: int) -> int:
    time.sleep(0.05 * (number % 2))
    return number * number


def threads(_: int) -> int:
    import cv2

    return cv2.getNumThreads()


def die_at_three(number: int) -> int:
    if number == 3:
        os._exit(1)
    return number


def refuse_two(number: int) -> int:
    if number == 2:
        raise InvalidMapError("two is bad")
    return number


def token(_: str) -> tuple[int, int]:
    """Another result at each call."""
    return os.getpid(), time.monotonic_ns()


def layers(number: int) -> np.ndarray:
    return np.full((300, 400), number, np.int32)


@pytest.mark.parametrize("workers", [1, 2])
def test_an_item_like_the_one_before_gets_its_result(workers: int):
    """The function is not called again for it; like means: the one before, not any."""
    with Workers(token, workers) as processes:
        found = list(processes.map("aabaaac", lambda one, other: one == other))
    assert "".join(item for item, _ in found) == "aabaaac"
    results = [result for _, result in found]
    assert results[0] == results[1]
    assert results[3] == results[4] == results[5]
    assert len(set(results)) == 4


def test_large_results_come_through_shared_memory_and_leave_nothing(tmp_path, monkeypatch):
    """Also where the stream is left before its end."""
    monkeypatch.setattr(packed, "SHARED_MEMORY", tmp_path)
    with Workers(layers, 2) as processes:
        for number, (item, result) in enumerate(processes.map(range(9))):
            assert (result == item).all()
            assert result.shape == (300, 400)
            if number == 5:
                assert list(tmp_path.iterdir())
                break
    assert not list(tmp_path.iterdir())
    assert (result == 5).all()


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_order_with_their_items(workers: int):
    """Even when later items are done first."""
    expected = [(number, number * number) for number in range(6)]
    assert list(ordered_map(slow_square, range(6), workers)) == expected


def test_items_are_taken_as_they_are_needed():
    """The stream is never read more than the look-ahead beyond what was taken: memory is bounded."""
    taken = 0

    def stream():
        nonlocal taken
        for number in range(40):
            taken += 1
            yield number

    results = ordered_map(slow_square, stream(), 2)
    for done in range(1, 5):
        next(results)
        assert taken <= done + 2 * LOOK_AHEAD_PER_WORKER
    results.close()
    assert taken < 40


@pytest.mark.parametrize("count", [1, 3])
def test_threads_keep_the_order_and_read_a_little_ahead(count: int):
    """However long each item takes."""
    taken = []

    def items() -> Iterator[int]:
        for number in range(12):
            taken.append(number)
            yield number

    def slower_first(number: int) -> int:
        time.sleep(0.02 / (1 + number))
        return number**2

    for done, found in enumerate(threaded_map(slower_first, items(), count)):
        assert found == (done, done**2)
        assert len(taken) <= done + 1 + count
    assert len(taken) == 12


def test_an_error_in_a_thread_arrives_as_it_is():
    """When the turn of its item comes."""
    results = threaded_map(refuse_two, range(4), 2)
    assert [next(results)[0] for _ in range(2)] == [0, 1]
    with pytest.raises(InvalidMapError, match="two is bad"):
        next(results)


def test_the_script_is_in_its_place_after_processes_were_started(monkeypatch):
    """Also by several threads at a time; while one starts, there is none that it could import."""
    script, seen = sys.modules["__main__"], []

    def start(_: object) -> None:
        seen.append(sys.modules["__main__"])
        time.sleep(0.02)

    context = SimpleNamespace(Process=SimpleNamespace(_Popen=start))
    monkeypatch.setattr("rose2_logs.system.workers._CONTEXT", context)
    with ThreadPoolExecutor(4) as threads:
        list(threads.map(WorkerProcess._Popen, range(8)))
    assert sys.modules["__main__"] is script
    assert len(seen) == 8
    assert not any(hasattr(module, "__file__") for module in seen)


def test_work_in_this_process_is_held_to_one_thread_and_lets_go():
    """Results must not depend on the number of workers, so neither on the number of threads."""
    import cv2

    before = cv2.getNumThreads()
    assert [result for _, result in ordered_map(threads, [0])] == [1]
    assert cv2.getNumThreads() == before


def test_threads_that_work_at_once_are_held_to_one_thread_each_and_let_go_together():
    import cv2

    before = cv2.getNumThreads()
    first_is_within, second_is_done = threading.Event(), threading.Event()

    def first() -> int:
        with _limit():
            first_is_within.set()
            assert second_is_done.wait(10)
            return threads(0)

    with ThreadPoolExecutor(1) as other:
        found = other.submit(first)
        assert first_is_within.wait(10)
        with _limit():
            assert threads(0) == 1
        second_is_done.set()
        assert found.result() == 1
    assert cv2.getNumThreads() == before


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not copy processes")
def test_a_process_that_is_forked_after_work_can_work_as_well():
    """OpenCV's threads are not copied; the copy would wait for them."""
    script = (
        "import os, cv2, numpy as np\n"
        "from rose2_logs.system.workers import ordered_map\n"
        "cv2.setNumThreads(2)\n"
        "blur = lambda side: cv2.GaussianBlur(np.ones((side, side), np.float32), (0, 0), 9).sum()\n"
        "blur(4000)\n"
        "first = list(ordered_map(blur, [900]))\n"
        "blur(4000)\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    os._exit(0 if list(ordered_map(blur, [900])) == first else 1)\n"
        "assert os.waitpid(child, 0)[1] == 0\n"
        "assert cv2.getNumThreads() == 2\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)


def test_an_error_of_the_work_arrives_as_it_is():
    """A known error in a worker process stays a known error."""
    with pytest.raises(InvalidMapError, match="two is bad"):
        list(ordered_map(refuse_two, range(4), 2))


def test_a_killed_worker_is_one_clear_line():
    """A process that dies is told with what to do, and nothing hangs."""
    with pytest.raises(WorkerError, match="fewer workers"):
        list(ordered_map(die_at_three, range(8), 2))


def test_a_process_is_held_to_one_thread_also_by_libraries_loaded_later():
    """Several processes share the processors, each with a whole log."""
    program = (
        "from rose2_logs.system.workers import limit_process_to_one_thread\n"
        "limit_process_to_one_thread()\n"
        "import cv2, numpy, scipy.linalg, sklearn.cluster\n"
        "from threadpoolctl import threadpool_info\n"
        "print({cv2.getNumThreads(), *(pool['num_threads'] for pool in threadpool_info())})"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "{1}\n"


def test_no_more_processes_are_started_than_are_of_use():
    """Nor than Windows can wait for: a machine of 64 cores would otherwise fail before its first map."""
    assert [usable_processes(count, "linux", cpus=4) for count in (1, 8, 9, 1000)] == [1, 8, 8, 8]
    assert [usable_processes(count, "win32", cpus=64) for count in (1, 61, 62, 128)] == [1, 61, 61, 61]
    assert usable_processes(128, "linux", cpus=64) == 128
    assert usable_processes(2) == 2


def test_processes_start_as_there_is_work():
    """A thousand that were asked for, for one item: no more than there are processors."""
    with Workers(slow_square, 1000) as processes:
        assert list(processes.map([3])) == [(3, 9)]
        assert len(processes._processes) <= usable_cpus() + 1


MANY_WORKERS = """
import time
from rose2_logs.system import workers
workers.usable_cpus = lambda: 12
if __name__ == "__main__":
    with workers.Workers(time.sleep, 24) as processes:
        print("started", flush=True)
        for _ in processes.map([30] * 100):
            pass
"""


SLOW_IMPORT = """
from rose2_logs.system import workers
if __name__ == "__main__":
    import slow
    print("started", flush=True)
    with workers.Workers(slow.work, 2) as processes:
        print(list(processes.map([1, 2])))
"""


def interrupted(script: Path, send: Callable[[int, int], None], delay_s: float) -> str:
    """Return what a script that is interrupted some time after its first line tells on stderr."""
    pipe, path = subprocess.PIPE, os.pathsep.join([str(script.parent), *sys.path])
    with subprocess.Popen(
        [sys.executable, script],
        stdout=pipe,
        stderr=pipe,
        text=True,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": path},
    ) as running:
        try:
            running.stdout.readline()
            time.sleep(delay_s)
            send(running.pid, signal.SIGINT)
            _, told = running.communicate(timeout=15)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(running.pid, signal.SIGKILL)
    assert running.returncode == -signal.SIGINT
    assert told.strip().endswith("KeyboardInterrupt")
    return told


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("delay_s", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["process", "terminal"])
def test_an_interrupt_ends_workers_that_are_still_starting(tmp_path, send, delay_s: float):
    """At once, and all that is on stderr is the interrupt itself, with what it came into the midst of.

    Python may tell besides that it also came into the midst of a callback of its own.
    """
    (tmp_path / "many.py").write_text(MANY_WORKERS)
    said = interrupted(tmp_path / "many.py", send, delay_s)
    if (told := said.count("\nKeyboardInterrupt")) > 1:
        said = re.sub(
            r"Exception ignored in.*?\nKeyboardInterrupt", "", said, count=told - 1, flags=re.DOTALL
        )
    assert said.count("\nKeyboardInterrupt") == 1


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_an_interrupt_while_modules_are_imported_for_workers_is_told_once(tmp_path):
    """A terminal sends it to all processes."""
    (tmp_path / "slow.py").write_text("import time\ntime.sleep(1.5)\ndef work(x): return x\n")
    (tmp_path / "script.py").write_text(SLOW_IMPORT)
    assert interrupted(tmp_path / "script.py", os.killpg, 0.7).count("\nKeyboardInterrupt") == 1


def test_an_interrupt_waits_for_a_process_to_be_started(monkeypatch):
    """So that there is no half started one that nobody could end."""
    started = []

    def start(_: object) -> None:
        signal.raise_signal(signal.SIGINT)
        started.append(True)

    monkeypatch.setattr("rose2_logs.system.workers._CONTEXT.Process.start", start)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        WorkerProcess().start()
    assert started
    assert signal.getsignal(signal.SIGINT) is before


SCRIPT = """
import math, os, sys
from rose2_logs.system import workers

workers.SHORT_FOLDERS = ("/there/is/no/such/folder", sys.argv[1])
with workers.Workers(math.factorial, 2) as pool:
    print([result for _, result in pool.map(range(5))], len(os.listdir(sys.argv[1])))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="sockets with names are used on Linux only")
def test_sockets_lie_in_a_private_folder_where_their_names_would_be_too_long():
    """It is used then only, and is gone afterwards."""
    with TemporaryDirectory() as short:
        for length, folders in ((75 - len(short) - 1, 0), (76 - len(short) - 1, 1)):
            temporary, sockets = Path(short) / ("x" * length), Path(short) / str(folders)
            temporary.mkdir()
            sockets.mkdir()
            done = subprocess.run(
                [sys.executable, "-c", SCRIPT, sockets],
                capture_output=True, text=True, check=False, env=os.environ | {"TMPDIR": str(temporary)},
            )  # fmt: skip
            assert (done.stdout, done.stderr) == (f"[1, 1, 2, 6, 24] {folders}\n", "")
            assert not [*sockets.iterdir(), *temporary.iterdir()]


def _two_asked_for(_: int) -> int:
    return len(list(ordered_map(int, range(4), 2))) * usable_processes(2)


def test_a_process_of_a_pool_does_the_work_itself():
    """It may not start processes of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(_two_asked_for, [0]) == [4]
