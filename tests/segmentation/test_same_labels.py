"""A map has the same labels and borders with any number of threads and whatever instructions a CPU has."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from drawn_maps import office, snapshot
from finished_runs import SAMPLE_LOGS

import rose2_logs as rl

PROGRAM = """
import sys
import cv2
cv2.setNumThreads(int(sys.argv[1]))
from test_same_labels import fingerprint_of_all
print(fingerprint_of_all())
"""


def fingerprint_of_all() -> str:
    """Of the last maps of the sample logs, and of a drawn one whose directions are equally strong."""
    maps = [snapshot(office(turn_rad=turn, clutter=25)[0]) for turn in (0.0, 0.3)]
    for name in ("office.mcap", "ring", "wing.bag"):
        with rl.open_log(SAMPLE_LOGS / name) as reader:
            maps.append(reader.last())
    digest = hashlib.sha256()
    for each in maps:
        found = rl.segment(each)
        digest.update(np.ascontiguousarray(found.labels).tobytes())
        digest.update(repr(found.borders).encode())
    return digest.hexdigest()


def test_labels_are_the_same_when_threads_segment_at_once():
    """The network is one for all threads of a process."""
    maps = [snapshot(office(turn_rad=turn, clutter=25)[0]) for turn in (0.0, 0.1, 0.2, 0.3)]
    wanted = [rl.segment(each).labels for each in maps]
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(rl.segment, maps * 3))
    assert all(np.array_equal(a.labels, b) for a, b in zip(found, wanted * 3, strict=True))


def run(threads: int, **environment: str) -> str:
    folders = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(threads)],
        check=True,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": folders} | environment,
    )
    return done.stdout.strip()


@pytest.fixture(scope="module")
def with_one_thread() -> str:
    return run(1)


@pytest.mark.parametrize(
    ("threads", "environment"),
    [
        (2, {}),
        (1, {"OPENCV_CPU_DISABLE": "AVX2,AVX512_SKX"}),
        (1, {"OPENCV_CPU_DISABLE": "SSE4.1,SSE4.2,AVX,FP16,AVX2", "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3"}),
    ],
    ids=["two threads", "without AVX2 and AVX-512", "without AVX"],
)
def test_labels_and_borders_are_those_of_one_thread(threads, environment, with_one_thread):
    assert run(threads, **environment) == with_one_thread
