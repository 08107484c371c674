"""Options that every command has: which messages it shows on stderr, and how."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, get_args

import typer
from typer.models import OptionInfo

PANEL = "Messages on stderr"
VALUES = {bool: "", int: "N", str: "NAME", Path: "PATH"}
"""What stands in a command's help for the value of an option of this type that has no name of its own."""

Quiet = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="Only errors; no progress, no warnings.", rich_help_panel=PANEL),
]
Verbose = Annotated[
    bool,
    typer.Option("--verbose", "-v", help="Also what is done, and every warning.", rich_help_panel=PANEL),
]
JsonLog = Annotated[
    bool,
    typer.Option(
        "--json-log",
        help="One JSON object a line: time, level, message, kind, file, topic, index of the message.",
        rich_help_panel=PANEL,
    ),
]
OPTIONS = {"quiet": Quiet, "verbose": Verbose, "json_log": JsonLog}


class App(typer.Typer):
    """A Typer application whose commands all have the options of `OPTIONS`."""

    def command(self, *arguments: Any, **options: Any) -> Callable[[Any], Any]:
        """Register a command."""
        register = super().command(*arguments, **options)
        return lambda command: register(_with_options(command))


def _with_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options, which set up the messages before it is called."""

    @functools.wraps(command)
    def with_messages(**given: Any) -> Any:
        from rose2_logs.cli.messages import show_messages

        quiet, verbose, as_json = (given.pop(name) for name in OPTIONS)
        show_messages(quiet=quiet, verbose=verbose, as_json=as_json)
        return command(**given)

    signature = inspect.signature(command, eval_str=True)
    more = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
        for name, kind in OPTIONS.items()
    ]
    kinds = {name: each.annotation for name, each in signature.parameters.items()}
    for kind in (*kinds.values(), *OPTIONS.values()):
        _name_value(kind)
    with_messages.__annotations__ = kinds | OPTIONS
    with_messages.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[*signature.parameters.values(), *more]
    )
    return with_messages


def _name_value(kind: Any) -> None:
    """Name what an option takes as people do; behind a flag nothing, as if it took a value."""
    base, *about = get_args(kind) or (kind,)
    base = next((each for each in get_args(base) if each is not type(None)), base)
    for each in about:
        if isinstance(each, OptionInfo) and each.metavar is None:
            each.metavar = VALUES.get(base)
