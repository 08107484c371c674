"""A long run: many maps of a small building, analyzed while memory and open files are watched.

``python tools/soak.py --snapshots 20000 -o DIR`` prints a table; the log and the results stay in the folder.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from benchmarking.gauges import memory_now
from log_writing import robot_log
from numpy.typing import NDArray

from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.system.workers import keep_freed_memory
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot
from rose2_logs.workflows.analyze import RunOptions, RunResult, analyze_log

RESOLUTION_M = 0.1
ROOMS = (2, 2)
"""Rows and columns of rooms."""
ROOM_CELLS = (35, 45)
"""Rows and columns of a room with its walls."""
DOOR_CELLS = 9
CHANGES_EVERY = 3
"""Every so many maps free and occupied cells change; the others differ in probabilities only."""
EXPLORED_AT = 0.5
"""Share of the run after which the whole building is seen."""
CLUTTER_CELLS = 4
"""Side of a thing that stands at another place after each change."""
PERIOD_S = 1.0
START_NS = 1_700_000_000_000_000_000
POINTS = (0.1, 0.25, 0.5, 0.75, 1.0)
"""Shares of the maps at which figures are printed."""


@dataclass(frozen=True)
class Sample:
    """How the process stood after so many maps: memory in bytes, open files, seconds since the start."""

    maps: int
    memory_bytes: int
    open_files: int
    seconds: float


def building() -> NDArray[np.int8]:
    """Cells (H, W) of a few rooms with a door to each neighbor: 0 free, 100 occupied."""
    rows, columns = (rooms * cells + 1 for rooms, cells in zip(ROOMS, ROOM_CELLS, strict=True))
    cells = np.zeros((rows, columns), np.int8)
    cells[:: ROOM_CELLS[0]] = 100
    cells[:, :: ROOM_CELLS[1]] = 100
    for row in range(1, ROOMS[0]):
        for column in range(ROOMS[1]):
            middle = column * ROOM_CELLS[1] + ROOM_CELLS[1] // 2
            cells[row * ROOM_CELLS[0], middle : middle + DOOR_CELLS] = 0
    for column in range(1, ROOMS[1]):
        for row in range(ROOMS[0]):
            middle = row * ROOM_CELLS[0] + ROOM_CELLS[0] // 2
            cells[middle : middle + DOOR_CELLS, column * ROOM_CELLS[1]] = 0
    return cells


def write_long_log(path: Path, snapshots: int) -> None:
    """Write a log of so many distinct maps, in which more and more of the building is seen.

    Parameters
    ----------
    path : Path
        By its suffix a kind of log, as `robot_log` knows them.
    snapshots : int
        Number of maps.
    """
    whole = building()
    geometry = GridGeometry(RESOLUTION_M, (0.0, 0.0), 0.0, "map", (whole.shape[0], whole.shape[1]))
    rng = np.random.default_rng(0)
    with robot_log(path, START_NS, {"made by": "tools/soak.py"}) as log:
        cells = whole
        for number in range(snapshots):
            if number % CHANGES_EVERY == 0:
                share = min(1.0, 0.3 + 0.7 * number / (EXPLORED_AT * snapshots))
                cells = whole.copy()
                row, column = (int(rng.integers(2, side - CLUTTER_CELLS - 2)) for side in whole.shape)
                cells[row : row + CLUTTER_CELLS, column : column + CLUTTER_CELLS] = 100
                cells[:, round(share * whole.shape[1]) :] = -1
            else:
                cells = cells.copy()
                free = np.flatnonzero((cells >= 0) & (cells < CHANGES_EVERY))
                cells.flat[free[0]] = number % CHANGES_EVERY
            log.write_map(number * PERIOD_S, cells, geometry)


def watch(log: Path, folder: Path, snapshots: int, options: RunOptions) -> tuple[RunResult, list[Sample]]:
    """Analyze a log and look at this process at each percent of its maps."""
    samples: list[Sample] = []
    start = time.perf_counter()
    seen = 0

    def look(step: TrackedSnapshot, share: float) -> None:
        nonlocal seen
        seen += 1
        if seen % max(1, snapshots // 100) == 0:
            files = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
            samples.append(Sample(seen, memory_now(), files, time.perf_counter() - start))

    return analyze_log(log, folder, options, look), samples


def table(samples: Sequence[Sample]) -> str:
    """Write the figures at some shares of the run as Markdown."""
    lines = ["| maps | memory, MB | open files | s |", "|---|---|---|---|"]
    for share in POINTS:
        at = samples[max(0, round(share * len(samples)) - 1)]
        lines.append(f"| {at.maps} | {at.memory_bytes / 1e6:.0f} | {at.open_files} | {at.seconds:.0f} |")
    return "\n".join(lines)


def main() -> None:
    """Make the log if it is not there, analyze it, print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder of the log and the results")
    parser.add_argument("--snapshots", type=int, default=20_000)
    parser.add_argument("--workers", type=int, default=1)
    chosen = parser.parse_args()
    log = chosen.out / f"soak_{chosen.snapshots}.mcap"
    if not log.exists():
        # By another process, so that its memory does not count.
        with ProcessPoolExecutor(1) as maker:
            maker.submit(write_long_log, log, chosen.snapshots).result()
    keep_freed_memory()
    options = RunOptions(workers=chosen.workers, overwrite=True)
    result, samples = watch(log, chosen.out / "results", chosen.snapshots, options)
    (chosen.out / "samples.json").write_text(json.dumps([asdict(sample) for sample in samples]))
    print(table(samples))
    totals = result.summary.totals
    print(f"{totals.snapshots} maps, {totals.unchanged} unchanged, {result.seconds:.0f} s")


if __name__ == "__main__":
    main()
