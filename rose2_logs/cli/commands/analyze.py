"""``analyze``: one log or a few, each to a folder of results."""

from __future__ import annotations

import dataclasses
import gc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rose2_logs.cli.exit_codes import EXIT_KNOWN
from rose2_logs.cli.messages import show_error
from rose2_logs.cli.printing import (
    duration,
    megabytes,
    print_line,
    print_table,
    print_text,
    progress_bar,
    shown,
)
from rose2_logs.config.run_options import MAPS, RunOptions
from rose2_logs.errors import AlreadyWholeError, ParameterError, Rose2LogsError
from rose2_logs.system.text import counted

if TYPE_CHECKING:
    from rose2_logs.runs.history import RunSummary
    from rose2_logs.tracking.track_history import SnapshotRef
    from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot
    from rose2_logs.workflows.analyze import OnSnapshot, RunResult

EXAMPLE = (
    "Example: [bold]rose2-logs analyze run.mcap -o results --workers 4[/bold]\n\n"
    "The maps of several robots: [bold]rose2-logs analyze run.mcap -o results --all-topics[/bold]\n\n"
    "A first look at a long log: [bold]rose2-logs analyze run.mcap -o look --max-snapshots 20[/bold]\n\n"
    "A log of laser scans without maps: [bold]rose2-logs analyze run.bag -o results --map-from /scan[/bold]"
)
EXAMPLES = {"analyze": EXAMPLE}
WORK = "rose2_logs.runs.stream"
"""The module of what workers do."""


def analyze(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG", help="One or several logs: whatever [bold]rose2-logs info[/bold] reads."
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help="Folder for results; those of a log go to OUT/<name of the log>/."),
    ],
    *,
    topics: Annotated[
        list[str] | None,
        typer.Option(
            "--topic",
            metavar="NAME",
            help="Topic of the maps. By default /map, or the only topic that holds maps. May be repeated: "
            "each of several topics has a folder of its own, OUT/<name of the log>/<topic>/.",
            show_default=False,
            rich_help_panel=MAPS,
        ),
    ] = None,
    all_topics: Annotated[
        bool, typer.Option("--all-topics", help="Take all topics that hold maps.", rich_help_panel=MAPS)
    ] = False,
    options: RunOptions,
) -> None:
    """Find and track the rooms in all maps of a log; write a recording, an annotated MCAP, and tables."""
    from rose2_logs.system.workers import keep_freed_memory, start_importing

    keep_freed_memory()
    if options.workers > 1:
        with suppress(OSError):  # it is told when the workers are started
            start_importing(WORK)
    from rose2_logs.io.discovery import tell_split_recordings
    from rose2_logs.workflows.analyze import log_stem

    names = [log_stem(log) for log in logs]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ParameterError(f"several logs are named {min(twice)}: analyze them to different folders")
    if all_topics and (topics or options.map_from is not None):
        other = "--topic" if topics else "--map-from"
        raise ParameterError(f"--all-topics and {other} exclude each other; pass one of them")
    # Whatever is wrong with them is told before the first log is read.
    asked = list(dict.fromkeys(topics or []))
    of_topics = [dataclasses.replace(options, topic=topic) for topic in asked] or [options]
    _refuse_names(options, is_one=len(logs) == 1 and len(asked) < 2)
    if len(logs) > 1:
        remedy = "if they are, give a folder that holds only these: it is one log"
        tell_split_recordings(map(str, logs), remedy)
    failed = 0
    for log, name in zip(logs, names, strict=True):
        try:
            # A topic that the log lacks is told before others are analyzed.
            chosen = of_topics if len(asked) < 2 and not all_topics else _of_topics(log, options, asked)
            _refuse_names(options, is_one=len(chosen) == 1)
        except Rose2LogsError as error:
            failed += 1
            _tell(error, is_only=len(logs) == 1)
            continue
        for folder, one in zip(_folders(out / name, chosen), chosen, strict=True):
            try:
                _run(log, folder, one)
            except Rose2LogsError as error:
                failed += 1
                _tell(error, is_only=len(logs) == len(chosen) == 1)
    if failed:
        raise typer.Exit(EXIT_KNOWN)


def _refuse_names(options: RunOptions, *, is_one: bool) -> None:
    """Refuse a table of names for the rooms of several runs: a track of one is another room in the next."""
    from rose2_logs.io.room_names import is_plan

    if options.names is not None and not is_one and not is_plan(Path(options.names)):
        raise ParameterError(
            f"names={str(options.names)!r}: is for the rooms of one run; analyze each log and topic by itself"
        )


def _of_topics(log: Path, options: RunOptions, asked: Sequence[str]) -> list[RunOptions]:
    """Options for each topic of a log that is asked for, or that holds maps."""
    from rose2_logs.io import map_topics

    return [dataclasses.replace(options, topic=topic) for topic in map_topics(log, options.reading, asked)]


def _folders(folder: Path, chosen: Sequence[RunOptions]) -> list[Path]:
    """Folder for the results of each topic: that of the log itself if there is but one."""
    from rose2_logs.batch.folders import safe_name

    if len(chosen) == 1:
        return [folder]
    names: dict[str, None] = {}
    for name in (safe_name(one.topic or "") for one in chosen):
        free = (f"{name}_{number}" for number in count(2))
        names[name if name not in names else next(each for each in free if each not in names)] = None
    return [folder / name for name in names]


def _run(log: Path, folder: Path, options: RunOptions) -> None:
    """Analyze the maps of one topic, and print what came out."""
    from rose2_logs.workflows.analyze import analyze_log

    try:
        with run_progress(folder.name) as on_snapshot:
            result = analyze_log(log, folder, options, on_snapshot)
        print_run(result)
    except AlreadyWholeError as whole:
        print_text(str(whole))


def _tell(error: Rose2LogsError, *, is_only: bool) -> None:
    """Show an error and go on, unless there is nothing else to do."""
    if is_only:
        raise error
    show_error(error)


@contextmanager
def run_progress(name: str) -> Iterator[OnSnapshot]:
    """Show a bar over the time of a log, with the rate, the time left and the rooms so far."""
    with progress_bar("{task.fields[note]}") as progress:
        task = progress.add_task(name, total=1.0, note="opening")
        seen = 0

        def on_snapshot(step: TrackedSnapshot, share: float) -> None:
            nonlocal seen
            seen += 1
            if seen == 1 and not gc.get_freeze_count():
                # All is imported now: looking for garbage in it takes half as long as analyzing a map, and
                # counting what was set aside some milliseconds.
                gc.freeze()
            elapsed = progress.tasks[task].elapsed or 0.0
            rate = f"{seen / elapsed:.2f} maps/s" if elapsed > 0 else ""
            note = f"map {seen}, {rate}, {len(step.track_ids)} rooms"
            progress.update(task, completed=share, note=note)

        yield on_snapshot


def print_run(result: RunResult) -> None:
    """Print where the results are and what a run found."""
    from rich.table import Table

    totals = result.summary.totals
    events = totals.events
    table = Table(box=None, show_header=False, pad_edge=False)
    left_out = f" ({totals.invalid} could not be analyzed)" if totals.invalid else ""
    table.add_row("maps", f"{totals.snapshots}{left_out}")
    parts = result.summary.parts
    if len(parts) < 2:
        table.add_row("coverage", f"{totals.coverage_first:.1%} to {totals.coverage_last:.1%}")
    for number, part in parts.items() if len(parts) > 1 else ():
        table.add_row(f"part {number}", _part(part))
    brief = len(result.summary.convergence.brief)
    over_the_run = f"{totals.tracks} over the run" + (f", {brief} only briefly" if brief else "")
    table.add_row("rooms at the end", f"{totals.rooms_last} ({over_the_run})")
    changes = ", ".join(f"{events[kind]} {kind}" for kind in ("split", "merged", "lost", "returned"))
    table.add_row("changes", changes)
    if events["shifted"]:
        table.add_row("shifts of the map", f"{events['shifted']}; see shifted in events.parquet")
    for name, since in (
        ("layout final", result.summary.layout_final),
        ("known part final", result.summary.known_final),
    ):
        if since is not None:
            table.add_row(name, _since(since, result.summary))
    if result.warnings.count:
        kinds = ", ".join(f"{found.count} {kind}" for kind, found in result.warnings.kinds.items())
        table.add_row("warnings", f"{kinds}; see warnings in summary.json")
    table.add_row("time", f"{result.seconds:.1f} s, {totals.snapshots / result.seconds:.2f} maps/s")
    print_table(table)
    print_line(f"results in [bold]{shown(result.folder)}[/]")
    for file in result.files:
        print_line(f"  {shown(file.name)}  {megabytes(file.stat().st_size)}")


def _part(part: RunSummary) -> str:
    """Say what a part of a run came to."""
    totals = part.totals
    coverage = f"coverage {totals.coverage_first:.1%} to {totals.coverage_last:.1%}"
    return f"{counted(totals.snapshots, 'map')}, {coverage}, {counted(totals.rooms_last, 'room')} at its end"


def _since(since: SnapshotRef, summary: RunSummary) -> str:
    """Say from when on something held."""
    if summary.is_last(since):
        return "only in the last map: take the rooms as preliminary"
    return f"from {since.coverage:.1%} coverage on, {duration(since.time_s)}"
