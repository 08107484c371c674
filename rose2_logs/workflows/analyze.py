"""One run: a log to a folder of results, what is found in its maps going to all sinks as it comes."""

from __future__ import annotations

import dataclasses
import glob
import logging
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import InvalidMapError
from rose2_logs.io import open_log
from rose2_logs.io.discovery import stem_of
from rose2_logs.io.log import LogReader
from rose2_logs.outputs.mcap.viewer_layouts import bag_metadata_path, foxglove_path, rviz_path
from rose2_logs.runs.back_projected_table import BackProjectedTable
from rose2_logs.runs.journal import JournaledWorkers
from rose2_logs.runs.output_folder import OutputFolder
from rose2_logs.runs.provenance import fingerprint, log_location, software_versions
from rose2_logs.runs.sink import BackProjectedSink, CopyingSink, RunInfo, Sink
from rose2_logs.runs.stream import SnapshotWorkers, start_workers, tracked_snapshots
from rose2_logs.runs.summary import RunTotals, write_summary
from rose2_logs.runs.tables import BACK_PROJECTED, SUMMARY, TABLES, Tables
from rose2_logs.system.files import refuse_existing, require_short, require_utf8
from rose2_logs.system.warnings import WarningLog, collect_warnings, muted
from rose2_logs.tracking.back_projection import RunBackProjection
from rose2_logs.tracking.track_history import SnapshotRef
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

__all__ = [
    "OnSnapshot",
    "RunOptions",
    "RunResult",
    "analyze_log",
    "log_stem",
]

logger = logging.getLogger(__name__)

NAMELESS = "log"
"""What the results of a log without a name of its own are called."""


@dataclass(frozen=True)
class RunResult:
    """What a run has written, its totals, since when the layout was as in the end, what was odd."""

    folder: Path
    files: tuple[Path, ...]
    totals: RunTotals
    seconds: float
    layout_final: SnapshotRef | None
    warnings: WarningLog = field(default_factory=WarningLog)


OnSnapshot = Callable[[TrackedSnapshot, float], None]
"""Told of each finished snapshot and of the share, in [0, 1], of the log's time that is done."""


def log_stem(path: Path) -> str:
    """Name for the results of a log: its name without its format's ending; of a pattern, its folder's.

    A name of dots alone, which would mean a folder above, becomes another.
    """
    path = path.resolve()
    is_pattern = glob.has_magic(path.name) and not path.exists()
    name = stem_of(path.parent.name if is_pattern else path.name)
    return name if name.strip(".") else NAMELESS


def analyze_log(
    path: Path, folder: Path, options: RunOptions, on_snapshot: OnSnapshot | None = None
) -> RunResult:
    """Analyze a log and write all results to a folder.

    Parameters
    ----------
    path : path
        The log.
    folder : path
        Where to; it is made. All results appear in it at the end, the summary last.
    options : RunOptions
        What to take, do and write.
    on_snapshot : callable, optional
        To show progress.

    Raises
    ------
    LogError, InvalidMapError
        If the log cannot be read or holds no map that can be analyzed.
    OutputError
        If there are results already and they may not be replaced, one cannot be written, or could not name
        the log.
    StrictError
        If something is odd, where that is an error.
    AlreadyWholeError
        If a run is to go on that is over.
    """
    with collect_warnings(options.strict) as warnings:
        return _analyze_log(path, folder, options, on_snapshot, warnings)


def _analyze_log(
    path: Path, folder: Path, options: RunOptions, on_snapshot: OnSnapshot | None, warnings: WarningLog
) -> RunResult:
    start = time.perf_counter()
    for named in (path, folder):
        require_utf8(named)
    output = OutputFolder(folder, [file.name for file in _planned_files(folder, path, options).values()])
    require_short((folder, *output.files))
    output.refuse_log(path)
    refuse_existing(output.files, overwrite=options.overwrite or options.resume)
    with (
        open_log(
            path, topic=options.topic, selection=options.selection, limits=options.parameters.reading
        ) as reader,
        start_workers(options) as processes,
    ):
        logger.info(
            "%s: %s, %d messages on %s",
            path,
            reader.info.format,
            len(reader.source.log_times(reader.topic)),
            reader.topic,
        )
        info = _run_info(path, folder, reader, options)
        made = output.made(_facts(info, options), overwrite=options.overwrite, resume=options.resume)
        with made as (work, journal):
            workers = JournaledWorkers(processes, journal) if options.journal else processes
            result = _analyze(reader, workers, work, info, options, on_snapshot, warnings, start)
    return dataclasses.replace(result, folder=folder, files=output.files)


def _analyze(
    reader: LogReader,
    workers: SnapshotWorkers | JournaledWorkers,
    folder: Path,
    info: RunInfo,
    options: RunOptions,
    on_snapshot: OnSnapshot | None,
    warnings: WarningLog,
    start: float,
) -> RunResult:
    """Write all results of an open log to a folder that is there; the run began at `start`."""
    path = info.log_path
    planned = _planned_files(folder, path, options)
    totals = RunTotals()
    last = reader.last()
    projector = RunBackProjection(options.parameters) if options.back_project else None
    step: TrackedSnapshot | None = None
    first_ns: int | None = None
    way = reader.robot_path(last.geometry.frame_id) if "path" in options.shown_layers else None
    with ExitStack() as stack:
        tables = Tables(folder)
        others = _make_sinks(planned, info, options, tables, reader)
        sinks = [stack.enter_context(sink) for sink in (tables, *others)]
        for step in tracked_snapshots(reader, last, workers, options.parameters, totals, way):
            for sink in sinks:
                sink.write(step)
            totals.add(step)
            if projector is not None:
                projector.add(step)
            logger.info(
                "snapshot %d: coverage %.1f %%, %d rooms",
                step.snapshot.index,
                100 * step.coverage,
                len(step.track_ids),
            )
            if on_snapshot is not None:
                now_ns = step.snapshot.log_time_ns
                first_ns = now_ns if first_ns is None else first_ns
                on_snapshot(step, (now_ns - first_ns) / max(last.log_time_ns - first_ns, 1))
        messages = dataclasses.asdict(reader.counts)
        if step is None:
            raise InvalidMapError(f"{path}: none of its {totals.invalid} maps can be analyzed")
        if projector is not None:
            logger.info("the maps are read once more, to be back_projected")
            receiving = [sink for sink in sinks if isinstance(sink, BackProjectedSink)]
            # What is odd was told the first time.
            with muted(), BackProjectedTable(planned[BACK_PROJECTED]) as table:
                for found in projector.back_projected(reader.snapshots()):
                    for receiver in (table, *receiving):
                        receiver.write_back_projected(found)
        tables.measure_convergence()
    if options.origin is not None:
        warnings.rename(str(path), options.origin)
    seconds = time.perf_counter() - start
    files = {name: file for name, file in planned.items() if name != "summary"}
    write_summary(
        planned["summary"],
        info,
        totals,
        tables.histories,
        tables.convergence,
        selection=dataclasses.asdict(options.selection),
        messages=messages,
        files=[file.name for file in files.values()],
        warnings=warnings.as_json(),
        copied=next((sink.copied for sink in sinks if isinstance(sink, CopyingSink)), None),
        seconds=seconds,
        workers=options.workers,
    )
    layout_final = None if tables.convergence is None else tables.convergence.layout_final
    written = (*files.values(), planned["summary"])
    return RunResult(folder, written, totals, seconds, layout_final, warnings)


def _run_info(path: Path, folder: Path, reader: LogReader, options: RunOptions) -> RunInfo:
    is_copy = options.origin is not None and "://" in options.origin
    return RunInfo(
        path,
        reader.topic,
        options.method,
        options.parameters,
        software_versions(),
        {"format": reader.info.format, **fingerprint(path)},
        options.origin,
        None if is_copy else log_location(path, options.home or folder),
    )


def _facts(info: RunInfo, options: RunOptions) -> dict[str, Any]:
    """Tell what the analysis of the maps depends on; what also stands in the summary, as it stands there."""
    return {
        **options.deciding(),
        "input": info.provenance,
        "topic": info.topic,
        "selection": dataclasses.asdict(options.selection),
        "versions": info.versions,
        "voronoi": "voronoi" in options.shown_layers,
    }


def _planned_files(folder: Path, log: Path, options: RunOptions) -> dict[str, Path]:
    files, stem = {}, log_stem(log)
    if options.recording:
        files["recording"] = folder / f"{stem}.rrd"
    if options.annotated_log:
        log = folder / f"{stem}.rose2.mcap"
        files |= {"annotated_log": log, "foxglove": foxglove_path(log), "rviz": rviz_path(log)}
        if options.bag:
            files["bag"] = bag_metadata_path(log)
    tables = (*TABLES, BACK_PROJECTED) if options.back_project else TABLES
    files |= {name: folder / f"{name}.parquet" for name in tables}
    return files | {"summary": folder / SUMMARY}


def _make_sinks(
    planned: dict[str, Path], info: RunInfo, options: RunOptions, tables: Tables, reader: LogReader
) -> list[Sink]:
    # Imported here: each brings a large library that the others do not need.
    sinks: list[Sink] = []
    if options.recording or options.live:
        from rose2_logs.outputs.rerun.recording import RerunRecording

        recording = planned.get("recording")
        sinks.append(RerunRecording(recording, info, live=options.live, layers=options.layers, tables=tables))
    if options.annotated_log:
        from rose2_logs.outputs.mcap.annotated import AnnotatedMcap

        log = planned["annotated_log"]
        sinks.append(AnnotatedMcap(log, info, reader.source, is_bag=options.bag))
    return sinks
