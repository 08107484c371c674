"""The command line ``rose2-logs``: its commands, and one line and an exit code for every error."""

from __future__ import annotations

import atexit
import gc
import importlib
import os
import re
import sys
from contextlib import suppress
from typing import Annotated, Any, NoReturn

import typer

from rose2_logs import __version__
from rose2_logs.cli import messages
from rose2_logs.cli.exit_codes import EXIT_CODES, EXIT_FAULT, EXIT_INTERRUPTED, EXIT_KNOWN, EXIT_SIGNALED
from rose2_logs.cli.help import Group
from rose2_logs.cli.message_options import Debug
from rose2_logs.errors import Rose2LogsError
from rose2_logs.system.signals import heeded

COMMANDS = {
    "info": ("info", "Show what a log holds: topics, duration, map sizes, resolution, coverage."),
    "analyze": (
        "analyze",
        "Find and track the rooms in all maps of a log; write a recording, an annotated MCAP, and tables.",
    ),
    "batch": (
        "batch",
        "Analyze many logs, each into its own folder, with one data set and one summary of all.",
    ),
    "view": ("view", "Open a recording in the Rerun viewer."),
    "serve": ("view", "Serve the recordings of all logs as one Rerun catalog, until Ctrl-C is pressed."),
    "report": (
        "results",
        "Write the results of a run as one HTML page with pictures, curves and tables. It needs no network.",
    ),
    "figure": (
        "results",
        "Draw the layout of one map for print: rooms, predicted parts, doorways, scale bar.",
    ),
    "export": ("results", "Write the floor plan of one map for other programs: GIS, CAD, Nav2, networkx."),
    "compare": (
        "compare",
        "Compare the last layouts of two runs: rooms and walls that are new, missing or moved.",
    ),
    "segment": ("segment", "Segment one map: label image, floor plan as GeoJSON, picture."),
    "evaluate": (
        "evaluate",
        "Segment maps whose true rooms are known, and print how well the rooms agree.",
    ),
}
"""Each command: its module in the folder ``commands``, and what it does, told without importing it."""


# Python looks for garbage once more when it ends: in all that was imported, which takes longer than most of
# what `info` does.
atexit.register(gc.freeze)

NO_THREAD = re.compile("can't start new thread|Failed to launch worker thread")
"""What Python and Arrow say where memory, addresses or processes are limited."""


class Commands(Group):
    """The commands, of which only the one that is called is imported."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return their names."""
        return list(COMMANDS)

    def about(self, ctx: Any, name: str) -> str:
        """Return what a command does, in one line."""
        return COMMANDS[name][1]

    def get_command(self, ctx: Any, name: str) -> Any:
        """Return a command, None for another name."""
        # Typer suggests the nearest of those that are made.
        for each in [name] if name in COMMANDS else COMMANDS:
            if each not in self.commands:
                self.commands[each] = _made(each)
        return self.commands.get(name)


def _made(name: str) -> Any:
    from rose2_logs.cli.options import built

    module = importlib.import_module(f"rose2_logs.cli.commands.{COMMANDS[name][0]}")
    return built(getattr(module, name), module.EXAMPLES[name])


app = typer.Typer(
    name="rose2-logs",
    cls=Commands,
    help="Find and track rooms in the maps of robot logs.\n\n"
    "Begin with [bold]rose2-logs analyze run.mcap -o results[/bold]. Then "
    "[bold]rose2-logs view results/run[/bold] shows what was found, and "
    "[bold]rose2-logs report results/run[/bold] makes a page of it.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def commands() -> dict[str, Any]:
    """Return all commands with their arguments and options, as the documentation lists them."""
    return {name: _made(name) for name in COMMANDS}


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
            # CPython ends by SIGINT, whatever the exit code, if the interrupt came while text was executed,
            # as named tuples are when a module is imported, and no text is executed after it.
            exec("")  # noqa: S102
            if came:
                sys.exit(EXIT_SIGNALED + came[0])
        try:
            if sys.stdout is not None and not sys.stdout.closed:
                sys.stdout.flush()
        except OSError as error:
            _end_by(error)
        raise
    except OSError as error:
        _end_by(error)
    except MemoryError:
        messages.error("out of memory; use fewer --workers, or a lower --set reading.map_max_cells")
        sys.exit(EXIT_KNOWN)
    except Exception as error:
        if messages.style.debug:
            raise
        if NO_THREAD.search(str(error)):
            messages.error(f"the system starts no further thread ({error}); allow more: ulimit -v, ulimit -u")
            sys.exit(EXIT_KNOWN)
        messages.error(f"{type(error).__name__}: {error} (internal error of rose2-logs; --debug shows where)")
        sys.exit(EXIT_FAULT)


def _end_by(error: OSError) -> NoReturn:
    """Tell what the system refused, and exit."""
    where = f"{error.filename}: " if error.filename else ""
    messages.error(f"{where}{error.strerror or error}", file=error.filename)
    try:
        sys.stdout.flush()
    except OSError:
        # What cannot be written is dropped: Python would try once more at its end, and say so in its own way.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (AttributeError, ValueError):
        pass  # there is no output, or it is closed
    sys.exit(EXIT_KNOWN)


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
