#!/usr/bin/env python3
"""Measure `batch` as a fleet would use it.

`speed` analyzes 200 copies of a sample log with four commands side by side that have a quarter of the logs
each and know nothing of each other, which is what the processors allow, with a Dask cluster of four local
processes, and with one process.

`many` runs the real driver over 100,000 logs whose analysis is only a copy of finished results, and tells
what that costs the driver: memory, processor time, files, the summary; then the same call again, with nothing
left to do.

Examples
--------
    python tools/measure_fleet.py speed -o DIR
    python tools/measure_fleet.py many -o DIR
    python tools/measure_fleet.py many --logs 10000 -o DIR
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from benchmarking.gauges import ProcessTree, memory_now, peak_now
from benchmarking.markdown import table

import rose2_logs as rl
from rose2_logs.batch import driver
from rose2_logs.batch.driver import LogState, run_batch
from rose2_logs.batch.options import BatchOptions
from rose2_logs.batch.task import LogOutcome, LogTask, Progress, analyze_task
from rose2_logs.errors import Rose2LogsError
from rose2_logs.runs.provenance import fingerprint
from rose2_logs.workflows import analyze as analysis

SAMPLE = Path(__file__).parents[1] / "sample_logs" / "office.mcap"
LOGS_PER_FOLDER = 1000
LINKS = 10_000
"""File systems allow a file some ten thousand names; then another copy is linked to."""
POINTS = (0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.75, 1.0)
"""Shares of the logs at which figures are told."""
PROCESSES = 4
"""Of the cluster, and commands side by side."""
WITHOUT_PROFILER = {"DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "false"}
"""Dask looks at what each worker does a hundred times a second, for its dashboard."""
MAPS = 2
"""Of each log that is analyzed."""


@dataclass(frozen=True)
class Cost:
    """Seconds of wall-clock time, and of processor time of all processes."""

    wall_s: float
    cpu_s: float


def speed(count: int, place: Path, repeats: int) -> None:
    """Analyze so many logs in three ways, in turn, and print the least that each took."""
    folders = [place / f"quarter_{k}" for k in range(PROCESSES)]
    for number in range(count):
        log = folders[number % PROCESSES] / f"run_{number:03}{SAMPLE.suffix}"
        log.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(SAMPLE, log)
    ways: dict[str, Callable[[], Cost]] = {
        "four commands side by side": lambda: _commands(
            place, [[folder] for folder in folders], "--workers", 1
        ),
        "a Dask cluster of four processes": lambda: _on_cluster(place, folders),
        "one process": lambda: _commands(place, [folders], "--workers", 1),
    }
    costs: dict[str, list[Cost]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            costs[name].append(way())
            print(name, costs[name][-1], f"load {os.getloadavg()[0]:.1f}", file=sys.stderr, flush=True)
    limit, _, one = (min(cost.wall_s for cost in each) for each in costs.values())
    rows = []
    for name, each in costs.items():
        wall = min(cost.wall_s for cost in each)
        cpu = min(cost.cpu_s for cost in each)
        figures = [f"{wall:.1f}", f"{cpu:.1f}", f"{count / wall:.2f}", f"{one / wall:.2f}"]
        rows.append([name, *figures, f"{100 * limit / wall:.0f}%"])
    print(
        *table(["logs analyzed by", "s", "processor s", "logs per second", "gain", "of the limit"], rows),
        sep="\n",
    )


def _commands(
    place: Path, logs: Sequence[Sequence[Path]], *options: object, besides: Sequence[int] = ()
) -> Cost:
    """Run a ``batch`` over each of some lists of folders, all at once; other processes may do their work."""
    start = time.perf_counter()
    with ExitStack() as stack:
        running = []
        for folders in logs:
            out = stack.enter_context(tempfile.TemporaryDirectory(dir=place))
            command = [sys.executable, "-m", "rose2_logs", "batch", *folders, "-o", out, *options]
            command += ["--max-snapshots", MAPS]
            running.append(
                subprocess.Popen(
                    list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
                )
            )
        trees = [ProcessTree(pid) for pid in [*(process.pid for process in running), *besides]]
        if sum(process.wait() for process in running):
            raise Rose2LogsError("a batch failed")
        wall_s = time.perf_counter() - start
        return Cost(wall_s, sum(tree.stop().cpu_s for tree in trees))


def _on_cluster(place: Path, folders: Sequence[Path]) -> Cost:
    from distributed import Client

    with tempfile.TemporaryDirectory(dir=place) as scratch, ExitStack() as stack:
        where = ["--scheduler-file", f"{scratch}/scheduler.json"]
        started = []
        for part in (
            ["scheduler", "--host", "127.0.0.1", "--port", "0"],
            ["worker", "--nworkers", str(PROCESSES), "--nthreads", "1", "--local-directory", scratch],
        ):
            command = [sys.executable, "-m", "dask", *part, *where, "--no-dashboard"]
            process = subprocess.Popen(
                command,
                env=os.environ | WITHOUT_PROFILER,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            started.append(stack.enter_context(process))
            stack.callback(process.terminate)
        connect: Any = Client
        with connect(scheduler_file=where[1], set_as_default=False) as client:
            client.wait_for_workers(PROCESSES)
        pids = [process.pid for process in started]
        return _commands(place, [folders], "--scheduler", where[1], besides=pids)


class Copies:
    """Stands for the analysis of a log: gives it the results of a sample log, by links to its files."""

    def __init__(self, results: Path, scratch: Path) -> None:
        self._results, self._scratch = results, scratch
        self._summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
        self._count = 0
        self.cpu_s = 0.0

    def __call__(self, log: Path, folder: Path, options: rl.RunOptions, *_: object) -> None:
        """Do what `analyze_log` is called for."""
        start = time.process_time()
        linked = self._scratch / f"results_{self._count // LINKS}"
        if self._count % LINKS == 0:
            shutil.copytree(self._results, linked)
        self._count += 1
        for file in linked.iterdir():
            if file.name != "summary.json":
                os.link(file, folder / file.name)
        about = self._summary | {"log": options.origin, "input": self._summary["input"] | fingerprint(log)}
        (folder / "summary.json").write_text(json.dumps(about), encoding="utf-8")
        self.cpu_s += time.process_time() - start


class WorkersHere:
    """Carries out the tasks in this process."""

    def __init__(self, _: int) -> None:
        self._waiting: deque[LogTask] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        pass

    def submit(self, task: LogTask) -> None:
        """Accept a task."""
        self._waiting.append(task)

    def events(self) -> Iterator[Progress | LogOutcome]:
        """Yield the outcome of each task."""
        while self._waiting:
            yield analyze_task(self._waiting.popleft(), lambda _: None)


class Watch:
    """Listens to a batch, and looks at the memory of this process on its way."""

    def __init__(self, logs: int) -> None:
        self._at = {round(share * logs) for share in POINTS}
        self._ended = 0
        self._start = time.process_time()
        self.rows: list[tuple[int, int, float]] = []

    def begin(self, logs: int, up_to_date: int) -> None:
        """Look at the driver after planning."""
        self._look()
        self._ended = up_to_date

    def progress(self, told: Progress) -> None:
        """Leave it."""

    def retry(self, name: str, reason: str) -> None:
        """Leave it."""

    def finished(self, state: LogState, outcome: LogOutcome) -> None:
        """Look now and then."""
        self._ended += 1
        if self._ended in self._at:
            self._look()

    def _look(self) -> None:
        self.rows.append((self._ended, memory_now(), time.process_time() - self._start))
        print(*self.rows[-1], file=sys.stderr, flush=True)


def many(count: int, place: Path) -> None:
    """Run a batch over so many logs, then again, each in a process of its own; print what it took."""
    logs, results = place / "logs", place / "results"
    for number in range(count):
        log = logs / f"robot_{number // LOGS_PER_FOLDER:03}" / f"run_{number:06}.mcap"
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_bytes(b"\x89MCAP0\r\n")
    if not results.exists():
        rl.analyze(SAMPLE, results, max_snapshots=MAPS)
    for step in ("first", "again"):
        subprocess.run([sys.executable, __file__, step, "-o", str(place), "--logs", str(count)], check=True)
    kinds = {
        name: sum(len(files) for *_, files in os.walk(place / "out" / name)) for name in ("logs", "tables")
    }
    sizes = [(place / "out" / f"summary.{kind}").stat().st_size for kind in ("csv", "parquet")]
    print(f"files below logs/: {kinds['logs']:,}; below tables/: {kinds['tables']:,}; "
          f"summary.csv: {sizes[0] / 1e6:.1f} MB, summary.parquet: {sizes[1] / 1e6:.1f} MB")  # fmt: skip


def one_call(count: int, place: Path) -> None:
    """Call the driver once in this process."""
    with tempfile.TemporaryDirectory(dir=place) as scratch:
        copies = Copies(place / "results", Path(scratch))
        vars(analysis)["analyze_log"] = copies
        vars(driver)["LocalWorkers"] = WorkersHere
        watch, before, start = Watch(count), memory_now(), time.process_time()
        result = run_batch([str(place / "logs")], place / "out", BatchOptions(), watch)
        assert len(result.states) == count
        assert not result.failed
        rows = [(f"{ended:,}", f"{held / 1e6:.0f}", f"{seconds:.0f}") for ended, held, seconds in watch.rows]
        print(*table(["logs ended", "memory, MB", "processor s"], rows), sep="\n")
        cpu_s = time.process_time() - start - copies.cpu_s
        memory = f"before: {before / 1e6:.0f} MB, peak: {peak_now() / 1e6:.0f} MB"
        print(f"{memory}, driver: {cpu_s:.0f} s of processor time")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("step", choices=("speed", "many", "first", "again"))
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="folder for all files"
    )
    parser.add_argument("--logs", type=int, metavar="N", help="200 for speed, else 100,000")
    parser.add_argument("--repeats", type=int, default=2, metavar="N", help="of speed (%(default)s)")
    given = parser.parse_args(arguments)
    place = given.output.absolute()
    if given.step == "speed":
        speed(given.logs or 200, place, given.repeats)
    else:
        (many if given.step == "many" else one_call)(given.logs or 100_000, place)
    return 0


if __name__ == "__main__":
    sys.exit(main())
