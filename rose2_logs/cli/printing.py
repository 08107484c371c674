"""What commands print on stdout, and bars on stderr: the parts that several of them use."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

from rose2_logs.cli.messages import errors, progress_line, style

if TYPE_CHECKING:
    from pathlib import Path

    from rich.progress import Progress
    from rich.table import Table

PIPE_WIDTH = 120
"""Columns of tables that do not go to a terminal."""

_out = Console(highlight=False, emoji=False, width=None if sys.stdout.isatty() else PIPE_WIDTH)


def shown(name: str | Path) -> str:
    """Return the name of a file or folder as markup, in one line and without what would steer a terminal."""
    signs = (" " if each in "\n\r\t" else each for each in str(name))
    return escape("".join(each if each.isprintable() else "\ufffd" for each in signs))


def print_line(markup: str, to_error: bool = False) -> None:
    """Print a line with markup to stdout, or to stderr above a progress bar."""
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
    """Print JSON as it is, for programs."""
    _out.file.write(json.dumps(value, indent=2) + "\n")


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


def print_file(path: Path) -> None:
    """Print the path and size of a file that was written."""
    _out.print(f"{shown(path)}  {megabytes(path.stat().st_size)}", soft_wrap=True)


def megabytes(size_bytes: int) -> str:
    """Return a size for people."""
    return f"{size_bytes / 1e6:.1f} MB" if size_bytes >= 1e5 else f"{size_bytes / 1e3:.1f} kB"


def duration(seconds: float) -> str:
    """Return a time for people."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{seconds:.1f} s"
