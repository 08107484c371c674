"""Every number that a result depends on: one frozen block per stage, with unit, default and reason.

Lengths are metres (``_m``, ``_m2``), angles radians (``_rad``), times seconds (``_s``); shares lie in [0, 1].
A configuration file is TOML with one table per block; ``resolved`` gives the same shape back.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rose2_logs.errors import ParameterError


def _number(default: float, unit: str, why: str, low: float = 0.0, high: float = math.inf) -> Any:
    """Declare a numeric parameter: its default, unit, the sentence that says where it comes from, bounds."""
    return field(default=default, metadata={"unit": unit, "why": why, "low": low, "high": high})


@dataclass(frozen=True)
class OccupancyParameters:
    """Which cells count as occupied and which as free."""

    occupied_min_percent: float = _number(
        65.0, "%", "Cells above are occupied; map_server's default occupied_thresh.", 0, 100
    )
    free_max_percent: float = _number(
        19.6, "%", "Known cells below are free; map_server's default free_thresh.", 0, 100
    )


@dataclass(frozen=True)
class TrackingParameters:
    """Identity of rooms over the snapshots of a run."""

    match_min_iou: float = _number(
        0.2, "share", "Least overlap for a room to continue a track; half-seen rooms double in size.", 0, 1
    )


@dataclass(frozen=True)
class Parameters:
    """All blocks."""

    occupancy: OccupancyParameters = field(default_factory=OccupancyParameters)
    tracking: TrackingParameters = field(default_factory=TrackingParameters)

    def resolved(self) -> dict[str, dict[str, float | int | bool | str]]:
        """Every parameter with its value, block by block, as written beside the results."""
        return dataclasses.asdict(self)

    def replaced(self, changes: Mapping[str, Mapping[str, Any]]) -> Parameters:
        """Return a copy with some values changed.

        Parameters
        ----------
        changes : mapping of block name to mapping of parameter name to value

        Raises
        ------
        ParameterError
            If a block or a name does not exist, or a value has the wrong type or lies out of bounds.
        """
        blocks = {block.name: getattr(self, block.name) for block in dataclasses.fields(self)}
        for block_name, values in changes.items():
            if block_name not in blocks:
                raise ParameterError(f"no parameter block {block_name!r}; there are: {', '.join(blocks)}")
            if not isinstance(values, Mapping):
                raise ParameterError(f"{block_name!r} must be a table of parameters, not {values!r}")
            blocks[block_name] = _replaced_block(block_name, blocks[block_name], values)
        return Parameters(**blocks)


def _replaced_block(block_name: str, block: Any, values: Mapping[str, Any]) -> Any:
    declared = {item.name: item for item in dataclasses.fields(block)}
    checked = {}
    for name, value in values.items():
        if name not in declared:
            raise ParameterError(f"no parameter {block_name}.{name}; there are: {', '.join(declared)}")
        checked[name] = _checked(f"{block_name}.{name}", declared[name], value)
    return dataclasses.replace(block, **checked)


def _checked(name: str, declared: dataclasses.Field[Any], value: Any) -> Any:
    kind = type(declared.default)
    if isinstance(value, bool) is not (kind is bool) or not isinstance(
        value, (int, float) if kind is float else kind
    ):
        raise ParameterError(f"{name} must be of type {kind.__name__}, not {value!r}")
    meta = declared.metadata
    if kind in (int, float) and not (meta["low"] <= value <= meta["high"]):
        raise ParameterError(f"{name} is {value}; it must lie between {meta['low']} and {meta['high']}")
    return kind(value)


def load_parameters(config: Path | None = None, settings: Iterable[str] = ()) -> Parameters:
    """Read the parameters of a run.

    Parameters
    ----------
    config : path, optional
        TOML file with one table per block.
    settings : iterable of str
        ``block.name=value`` with the value written as in TOML; they win over the file.

    Raises
    ------
    ParameterError
        If the file or a setting cannot be read or names something that does not exist.
    """
    parameters = Parameters()
    if config is not None:
        try:
            parameters = parameters.replaced(tomllib.loads(config.read_text(encoding="utf-8")))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise ParameterError(f"{config}: cannot be read as TOML: {error}") from error
    for setting in settings:
        try:
            parsed = tomllib.loads(setting)
        except tomllib.TOMLDecodeError as error:
            raise ParameterError(f"--set {setting!r}: write it as block.name=value") from error
        if not all(isinstance(values, Mapping) for values in parsed.values()):
            raise ParameterError(f"--set {setting!r}: write it as block.name=value")
        parameters = parameters.replaced(parsed)
    return parameters


def describe_parameters() -> list[dict[str, Any]]:
    """List every parameter: block, name, default, unit, bounds and reason."""
    rows = []
    for block in dataclasses.fields(Parameters):
        for item in dataclasses.fields(getattr(Parameters(), block.name)):
            rows.append({"block": block.name, "name": item.name, "default": item.default, **item.metadata})
    return rows
