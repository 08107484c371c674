"""How parameters are declared: blocks of fields with unit, bounds and a reason, which check themselves."""

from __future__ import annotations

import dataclasses
import itertools
import math
import numbers
import reprlib
from collections.abc import Mapping
from dataclasses import field
from typing import Any, ClassVar

from rose2_logs.errors import ParameterError

BY_FACES = ("walls", "dbscan")
"""Groupings of the floor plan that join faces; the other one joins atoms by fitted borders."""
HIGHEST = {
    "m": 100.0,
    "m2": 1e6,
    "rad": 3.2,
    "share": 1.0,
    "score": 1.0,
    "share of the range": 1.0,
    "%": 100.0,
    "1": 100.0,
    "1/m2": 100.0,
    "cells": 1000.0,
    "cells^2": 1e6,
    "tracks": 1e6,
}
"""Upper bound of a parameter that names none, by its unit: buildings fit, slips of the unit do not."""
TIMES_DEFAULT = {"m": 20.0, "cells": 20.0}
"""And it is at most so many times the default: centimeters taken for meters are a hundred times as much."""


def number(default: float, unit: str, why: str, low: float = 0.0, high: float | None = None) -> Any:
    """Declare a numeric parameter.

    Parameters
    ----------
    default : int or float
        An int makes a parameter that takes whole numbers only.
    unit : str
        Its unit.
    why : str
        The sentence that says where the default comes from.
    low, high : float, optional
        Bounds, both inclusive; the upper one is by default that of the unit, see `HIGHEST` and
        `TIMES_DEFAULT`.
    """
    if high is None:
        high = min(HIGHEST[unit], TIMES_DEFAULT.get(unit, math.inf) * default)
    return field(default=default, metadata={"unit": unit, "why": why, "low": low, "high": high})


def choice(default: str, choices: tuple[str, ...], why: str) -> Any:
    """Declare a parameter that takes one of a few names."""
    return field(default=default, metadata={"unit": "name", "why": why, "choices": choices})


def changed(block: Any) -> dict[str, Any]:
    """Values of a dataclass that differ from the defaults, by name."""
    found = {}
    for declared in dataclasses.fields(block):
        factory: Any = declared.default_factory
        default = declared.default if factory is dataclasses.MISSING else factory()
        if (value := getattr(block, declared.name)) != default:
            found[declared.name] = value
    return found


def changed_text(block: Any) -> str:
    """Show a dataclass by what differs from the defaults."""
    return (
        f"{type(block).__name__}({', '.join(f'{name}={value!r}' for name, value in changed(block).items())})"
    )


class ParameterBlock:
    """Base of the blocks of parameters: a block checks itself when it is built.

    Subclasses are frozen dataclasses whose fields are declared by `number` and `choice`.

    Attributes
    ----------
    block : str
        Name of the block, as in a configuration file.
    ascending : tuple of tuple of str
        Groups of parameters whose values must not fall from one to the next.
    implied : mapping of str to mapping
        What naming a parameter decides of others that are not named with it.
    groupings : mapping of str to tuple of str
        With which `floor_plan.grouping` a parameter has an effect, for those that have none with others.

    Raises
    ------
    ParameterError
        If a value has the wrong type, lies out of bounds, or contradicts another one.
    """

    block: ClassVar[str]
    ascending: ClassVar[tuple[tuple[str, ...], ...]] = ()
    implied: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    groupings: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    def __post_init__(self) -> None:
        for declared in dataclasses.fields(self):  # type: ignore[arg-type]
            value = _checked(f"{self.block}.{declared.name}", declared, getattr(self, declared.name))
            object.__setattr__(self, declared.name, value)
        for names in self.ascending:
            for lower, upper in itertools.pairwise(names):
                if getattr(self, lower) > getattr(self, upper):
                    raise ParameterError(
                        f"{self.block}.{lower} is {getattr(self, lower)}; it must not be above "
                        f"{self.block}.{upper}, which is {getattr(self, upper)}"
                    )

    def __repr__(self) -> str:
        return changed_text(self)

    def changed(self) -> dict[str, float | int | str]:
        """Values that differ from the defaults, by name."""
        return changed(self)


def _checked(name: str, declared: dataclasses.Field[Any], value: Any) -> float | int | str:
    kind: Any = type(declared.default)
    accepted: Any = {float: numbers.Real, int: numbers.Integral}.get(kind, kind)
    if isinstance(value, bool) or not isinstance(value, accepted):
        raise ParameterError(f"{name} must be of type {kind.__name__}, not {reprlib.repr(value)}")
    meta = declared.metadata
    if "choices" in meta:
        if value not in meta["choices"]:
            raise ParameterError(
                f"{name} is {reprlib.repr(value)}; it must be one of {', '.join(meta['choices'])}"
            )
    elif not meta["low"] <= value <= meta["high"]:
        shown = reprlib.repr(value) if isinstance(value, int) else value
        raise ParameterError(f"{name} is {shown}; it must lie between {meta['low']} and {meta['high']}")
    checked: float | int | str = kind(value)
    return checked
