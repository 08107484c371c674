"""The commands for results that are there: ``report``, ``figure`` and ``export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rose2_logs.cli.options import EXIT_KNOWN, Debug, Overwrite
from rose2_logs.outputs.report import PANELS
from rose2_logs.workflows.figure import FIGURE_WIDTH_PX

REPORT_EXAMPLE = (
    "Example: [bold]rose2-logs report results/run[/bold], then open results/run/report.html in a browser. "
    "[bold]rose2-logs report results[/bold] writes one for each log below, and a page that lists them."
)
FIGURE_EXAMPLE = "Example: [bold]rose2-logs figure results/run --coverage 0.5 -o half.svg[/bold]"
EXPORT_EXAMPLE = "Example: [bold]rose2-logs export results/run --format dxf --format geojson -o plans[/bold]"

Results = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of one log that analyze has written.")]
Snapshot = Annotated[
    int | None,
    typer.Option(metavar="N", help="The map of this number, from 0 on.", show_default=False),
]
Coverage = Annotated[
    float | None,
    typer.Option(metavar="SHARE", help="The first map with this coverage, 0 to 1.", show_default=False),
]
Last = Annotated[bool, typer.Option("--last", help="The last map: what is taken by default.")]


def report(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder that analyze or batch has written, of one log or many."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="PATH",
            help="The page; of many logs a folder. By default report.html beside the results.",
            show_default=False,
        ),
    ] = None,
    panels: Annotated[
        int, typer.Option(min=1, help="Small pictures of the layout, evenly along coverage.")
    ] = PANELS,
    overwrite: Overwrite = False,
    debug: Debug = False,
) -> None:
    """Write what a run found as one HTML page: pictures, curves, tables; needs no network."""
    from rose2_logs.cli import messages as reporting_messages
    from rose2_logs.cli import printing as reporting
    from rose2_logs.outputs.report.overview import write_reports

    written = write_reports(folder, out, panels=panels, overwrite=overwrite)
    for page in written.pages:
        reporting.print_file(page)
    for error in written.failed:
        reporting_messages.error(str(error))
    if written.failed:
        raise typer.Exit(EXIT_KNOWN)


def figure(
    folder: Results,
    snapshot: Snapshot = None,
    coverage: Coverage = None,
    last: Last = False,
    back_projected: Annotated[
        bool,
        typer.Option(
            "--back-projected", help="The rooms of the last map as far as this one shows them, not its own."
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="The picture, .png or .svg. By default DIR/<name>.figure.png.",
            show_default=False,
        ),
    ] = None,
    width: Annotated[
        int, typer.Option(metavar="PX", min=100, max=20000, help="Width of a PNG; 1800 are 15 cm at 300 dpi.")
    ] = FIGURE_WIDTH_PX,
    overwrite: Overwrite = False,
    debug: Debug = False,
) -> None:
    """Draw the layout of one map for print: map, rooms, predicted parts, doorways, scale bar."""
    from rose2_logs.cli import printing as reporting
    from rose2_logs.workflows.figure import write_figure

    choice = _choice(snapshot, coverage, last)
    picture = write_figure(
        folder, out, *choice, back_projected=back_projected, width_px=width, overwrite=overwrite
    )
    reporting.print_file(picture)


def export(
    folder: Results,
    formats: Annotated[
        list[str],
        typer.Option(
            "--format",
            "-f",
            metavar="FORMAT",
            help="geojson, svg, dxf, map_server or graph; may be repeated.",
        ),
    ],
    snapshot: Snapshot = None,
    coverage: Coverage = None,
    last: Last = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Folder for the files; by default that of the results.",
            show_default=False,
        ),
    ] = None,
    overwrite: Overwrite = False,
    debug: Debug = False,
) -> None:
    """Write the floor plan of one map for other programs: GIS, CAD, Nav2, networkx."""
    from rose2_logs.cli import printing as reporting
    from rose2_logs.workflows.figure import export_plan

    choice = _choice(snapshot, coverage, last)
    for file in export_plan(folder, formats, out, *choice, overwrite=overwrite):
        reporting.print_file(file)


def _choice(snapshot: int | None, coverage: float | None, last: bool) -> tuple[int | None, float | None]:
    """Return which map was asked for; it can be told in one way only."""
    from rose2_logs.errors import ParameterError

    if (snapshot is not None) + (coverage is not None) + last > 1:
        raise ParameterError("--snapshot, --coverage and --last exclude each other; pass one of them")
    return snapshot, coverage
