"""From the names that options have in Python to their flags, in the options themselves and in messages."""

from __future__ import annotations

import dataclasses
import re
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rose2_logs.config.run_options import Option

OTHERS = {"web=True": "--web", "resolution_m=": "--resolution "}
"""Options of single commands that messages of the library name."""


def flag_of(name: str, about: Option) -> str:
    """Return the flag of an option."""
    return about.flag or f"--{name.replace('_', '-')}"


@cache
def _flags() -> dict[str, str]:
    """Options as messages of the library write them, and as the command line does."""
    from rose2_logs.batch.options import BatchOptions
    from rose2_logs.config.run_options import RunOptions, options_of

    flags = dict(OTHERS)
    for kind in (RunOptions, BatchOptions):
        defaults = {each.name: each.default for each in dataclasses.fields(kind)}
        for name, about in options_of(kind).items():
            default = defaults[name]
            if not about.commands:
                continue
            if isinstance(default, bool):
                flags[f"{name}={not default}"] = flag_of(name, about)
            else:
                flags[f"{name}="] = f"{flag_of(name, about)} "
    return flags


_QUOTED = r"""(?<!\w)(?:'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*")"""
"""A text in quotes, as Python writes it; an apostrophe within a word opens none."""
_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?(?:e[-+]?\d+)?|nan|inf)(?=[:;,)]?(?:\s|$))"
_VALUE = rf"['\"]|NAME\b|\s|$|{_NUMBER}"
"""How the value of an option begins in a message: quoted, a number, the word NAME, or none."""
_PARAMETER = r"\bthe parameter (?P<parameter>\w+\.\w+)"


@cache
def _replaced() -> re.Pattern[str]:
    """What `with_flags` looks for; texts in quotes are found first, so that nothing in them is."""
    options = "|".join(
        rf"{re.escape(name)}(?={_VALUE})" if name.endswith("=") else rf"{re.escape(name)}(?![\w./-])"
        for name in _flags()
    )
    return re.compile(rf"{_QUOTED}|(?<![^\s(])(?P<option>{options})|{_PARAMETER}")


def with_flags(message: str) -> str:
    """Return a message of the library with options and parameters as the command line has them.

    The library knows no flags: its messages name options as Python writes them, ``overwrite=True``. What
    stands in quotes was given by the user and stays, and so do names of files that look alike.
    """

    def flag(found: re.Match[str]) -> str:
        if found["parameter"] is not None:
            return f"--set {found['parameter']}"
        return found[0] if found["option"] is None else _flags()[found["option"]]

    return _replaced().sub(flag, message)
