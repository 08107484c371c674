"""Two versions of the project side by side: the same maps and logs, by turns, in one run."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarking.accuracy import load_all_cases
from benchmarking.markdown import table
from benchmarking.robustness import sampled
from benchmarking.scaling import time_log
from rose2_logs.errors import Rose2LogsError

TIME_MAPS = Path(__file__).with_name("time_maps.py")
PROJECT = Path(__file__).parents[2]
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
OURS = {"fitted": "floor_plan.grouping=fitted", "walls": "floor_plan.grouping=walls"}
"""Ways of grouping of this version that are timed, and the parameter that asks for each."""


@dataclass(frozen=True)
class MapAgainst:
    """Seconds of processor time that one map takes, from its file to its rooms, medians.

    Attributes
    ----------
    group, name : str
    other_s : float
        By the other version, with its defaults.
    ours_s : dict of str to float
        By this one, for each of `OURS`.
    """

    group: str
    name: str
    other_s: float
    ours_s: dict[str, float]


@dataclass(frozen=True)
class LogAgainst:
    """Seconds that `analyze` with all outputs takes, from start to end, with this many workers."""

    maps: int
    workers: int
    other_s: float
    ours_s: float


@dataclass(frozen=True)
class Against:
    """All of it; `other` is the name of the other checkout's folder."""

    other: str
    maps: tuple[MapAgainst, ...]
    logs: tuple[LogAgainst, ...]


def time_maps_against(
    other: Path, cases: Sequence[Path], maps_per_group: int | None, repeats: int, say: Callable[[str], None]
) -> list[MapAgainst]:
    """Time maps of a benchmark by turns.

    Raises
    ------
    Rose2LogsError
        If a version cannot be run.
    """
    everything = load_all_cases(cases)
    chosen = {id(case) for case in sampled(everything, maps_per_group)}
    times = []
    with ExitStack() as stack:
        theirs = stack.enter_context(_timed(other, cases, ()))
        ours = {name: stack.enter_context(_timed(PROJECT, cases, (s,))) for name, s in OURS.items()}
        for number, case in enumerate(everything):
            if id(case) in chosen:
                say(f"map {case.name}, by turns")
                other_s = theirs(number, repeats)
                ours_s = {name: time(number, repeats) for name, time in ours.items()}
                times.append(MapAgainst(case.group, case.name, other_s, ours_s))
    return times


def time_log_against(other: Path, log: Path, maps: int, workers: int, folder: Path) -> LogAgainst:
    """Run `analyze` of both versions on a log.

    Raises
    ------
    Rose2LogsError
        If a command fails.
    """
    other_s, ours_s = (
        time_log(log, maps, workers, folder / name, checkout).wall_s
        for name, checkout in (("other", other), ("ours", PROJECT))
    )
    return LogAgainst(maps, workers, other_s, ours_s)


@contextmanager
def _timed(
    checkout: Path, cases: Sequence[Path], settings: Sequence[str]
) -> Iterator[Callable[[int, int], float]]:
    """Run `time_maps` in a checkout on one core; yield what times a map by its number."""
    command = [sys.executable, "-c", TIME_MAPS.read_text("utf-8"), *(str(path.resolve()) for path in cases)]
    env = {**os.environ, **ONE_THREAD, "PYTHONPATH": str(checkout)}
    with subprocess.Popen(
        [*command, "--set", *settings],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=env,
        cwd=checkout,
    ) as process:
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(process.pid, {max(os.sched_getaffinity(0))})
        assert process.stdin is not None
        assert process.stdout is not None

        def time(number: int, repeats: int) -> float:
            print(json.dumps([number, repeats]), file=process.stdin, flush=True)
            answer = process.stdout.readline() if process.stdout else ""
            if not answer:
                raise Rose2LogsError(f"{checkout}: its analysis cannot be run")
            return float(json.loads(answer)[0])

        yield time
        process.stdin.close()


def against_lines(against: Against) -> list[str]:
    """Tables for the report."""
    lines = [
        "## Beside another version",
        "",
        f"The version in `{against.other}` with its defaults, and this one with each grouping, on the "
        "same maps by turns: seconds of processor time from file to rooms, medians, and the share of the "
        "other version's time.",
        "",
    ]
    groups = [*dict.fromkeys(times.group for times in against.maps), "all"]
    rows = []
    for group in groups:
        members = [times for times in against.maps if group in (times.group, "all")]
        other = [times.other_s for times in members]
        row = [f"{group} ({len(members)})", f"{np.median(other):.3f}", f"{max(other):.2f}"]
        for name in OURS:
            ours = [times.ours_s[name] for times in members]
            share = np.median([times.ours_s[name] / times.other_s for times in members])
            row += [f"{np.median(ours):.3f}", f"{100 * share:.0f}%", f"{max(ours):.2f}"]
        rows.append(row)
    head = ["group (maps)", "other, s", "slowest"]
    for name in OURS:
        head += [f"{name}, s", "share", "slowest"]
    lines += table(head, rows)
    if against.logs:
        head = ["maps of the log", "workers", "other, s", "this, s", "share"]
        lines += table(
            head,
            [
                [
                    f"{row.maps}",
                    f"{row.workers}",
                    f"{row.other_s:.1f}",
                    f"{row.ours_s:.1f}",
                    f"{100 * row.ours_s / row.other_s:.0f}%",
                ]
                for row in against.logs
            ],
        )
    return lines
