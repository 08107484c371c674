"""``segment``: one saved map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rose2_logs.cli.options import option_of
from rose2_logs.cli.printing import print_line, print_table, shown
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import with_detail

if TYPE_CHECKING:
    from rose2_logs.workflows.segment import StaticMapResult

EXAMPLE = "Example: [bold]rose2-logs segment map.png --resolution 0.05 -o rooms[/bold]"
EXAMPLES = {"segment": EXAMPLE}
METHOD, DETAIL = option_of("method"), option_of("detail")


def segment(
    map_file: Annotated[
        Path,
        typer.Argument(
            metavar="MAP", help="Saved map: the .yaml of map_server, or a .png, .pgm, .bmp or .tif."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")],
    parameters: Parameters,
    resolution: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            help="Side of a cell in meters, for an image without a .yaml next to it.",
            show_default=False,
        ),
    ] = None,
    formats: Annotated[
        list[str] | None,
        typer.Option(
            "--format",
            metavar="FORMAT",
            help="Also write the floor plan as svg, dxf, map_server or graph, like export; may be repeated.",
            show_default=False,
        ),
    ] = None,
    method: str = METHOD,
    detail: float | None = DETAIL,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that exist already.")] = False,
) -> None:
    """Segment one map: label image, floor plan as GeoJSON, picture."""
    from rose2_logs.workflows.segment import segment_map

    used = with_detail(parameters, detail, method)
    result = segment_map(
        map_file, out, used, method, formats=formats or (), resolution_m=resolution, overwrite=overwrite
    )
    print_static_map(result)


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
    print_table(table)
    for border in sorted(result.borders, key=lambda border: border.strength):
        if border.is_unsure:
            one, other = border.rooms
            print_line(f"rooms {one} and {other} may be one ({border.kind}, {border.strength:.0%} sure)")
    print_line(f"results in [bold]{shown(result.folder)}[/]")
    for file in result.files:
        print_line(f"  {shown(file.name)}")
