"""The options about messages, which all commands have."""

from __future__ import annotations

from typing import Annotated

import typer

from rose2_logs.cli.messages import style

MESSAGES = "Messages on stderr"


def _set_debug(value: bool) -> None:
    style.debug = value or style.debug


Quiet = Annotated[
    bool,
    typer.Option(
        "--quiet", "-q", help="Show only errors: no progress, no warnings.", rich_help_panel=MESSAGES
    ),
]
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", help="Also show what is being done, and every warning.", rich_help_panel=MESSAGES
    ),
]
JsonLog = Annotated[
    bool,
    typer.Option(
        "--json-log",
        help="Write each message as one line of JSON for programs: time, level, message, kind, file, topic, "
        "index of the message.",
        rich_help_panel=MESSAGES,
    ),
]
Debug = Annotated[
    bool,
    typer.Option(
        "--debug",
        help="Show the traceback of an error, for a bug report.",
        callback=_set_debug,
        is_eager=True,
        rich_help_panel=MESSAGES,
    ),
]
MESSAGE_OPTIONS = {"quiet": Quiet, "verbose": Verbose, "json_log": JsonLog, "debug": Debug}
