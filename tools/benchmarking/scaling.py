"""How time and memory grow: with the size of a map, with the length of a log, with more workers."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from log_writing import robot_log
from numpy.typing import NDArray

from benchmarking.gauges import ProcessTree, peak_memory
from benchmarking.map_times import time_analysis
from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import Rose2LogsError
from rose2_logs.model.labels import known_window
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.segmentation.pipeline import analyze

START_NS = 1_700_000_000_000_000_000
MAP_EVERY_S = 5.0
POSES_PER_MAP = 10


@dataclass(frozen=True)
class TileTimes:
    """One building laid out so many times: seconds of processor time, peak memory in bytes."""

    copies: int
    explored_cells: int
    rooms: int
    analysis_s: float
    resolution_m: float
    peak_bytes: int | None


@dataclass(frozen=True)
class LogTimes:
    """A log analyzed by the command line.

    Attributes
    ----------
    snapshots, workers : int
        How many maps, how many processes.
    wall_s, cpu_s : float
        Of the whole command with its start; the processor time of all its processes.
    peak_bytes : int or None
        Sum of the peaks of all its processes.
    log_bytes, recording_bytes : int
        Size of the log, and of the recording made of it.
    """

    snapshots: int
    workers: int
    wall_s: float
    cpu_s: float
    peak_bytes: int | None
    log_bytes: int
    recording_bytes: int


def explored_part(snapshot: OccupancySnapshot) -> NDArray[np.int8]:
    """Cells of the known part of a map, to be laid out again and again."""
    return np.ascontiguousarray(snapshot.cells[known_window(snapshot.cells >= 0)])


def tiled(cells: NDArray[np.int8], copies: int, resolution_m: float) -> OccupancySnapshot:
    """Lay a map out `copies` times, a square number."""
    side = round(copies**0.5)
    laid = np.tile(cells, (side, side))
    return OccupancySnapshot(
        0, 0, 0, "tiles", laid, GridGeometry(resolution_m, (0.0, 0.0), 0.0, "map", laid.shape)
    )


def time_tiles(
    cells: NDArray[np.int8], resolution_m: float, counts: Sequence[int], parameters: Parameters, repeats: int
) -> Iterator[TileTimes]:
    """Time the same building laid out 1, 4, 16 ... times, on one core; the larger ones once."""
    for copies in counts:
        snapshot = tiled(cells, copies, resolution_m)
        seconds, _, analysis = time_analysis(
            snapshot, parameters, repeats if copies <= counts[0] * 4 else 1, warm=copies == counts[0]
        )
        peak = peak_memory(partial(analyze, snapshot, parameters))
        yield TileTimes(
            copies, snapshot.cells.size, len(analysis.rooms), seconds, analysis.resolution_m, peak
        )


def write_growing_log(path: Path, cells: NDArray[np.int8], resolution_m: float, count: int) -> None:
    """Write a log in which a map of constant canvas is uncovered from its middle, with poses between.

    Parameters
    ----------
    path : Path
        As for `robot_log`.
    cells : (H, W) int8
        The whole map, which the last message holds.
    resolution_m : float
        Side of a cell.
    count : int
        Number of maps.
    """
    rows, columns = np.indices(cells.shape)
    distance = np.hypot(rows - cells.shape[0] / 2, columns - cells.shape[1] / 2)
    geometry = GridGeometry(resolution_m, (0.0, 0.0), 0.0, "map", cells.shape)
    with robot_log(path, START_NS, {"made by": "the benchmark"}) as log:
        for number in range(1, count + 1):
            for k in range(POSES_PER_MAP):
                pose = np.array([0.01 * number, 0.02 * number, 0.001 * k])
                log.write_pose(MAP_EVERY_S * (number - 1 + k / POSES_PER_MAP), pose, pose)
            # The area grows evenly, as that of an exploration does.
            seen = distance <= distance.max() * (number / count) ** 0.5
            log.write_map(MAP_EVERY_S * number, np.where(seen, cells, -1).astype(np.int8), geometry)


def time_log(log: Path, snapshots: int, workers: int, folder: Path, checkout: Path | None = None) -> LogTimes:
    """Run ``analyze`` on a log as a user does, of this version or of that in another checkout.

    Raises
    ------
    Rose2LogsError
        If the command fails.
    """
    start = time.perf_counter()
    with _analyze(log, workers, folder, checkout) as process:
        tree = ProcessTree(process.pid)
        _wait(process, log)
    wall_s, use = time.perf_counter() - start, tree.stop()
    return LogTimes(
        snapshots,
        workers,
        wall_s,
        use.cpu_s,
        use.peak_bytes,
        log.stat().st_size,
        (folder / log.stem / f"{log.stem}.rrd").stat().st_size,
    )


def side_by_side_gain(log: Path, one_s: float, folder: Path) -> float:
    """How much more two commands of one worker each get done at once than one that takes `one_s` alone.

    No two workers can gain more on this machine.
    """
    start = time.perf_counter()
    with _analyze(log, 1, folder / "one") as one, _analyze(log, 1, folder / "two") as other:
        for process in (one, other):
            _wait(process, log)
    return 2 * one_s / (time.perf_counter() - start)


def _analyze(log: Path, workers: int, folder: Path, checkout: Path | None = None) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "rose2_logs", "analyze", str(log), "-o", str(folder), "--overwrite"]
    command += ["--workers", str(workers)]
    env = {**os.environ, "PYTHONPATH": str(checkout)} if checkout else None
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env, cwd=checkout
    )


def _wait(process: subprocess.Popen[str], log: Path) -> None:
    _, complaint = process.communicate()
    if process.returncode:
        raise Rose2LogsError(f"{log.name}: analyze failed: {complaint.strip()}")
