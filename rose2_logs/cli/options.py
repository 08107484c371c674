"""Options of commands: those that all have, and those that are made from dataclasses of the library."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer
from typer.models import OptionInfo

from rose2_logs.batch.options import BatchOptions
from rose2_logs.cli.flags import flag_of
from rose2_logs.cli.help import Command
from rose2_logs.cli.message_options import MESSAGE_OPTIONS
from rose2_logs.cli.messages import show_messages
from rose2_logs.config.parameters import Parameters, load_parameters
from rose2_logs.config.run_options import METHOD, Option, RunOptions, options_of
from rose2_logs.system.files import expanded, require_local

VALUES = {bool: "", int: "N", str: "NAME", Path: "PATH"}
"""Placeholder in a command's help for the value of an option of this type, where it declares none."""
Config = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.toml",
        help="Read parameters from a TOML file with a table for each stage, as summary.json shows them.",
        show_default=False,
        rich_help_panel=METHOD,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="STAGE.NAME=VALUE",
        help="Change one parameter, as in walls.extension_m=6; may be repeated and wins over --config. "
        "The summary.json of a run lists all parameters with their values.",
        show_default=False,
        rich_help_panel=METHOD,
    ),
]
PARAMETER_OPTIONS = {"config": Config, "settings": Settings}
MADE_FROM = (RunOptions, BatchOptions, Parameters)
"""A command that takes one of these gets an option for each of its fields."""


def part_option(of: str, panel: str | None = None) -> Any:
    """Make the option that takes one part of the results of a run."""
    return typer.Option(
        metavar="N",
        help=f"Part of {of}, from 1, where the map was begun anew within the log. By default the last.",
        show_default=False,
        rich_help_panel=panel,
    )


def option_of(name: str) -> Any:
    """Make the option of a command that takes a single one of `RunOptions`, with its default."""
    declared = next(each for each in dataclasses.fields(RunOptions) if each.name == name)
    return _typer_option(name, declared.metadata["option"], declared.default)


def built(command: Callable[..., Any], epilog: str) -> Any:
    """Make a command of Typer from a function, with the options about messages.

    A parameter of the function that is annotated with one of `MADE_FROM` stands for all the options of that
    class; the function is called with an object made from the given values.

    Parameters
    ----------
    command : callable
        What the command does.
    epilog : str
        Examples, below its help.
    """
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(cls=Command, epilog=epilog)(_with_options(command))
    return typer.main.get_command(alone)


def _with_options(command: Callable[..., Any]) -> Callable[..., Any]:
    name = command.__name__
    signature = inspect.signature(command, eval_str=True)
    made = {
        each.name: each.annotation for each in signature.parameters.values() if each.annotation in MADE_FROM
    }

    @functools.wraps(command)
    def with_options(**given: Any) -> Any:
        quiet, verbose, as_json, _ = (given.pop(each) for each in MESSAGE_OPTIONS)
        show_messages(quiet=quiet, verbose=verbose, as_json=as_json)
        given = {each: _local(value) for each, value in given.items()}
        return command(**{each: _built(kind, name, given) for each, kind in made.items()}, **given)

    parameters: list[inspect.Parameter] = []
    for each in signature.parameters.values():
        own = _parameters_of(each.annotation, name) if each.name in made else [each]
        parameters += [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in own]
    parameters += [_parameter(each, kind, False) for each, kind in MESSAGE_OPTIONS.items()]
    for each in parameters:
        _name_value(each.annotation)
    with_options.__annotations__ = {each.name: each.annotation for each in parameters}
    with_options.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return with_options


def _local(value: Any) -> Any:
    """Return what was given, paths from the home folder where they begin with ``~/``; URLs are refused."""
    if isinstance(value, list):
        return [_local(each) for each in value]
    if not isinstance(value, Path):
        return value
    path = expanded(value)
    require_local(path)
    return path


def _parameter(name: str, kind: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def _parameters_of(kind: Any, command: str) -> list[inspect.Parameter]:
    """Make a command's parameters from the options of a dataclass that it has."""
    if kind is Parameters:
        return [_parameter(each, about, None) for each, about in PARAMETER_OPTIONS.items()]
    hints, parameters = get_type_hints(kind), []
    for declared in dataclasses.fields(kind):
        if hints[declared.name] in MADE_FROM:
            parameters += _parameters_of(hints[declared.name], command)
            continue
        about: Option = declared.metadata["option"]
        if command not in about.commands:
            continue
        option = _typer_option(declared.name, about, declared.default)
        given = str if about.parse is not None else hints[declared.name]
        parameters.append(_parameter(declared.name, given, option))
    return parameters


def _typer_option(name: str, about: Option, default: Any) -> Any:
    # A flag is off until it is given, also one that turns off what is on.
    shown = False if isinstance(default, bool) else about.text if about.parse is not None else default
    return typer.Option(
        shown,
        flag_of(name, about),
        metavar="" if isinstance(default, bool) else about.metavar or None,
        help=f"Do not {about.help[0].lower()}{about.help[1:]}" if default is True else about.help,
        show_default=shown is not None,
        rich_help_panel=about.panel,
        autocompletion=_completing(about.choices) if about.choices else None,
    )


def _completing(choices: tuple[str, ...]) -> Callable[[str], list[str]]:
    """Return what a shell asks for the names that begin as what was typed."""

    def complete(incomplete: str) -> list[str]:
        return [name for name in choices if name.startswith(incomplete)]

    return complete


def _built(kind: Any, command: str, given: dict[str, Any]) -> Any:
    """Make an object of a dataclass from its options, which are taken out of what was given."""
    if kind is Parameters:
        return load_parameters(given.pop("config"), given.pop("settings") or ())
    hints, values = get_type_hints(kind), {}
    for declared in dataclasses.fields(kind):
        if hints[declared.name] in MADE_FROM:
            values[declared.name] = _built(hints[declared.name], command, given)
    for name, about in options_of(kind).items():
        if command in about.commands and name not in values:
            value = given.pop(name)
            value = about.parse(value) if about.parse is not None else value
            values[name] = not value if getattr(kind, name, None) is True else value
    return kind(**values)


def _name_value(kind: Any) -> None:
    """Name what an option takes as people do; behind a flag nothing, as if it took a value."""
    base, *about = get_args(kind) or (kind,)
    base = next((each for each in get_args(base) if each is not type(None)), base)
    for each in about:
        if isinstance(each, OptionInfo) and each.metavar is None:
            each.metavar = VALUES.get(base)
