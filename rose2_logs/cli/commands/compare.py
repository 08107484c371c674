"""``compare``: what differs between two runs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from rose2_logs.cli.messages import warning
from rose2_logs.cli.options import part_option
from rose2_logs.cli.printing import print_line, print_table, shown
from rose2_logs.config.parameters import Parameters

if TYPE_CHECKING:
    from rose2_logs.comparison.layouts import LayoutComparison
    from rose2_logs.workflows.compare import ComparisonResult

EXAMPLE = (
    "Example: [bold]rose2-logs compare results/monday results/friday -o changes[/bold]\n\n"
    "The robot may have started anywhere in the building: B is aligned with A by its walls. Coordinates in "
    "the results are in A's frame."
)
EXAMPLES = {"compare": EXAMPLE}
WALLS_SHOWN = 12
"""Walls that are printed, the longest of each kind first; the table holds all."""


def compare(
    a: Annotated[
        Path, typer.Argument(metavar="A", help="Results of analyze: the layout as it was, the reference.")
    ],
    b: Annotated[Path, typer.Argument(metavar="B", help="Results of analyze: the layout as it is now.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results of the comparison.")],
    parameters: Parameters,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the results of an earlier comparison.")
    ] = False,
    no_rrd: Annotated[bool, typer.Option("--no-rrd", help="Write no Rerun recording.")] = False,
    names: Annotated[
        Path | None,
        typer.Option(
            "--names",
            metavar="FILE",
            help="Other names for the rooms of A, as for analyze.",
            show_default=False,
        ),
    ] = None,
    part_a: Annotated[int | None, part_option("A")] = None,
    part_b: Annotated[int | None, part_option("B")] = None,
) -> None:
    """Compare the last layouts of two runs: rooms and walls that are new, missing or moved."""
    from rose2_logs.runs.run import named_run
    from rose2_logs.workflows.compare import compare_runs

    run_a, run_b = named_run(a, names, part_a), named_run(b, None, part_b)
    result = compare_runs(run_a, run_b, out, recording=not no_rrd, overwrite=overwrite, parameters=parameters)
    print_comparison(result)


def print_comparison(result: ComparisonResult) -> None:
    """Print how the layouts are aligned, how rooms and walls changed, and where the results are."""
    found = result.comparison
    for doubt in found.doubts:
        warning(doubt)
    _print_overview(found)
    _print_rooms(found)
    _print_walls(found)
    print_line(f"results in [bold]{shown(result.folder)}[/]")
    for file in result.files:
        print_line(f"  {shown(file.name)}")


def _print_overview(found: LayoutComparison) -> None:
    from rich.table import Table

    x, y, yaw = found.placement.motion.pose
    yaw_deg = math.degrees(math.remainder(yaw, 2 * math.pi))
    # Rounded, and 0.0 added, as what is too little to be shown may be below zero.
    x, y, yaw_deg = (round(each, 2) + 0.0 for each in (x, y, yaw_deg))
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_row("A", f"{shown(found.a.name)}, {len(found.a.tracks)} rooms")
    table.add_row("B", f"{shown(found.b.name)}, {len(found.b.tracks)} rooms")
    table.add_row("B's frame in A's", f"{x:+.2f}, {y:+.2f} m, turned by {yaw_deg:+.2f} deg")
    sure = "not the same building" if not found.same_building else "ambiguous" if found.ambiguous else "sure"
    table.add_row(
        "alignment",
        f"{sure}: walls agree at {found.placement.agreement:.0%} of where both explored, "
        f"which is {found.placement.common_share:.0%} of the smaller map's walls",
    )
    table.add_row("overlap", f"floor {found.floor_iou:.0%}, rooms {found.rooms_iou:.0%}")
    counts = ", ".join(f"{count} {status}" for status, count in found.room_counts.items())
    table.add_row("rooms", counts)
    if found.walls is not None:
        lengths = found.walls.lengths_m
        changes = ", ".join(f"{length:.1f} m {status}" for status, length in lengths.items())
        table.add_row("walls", changes or "none missing, new or moved")
    print_table(table)


def _print_rooms(found: LayoutComparison) -> None:
    from rich.table import Table

    from rose2_logs.model.room_names import short_name

    table = Table(box=None, pad_edge=False)
    table.add_column("rooms", no_wrap=True)
    for heading in ("in A", "in B", "IoU", "both explored", "m2 in A", "m2 in B"):
        table.add_column(heading, justify="right")
    for change in found.rooms:
        table.add_row(
            change.status,
            escape(", ".join(short_name(track, found.a.name_of) for track in change.tracks_a)) or "-",
            escape(", ".join(short_name(track, found.b.name_of) for track in change.tracks_b)) or "-",
            f"{change.iou:.2f}",
            f"{change.explored_share:.0%}",
            f"{change.area_a_m2:.1f}",
            f"{change.area_b_m2:.1f}",
        )
    print_table(table)


def _print_walls(found: LayoutComparison) -> None:
    from rich.table import Table

    if found.walls is None or not found.walls.changes:
        return
    table = Table(box=None, pad_edge=False)
    table.add_column("walls", no_wrap=True)
    for heading in ("m", "moved by m", "in A from .. to", "in B from .. to"):
        table.add_column(heading, justify="right", no_wrap=True)
    longest = sorted(found.walls.changes, key=lambda change: -change.length_m)[:WALLS_SHOWN]
    for change in (each for each in found.walls.changes if each in longest):
        ends = (
            "-" if each is None else "{:.1f}, {:.1f} .. {:.1f}, {:.1f}".format(*each)
            for each in (change.ends_a_m, change.ends_b_m)
        )
        shift = "" if change.shift_m is None else f"{change.shift_m:.2f}"
        table.add_row(change.status, f"{change.length_m:.1f}", shift, *ends)
    print_table(table)
    if len(found.walls.changes) > WALLS_SHOWN:
        print_line(f"and {len(found.walls.changes) - WALLS_SHOWN} shorter ones, see wall_changes.parquet")
