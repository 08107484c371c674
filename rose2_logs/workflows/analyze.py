"""One run: a log to a folder of results, what is found in its maps going to all sinks as it comes."""

from __future__ import annotations

import dataclasses
import glob
import json
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import AlreadyWholeError, InvalidMapError, OutputError, ParameterError
from rose2_logs.io import open_log
from rose2_logs.io.discovery import stem_of
from rose2_logs.io.log import LogReader
from rose2_logs.io.room_names import is_plan, read_room_names
from rose2_logs.model.analysis import left_out_note
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.model.room_names import RoomNames, TrackNames
from rose2_logs.outputs.mcap.viewer_layouts import bag_metadata_path, foxglove_path, rviz_path
from rose2_logs.runs.history import RunHistory, RunSummary
from rose2_logs.runs.journal import JournaledWorkers
from rose2_logs.runs.names import names_in, tell_unused
from rose2_logs.runs.output_folder import OutputFolder
from rose2_logs.runs.provenance import fingerprint, software_versions
from rose2_logs.runs.sink import RunInfo, Sink, abandoned_on_error, as_sinks
from rose2_logs.runs.store import RunStore, table_path
from rose2_logs.runs.stored_run import StoredRun
from rose2_logs.runs.stream import SnapshotWorkers, TrackedStream, start_workers
from rose2_logs.runs.summary import SUMMARY, write_summary
from rose2_logs.runs.tables import BACK_PROJECTED, TABLES
from rose2_logs.system.files import refuse_existing, require_short, require_utf8
from rose2_logs.system.warnings import WarningLog, collect_warnings, log_warning, muted
from rose2_logs.system.workers import usable_processes
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot
from rose2_logs.workflows.without_effect import COMPARING, following, tell_without_effect

__all__ = [
    "OnSnapshot",
    "RunOptions",
    "RunResult",
    "analyze_log",
    "log_stem",
]

logger = logging.getLogger(__name__)

NAMELESS = "log"
"""Name of the results of a log that has no name itself."""


@dataclass(frozen=True)
class RunResult:
    """What a run has written, what it came to, and the warnings about the log."""

    folder: Path
    files: tuple[Path, ...]
    summary: RunSummary
    seconds: float
    warnings: WarningLog = field(default_factory=WarningLog)


OnSnapshot = Callable[[TrackedSnapshot, float], None]
"""Called with each finished step and the share, in [0, 1], of the log's time that is done."""


def log_stem(path: Path) -> str:
    """Name for the results of a log: its name without its format's ending; of a pattern, its folder's.

    A name of dots alone, which would mean a folder above, becomes another.
    """
    path = path.resolve()
    is_pattern = glob.has_magic(path.name) and not path.exists()
    name = stem_of(path.parent.name if is_pattern else path.name)
    return name if name.strip(".") else NAMELESS


def analyze_log(
    path: Path,
    folder: Path,
    options: RunOptions | None = None,
    on_snapshot: OnSnapshot | None = None,
    sinks: Sequence[Sink] = (),
) -> RunResult:
    """Analyze a log and write all results to a folder.

    Parameters
    ----------
    path : path
        The log.
    folder : path
        Output folder, created if needed. All results appear in it at the end, the summary last.
    options : RunOptions, optional
        What to take, do and write; by default everything of the only map topic.
    on_snapshot : callable, optional
        To show progress.
    sinks : sequence of Sink
        Further outputs, which receive each step before those of this package.

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
        If a run is to be resumed that is over.
    """
    options = options or RunOptions()
    sinks = as_sinks(sinks)
    if on_snapshot is not None and not callable(on_snapshot):
        raise ParameterError(f"on_snapshot must be callable, not {on_snapshot!r:.60}")
    with collect_warnings(options.strict) as warnings:
        return _analyze_log(path, folder, options, on_snapshot, sinks, warnings)


def _analyze_log(
    path: Path,
    folder: Path,
    options: RunOptions,
    on_snapshot: OnSnapshot | None,
    sinks: Sequence[Sink],
    warnings: WarningLog,
) -> RunResult:
    start = time.perf_counter()
    for named in (path, folder):
        require_utf8(named)
    output = OutputFolder(folder, [file.name for file in _planned_files(folder, path, options).values()])
    require_short((folder, *output.files))
    output.refuse_log(path)
    refuse_existing(output.files, overwrite=options.overwrite or options.resume)
    names = _names_given(options)
    with (
        open_log(
            path,
            topic=options.topic,
            selection=options.selection,
            limits=options.reading,
            occupancy=options.parameters.occupancy,
            part=options.part,
            map_from=options.map_from,
            map_frame=options.map_frame,
            mapping=options.parameters.mapping,
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
        _tell_without_effect(reader, options)
        info = _run_info(path, reader, options)
        prepared = output.prepared(_facts(info, options), overwrite=options.overwrite, resume=options.resume)
        with _refused_if_named_otherwise(folder, names), prepared as (work, journal):
            planned = _planned_files(work, path, options)
            workers = JournaledWorkers(processes, journal) if options.journal else processes
            stream, names_given = _stream_of(reader, workers, options)
            stream.begin()  # the workers are at the first maps while the libraries of the sinks are imported
            called = TrackNames()
            outputs = [*sinks, *_make_sinks(planned, options, reader, called)]
            summary = _follow(reader, stream, work, info, options, outputs, called, names_given, on_snapshot)
            if options.origin is not None:
                warnings.rename(str(path), options.origin)
            seconds = time.perf_counter() - start
            write_summary(
                planned["summary"],
                info,
                summary,
                selection=dataclasses.asdict(options.selection),
                messages=dataclasses.asdict(reader.counts),
                decided=reader.decided,
                names=names,
                files=[file.name for name, file in planned.items() if name != "summary"],
                warnings=warnings.as_json(),
                facts=_facts_of(outputs),
                seconds=seconds,
                workers=options.workers,
            )
    return RunResult(folder, output.files, summary, seconds, warnings)


@contextmanager
def _refused_if_named_otherwise(folder: Path, names: dict[str, Any] | None) -> Iterator[None]:
    """Refuse to leave complete results as they are if their rooms are to get other names, or none."""
    try:
        yield
    except AlreadyWholeError:
        before = StoredRun(folder).summary.get("names")
        if (before and before["sha256"]) != (names and names["sha256"]):
            raise OutputError(
                f"{folder}: is whole already, with {'other' if before else 'no'} names of rooms; "
                "overwrite=True analyzes it again, and report, figure and export take names, too"
            ) from None
        raise


def _names_given(options: RunOptions) -> dict[str, Any] | None:
    """Return which file of names was given, as JSON values for the summary; None for none.

    Raises
    ------
    ParameterError
        If it cannot be read.
    """
    if options.names is None:
        return None
    read_room_names(Path(options.names))
    return {"file": options.names, "sha256": fingerprint(Path(options.names))["sha256"]}


def _facts_of(sinks: Sequence[Sink]) -> dict[str, Any]:
    """Facts of all sinks for the summary.

    Raises
    ------
    OutputError
        If those of one are no JSON object.
    """
    facts: dict[str, Any] = {}
    for sink in sinks:
        try:
            json.dumps(sink.facts, allow_nan=False)
            facts |= {str(name): value for name, value in sink.facts.items()}
        except (TypeError, ValueError, AttributeError) as error:
            raise OutputError(f"the facts of a sink for {SUMMARY} are no JSON object: {error}") from error
    return facts


def _tell_without_effect(reader: LogReader, options: RunOptions) -> None:
    """Warn of parameters that were set in vain, which depends on where the maps and the names come from."""
    read = ["kinds", *following(built=reader.is_built)]
    if options.names is not None and is_plan(Path(options.names)):
        read += COMPARING
    tell_without_effect(options.parameters, *read, method=options.method)


def _stream_of(
    reader: LogReader, workers: SnapshotWorkers | JournaledWorkers, options: RunOptions
) -> tuple[TrackedStream, RoomNames | None]:
    """Return the maps of the log with their rooms, and what these are called."""
    parameters, names = options.parameters, None
    if options.names is not None:
        names = names_in(reader.last(), Path(options.names), parameters, parameters.occupancy)
    stream = TrackedStream.of_log(
        reader,
        workers,
        parameters,
        with_path="path" in options.shown_layers or options.annotated_log,
        base_frame=options.base_frame,
        names=names,
    )
    return stream, names


def _follow(
    reader: LogReader,
    stream: TrackedStream,
    folder: Path,
    info: RunInfo,
    options: RunOptions,
    sinks: Sequence[Sink],
    called: TrackNames,
    names: RoomNames | None,
    on_snapshot: OnSnapshot | None,
) -> RunSummary:
    """Take the log's maps one by one to the history, the store and the sinks, and finish these."""
    parameters = options.parameters
    history = RunHistory(parameters, back_project=options.back_project)
    store = RunStore(folder, parameters.occupancy, parameters.kinds, back_project=options.back_project)
    tracks: set[int] = set()
    used: set[str] = set()
    with store, abandoned_on_error(sinks):
        for sink in sinks:
            sink.begin(info)
        for step in stream:
            history.add(step)
            store.write(step, history)
            called.add(step.track_ids, step.names)
            tracks.update(step.track_ids)
            used.update(step.names)
            for sink in sinks:
                sink.write(step)
            _tell_progress(step, history, stream, on_snapshot)
        if not history.totals.snapshots:
            raise InvalidMapError(f"{info.log_path}: none of its {stream.invalid} maps can be analyzed")
        history.totals.invalid, history.totals.unchanged = stream.invalid, stream.unchanged
        _project_back(reader, history, store, sinks)
        note = left_out_note(history.totals.outside_m2_last, history.totals.free_m2_last)
        if note is not None:
            where = info.origin or info.log_path
            log_warning(logger, "outside", f"{where}: in the last map, {note}", file=where)
        _warn_if_far(step.snapshot, info)
        if options.names is not None and names is not None:
            tell_unused(Path(options.names), names.unused(used, tracks))
        summary = store.finish(history, usable_processes(options.workers))
        for sink in sinks:
            sink.finish(summary)
    return summary


def _warn_if_far(last: OccupancySnapshot, info: RunInfo) -> None:
    """Tell that a map is so far from its frame's origin that viewers, which count in 32 bits, round it."""
    farthest_m = float(np.abs(last.geometry.corners_m()).max())
    step_m = float(np.spacing(np.float32(farthest_m)))
    if step_m > last.geometry.resolution_m / 2:
        where = info.origin or info.log_path
        text = (
            f"{where}: the map is {farthest_m / 1000:.0f} km from the origin of its frame, where viewers "
            f"round to {step_m:.2g} m; the tables are exact. Publish maps in a frame nearby"
        )
        log_warning(logger, "far_origin", text, file=where)


def _project_back(reader: LogReader, history: RunHistory, store: RunStore, sinks: Sequence[Sink]) -> None:
    """If requested, read the maps again to measure how much of the last map's rooms each of them shows."""
    if not history.projects_back:
        return
    logger.info("the maps are read again, to project the last layout back")
    counts = reader.counts
    with muted():  # these warnings came the first time
        for found in history.back_projected(reader.snapshots()):
            store.write_back_projected(found)
            for sink in sinks:
                sink.write_back_projected(found)
    reader.counts = counts


def _tell_progress(
    step: TrackedSnapshot, history: RunHistory, stream: TrackedStream, on_snapshot: OnSnapshot | None
) -> None:
    rooms = len(step.track_ids)
    logger.info("snapshot %d: coverage %.1f %%, %d rooms", step.snapshot.index, 100 * step.coverage, rooms)
    if on_snapshot is not None:
        first_ns, last_ns = history.totals.first_log_time_ns or 0, stream.last_log_time_ns or 0
        on_snapshot(step, (step.snapshot.log_time_ns - first_ns) / max(last_ns - first_ns, 1))


def _run_info(path: Path, reader: LogReader, options: RunOptions) -> RunInfo:
    return RunInfo(
        path,
        reader.topic,
        options.method,
        options.parameters,
        software_versions(),
        {"format": reader.info.format, **fingerprint(path)},
        options.origin,
    )


def _facts(info: RunInfo, options: RunOptions) -> dict[str, Any]:
    """Return what the analysis of the maps depends on, in the form of the summary where it is part of it."""
    return {
        **options.deciding(),
        "input": info.provenance,
        "topic": info.topic,
        "selection": dataclasses.asdict(options.selection),
        "versions": info.versions,
        "a recording with the layer voronoi": "voronoi" in options.shown_layers,
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
    files |= {name: table_path(folder, name) for name in tables}
    return files | {"summary": folder / SUMMARY}


def _make_sinks(
    planned: dict[str, Path], options: RunOptions, reader: LogReader, called: TrackNames
) -> list[Sink]:
    # Imported here: each brings a large library that the others do not need.
    sinks: list[Sink] = []
    if options.recording or options.live:
        from rose2_logs.outputs.rerun.recording import RerunRecording

        recording = RerunRecording(
            planned.get("recording"), live=options.live, layers=options.layers, name_of=called
        )
        sinks.append(recording)
    if options.annotated_log:
        from rose2_logs.outputs.mcap.annotated import AnnotatedMcap

        sinks.append(AnnotatedMcap(planned["annotated_log"], reader.source, is_bag=options.bag))
    return sinks
