"""The command for two runs: ``compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rose2_logs.cli.options import Debug

EXAMPLE = (
    "Example: [bold]rose2-logs compare results/monday results/friday -o changes[/bold]\n\n"
    "The robot may have started anywhere in the building: B is laid over A by its walls. Coordinates in the "
    "results are in A's frame."
)


def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="Results of analyze: the layout as it was.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="Results of analyze: what it is now.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an earlier comparison.")] = False,
    no_rrd: Annotated[bool, typer.Option("--no-rrd", help="Write no Rerun recording.")] = False,
    debug: Debug = False,
) -> None:
    """Tell what differs between the last layouts of two runs: rooms and walls new, missing, moved."""
    from rose2_logs.cli import printing_compare as reporting_compare
    from rose2_logs.workflows.compare import compare_runs

    result = compare_runs(a, b, out, recording=not no_rrd, overwrite=overwrite)
    reporting_compare.print_comparison(result)
