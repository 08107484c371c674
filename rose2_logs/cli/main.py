"""The command line ``rose2-logs``: its commands, and one line and an exit code for every error."""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import Annotated

import typer

from rose2_logs import __version__
from rose2_logs.cli import messages
from rose2_logs.cli.commands import analyze, batch, compare, evaluate, info, results, segment, view
from rose2_logs.cli.options import (
    EXIT_CODES,
    EXIT_FAULT,
    EXIT_INTERRUPTED,
    EXIT_KNOWN,
    EXIT_SIGNALED,
    App,
    Debug,
)
from rose2_logs.errors import Rose2LogsError
from rose2_logs.system.signals import heeded

app = App(
    name="rose2-logs",
    help="Find and track rooms in the maps of robot logs.\n\n"
    "Begin with [bold]rose2-logs analyze run.mcap -o results[/bold]. Then "
    "[bold]rose2-logs view results/run[/bold] shows what was found, and "
    "[bold]rose2-logs report results/run[/bold] makes a page of it.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command(epilog=info.EXAMPLE)(info.info)
app.command(epilog=analyze.EXAMPLE)(analyze.analyze)
app.command(epilog=batch.EXAMPLE)(batch.batch)
app.command(epilog=view.VIEW_EXAMPLE)(view.view)
app.command(epilog=view.SERVE_EXAMPLE)(view.serve)
app.command(epilog=results.REPORT_EXAMPLE)(results.report)
app.command(epilog=results.FIGURE_EXAMPLE)(results.figure)
app.command(epilog=results.EXPORT_EXAMPLE)(results.export)
app.command(epilog=compare.EXAMPLE)(compare.compare)
app.command(epilog=segment.EXAMPLE)(segment.segment)
app.command(epilog=evaluate.EXAMPLE)(evaluate.evaluate)


def main() -> None:
    """Run the command line and exit."""
    messages.style.debug = False
    try:
        with heeded() as came:
            app()
    except Rose2LogsError as error:
        messages.show_error(error)
        sys.exit(EXIT_KNOWN)
    except SystemExit as ended:
        # Typer ends so, without a word, upon Ctrl-C and what is taken for it.
        if ended.code == EXIT_INTERRUPTED:
            with suppress(OSError):  # the terminal may be gone
                messages.error("interrupted; unfinished results were removed")
            if came:
                sys.exit(EXIT_SIGNALED + came[0])
        raise
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        messages.error(f"{where}{error.strerror or error}", file=error.filename)
        sys.exit(EXIT_KNOWN)
    except MemoryError:
        messages.error("out of memory; use fewer --workers, or a lower --set reading.map_max_cells")
        sys.exit(EXIT_KNOWN)
    except Exception as error:
        if messages.style.debug:
            raise
        messages.error(f"{type(error).__name__}: {error} (internal error of rose2-logs; --debug shows where)")
        sys.exit(EXIT_FAULT)


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"rose2-logs {__version__}")
        raise typer.Exit


@app.callback()
def _everything(
    debug: Debug = False,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, metavar="", help="Show the version."
        ),
    ] = False,
) -> None:
    messages.show_messages()
