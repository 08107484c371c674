"""``batch``: many logs into one folder, with a bar for each log in work."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Self

import typer
from rich.markup import escape

from rose2_logs.batch.options import BatchOptions
from rose2_logs.cli.exit_codes import EXIT_KNOWN
from rose2_logs.cli.flags import with_flags
from rose2_logs.cli.messages import error, style, warning
from rose2_logs.cli.printing import print_line, print_table, progress_bar, shown
from rose2_logs.system.text import counted

if TYPE_CHECKING:
    from rich.progress import TaskID

    from rose2_logs.batch.driver import BatchResult, LogState
    from rose2_logs.batch.task import LogOutcome, Progress

EXAMPLE = (
    "Example: [bold]rose2-logs batch /data/robots 'old/*.bag' -o results --workers 8[/bold]\n\n"
    "On a cluster: [bold]dask scheduler[/bold] on one machine prints its address, "
    "[bold]dask worker tcp://HOST:8786 --nworkers 8 --nthreads 1[/bold] on each, then "
    "[bold]rose2-logs batch /data/robots -o /data/results --scheduler tcp://HOST:8786[/bold]\n\n"
    "The same command again continues where it was stopped, and adds logs that are new."
)
EXAMPLES = {"batch": EXAMPLE}
MOST_BARS = 10
"""At most this many logs in progress have their own bar; a cluster may work on hundreds."""
MOST_ROWS = 200
"""If a batch has more logs, only those that failed are listed at the end, and at most this many of them."""
COLORS = {"done": "green", "up to date": "green", "failed": "bold red"}


def batch(
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOG",
            help="Logs, folders that are searched at any depth, quoted patterns, or URLs of these (s3://, "
            "https://, ...).",
        ),
    ],
    out: Annotated[
        str,
        typer.Option(
            "--out",
            "-o",
            metavar="PATH",
            help="Folder for results, or URL of an object store (s3://...): those of a log go to "
            "OUT/logs/NAME/, the tables of all logs to OUT/tables/, one row per log to OUT/summary.csv and "
            "OUT/summary.parquet.",
        ),
    ],
    options: BatchOptions,
) -> None:
    """Analyze many logs, each into its own folder, with one data set and one summary of all."""
    from rose2_logs.batch.driver import run_batch

    with BatchDisplay() as display:
        result = run_batch(logs, out, options, display)
    print_batch(result)
    if result.failed:
        raise typer.Exit(EXIT_KNOWN)


class BatchDisplay:
    """Shows how a batch goes on: a bar over all logs, one for each log in work, a line for each that ends."""

    def __init__(self) -> None:
        self._bar = progress_bar("{task.fields[note]}")
        self._all: TaskID | None = None
        self._running: dict[str, TaskID] = {}
        self._over: set[str] = set()
        self._logs = self._ended = self._failed = 0

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._bar.stop()

    def begin(self, logs: int, up_to_date: int) -> None:
        """Start the bar over all logs."""
        self._logs, self._ended = logs, up_to_date
        self._all = self._bar.add_task("all logs", total=logs, completed=up_to_date, note=self._note())

    def progress(self, told: Progress) -> None:
        """Move a log's bar."""
        if told.name in self._over:
            return
        if told.name not in self._running:
            if len(self._running) >= MOST_BARS:
                return
            self._running[told.name] = self._bar.add_task(told.name, total=1.0, note="")
        self._bar.update(self._running[told.name], completed=told.share)

    def retry(self, name: str, reason: str) -> None:
        """Show that a log is tried again."""
        warning(f"{name}: {reason}; it is tried again")
        self._remove(name)

    def finished(self, state: LogState, outcome: LogOutcome) -> None:
        """Show how a log ended."""
        # A log that had moved was begun under another name.
        self._over.add(outcome.name)
        self._remove(outcome.name)
        for told in outcome.warnings:
            warning(f"{state.name}: {told}")
        self._ended += 1
        row = state.row
        if state.status == "failed":
            self._failed += 1
            if style.debug and outcome.details:
                print_line(escape(outcome.details), to_error=True)
            error(f"{state.name}: {row['reason']}")
        else:
            found = f"{row['snapshots']} maps, {row['rooms_last']} rooms, {row['run_s']:.1f} s"
            print_line(f"[green]{state.status}:[/] {shown(state.name)}, {found}", to_error=True)
        if self._all is not None:
            self._bar.update(self._all, completed=self._ended, note=self._note())

    def _note(self) -> str:
        return f"{self._ended}/{self._logs}" + (f", {self._failed} failed" if self._failed else "")

    def _remove(self, name: str) -> None:
        if name in self._running:
            self._bar.remove_task(self._running.pop(name))


def print_batch(result: BatchResult) -> None:
    """Print one line for each log of a batch, how many went well, and where everything is."""
    from rich.table import Table

    listed = result.states if len(result.states) <= MOST_ROWS else result.failed[:MOST_ROWS]
    table = Table(box=None, pad_edge=False)
    table.add_column("log", overflow="fold")
    table.add_column("status", no_wrap=True)
    for heading in ("maps", "rooms", "tracks", "warnings", "s"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("why", overflow="fold")
    for state in listed:
        row, color = state.row, COLORS[state.status]
        names = ("snapshots", "rooms_last", "tracks", "warnings")
        figures = ["" if row[name] is None else str(row[name]) for name in names]
        seconds = "" if row["run_s"] is None else f"{row['run_s']:.1f}"
        status = f"[{color}]{state.status}[/]"
        table.add_row(shown(state.name), status, *figures, seconds, escape(with_flags(row["reason"] or "")))
    if listed:
        print_table(table)
    if others := len(result.states) - len(listed):
        print_line(f"{counted(others, 'log')} not listed here: see the summary")
    counts = {status: sum(state.status == status for state in result.states) for status in COLORS}
    print_line(", ".join(f"{count} {status}" for status, count in counts.items() if count))
    print_line(f"results in [bold]{shown(result.out)}[/]")
    for file in result.files:
        print_line(f"  {shown(file.name)}")
