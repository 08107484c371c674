"""The data files beside this one: published figures and targets, and the list of ablations."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rose2_logs.config.parameters import Parameters, load_parameters
from rose2_logs.errors import ParameterError
from rose2_logs.evaluation.scores import FIGURES
from rose2_logs.segmentation.pipeline import METHODS

PUBLISHED_FILE = Path(__file__).with_name("published.toml")
ABLATIONS_FILE = Path(__file__).with_name("ablations.toml")

Figures = Mapping[str, float]


@dataclass(frozen=True)
class Published:
    """Figures of others, and targets, in percent.

    Attributes
    ----------
    groups : dict
        For each group, figures by name of what was published.
    targets : dict
        For each group, the figures to reach.
    elsewhere : dict
        Figures on maps that are not among the cases, by name.
    """

    groups: Mapping[str, Mapping[str, Figures]]
    targets: Mapping[str, Figures]
    elsewhere: Mapping[str, Figures]


@dataclass(frozen=True)
class Ablation:
    """One part of a method turned off.

    Attributes
    ----------
    name, sentence : str
        What it is called, and what is done without the part.
    method : str
        The method that it belongs to.
    settings : tuple of str
        As for ``--set``.
    """

    name: str
    sentence: str
    method: str
    settings: tuple[str, ...]

    def parameters(self, config: Path | None, settings: tuple[str, ...]) -> Parameters:
        """Return the parameters of a run with this part off; `settings` hold for all that is compared.

        Raises
        ------
        ParameterError
            If one of the settings names something that does not exist.
        """
        try:
            return load_parameters(config, (*settings, *self.settings))
        except ParameterError as error:
            raise ParameterError(f"ablation {self.name!r}: {error}") from error


def load_published(path: Path = PUBLISHED_FILE) -> Published:
    """Read published figures and targets.

    Raises
    ------
    ParameterError
        If the file cannot be read or names a figure that does not exist.
    """
    data = load_toml(path)
    try:
        groups = data.get("groups", {})
        return Published(
            {group: _named(values.get("published", [])) for group, values in groups.items()},
            {group: _figures(values["target"]) for group, values in groups.items() if "target" in values},
            _named(data.get("elsewhere", [])),
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ParameterError(f"{path}: not a table of published figures: {error!r}") from error


def load_ablations(path: Path = ABLATIONS_FILE) -> tuple[Ablation, ...]:
    """Read the list of ablations.

    Raises
    ------
    ParameterError
        If the file cannot be read, an entry lacks something, or names a method that does not exist.
    """
    data = load_toml(path)
    try:
        ablations = tuple(
            Ablation(entry["name"], entry["sentence"], entry.get("method", METHODS[0]), tuple(entry["set"]))
            for entry in data.get("ablation", [])
        )
    except (AttributeError, KeyError, TypeError) as error:
        raise ParameterError(f"{path}: an ablation needs name, sentence and set: {error!r}") from error
    for ablation in ablations:
        if ablation.method not in METHODS:
            raise ParameterError(f"{path}: ablation {ablation.name!r} is of no method in {METHODS}")
    return ablations


def load_toml(path: Path) -> dict[str, Any]:
    """Read a file of the tool.

    Raises
    ------
    ParameterError
        If it cannot be read.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ParameterError(f"{path}: cannot be read as TOML: {error}") from error


def _named(entries: list[dict[str, Any]]) -> dict[str, Figures]:
    return {
        entry["name"]: _figures({key: value for key, value in entry.items() if key != "name"})
        for entry in entries
    }


def _figures(values: Mapping[str, Any]) -> dict[str, float]:
    if unknown := set(values) - set(FIGURES):
        raise ValueError(f"no figure {', '.join(sorted(unknown))}")
    figures = {name: float(value) for name, value in values.items()}
    if {"iou_seg", "iou_gt"} <= figures.keys():
        figures.setdefault("iou_sym", (figures["iou_seg"] + figures["iou_gt"]) / 2)
    return figures
