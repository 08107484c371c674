"""How long one map takes: stage by stage, beside a floor that no method can pass, and the other methods."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from scipy import fft

from benchmarking.gauges import peak_allocated, peak_memory, timed
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.selection import Selection
from rose2_logs.evaluation.cases import Case
from rose2_logs.io import open_log
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.labels import known_window
from rose2_logs.model.occupancy import BoolArray, OccupancySnapshot, classify
from rose2_logs.segmentation.pipeline import analyze

HOUGH_THRESHOLD = 20
"""Votes of a line in the floor's Hough transform: about a meter of wall at 5 cm."""
HOUGH_MIN_LENGTH, HOUGH_MAX_GAP = 20, 5
"""Cells; a meter of wall with a gap of a quarter meter at 5 cm."""


@dataclass(frozen=True)
class MapToTime:
    """A map and how it is read.

    Attributes
    ----------
    group, name : str
        What it is called.
    read : callable
        Reads it from its file.
    """

    group: str
    name: str
    read: Callable[[], OccupancySnapshot]


@dataclass(frozen=True)
class MapTimes:
    """What one map took on one core, in seconds of processor time; medians over the repeats.

    Attributes
    ----------
    group, name : str
        Which map.
    cells, explored_cells, rooms : int
        Size of the canvas, of the explored part, number of rooms found.
    decode_s, analysis_s : float
        Reading the map, and its analysis.
    stages_s : dict of str to float
        Of the analysis.
    floor_s : float
        One real Fourier transform and one Hough transform of the same map.
    methods_s : dict of str to float
        The analysis by other methods.
    peak_bytes : int or None
        Memory that the process takes above the map, its result included, and what its allocators hold back.
    arrays_bytes : int
        Most bytes that Python and numpy held at once, the result included.
    """

    group: str
    name: str
    cells: int
    explored_cells: int
    rooms: int
    decode_s: float
    analysis_s: float
    stages_s: dict[str, float]
    floor_s: float
    methods_s: dict[str, float]
    peak_bytes: int | None
    arrays_bytes: int

    @property
    def whole_s(self) -> float:
        """Reading the map and its analysis."""
        return self.decode_s + self.analysis_s

    @property
    def over_floor(self) -> float:
        """The whole over the floor, both with reading the map."""
        return self.whole_s / (self.decode_s + self.floor_s)


def maps_of_cases(cases: Sequence[Case]) -> list[MapToTime]:
    """Take every map of a benchmark."""
    return [MapToTime(case.group, case.name, case.snapshot) for case in cases]


def maps_of_logs(logs: Sequence[Path], maps_per_log: int) -> list[MapToTime]:
    """Take some maps of each log, spread evenly; the last one is among them."""
    return [
        MapToTime("logs", f"{log.name}, map {number} of {maps_per_log}", _reader(log, number, maps_per_log))
        for log in logs
        for number in range(1, maps_per_log + 1)
    ]


def _reader(log: Path, number: int, count: int) -> Callable[[], OccupancySnapshot]:
    with open_log(log) as reader:
        stamps = [snapshot.log_time_ns for snapshot in reader.snapshots()]
    time_ns = stamps[round(number * len(stamps) / count) - 1]

    def read() -> OccupancySnapshot:
        with open_log(log, selection=Selection(time_ns, time_ns)) as reader:
            return reader.first()

    return read


def time_map(map_: MapToTime, parameters: Parameters, methods: Sequence[str], repeats: int) -> MapTimes:
    """Time one map, warmed: everything is run once before. The other methods are run once more each."""
    snapshot = map_.read()
    decode_s = float(np.median([timed(map_.read)[1].cpu_s for _ in range(repeats)]))
    seconds, stages, analysis = time_analysis(snapshot, parameters, repeats)
    free, occupied = classify(snapshot.cells, parameters.occupancy)
    window = known_window(free | occupied)
    explored = np.ascontiguousarray(occupied[window])
    floor(explored)
    floor_s = float(np.median([timed(lambda: floor(explored))[1].cpu_s for _ in range(repeats)]))
    others = {}
    for method in methods:
        analyze(snapshot, parameters, method)
        others[method] = timed(partial(analyze, snapshot, parameters, method))[1].cpu_s
    return MapTimes(
        map_.group,
        map_.name,
        snapshot.cells.size,
        explored.size,
        len(analysis.rooms),
        decode_s,
        seconds,
        stages,
        floor_s,
        others,
        peak_memory(partial(analyze, snapshot, parameters)),
        peak_allocated(partial(analyze, snapshot, parameters)),
    )


def time_analysis(
    snapshot: OccupancySnapshot, parameters: Parameters, repeats: int, *, warm: bool = True
) -> tuple[float, dict[str, float], SnapshotAnalysis]:
    """Return the median seconds of processor time of the analysis and of each stage, and a result.

    The stages tell wall-clock times; each run's are scaled to the processor time that the run got.
    """
    if warm:
        analyze(snapshot, parameters)
    runs = [timed(lambda: analyze(snapshot, parameters)) for _ in range(repeats)]
    stages = {
        stage: float(np.median([result.seconds[stage] * took.cpu_s / took.wall_s for result, took in runs]))
        for stage in runs[0][0].seconds
    }
    return float(np.median([took.cpu_s for _, took in runs])), stages, runs[-1][0]


def floor(occupied: BoolArray) -> None:
    """Do what every method of this kind must: one real Fourier transform, one Hough transform."""
    shape = [fft.next_fast_len(side, real=True) for side in occupied.shape]
    fft.rfft2(occupied.astype(np.float32), shape)
    cv2.HoughLinesP(
        occupied.astype(np.uint8),
        1,
        np.pi / 180,
        HOUGH_THRESHOLD,
        minLineLength=HOUGH_MIN_LENGTH,
        maxLineGap=HOUGH_MAX_GAP,
    )
