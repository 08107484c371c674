"""``report``, ``figure`` and ``export``: from the results of a run to pages, pictures and plans."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rose2_logs.cli.exit_codes import EXIT_KNOWN
from rose2_logs.cli.messages import show_error
from rose2_logs.cli.options import part_option
from rose2_logs.cli.printing import print_file
from rose2_logs.drawing import WIDEST_PX
from rose2_logs.outputs.report import PANELS
from rose2_logs.workflows import FIGURE_WIDTH_PX

REPORT_EXAMPLE = (
    "Example: [bold]rose2-logs report results/run[/bold], then open results/run/report.html in a browser. "
    "[bold]rose2-logs report results[/bold] writes a page for each log in results, and one that lists them."
)
FIGURE_EXAMPLE = "Example: [bold]rose2-logs figure results/run --coverage 0.5 -o half.svg[/bold]"
EXPORT_EXAMPLE = "Example: [bold]rose2-logs export results/run --format dxf --format geojson -o plans[/bold]"
EXAMPLES = {"report": REPORT_EXAMPLE, "figure": FIGURE_EXAMPLE, "export": EXPORT_EXAMPLE}
WHICH_MAP, WHAT = "Which map", "What to write"

Results = Annotated[
    Path, typer.Argument(metavar="DIR", help="Folder of results of one log, as analyze writes it.")
]
Snapshot = Annotated[
    int | None,
    typer.Option(
        metavar="N", help="Map number N, counted from 0.", show_default=False, rich_help_panel=WHICH_MAP
    ),
]
Coverage = Annotated[
    float | None,
    typer.Option(
        metavar="SHARE",
        help="The first map with at least this coverage: 0.5 for half of the area that the last map shows.",
        show_default=False,
        rich_help_panel=WHICH_MAP,
    ),
]
Last = Annotated[
    bool, typer.Option("--last", help="The last map, which is the default.", rich_help_panel=WHICH_MAP)
]
Part = Annotated[int | None, part_option("the run", WHICH_MAP)]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace files that exist already.", rich_help_panel=WHAT)
]


Names = Annotated[
    Path | None,
    typer.Option(
        "--names",
        metavar="FILE",
        help="Other names for rooms, as for analyze: a table (CSV) with the columns name "
        "and track, or name, x and y in meters of the last map; or GeoJSON or DXF with named outlines.",
        show_default=False,
        rich_help_panel=WHAT,
    ),
]


def report(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Results of one log or of many, as analyze and batch write them."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="PATH",
            help="File for the page; for many logs, folder for the pages. By default report.html in the "
            "folder of results.",
            show_default=False,
            rich_help_panel=WHAT,
        ),
    ] = None,
    panels: Annotated[
        int,
        typer.Option(
            min=1,
            help="Number of small pictures of the layout, evenly spaced over the coverage.",
            rich_help_panel=WHAT,
        ),
    ] = PANELS,
    part: Part = None,
    names: Names = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the results of a run as one HTML page with pictures, curves and tables. It needs no network."""
    from rose2_logs.outputs.report.overview import write_reports

    written = write_reports(folder, out, panels=panels, part=part, overwrite=overwrite, names=names)
    for page in written.pages:
        print_file(page)
    for error in written.failed:
        show_error(error)
    if written.failed:
        raise typer.Exit(EXIT_KNOWN)


def figure(
    folder: Results,
    snapshot: Snapshot = None,
    coverage: Coverage = None,
    last: Last = False,
    part: Part = None,
    back_projected: Annotated[
        bool,
        typer.Option(
            "--back-projected",
            help="Draw the rooms of the last map, as far as the chosen map shows them.",
            rich_help_panel=WHICH_MAP,
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="File for the picture, .png or .svg. By default DIR/<name>.figure.png.",
            show_default=False,
            rich_help_panel=WHAT,
        ),
    ] = None,
    width: Annotated[
        int,
        typer.Option(
            metavar="PX",
            min=100,
            max=WIDEST_PX,
            help="Width of a PNG in pixels; 1800 pixels are 15 cm at 300 dpi.",
            rich_help_panel=WHAT,
        ),
    ] = FIGURE_WIDTH_PX,
    names: Names = None,
    overwrite: Overwrite = False,
) -> None:
    """Draw the layout of one map for print: rooms, predicted parts, doorways, scale bar."""
    from rose2_logs.workflows.figure import write_figure

    choice = _choice(snapshot, coverage, last)
    picture = write_figure(
        folder,
        out,
        *choice,
        back_projected=back_projected,
        width_px=width,
        overwrite=overwrite,
        names=names,
        part=part,
    )
    print_file(picture)


def export(
    folder: Results,
    formats: Annotated[
        list[str],
        typer.Option(
            "--format",
            "-f",
            metavar="FORMAT",
            help="geojson, qgis (layers), dxf (CAD), svg, map_server (Nav2), graph (networkx); repeatable.",
            rich_help_panel=WHAT,
        ),
    ],
    snapshot: Snapshot = None,
    coverage: Coverage = None,
    last: Last = False,
    part: Part = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Folder for the files. By default the folder of results.",
            show_default=False,
            rich_help_panel=WHAT,
        ),
    ] = None,
    names: Names = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the floor plan of one map for other programs: GIS, CAD, Nav2, networkx."""
    from rose2_logs.workflows.figure import export_plan

    choice = _choice(snapshot, coverage, last)
    for file in export_plan(folder, formats, out, *choice, overwrite=overwrite, names=names, part=part):
        print_file(file)


def _choice(snapshot: int | None, coverage: float | None, last: bool) -> tuple[int | None, float | None]:
    """Return which map was requested; it can be given in one way only."""
    from rose2_logs.errors import ParameterError

    if (snapshot is not None) + (coverage is not None) + last > 1:
        raise ParameterError("--snapshot, --coverage and --last exclude each other; pass one of them")
    return snapshot, coverage
