"""The tables of the accuracy page: methods by group and by building, and on maps that are changed."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from fit_grouping.maps_with_truth import building_of

from benchmarking.accuracy import Progress, load_all_cases
from benchmarking.bootstrap import bootstrap_interval
from benchmarking.markdown import figures_of, percent, table
from benchmarking.references import load_published, load_toml
from benchmarking.robustness import Robustness, check_robustness, robustness_table, sampled
from benchmarking.transforms import TRANSFORMS
from rose2_logs.config.parameters import Parameters, load_parameters
from rose2_logs.errors import CasesError, ParameterError
from rose2_logs.evaluation.benchmark import evaluate_cases
from rose2_logs.evaluation.cases import Case, Truth
from rose2_logs.evaluation.scores import FIGURES, Scores, mean_scores, score_against
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.runs.provenance import software_versions
from rose2_logs.runs.summary import write_json
from rose2_logs.segmentation.pipeline import METHODS

METHODS_FILE = Path(__file__).with_name("methods.toml")
FIGURE = "iou_sym"
PAPER = "ROSE2, the paper's implementation"
"""Published figures that stand beside those of the first method."""
EXPLAINED = """\
`iou_sym` in percent, mean over maps. In brackets the range of 95 % of the means when as many buildings are
drawn again and again, with return; a group of one building has none. The last columns are the mean of the
groups and that of the buildings, each of which counts once. What may be one building is taken as one."""


@dataclass(frozen=True)
class NamedMethod:
    """What is compared: a method with its parameters, or rooms that something else has found.

    Attributes
    ----------
    name : str
        Head of its rows.
    method : str
        Segmentation method; not used for predictions.
    parameters : Parameters
    predictions : path, optional
        Folder of label images, ``<group>/<name>.png``.
    """

    name: str
    method: str
    parameters: Parameters
    predictions: Path | None = None


@dataclass(frozen=True, eq=False)
class PageFigures:
    """Everything that the tables show.

    Attributes
    ----------
    cases : tuple of Case
    methods : tuple of NamedMethod
    scores : dict
        For each method by its name, the figures of each case.
    truths : dict
        The same for the truth that they are against.
    robustness : dict
        For each method that was checked, the agreement of each sampled case with itself, changed.
    """

    cases: tuple[Case, ...]
    methods: tuple[NamedMethod, ...]
    scores: Mapping[str, tuple[Scores, ...]]
    truths: Mapping[str, tuple[Truth, ...]]
    robustness: Mapping[str, tuple[Robustness, ...]]

    @property
    def groups(self) -> tuple[str, ...]:
        """Name of the group of each case."""
        return tuple(case.group for case in self.cases)

    @property
    def buildings(self) -> tuple[str, ...]:
        """Name of the building that each case shows."""
        return tuple(building_of(case.group, case.name) for case in self.cases)

    def iou_sym(self, name: str) -> FloatArray:
        """Figure of each case with a method."""
        return np.array([getattr(scores, FIGURE) for scores in self.scores[name]])

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        places = zip(self.groups, (case.name for case in self.cases), self.buildings, strict=True)
        rows = [{"group": group, "name": name, "building": building} for group, name, building in places]
        return {
            "versions": software_versions(),
            "methods": [
                {
                    "name": each.name,
                    "method": each.method,
                    "parameters": each.parameters.resolved(),
                    "maps": [
                        row | {"truth": truth} | dataclasses.asdict(scores)
                        for row, truth, scores in zip(
                            rows, self.truths[each.name], self.scores[each.name], strict=True
                        )
                    ],
                    "robustness": [
                        dataclasses.asdict(agreement) for agreement in self.robustness.get(each.name, ())
                    ],
                }
                for each in self.methods
            ],
        }


def load_methods(path: Path = METHODS_FILE, config: Path | None = None) -> tuple[NamedMethod, ...]:
    """Read the list of what is compared.

    Parameters
    ----------
    path : path
        The list, see `METHODS_FILE`.
    config : path, optional
        Parameters that all of them start from.

    Raises
    ------
    ParameterError
        If the file cannot be read, an entry lacks something, or names what does not exist.
    """
    try:
        entries = [(str(entry["name"]), entry) for entry in load_toml(path)["method"]]
        found = tuple(
            NamedMethod(
                name,
                str(entry.get("method", METHODS[0])),
                load_parameters(config, tuple(entry.get("set", ()))),
                path.parent / entry["predictions"] if "predictions" in entry else None,
            )
            for name, entry in entries
        )
    except (AttributeError, KeyError, TypeError) as error:
        raise ParameterError(f"{path}: a list of methods, each with a name: {error!r}") from error
    for each in found:
        if each.method not in METHODS:
            raise ParameterError(f"{path}: {each.name!r} is of no method in {METHODS}")
    if not found or len({each.name for each in found}) < len(found):
        raise ParameterError(f"{path}: at least one method, and no two of one name")
    return found


def measure_page(
    cases: Sequence[Path], methods: Sequence[NamedMethod], sample: int, workers: int = 1
) -> PageFigures:
    """Evaluate every method on every case, and its rooms on changed maps.

    Parameters
    ----------
    cases : sequence of path
        Files of cases, taken together.
    methods : sequence of NamedMethod
    sample : int
        So many maps of each group are changed, at most; 0 for none.
    workers : int
        Processes.

    Raises
    ------
    Rose2LogsError
        If a case or a prediction cannot be used.
    """
    listed = load_all_cases(cases)
    chosen = sampled(listed, sample)
    say = Progress(len(listed))
    scores, truths, robustness = {}, {}, {}
    for each in methods:
        say.start(f"figures of {each.name}", len(listed))
        rows = tuple(say.each(_scored(each, listed, workers)))
        truths[each.name], scores[each.name] = zip(*rows, strict=True)
        if chosen and each.predictions is None:
            say.start(f"robustness of {each.name}", len(chosen))
            checked = check_robustness(chosen, each.method, each.parameters, workers)
            robustness[each.name] = tuple(say.each(checked))
    return PageFigures(listed, tuple(methods), scores, truths, robustness)


def _scored(each: NamedMethod, cases: Sequence[Case], workers: int) -> Iterator[tuple[Truth, Scores]]:
    """Truth that counts, and figures against it, of each case."""
    if each.predictions is None:
        for result in evaluate_cases(cases, each.method, each.parameters, workers):
            yield result.truth, result.scores
        return
    for case in cases:
        path = each.predictions / case.group / f"{case.name}.png"
        found, truths = dataclasses.replace(case, rooms_path=path).truth(), case.truths()
        if found.shape != (shape := truths["rooms"].shape):
            raise CasesError(f"{path}: of shape {found.shape}, but {case.rooms_path} is {shape}")
        yield score_against(truths, found)


def write_page(page: PageFigures, folder: Path) -> Path:
    """Write ``tables.md`` and ``tables.json``; returns the first.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    write_json(folder / "tables.json", page.as_json())
    path = folder / "tables.md"
    path.write_text(page_tables(page), encoding="utf-8")
    return path


def page_tables(page: PageFigures) -> str:
    """Return all tables as Markdown."""
    first = page.methods[0].name
    lines = [f"## Rooms: {first}", "", *figures_lines(page, first), "## Methods", "", EXPLAINED, ""]
    lines += [*methods_lines(page), "## Buildings", "", f"`{FIGURE}`, mean over the maps of a building.", ""]
    lines += _buildings_table(page)
    if page.robustness:
        lines += [
            "## Invariance",
            "",
            f"`{FIGURE}` between the rooms of a map, changed like the map, and those found in the changed "
            "map: mean / worst over a sample of the maps.",
            "",
            *(f"- **{transform.name}**: {transform.sentence}" for transform in TRANSFORMS),
            "",
        ]
        for name, rows in page.robustness.items():
            lines += [f"### {name}", "", *robustness_table(rows)]
    return "\n".join(lines)


def figures_lines(page: PageFigures, name: str) -> list[str]:
    """Every figure of one method by group, with the published ones."""
    published = load_published().groups
    rows = []
    for group in dict.fromkeys(page.groups):
        members = [scores for scores, of in zip(page.scores[name], page.groups, strict=True) if of == group]
        ours = figures_of(mean_scores(members), FIGURES)
        theirs = figures_of(published.get(group, {}).get(PAPER, {}), FIGURES)
        cells = [f"{our} ({their})" if their else our for our, their in zip(ours, theirs, strict=True)]
        rows.append([group, str(len(members)), *cells])
    return [
        f"Percent, mean over maps; in brackets the published figures of {PAPER}, as far as there are any.",
        "",
        *table(["group", "maps", *FIGURES], rows),
    ]


def methods_lines(page: PageFigures) -> list[str]:
    """Return a row per method: means of groups, their mean, and the mean of the buildings, with ranges."""
    groups, buildings = np.array(page.groups), np.array(page.buildings)
    names = list(dict.fromkeys(page.groups))
    heads = [f"{group} ({np.count_nonzero(groups == group)})" for group in names]
    rows = []
    for each in page.methods:
        scores = page.iou_sym(each.name)
        cells = []
        for group in names:
            inside = groups == group
            cells.append(_with_range(scores[inside].mean(), buildings[inside].tolist(), scores[inside]))
        mean = float(np.mean([scores[groups == group].mean() for group in names]))
        cells.append(_with_range(mean, page.buildings, scores, page.groups))
        of_building = np.array(list(building_means(page, each.name).values()))
        cells.append(_with_range(of_building.mean(), list(dict.fromkeys(page.buildings)), of_building))
        rows.append([each.name, *cells])
    return table(["method", *heads, "mean of groups", "mean of buildings"], rows)


def _with_range(
    mean: float, buildings: Sequence[str], scores: FloatArray, groups: Sequence[str] | None = None
) -> str:
    if len(set(buildings)) == 1:
        return percent(mean)
    low, high = bootstrap_interval(buildings, scores, groups)
    return f"{percent(mean)} ({percent(low)} to {percent(high)})"


def building_means(page: PageFigures, name: str) -> dict[str, float]:
    """Mean figure of each building with a method."""
    buildings, scores = np.array(page.buildings), page.iou_sym(name)
    return {one: float(scores[buildings == one].mean()) for one in dict.fromkeys(page.buildings)}


def _buildings_table(page: PageFigures) -> list[str]:
    means = {each.name: building_means(page, each.name) for each in page.methods}
    rows = [
        [building, str(page.buildings.count(building)), *(percent(of[building]) for of in means.values())]
        for building in dict.fromkeys(page.buildings)
    ]
    return table(["building", "maps", *means], rows)
