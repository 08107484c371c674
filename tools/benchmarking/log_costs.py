"""What surrounds the analysis of a log: outputs, the copied log, starting up, looking at a log."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from sparse_log import write_sparse_log

from benchmarking.gauges import bytes_read, timed
from rose2_logs.config.parameters import Parameters
from rose2_logs.io import open_log
from rose2_logs.runs.history import RunSummary, RunTotals
from rose2_logs.runs.sink import RunInfo, Sink
from rose2_logs.runs.stream import TrackedStream, start_workers
from rose2_logs.tracking.convergence import Convergence
from rose2_logs.tracking.track_history import TrackHistories
from rose2_logs.workflows.analyze import RunOptions
from rose2_logs.workflows.info import describe_log

MESSAGE_BYTES = 1 << 20
"""Of the log to copy: about a picture or a cloud of points."""


@dataclass(frozen=True)
class SinkCosts:
    """What the parts of a run took, in seconds of processor time, and what they wrote, in bytes.

    Attributes
    ----------
    log : str
        Name of the log.
    maps : int
        How many.
    analysis_s, tracking_and_reading_s : float
        Of all maps.
    sinks_s : dict of str to float
        For each sink the time of all its work, from opening to closing.
    sizes : dict of str to int
        Of the recording and the annotated log.
    """

    log: str
    maps: int
    analysis_s: float
    tracking_and_reading_s: float
    sinks_s: dict[str, float]
    sizes: dict[str, int]

    @property
    def share(self) -> float:
        """Recording and annotated log over the analysis."""
        return (self.sinks_s["recording"] + self.sinks_s["annotated log"]) / self.analysis_s


@dataclass(frozen=True)
class CopyTimes:
    """A log copied with the results of two maps in it, the file warm.

    Attributes
    ----------
    size_bytes : int
        Of the log.
    cpu_s, wall_s : float
        Of the copy.
    """

    size_bytes: int
    cpu_s: float
    wall_s: float


@dataclass(frozen=True)
class StartTimes:
    """A command that does little, from its start to its end: the median and the least of some times."""

    command: str
    wall_s: float
    least_wall_s: float


@dataclass(frozen=True)
class LookTimes:
    """What ``info`` reads of a log of a given size; its time is that of looking alone."""

    size_bytes: int
    maps: int
    read_bytes: int | None
    cpu_s: float


def sink_costs(log: Path, parameters: Parameters, folder: Path) -> SinkCosts:
    """Analyze a log in this process and time its parts.

    Rerun's own threads write the recording; their time is that of the part during which they do so.
    """
    from rose2_logs.outputs.mcap.annotated import AnnotatedMcap
    from rose2_logs.outputs.rerun.recording import RerunRecording
    from rose2_logs.runs.history import RunHistory
    from rose2_logs.runs.store import RunStore

    options = RunOptions(parameters=parameters)
    info = RunInfo(log, "/map", options.method, parameters, {}, {})
    files = {"recording": folder / "run.rrd", "annotated log": folder / "run.mcap"}
    spent = dict.fromkeys(("tables", *files), 0.0)
    analysis_s = others_s = 0.0
    with ExitStack() as stack:
        reader = stack.enter_context(open_log(log))
        workers = stack.enter_context(start_workers(options))
        history = RunHistory(parameters)
        store = stack.enter_context(RunStore(folder, parameters.occupancy))
        sinks: dict[str, Sink] = {
            "recording": RerunRecording(files["recording"]),
            "annotated log": AnnotatedMcap(files["annotated log"]),
        }
        for name, sink in sinks.items():
            spent[name] += timed(partial(sink.begin, info))[1].cpu_s
        steps = iter(TrackedStream.of_log(reader, workers, parameters, with_path=True))
        while True:
            step, took = timed(partial(next, steps, None))
            if step is None:
                break
            # Stages tell wall-clock times.
            share = took.cpu_s / took.wall_s
            within = sum(step.analysis.seconds.values()) * share
            analysis_s, others_s = analysis_s + within, others_s + took.cpu_s - within
            history.add(step)
            spent["tables"] += timed(partial(store.write, step, history))[1].cpu_s
            for name, sink in sinks.items():
                spent[name] += timed(partial(sink.write, step))[1].cpu_s
        summary, took = timed(partial(store.finish, history))
        spent["tables"] += took.cpu_s
        for name, sink in sinks.items():
            spent[name] += timed(partial(sink.finish, summary))[1].cpu_s
    sizes = {name: file.stat().st_size for name, file in files.items()}
    return SinkCosts(log.name, history.totals.snapshots, analysis_s, others_s, spent, sizes)


def copy_times(sample: Path, size_bytes: int, folder: Path) -> CopyTimes:
    """Annotate a log of noise in compressed chunks, with two maps of a sample log at its ends."""
    from rose2_logs.outputs.mcap.annotated import AnnotatedMcap

    log = folder / "noise.mcap"
    _write_noise(log, sample, size_bytes)
    log.read_bytes()  # warm
    options = RunOptions()
    info = RunInfo(log, "/map", options.method, options.parameters, {}, {})
    with open_log(log) as reader, start_workers(options) as workers:
        steps = list(TrackedStream.of_log(reader, workers, options.parameters))
    summary = RunSummary(RunTotals(), TrackHistories(), Convergence())

    def copy() -> None:
        sink = AnnotatedMcap(folder / "copy.mcap")
        sink.begin(info)
        for step in steps:
            sink.write(step)
        sink.finish(summary)

    _, took = timed(copy)
    return CopyTimes(log.stat().st_size, took.cpu_s, took.wall_s)


def _write_noise(log: Path, sample: Path, size_bytes: int) -> None:
    rng = np.random.default_rng(0)
    with sample.open("rb") as source, log.open("wb") as target:
        maps = list(make_reader(source).iter_messages(topics=["/map"]))
        kind, channel, _ = maps[0]
        assert kind is not None
        writer = Writer(target, compression=CompressionType.ZSTD)
        writer.start("ros2", "benchmark")
        schema = writer.register_schema(kind.name, kind.encoding, kind.data)
        grid = writer.register_channel("/map", "cdr", schema, channel.metadata)
        noise = writer.register_channel(
            "/noise", "json", writer.register_schema("noise", "jsonschema", b"{}")
        )
        count = size_bytes // MESSAGE_BYTES
        writer.add_message(grid, 0, maps[0][2].data, 0)
        for number in range(1, count + 1):
            writer.add_message(noise, number, rng.bytes(MESSAGE_BYTES), number)
        writer.add_message(grid, count + 1, maps[-1][2].data, count + 1)
        writer.finish()  # type: ignore[no-untyped-call]


def start_times(logs: Sequence[Path], repeats: int) -> list[StartTimes]:
    """Time ``--help`` and ``info`` of small logs."""
    commands = [["--help"], *(["info", str(log)] for log in logs)]
    times = []
    for arguments in commands:
        walls = []
        for _ in range(repeats):
            start = time.perf_counter()
            subprocess.run(
                [sys.executable, "-m", "rose2_logs", *arguments], stdout=subprocess.DEVNULL, check=True
            )
            walls.append(time.perf_counter() - start)
        shown = " ".join([arguments[0], *(Path(each).name for each in arguments[1:])])
        times.append(StartTimes(shown, float(np.median(walls)), min(walls)))
    return times


def look_times(sample: Path, size_bytes: int, maps: int, folder: Path) -> LookTimes:
    """Describe a log of a given size with so many maps of a sample log."""
    log = folder / "huge.mcap"
    with sample.open("rb") as source:
        messages = list(make_reader(source).iter_messages(topics=["/map"]))
    kind = messages[0][0]
    assert kind is not None
    data = [messages[number % len(messages)][2].data for number in range(maps)]
    write_sparse_log(log, size_bytes, kind.data, data)
    describe_log(str(sample))
    read = bytes_read(lambda: describe_log(str(log)))
    _, took = timed(lambda: describe_log(str(log)))
    size = log.stat().st_size
    log.unlink()
    return LookTimes(size, maps, read, took.cpu_s)
