"""Every figure of every method over any cases, with ablations and robustness, as one report."""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from benchmarking.references import Ablation, Published, load_ablations, load_published
from benchmarking.robustness import Robustness, check_robustness, sampled
from rose2_logs.config.parameters import Parameters, load_parameters
from rose2_logs.drawing.evaluation_pictures import CasePictures
from rose2_logs.errors import CasesError
from rose2_logs.evaluation.along import RunPoint, along_as_json, along_runs
from rose2_logs.evaluation.benchmark import CaseResult, evaluate_cases, figures, group_means
from rose2_logs.evaluation.cases import Case, load_cases
from rose2_logs.evaluation.scores import Scores
from rose2_logs.runs.provenance import software_versions

Item = TypeVar("Item")


@dataclass(frozen=True)
class AccuracyOptions:
    """What is run.

    Attributes
    ----------
    cases : tuple of path
        Files of cases, taken together.
    folder : path
        Where the report goes.
    methods : tuple of str
        Segmentation methods.
    runs : str
        Groups whose names begin so are runs: their figures are shown over coverage.
    ablations, published : path, optional
        Data files; by default those beside the tool.
    sample : int, optional
        Robustness is checked on at most so many maps of each group; on all by default.
    skip : set of str
        Parts that are left out: "ablations", "robustness", "pictures".
    config : path, optional
    settings : tuple of str
        Parameters that everything is run with.
    workers : int
        Processes.
    """

    cases: tuple[Path, ...]
    folder: Path
    methods: tuple[str, ...]
    runs: str = "incremental"
    ablations: Path | None = None
    published: Path | None = None
    sample: int | None = None
    skip: frozenset[str] = frozenset()
    config: Path | None = None
    settings: tuple[str, ...] = ()
    workers: int = 1


@dataclass(frozen=True)
class Accuracy:
    """Everything that was measured.

    Attributes
    ----------
    parameters : Parameters
        What every method was run with.
    published : Published
        What to compare with.
    results : dict
        For each method the result of each case, without its labels.
    ablations : tuple of (Ablation, dict of str to Scores)
        Means of each group with one part turned off.
    robustness : dict
        For each method the agreement of each sampled case.
    runs : dict
        For each method the runs, point by point.
    """

    parameters: Parameters
    published: Published
    results: Mapping[str, tuple[CaseResult, ...]]
    ablations: tuple[tuple[Ablation, Mapping[str, Scores]], ...] = ()
    robustness: Mapping[str, tuple[Robustness, ...]] = field(default_factory=dict)
    runs: Mapping[str, Mapping[str, tuple[RunPoint, ...]]] = field(default_factory=dict)

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups, in the order of the cases."""
        first = next(iter(self.results.values()))
        return tuple(dict.fromkeys(result.case.group for result in first))

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        return {
            "versions": software_versions(),
            "parameters": self.parameters.resolved(),
            "published": dataclasses.asdict(self.published),
            "methods": {
                method: figures(results) | {"along": along_as_json(self.runs[method])}
                for method, results in self.results.items()
            },
            "ablations": [
                dataclasses.asdict(ablation)
                | {"groups": {group: dataclasses.asdict(mean) for group, mean in means.items()}}
                for ablation, means in self.ablations
            ],
            "robustness": {
                method: [dataclasses.asdict(row) for row in rows] for method, rows in self.robustness.items()
            },
        }


def measure_accuracy(options: AccuracyOptions) -> Accuracy:
    """Run every method, ablation and check of robustness; pictures go to ``<folder>/pictures/<method>``.

    Raises
    ------
    Rose2LogsError
        If cases, parameters or data files cannot be used: before anything is run.
    """
    cases = load_all_cases(options.cases)
    parameters = load_parameters(options.config, options.settings)
    published = load_published(*_given(options.published))
    ablations = [] if "ablations" in options.skip else load_ablations(*_given(options.ablations))
    turned_off = [
        (ablation, ablation.parameters(options.config, options.settings))
        for ablation in ablations
        if ablation.method in options.methods
    ]
    say = Progress(len(cases))
    results = {
        method: tuple(_evaluated(cases, method, parameters, options, say)) for method in options.methods
    }
    measured = []
    for ablation, changed in turned_off:
        say.start(f"ablation {ablation.name!r}")
        rows = list(say.each(evaluate_cases(cases, ablation.method, changed, options.workers)))
        measured.append((ablation, group_means(rows)))
    robustness = {}
    if "robustness" not in options.skip:
        chosen = sampled(cases, options.sample)
        for method in options.methods:
            say.start(f"robustness of {method}", len(chosen))
            robustness[method] = tuple(
                say.each(check_robustness(chosen, method, parameters, options.workers))
            )
    runs = {
        method: along_runs([result for result in rows if result.case.group.startswith(options.runs)])
        for method, rows in results.items()
    }
    return Accuracy(parameters, published, results, tuple(measured), robustness, runs)


def load_all_cases(paths: Sequence[Path]) -> tuple[Case, ...]:
    """Read several files of cases as one list.

    Raises
    ------
    CasesError
        If a file cannot be read, or two of them have a group of the same name.
    """
    cases: list[Case] = []
    for path in paths:
        more = load_cases(path)
        if both := {case.group for case in more} & {case.group for case in cases}:
            raise CasesError(f"{path}: the group {min(both)!r} is in another file too; run them apart")
        cases.extend(more)
    return tuple(cases)


def _evaluated(
    cases: Sequence[Case], method: str, parameters: Parameters, options: AccuracyOptions, say: Progress
) -> Iterator[CaseResult]:
    say.start(f"figures of {method}", len(cases))
    drawn = "pictures" not in options.skip
    with CasePictures(options.folder / "pictures" / method) if drawn else nullcontext() as pictures:
        for result in say.each(evaluate_cases(cases, method, parameters, options.workers)):
            if pictures is not None:
                pictures.add(result)
            yield result.without_labels()


def _given(path: Path | None) -> tuple[Path, ...]:
    return () if path is None else (path,)


class Progress:
    """A line on stderr for each step, with how far it is where that is a terminal."""

    def __init__(self, count: int) -> None:
        self._count, self._began = count, time.monotonic()
        self._write: Callable[[str], int] = sys.stderr.write

    def start(self, step: str, count: int | None = None) -> None:
        """Begin a step of so many items, by default of as many as the one before."""
        self._count = count or self._count
        self._write(f"{time.monotonic() - self._began:6.0f} s  {step}\n")

    def each(self, items: Iterator[Item]) -> Iterator[Item]:
        """Hand on the items of the step, and count them."""
        for number, item in enumerate(items, start=1):
            if sys.stderr.isatty():
                self._write(
                    f"\r          {number}/{self._count}\r" + (" " * 30 + "\r") * (number == self._count)
                )
            yield item
