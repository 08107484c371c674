"""Order, look-ahead and failures of the worker pool, with real processes."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from rose2_logs.errors import InvalidMapError
from rose2_logs.workers import LOOK_AHEAD_PER_WORKER, WorkerError, ordered_map


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


def test_work_in_this_process_is_held_to_one_thread_and_lets_go():
    """Results must not depend on the number of workers, so neither on the number of threads."""
    import cv2

    before = cv2.getNumThreads()
    assert [result for _, result in ordered_map(threads, [0])] == [1]
    assert cv2.getNumThreads() == before


def test_an_error_of_the_work_arrives_as_it_is():
    """A known error in a worker process stays a known error."""
    with pytest.raises(InvalidMapError, match="two is bad"):
        list(ordered_map(refuse_two, range(4), 2))


def test_a_killed_worker_is_one_clear_line():
    """A process that dies is told with what to do, and nothing hangs."""
    with pytest.raises(WorkerError, match="fewer --workers"):
        list(ordered_map(die_at_three, range(8), 2))


def test_a_process_is_held_to_one_thread_also_by_libraries_loaded_later():
    """Several processes share the processors, each with a whole log."""
    program = (
        "from rose2_logs.workers import limit_process_to_one_thread\n"
        "limit_process_to_one_thread()\n"
        "import cv2, numpy, scipy.linalg, sklearn.cluster\n"
        "from threadpoolctl import threadpool_info\n"
        "print({cv2.getNumThreads(), *(pool['num_threads'] for pool in threadpool_info())})"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "{1}\n"
