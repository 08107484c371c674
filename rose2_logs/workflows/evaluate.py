"""Maps with true rooms to the figures of a method: of each map, of groups, and along runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import RunOptions, check_option
from rose2_logs.drawing.evaluation_pictures import CasePictures, along_file, draw_along
from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.evaluation.along import RunPoint, along_as_json, along_runs
from rose2_logs.evaluation.benchmark import CaseResult, evaluate_cases, figures, group_means
from rose2_logs.evaluation.cases import load_cases
from rose2_logs.evaluation.run_tracks import RunTracks, RunTrackScores, run_tracks_as_json
from rose2_logs.evaluation.scores import Scores
from rose2_logs.runs.summary import write_json
from rose2_logs.system.text import counted
from rose2_logs.workflows.evaluation_files import check_files
from rose2_logs.workflows.without_effect import tell_without_effect

OnCase = Callable[[CaseResult, int, int], None]
"""Told of each result, with its labels, how many cases are done and how many there are."""


@dataclass(frozen=True)
class Evaluation:
    """How well the rooms of a method agree with the true ones.

    A map may have two truths: the one that agrees better counts, and its result names it.

    Attributes
    ----------
    method : str
        The segmentation method.
    parameters : Parameters
        Its parameters.
    maps : tuple of CaseResult
        Figures of each map, in the order of the cases. Label images are not kept.
    groups : mapping of str to Scores
        Mean figures of each group.
    runs : mapping of str to tuple of RunPoint
        Figures of each group's maps over coverage, if the groups were evaluated as runs.
    tracks : mapping of str to RunTrackScores
        Figures of each group's tracks, in the same case.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> found = rl.evaluate("cases.json")  # doctest: +SKIP
    >>> found.groups["campus"].iou_sym  # doctest: +SKIP
    """

    method: str
    parameters: Parameters
    maps: tuple[CaseResult, ...]
    groups: Mapping[str, Scores]
    runs: Mapping[str, tuple[RunPoint, ...]] = field(default_factory=dict)
    tracks: Mapping[str, RunTrackScores] = field(default_factory=dict)

    def __repr__(self) -> str:
        maps, groups = counted(len(self.maps), "map"), counted(len(self.groups), "group")
        return f"Evaluation(method={self.method!r}, {maps}, {groups})"

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        found = {"method": self.method, "parameters": self.parameters.resolved(), **figures(self.maps)}
        if self.runs:
            found |= {"along": along_as_json(self.runs), "tracks": run_tracks_as_json(self.tracks)}
        return found


def evaluate_method(
    cases: Path | str,
    *,
    method: str = "rose2",
    parameters: Parameters | None = None,
    group: str | None = None,
    along: bool = False,
    workers: int = 1,
    predictions: Path | None = None,
    pictures: Path | None = None,
    json_file: Path | None = None,
    overwrite: bool = False,
    on_case: OnCase | None = None,
) -> Evaluation:
    """Segment maps whose true rooms are known, and measure how well the rooms agree.

    Parameters
    ----------
    cases : path
        The list of cases, see `rose2_logs.evaluation.cases`.
    method : str
        The segmentation method.
    parameters : Parameters, optional
        By default those of `Parameters()`.
    group : str, optional
        Evaluate only the cases of this group.
    along : bool
        Whether the cases of a group are, in their order, the maps of one run.
    workers : int
        Number of processes; results do not depend on it.
    predictions : path, optional
        Folder for label images, ``<group>/<name>.png``.
    pictures : path, optional
        Folder for pictures of the cases, ``<group>/<name>.png``, contact sheets, and of runs the curves.
    json_file : path, optional
        File for the figures, as JSON.
    overwrite : bool
        Whether files that exist already may be replaced; inputs may not.
    on_case : callable, optional
        Told of each result.

    Raises
    ------
    CasesError
        If the list or an image cannot be read, the images of a case differ in size, or the name of a case
        leads out of a folder.
    ParameterError
        If there is no such method, or the number of workers cannot be used.
    OutputError
        If a file cannot be written, would be written twice, is an input, or exists and may not be replaced.
    """
    check_option(RunOptions, "method", method)
    check_option(RunOptions, "workers", workers)
    used = parameters or Parameters()
    tell_without_effect(used, *(["tracking"] if along else []), method=method)
    chosen = load_cases(Path(cases), group)
    check_files(
        Path(cases),
        chosen,
        predictions=predictions,
        pictures=pictures,
        json_file=json_file,
        along=along,
        overwrite=overwrite,
    )
    results: list[CaseResult] = []
    tracks = RunTracks(used)
    with ExitStack() as stack:
        drawer = None if pictures is None else stack.enter_context(CasePictures(pictures))
        for result in evaluate_cases(chosen, method, used, workers):
            if predictions is not None:
                write_label_image(result.case.image_in(predictions), result.labels)
            if drawer is not None:
                drawer.add(result)
            if along:
                tracks.add(result)
            results.append(result.without_labels())
            if on_case is not None:
                on_case(result, len(results), len(chosen))
    runs = along_runs(results) if along else {}
    if pictures is not None:
        for name, points in runs.items():
            draw_along(f"{name}, {method}", points).save(along_file(pictures, name), width_px=None)
    found = Evaluation(method, used, tuple(results), group_means(results), runs, tracks.scores())
    if json_file is not None:
        write_json(json_file, found.as_json())
    return found
