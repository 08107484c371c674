"""What the command line shows: tables, progress, errors. Only `cli` uses it."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

from rose2_logs.cli.messages import errors, printable, progress_line, style, with_flags

if TYPE_CHECKING:
    from pathlib import Path

    from rich.progress import Progress
    from rich.table import Table

    from rose2_logs.evaluation.along import RunPoint
    from rose2_logs.evaluation.benchmark import CaseResult
    from rose2_logs.evaluation.run_tracks import RunTrackScores
    from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot
    from rose2_logs.workflows.analyze import OnSnapshot, RunResult
    from rose2_logs.workflows.info import LogFacts, MapFacts
    from rose2_logs.workflows.segment import StaticMapResult

ALONG_FIGURES = ("iou_seg", "iou_gt", "iou_sym")
PIPE_WIDTH = 120
"""Columns of tables that do not go to a terminal."""

_out = Console(highlight=False, width=None if sys.stdout.isatty() else PIPE_WIDTH)


def print_line(markup: str, to_error: bool = False) -> None:
    """Print a line with markup, beside the progress bar if it goes to stderr."""
    if to_error:
        progress_line(markup)
    else:
        _out.print(markup, soft_wrap=True)


def print_text(text: str) -> None:
    """Print a line as it is."""
    _out.print(escape(text), soft_wrap=True)


def print_table(table: Table) -> None:
    """Print a table."""
    _out.print(table)


def print_json(value: Any) -> None:
    """Print JSON as it is, for scripts."""
    _out.file.write(json.dumps(value, indent=2) + "\n")


def print_log_facts(facts: LogFacts) -> None:
    """Print what a log holds."""
    from rich.table import Table

    info = facts.info
    _out.print(f"[bold]{escape(str(info.path))}[/]", soft_wrap=True)
    index = "" if info.indexed else ", no index: read from its beginning"
    index += "" if info.whole else ", damaged: what is whole of it"
    _out.print(f"{info.format}, {_megabytes(info.size_bytes)}, {_duration(info.duration_s)}{index}")
    table = Table("topic", "type", "encoding", "messages", "map", box=None, pad_edge=False)
    for topic in info.topics:
        count = "?" if topic.message_count is None else str(topic.message_count)
        is_map = "yes" if topic.is_map else ""
        told = (escape(printable(text)) for text in (topic.name, topic.message_type, topic.encoding))
        table.add_row(*told, count, is_map)
    _out.print(table)
    for topic_facts in facts.maps:
        if topic_facts.first is None or topic_facts.last is None:
            trouble = escape(printable(with_flags(topic_facts.trouble or "")))
            _out.print(f"[bold]{escape(printable(topic_facts.topic))}[/]: {trouble}", soft_wrap=True)
            continue
        frame = escape(printable(topic_facts.last.frame_id))
        _out.print(f"[bold]{escape(printable(topic_facts.topic))}[/] in frame {frame}")
        _out.print(f"  first map {_map_line(topic_facts.first)}")
        _out.print(f"  last map  {_map_line(topic_facts.last)}")
        if topic_facts.coverage_first is not None:
            _out.print(f"  coverage  {topic_facts.coverage_first:.1%} to 100%")
    if not facts.maps:
        _out.print("no occupancy grids: analyze cannot use this log")


def _map_line(facts: MapFacts) -> str:
    height, width = facts.shape
    return (
        f"{width} x {height} cells of {facts.resolution_m:.4g} m "
        f"({width * facts.resolution_m:.1f} x {height * facts.resolution_m:.1f} m), "
        f"{facts.free_area_m2:.1f} m2 free"
    )


@contextmanager
def run_progress(name: str) -> Iterator[OnSnapshot]:
    """Show a bar over the time of a log, with the rate, the time left and the rooms so far."""
    with progress_bar("{task.fields[note]}") as progress:
        task = progress.add_task(name, total=1.0, note="opening")
        seen = 0

        def on_snapshot(step: TrackedSnapshot, share: float) -> None:
            nonlocal seen
            seen += 1
            elapsed = progress.tasks[task].elapsed or 0.0
            rate = f"{seen / elapsed:.2f} maps/s" if elapsed > 0 else ""
            note = f"map {seen}, {rate}, {len(step.track_ids)} rooms"
            progress.update(task, completed=share, note=note)

        yield on_snapshot


@contextmanager
def case_progress(count: int) -> Iterator[Callable[[str], None]]:
    """Show a bar over a number of cases."""
    with progress_bar("{task.completed:.0f}/{task.total:.0f} {task.fields[note]}") as progress:
        task = progress.add_task("evaluate", total=count, note="")
        yield lambda name: progress.update(task, advance=1, note=name)


def progress_bar(text: str) -> Progress:
    """Make a bar on stderr whose tasks end with a text; none is drawn into a file or a pipe."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn(text, markup=False),
        TimeRemainingColumn(compact=True),
        console=errors,
        # The bar goes when it is done or an error comes; in a file or a pipe there is none.
        transient=True,
        disable=not style.shows_progress,
    )


def print_run(result: RunResult) -> None:
    """Print where the results are and what a run found."""
    from rich.table import Table

    totals = result.summary.totals
    events = totals.events
    table = Table(box=None, show_header=False, pad_edge=False)
    left_out = f" ({totals.invalid} could not be analyzed)" if totals.invalid else ""
    table.add_row("maps", f"{totals.snapshots}{left_out}")
    table.add_row("coverage", f"{totals.coverage_first:.1%} to {totals.coverage_last:.1%}")
    table.add_row("rooms at the end", f"{totals.rooms_last} ({totals.tracks} over the run)")
    changes = ", ".join(f"{events[kind]} {kind}" for kind in ("split", "merged", "lost", "returned"))
    table.add_row("changes", changes)
    if events["shifted"]:
        table.add_row("shifts of the map", f"{events['shifted']}; see shifted in events.parquet")
    if result.summary.layout_final is not None:
        since = result.summary.layout_final
        in_the_end = f"from {since.coverage:.1%} coverage on, {_duration(since.time_s)}"
        span_ns = (totals.last_log_time_ns or 0) - (totals.first_log_time_ns or 0)
        if totals.snapshots > 1 and since.time_s == span_ns / 1e9:
            in_the_end = "only in the last map: take the rooms as preliminary"
        table.add_row("layout as in the end", in_the_end)
    if result.warnings.count:
        kinds = ", ".join(f"{found.count} {kind}" for kind, found in result.warnings.kinds.items())
        table.add_row("warnings", f"{kinds}; see warnings in summary.json")
    table.add_row("time", f"{result.seconds:.1f} s, {totals.snapshots / result.seconds:.2f} maps/s")
    _out.print(table)
    _out.print(f"results in [bold]{escape(str(result.folder))}[/]", soft_wrap=True)
    for file in result.files:
        _out.print(f"  {escape(file.name)}  {_megabytes(file.stat().st_size)}", soft_wrap=True)


def print_file(path: Path) -> None:
    """Print where a file is that was written."""
    _out.print(f"{escape(str(path))}  {_megabytes(path.stat().st_size)}", soft_wrap=True)


def print_static_map(result: StaticMapResult) -> None:
    """Print the rooms of one map and where the results are."""
    from rich.table import Table

    rooms = result.rooms
    table = Table("room", "area m2", "with predicted m2", "behind doors", box=None, pad_edge=False)
    for number, (area, predicted) in enumerate(
        zip(rooms.areas_m2, rooms.predicted_areas_m2, strict=True), start=1
    ):
        neighbors = ", ".join(str(other) for other in rooms.neighbors(number))
        table.add_row(str(number), f"{area:.1f}", f"{predicted:.1f}", neighbors)
    _out.print(table)
    _out.print(f"results in [bold]{escape(str(result.folder))}[/]", soft_wrap=True)
    for file in result.files:
        _out.print(f"  {escape(file.name)}", soft_wrap=True)


def print_figures(results: Sequence[CaseResult]) -> None:
    """Print the figures of each map and the means of each group, in percent."""
    from rich.table import Table

    from rose2_logs.evaluation.benchmark import group_means
    from rose2_logs.evaluation.scores import FIGURES, Scores

    def row(scores: Scores) -> list[str]:
        figures = [f"{getattr(scores, name):.2f}" for name in FIGURES]
        return [*figures, f"{scores.rooms_seg:.3g}/{scores.rooms_gt:.3g}"]

    table = Table(box=None, pad_edge=False)
    table.add_column("map", no_wrap=True)
    for heading in (*FIGURES, "rooms/true", "s"):
        table.add_column(heading, justify="right")
    for group, mean in group_means(results).items():
        members = [result for result in results if result.case.group == group]
        for result in members:
            table.add_row(escape(result.case.name), *row(result.scores), f"{result.seconds:.1f}")
        seconds = sum(result.seconds for result in members) / len(members)
        head = f"[bold]{escape(group)}, mean of {len(members)}"
        table.add_row(head, *row(mean), f"{seconds:.1f}", end_section=True)
    _out.print(table)


def print_along(runs: Mapping[str, Sequence[RunPoint]]) -> None:
    """Print the figures of each run's maps over its coverage, and their means."""
    from rich.table import Table

    from rose2_logs.evaluation.scores import mean_scores

    table = Table(box=None, pad_edge=False)
    table.add_column("map", no_wrap=True)
    for heading in ("coverage", *ALONG_FIGURES, "rooms found/true"):
        table.add_column(heading, justify="right")
    for group, points in runs.items():
        for point in points:
            figures = [f"{getattr(point.scores, name):.2f}" for name in ALONG_FIGURES]
            rooms = f"{point.scores.rooms_seg:.0f}/{point.scores.rooms_gt:.0f}"
            table.add_row(escape(point.name), f"{point.coverage:.1%}", *figures, rooms)
        mean = mean_scores(point.scores for point in points)
        figures = [f"{getattr(mean, name):.2f}" for name in ALONG_FIGURES]
        head = f"[bold]{escape(group)}, mean of {len(points)}"
        table.add_row(head, "", *figures, f"{mean.rooms_seg:.3g}/{mean.rooms_gt:.3g}", end_section=True)
    _out.print(table)


def print_tracks(runs: Mapping[str, RunTrackScores]) -> None:
    """Print the figures of each run's tracks, in percent and in numbers."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    table.add_column("tracks of", no_wrap=True)
    for heading in ("IDF1", "at best", "IDP", "IDR", "switches", "fragmentations", "tracks found/true"):
        table.add_column(heading, justify="right")
    for group, run in runs.items():
        table.add_row(f"[bold]{escape(group)}")
        rows = {"rooms found": run.found, "back_projected": run.back_projected, "true rooms": run.true_rooms}
        for name, scores in rows.items():
            shares = (scores.idf1, scores.idf1_bound, scores.idp, scores.idr)
            counts = (str(scores.id_switches), str(scores.fragmentations))
            number = f"{scores.tracks}/{scores.true_tracks}"
            table.add_row(f"  {name}", *(f"{share:.2f}" for share in shares), *counts, number)
    _out.print(table)
    for group, run in runs.items():
        _out.print(
            f"back_projected: the rooms of the last map carried over to those before, {escape(group)}: "
            f"mean iou_sym {run.back_projected_iou_sym:.2f}"
        )


def _megabytes(size_bytes: int) -> str:
    return f"{size_bytes / 1e6:.1f} MB" if size_bytes >= 1e5 else f"{size_bytes / 1e3:.1f} kB"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{seconds:.1f} s"
