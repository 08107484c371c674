"""``evaluate``: segmentations of maps whose true rooms are known, and their figures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from rose2_logs.cli.options import option_of
from rose2_logs.cli.printing import print_line, print_table, progress_bar
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import with_detail

if TYPE_CHECKING:
    from rich.table import Table

    from rose2_logs.evaluation.benchmark import CaseResult
    from rose2_logs.workflows.evaluate import Evaluation, OnCase

EXAMPLE = "Example: [bold]rose2-logs evaluate cases.json --pictures pictures --json figures.json[/bold]"
EXAMPLES = {"evaluate": EXAMPLE}
ALONG_FIGURES = ("iou_seg", "iou_gt", "iou_sym")
METHOD, DETAIL, WORKERS = option_of("method"), option_of("detail"), option_of("workers")


def evaluate(
    cases: Annotated[
        Path,
        typer.Argument(
            metavar="CASES.json",
            help="List of maps with true rooms: "
            '{"cases": \\[{"group", "name", "map", "rooms", "resolution_m"}, ...]}, '
            "where map and rooms name images of the same size. A case may also have rooms_other, a second "
            "image of true rooms: the one that agrees better counts, and the column truth names it; and "
            "origin_xy_m, \\[x, y] of the lower left corner.",
        ),
    ],
    parameters: Parameters,
    predictions: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Also write label images, DIR/<group>/<name>.png.", show_default=False
        ),
    ] = None,
    pictures: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Also draw maps with true rooms, found rooms and errors, DIR/<group>/<name>.png.",
            show_default=False,
        ),
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Also write the figures as JSON.", show_default=False),
    ] = None,
    group: Annotated[
        str | None, typer.Option(help="Evaluate only the cases of this group.", show_default=False)
    ] = None,
    along: Annotated[
        bool,
        typer.Option(
            "--along",
            help="Take the cases of each group, in their order, as the maps of one run. Prints figures over "
            "coverage (free area over that of the last map) and of the tracks: IDF1, switches, "
            "fragmentations. With --pictures also the curves, DIR/<group>.along.png.",
        ),
    ] = False,
    workers: int = WORKERS,
    method: str = METHOD,
    detail: float | None = DETAIL,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that exist already.")] = False,
) -> None:
    """Segment maps whose true rooms are known, and print how well the rooms agree."""
    from rose2_logs.system.workers import keep_freed_memory
    from rose2_logs.workflows.evaluate import evaluate_method

    keep_freed_memory()
    with case_progress() as on_case:
        found = evaluate_method(
            cases,
            method=method,
            parameters=with_detail(parameters, detail, method),
            group=group,
            along=along,
            workers=workers,
            predictions=predictions,
            pictures=pictures,
            json_file=json_file,
            overwrite=overwrite,
            on_case=on_case,
        )
    if along:
        print_along(found)
        print_tracks(found)
    else:
        print_figures(found)


@contextmanager
def case_progress() -> Iterator[OnCase]:
    """Show a bar over the cases."""
    with progress_bar("{task.completed:.0f}/{task.total:.0f} {task.fields[note]}") as progress:
        task = progress.add_task("evaluate", total=1, note="")

        def on_case(result: CaseResult, done: int, count: int) -> None:
            progress.update(task, completed=done, total=count, note=result.case.name)

        yield on_case


def print_figures(found: Evaluation) -> None:
    """Print the figures of each map and the means of each group, in percent."""
    from rich.table import Table

    from rose2_logs.evaluation.scores import FIGURES, Scores

    def row(scores: Scores) -> list[str]:
        figures = [f"{getattr(scores, name):.2f}" for name in FIGURES]
        return [*figures, f"{scores.rooms_seg:.3g}/{scores.rooms_gt:.3g}"]

    table = Table(box=None, pad_edge=False)
    table.add_column("map", no_wrap=True)
    for heading in (*FIGURES, "rooms/true", "s"):
        table.add_column(heading, justify="right")
    has_other = add_truth_column(table, found)
    for group, mean in found.groups.items():
        members = [result for result in found.maps if result.case.group == group]
        for result in members:
            cells = [*row(result.scores), f"{result.seconds:.1f}", *[result.truth] * has_other]
            table.add_row(escape(result.case.name), *cells)
        seconds = sum(result.seconds for result in members) / len(members)
        head = f"[bold]{escape(group)}, mean of {len(members)}"
        table.add_row(head, *row(mean), f"{seconds:.1f}", end_section=True)
    print_table(table)


def add_truth_column(table: Table, found: Evaluation) -> bool:
    """Add a column for the truth that counted; says whether a map has two truths, so that it is needed."""
    has_other = any(result.case.rooms_other_path is not None for result in found.maps)
    if has_other:
        table.add_column("truth")
    return has_other


def print_along(found: Evaluation) -> None:
    """Print the figures of each run's maps over its coverage, and their means."""
    from rich.table import Table

    from rose2_logs.evaluation.scores import mean_scores

    table = Table(box=None, pad_edge=False)
    table.add_column("map", no_wrap=True)
    for heading in ("coverage", *ALONG_FIGURES, "rooms found/true"):
        table.add_column(heading, justify="right")
    has_other = add_truth_column(table, found)
    for group, points in found.runs.items():
        for point in points:
            figures = [f"{getattr(point.scores, name):.2f}" for name in ALONG_FIGURES]
            rooms = f"{point.scores.rooms_seg:.0f}/{point.scores.rooms_gt:.0f}"
            cells = [f"{point.coverage:.1%}", *figures, rooms, *[point.truth] * has_other]
            table.add_row(escape(point.name), *cells)
        mean = mean_scores(point.scores for point in points)
        figures = [f"{getattr(mean, name):.2f}" for name in ALONG_FIGURES]
        head = f"[bold]{escape(group)}, mean of {len(points)}"
        table.add_row(head, "", *figures, f"{mean.rooms_seg:.3g}/{mean.rooms_gt:.3g}", end_section=True)
    print_table(table)


def print_tracks(found: Evaluation) -> None:
    """Print the figures of each run's tracks, in percent and in numbers."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    table.add_column("tracks of", no_wrap=True)
    for heading in ("IDF1", "at best", "IDP", "IDR", "switches", "fragmentations", "tracks found/true"):
        table.add_column(heading, justify="right")
    has_other = add_truth_column(table, found)
    for group, run in found.tracks.items():
        table.add_row(f"[bold]{escape(group)}")
        rows = {
            "rooms found": run.found,
            "back-projected rooms": run.back_projected,
            "true rooms": run.true_rooms,
        }
        for name, scores in rows.items():
            shares = (scores.idf1, scores.idf1_bound, scores.idp, scores.idr)
            counts = (str(scores.id_switches), str(scores.fragmentations))
            number = f"{scores.tracks}/{scores.true_tracks}"
            cells = [*(f"{share:.2f}" for share in shares), *counts, number, *[run.truth] * has_other]
            table.add_row(f"  {name}", *cells)
    print_table(table)
    for group, run in found.tracks.items():
        print_line(
            "back-projected rooms are those of the last map, carried over to the maps before; "
            f"{escape(group)}: mean iou_sym {run.back_projected_iou_sym:.2f}"
        )
