"""How much the figures hang on each parameter, and what choosing it without a building would give there."""

from __future__ import annotations

import dataclasses
import fnmatch
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarking.markdown import bold, difference, percent, table
from benchmarking.references import load_toml
from rose2_logs.config.parameters import Parameters, describe_parameters
from rose2_logs.errors import ParameterError
from rose2_logs.evaluation.benchmark import evaluate_cases
from rose2_logs.evaluation.cases import Case
from rose2_logs.model.occupancy import FloatArray

BUILDINGS_FILE = Path(__file__).with_name("buildings.toml")
BLOCKS = ("spectrum", "walls", "floor_plan", "topology")
"""The stages of the method; other blocks are conventions, baselines and tracking."""
STEP = 1.25
"""Each parameter is divided and multiplied by this."""
FIGURE = "iou_sym"


@dataclass(frozen=True)
class Variant:
    """One parameter changed; none for the defaults.

    Attributes
    ----------
    name : str
        ``block.name = value``.
    parameters : Parameters
        All parameters of the variant.
    """

    name: str
    parameters: Parameters


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Figures of every map with every variant.

    Attributes
    ----------
    cases : tuple of Case
    buildings : tuple of str
        Building of each case.
    variants : tuple of Variant
        The defaults first.
    iou_sym : (V, C) float
        In percent.
    """

    cases: tuple[Case, ...]
    buildings: tuple[str, ...]
    variants: tuple[Variant, ...]
    iou_sym: FloatArray

    def building_means(self) -> tuple[tuple[str, ...], FloatArray]:
        """Names of the buildings, and the mean (V, B) over the maps of each: however many, it counts once."""
        names = tuple(dict.fromkeys(self.buildings))
        of_case = np.array(self.buildings)
        means = [self.iou_sym[:, of_case == name].mean(1) for name in names]
        return names, np.column_stack(means)


def make_variants(parameters: Parameters, names: Sequence[str] = ()) -> tuple[Variant, ...]:
    """Return the parameters as they are, then with each number of the stages a step down and a step up.

    Parameters
    ----------
    parameters : Parameters
    names : sequence of str
        Patterns of ``block.name``; all numbers of `BLOCKS` where there is none.

    Raises
    ------
    ParameterError
        If a pattern matches nothing.
    """
    rows = [row for row in describe_parameters() if row["block"] in BLOCKS and "low" in row]
    known = [f"{row['block']}.{row['name']}" for row in rows]
    for pattern in names:
        if not fnmatch.filter(known, pattern):
            raise ParameterError(f"no parameter {pattern!r}; there are: {', '.join(known)}")
    variants = [Variant("defaults", parameters)]
    for row, name in zip(rows, known, strict=True):
        if names and not any(fnmatch.fnmatch(name, pattern) for pattern in names):
            continue
        now = getattr(getattr(parameters, row["block"]), row["name"])
        for factor in (1 / STEP, STEP):
            value = min(max(now * factor, row["low"]), row["high"])
            value = round(value) if isinstance(now, int) else float(f"{value:.3g}")
            if value != now:
                changed = parameters.replaced({row["block"]: {row["name"]: value}})
                variants.append(Variant(f"{name} = {value:.3g}", changed))
    return tuple(variants)


def measure_sensitivity(
    cases: Sequence[Case],
    method: str,
    variants: Sequence[Variant],
    buildings: Sequence[str],
    workers: int,
    say: Callable[[str], object],
) -> Sensitivity:
    """Run every variant over every case."""
    rows = []
    for variant in variants:
        results = evaluate_cases(cases, method, variant.parameters, workers)
        rows.append([getattr(result.scores, FIGURE) for result in results])
        say(f"{variant.name}: {np.mean(rows[-1]):.2f}\n")
    return Sensitivity(tuple(cases), tuple(buildings), tuple(variants), np.array(rows))


def buildings_of(cases: Sequence[Case], path: Path = BUILDINGS_FILE) -> tuple[str, ...]:
    """Name the building of each case.

    Raises
    ------
    ParameterError
        If the file cannot be read or an entry lacks something.
    """
    entries = load_toml(path).get("building", [])
    try:
        patterns = [(pattern, entry["name"]) for entry in entries for pattern in entry["maps"]]
    except (KeyError, TypeError) as error:
        raise ParameterError(f"{path}: not a list of buildings: {error!r}") from error
    return tuple(_building(f"{case.group}/{case.name}", patterns) for case in cases)


def _building(name: str, patterns: Sequence[tuple[str, str]]) -> str:
    return next((building for pattern, building in patterns if fnmatch.fnmatchcase(name, pattern)), name)


def left_out(sensitivity: Sensitivity) -> list[tuple[str, float, str, float]]:
    """Choose the best variant on all other buildings, for each building.

    Returns
    -------
    rows : list of (building, its figure with the defaults, name of the variant, its figure with that)
    """
    names, means = sensitivity.building_means()
    rows = []
    for place, name in enumerate(names):
        others = np.delete(means, place, axis=1).mean(1)
        best = int(others.argmax())
        rows.append(
            (name, float(means[0, place]), sensitivity.variants[best].name, float(means[best, place]))
        )
    return rows


def sensitivity_report(sensitivity: Sensitivity) -> str:
    """Return the tables as Markdown."""
    groups = tuple(dict.fromkeys(case.group for case in sensitivity.cases))
    of_case = np.array([case.group for case in sensitivity.cases])
    by_group = np.column_stack([sensitivity.iou_sym[:, of_case == group].mean(1) for group in groups])
    _, by_building = sensitivity.building_means()
    change = by_building.mean(1) - by_building.mean(1)[0]
    order = np.argsort(change[1:], kind="stable") + 1
    rows = [["defaults", *(percent(value) for value in by_group[0]), percent(by_building[0].mean())]]
    for row in order.tolist():
        deltas = [difference(value) for value in by_group[row] - by_group[0]]
        rows.append([sensitivity.variants[row].name, *deltas, bold(difference(change[row]), change[row] > 0)])
    lines = [
        "# Sensitivity",
        "",
        f"`{FIGURE}` in percent with the defaults, then its change with one parameter divided or multiplied "
        f"by {STEP:g}; the last column is the mean over buildings, each of which counts once.",
        "",
        *table(["", *groups, "buildings"], rows),
    ]
    if len(set(sensitivity.buildings)) > 1:
        chosen = left_out(sensitivity)
        lines += [
            "## Buildings left out",
            "",
            "For each building, the variant that is best on all the others, and what it gives on this one: "
            "were the defaults fitted to these buildings, a choice without one would lose much on it.",
            "",
            *table(
                ["building", "defaults", "chosen without it", "figure"],
                [[name, percent(now), variant, percent(then)] for name, now, variant, then in chosen],
            ),
            f"Mean over buildings: {np.mean([row[1] for row in chosen]):.1f} with the defaults, "
            f"{np.mean([row[3] for row in chosen]):.1f} chosen without the building, "
            f"{by_building.max(0).mean():.1f} with the best variant of each.",
            "",
        ]
    return "\n".join(lines)


def sensitivity_as_json(sensitivity: Sensitivity) -> Mapping[str, object]:
    """Return all figures as JSON values."""
    return {
        "variants": [variant.name for variant in sensitivity.variants],
        "parameters": dataclasses.asdict(sensitivity.variants[0].parameters),
        "cases": [f"{case.group}/{case.name}" for case in sensitivity.cases],
        "buildings": list(sensitivity.buildings),
        FIGURE: sensitivity.iou_sym.round(3).tolist(),
    }
