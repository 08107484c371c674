"""How fast everything is, measured in one run: maps, scaling, logs, outputs, starting up."""

from __future__ import annotations

import dataclasses
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarking.accuracy import load_all_cases
from benchmarking.against import Against, LogAgainst, MapAgainst, time_log_against, time_maps_against
from benchmarking.gauges import machine, one_core
from benchmarking.log_costs import (
    CopyTimes,
    LookTimes,
    SinkCosts,
    StartTimes,
    copy_times,
    look_times,
    sink_costs,
    start_times,
)
from benchmarking.map_times import MapTimes, maps_of_cases, maps_of_logs, time_map
from benchmarking.robustness import sampled
from benchmarking.scaling import (
    LogTimes,
    TileTimes,
    explored_part,
    side_by_side_gain,
    tiled,
    time_log,
    time_tiles,
    write_growing_log,
)
from rose2_logs.config.parameters import load_parameters
from rose2_logs.io import open_log
from rose2_logs.runs.provenance import software_versions
from rose2_logs.segmentation.pipeline import METHODS

GROWING_SIDE = 1000
"""Cells along the side of the maps of the logs that are written for the scaling runs."""


@dataclass(frozen=True)
class Amount:
    """How much is measured.

    Attributes
    ----------
    maps_per_group : int or None
        Of each benchmark group, spread evenly; None for all.
    maps_per_log : int
        Of each sample log.
    repeats : int
        Of each map; medians are told.
    tiles : tuple of int
        How often one building is laid out, square numbers.
    snapshots : tuple of int
        Lengths of the logs.
    copied_bytes, looked_at_bytes : int
        Size of the log that is copied, and of that which ``info`` looks at.
    maps_looked_at : int
        Maps in the latter.
    starts : int
        How often each small command is started.
    """

    maps_per_group: int | None
    maps_per_log: int
    repeats: int
    tiles: tuple[int, ...]
    snapshots: tuple[int, ...]
    copied_bytes: int
    looked_at_bytes: int
    maps_looked_at: int
    starts: int


FULL = Amount(None, 5, 3, (1, 4, 16, 64), (10, 100, 1000), 512_000_000, 10_000_000_000, 720, 7)
QUICK = Amount(2, 1, 1, (1, 4), (4, 8), 64_000_000, 10_000_000_000, 100, 3)


@dataclass(frozen=True)
class SpeedOptions:
    """What is run.

    Attributes
    ----------
    cases, logs : tuple of path
        Files of benchmark cases; logs whose maps are timed and whose outputs are. The first log also gives
        the building of the scaling runs, and must be an MCAP.
    amount : Amount
        How much of it.
    skip : set of str
        Parts that are left out: "maps", "tiles", "logs", "outputs".
    config : path, optional
    settings : tuple of str
        Parameters that everything but the logs' command is run with.
    against : path, optional
        Checkout of another version, which maps and logs are timed beside.
    """

    cases: tuple[Path, ...]
    logs: tuple[Path, ...]
    amount: Amount = FULL
    skip: frozenset[str] = frozenset()
    config: Path | None = None
    settings: tuple[str, ...] = ()
    against: Path | None = None


@dataclass(frozen=True)
class Speed:
    """Everything that was measured; what was left out is empty or None."""

    machine: dict[str, str]
    versions: dict[str, str]
    repeats: int
    maps: tuple[MapTimes, ...]
    tiles: tuple[TileTimes, ...]
    logs: tuple[LogTimes, ...]
    side_by_side: float | None
    outputs: tuple[SinkCosts, ...]
    copy: CopyTimes | None
    starts: tuple[StartTimes, ...]
    look: LookTimes | None
    against: Against | None = None

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        return dataclasses.asdict(self)


def measure_speed(options: SpeedOptions) -> Speed:
    """Measure it all, one thing after the other.

    Raises
    ------
    Rose2LogsError
        If cases, logs or parameters cannot be used.
    """
    amount, began = options.amount, time.monotonic()
    parameters = load_parameters(options.config, options.settings)
    facts = machine()

    def say(step: str) -> None:
        sys.stderr.write(f"{time.monotonic() - began:6.0f} s  {step}\n")

    maps: list[MapTimes] = []
    tiles: list[TileTimes] = []
    logs: list[LogTimes] = []
    outputs: list[SinkCosts] = []
    side_by_side, copy, look, starts = None, None, None, []
    other = options.against
    maps_against: list[MapAgainst] = []
    logs_against: list[LogAgainst] = []
    with open_log(options.logs[0]) as reader:
        last = reader.last()
    building, resolution_m = explored_part(last), last.geometry.resolution_m
    with tempfile.TemporaryDirectory(prefix="rose2_speed_") as scratch:
        folder = Path(scratch)
        if "maps" not in options.skip:
            chosen = [
                *sampled(maps_of_cases(load_all_cases(options.cases)), amount.maps_per_group),
                *maps_of_logs(options.logs, amount.maps_per_log),
            ]
            with one_core():
                for number, map_ in enumerate(chosen, start=1):
                    say(f"map {number} of {len(chosen)}: {map_.group}, {map_.name}")
                    maps.append(time_map(map_, parameters, METHODS[1:], amount.repeats))
        if "maps" not in options.skip and other is not None:
            per_group = amount.maps_per_group
            maps_against = time_maps_against(other, options.cases, per_group, amount.repeats, say)
        if "tiles" not in options.skip:
            with one_core():
                for row in time_tiles(building, resolution_m, amount.tiles, parameters, amount.repeats):
                    say(f"building laid out {row.copies} times: {row.analysis_s:.2f} s")
                    tiles.append(row)
        if "logs" not in options.skip:
            canvas = tiled(building, _copies_for(GROWING_SIDE, building.shape), resolution_m).cells
            canvas = canvas[:GROWING_SIDE, :GROWING_SIDE]
            for count in amount.snapshots:
                log = folder / f"growing_{count}.mcap"
                write_growing_log(log, canvas, resolution_m, count)
                for workers in (1, 2):
                    say(f"log of {count} maps, {workers} workers")
                    logs.append(time_log(log, count, workers, folder / f"out_{count}"))
                if other is not None:
                    say(f"log of {count} maps, both versions")
                    logs_against.append(time_log_against(other, log, count, 1, folder / f"both_{count}"))
            say("two commands side by side")
            shortest = folder / f"growing_{amount.snapshots[0]}.mcap"
            side_by_side = side_by_side_gain(shortest, logs[0].wall_s, folder)
        if "outputs" not in options.skip:
            for log in options.logs:
                say(f"outputs of {log.name}")
                outputs.append(sink_costs(log, parameters, folder / log.name))
            say("copying, starting, looking at a log")
            copy = copy_times(options.logs[0], amount.copied_bytes, folder)
            starts = start_times(options.logs, amount.starts)
            look = look_times(options.logs[0], amount.looked_at_bytes, amount.maps_looked_at, folder)
    return Speed(
        facts,
        software_versions(),
        amount.repeats,
        tuple(maps),
        tuple(tiles),
        tuple(logs),
        side_by_side,
        tuple(outputs),
        copy,
        tuple(starts),
        look,
        Against(other.name, tuple(maps_against), tuple(logs_against)) if other else None,
    )


def _copies_for(side: int, shape: tuple[int, ...]) -> int:
    """Return the least square number of copies that fill a square of `side` cells."""
    return int(np.ceil(side / min(shape))) ** 2
