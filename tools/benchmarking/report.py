"""The report of a benchmark as Markdown, with its pictures beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np

from benchmarking.accuracy import Accuracy
from benchmarking.markdown import bold, difference, figures_of, percent, rooms_of, table
from benchmarking.robustness import robustness_table
from benchmarking.transforms import TRANSFORMS
from rose2_logs.drawing.chart import Curve, line_chart
from rose2_logs.drawing.sheet import stacked
from rose2_logs.evaluation.benchmark import CaseResult, group_means
from rose2_logs.evaluation.scores import FIGURES, Scores, mean_scores
from rose2_logs.runs.provenance import software_versions
from rose2_logs.runs.summary import write_json

IOU = ("iou_sym", "iou_seg", "iou_gt")
EXPLAINED = """\
Percent, means over maps. The partner of a room is the room on the other side that it overlaps most.
`precision` and `recall`: overlap over own size, mean over found and over true rooms. `iou_seg`: intersection
over union with the partner, mean over found rooms, which forgives merged rooms; `iou_gt`: the same over true
rooms, which punishes them; `iou_sym`: their mean. `pq`: panoptic quality. Rooms: found over true ones. Truth:
which of the true rooms counts where a map has two."""


def write_report(accuracy: Accuracy, folder: Path) -> Path:
    """Write ``report.md``, ``report.json`` and the curves; returns the first.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    write_json(folder / "report.json", accuracy.as_json())
    lines = ["# Accuracy", "", EXPLAINED, "", *_summary(accuracy)]
    for group in accuracy.groups:
        lines += [f"## {group}", "", *_methods(accuracy, group), *_along(accuracy, group, folder)]
        lines += [*_maps(accuracy, group, folder), *_sheets(accuracy, group, folder)]
    lines += [*_ablations(accuracy), *_robustness(accuracy), *_elsewhere(accuracy), *_made_with()]
    path = folder / "report.md"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def _means(accuracy: Accuracy) -> dict[str, dict[str, Scores]]:
    return {method: group_means(results) for method, results in accuracy.results.items()}


def _of_group(results: Sequence[CaseResult], group: str) -> list[CaseResult]:
    return [result for result in results if result.case.group == group]


def _summary(accuracy: Accuracy) -> list[str]:
    """iou_seg/iou_gt/iou_sym of each method and group, beside the targets."""
    order = ("iou_seg", "iou_gt", "iou_sym")
    means, targets = _means(accuracy), accuracy.published.targets
    rows = []
    for group in accuracy.groups:
        count = len(_of_group(next(iter(accuracy.results.values())), group))
        cells = [f"{group} ({count})"]
        for method in accuracy.results:
            figures = [
                bold(
                    percent(getattr(means[method][group], name)),
                    getattr(means[method][group], name) >= targets.get(group, {}).get(name, np.inf),
                )
                for name in order
            ]
            cells.append(" / ".join(figures))
        cells.append(" / ".join(figures_of(targets[group], order)) if group in targets else "")
        rows.append(cells)
    head = ["group (maps)", *accuracy.results, "target"]
    return ["iou_seg / iou_gt / iou_sym; bold where the target is reached.", "", *table(head, rows)]


def _methods(accuracy: Accuracy, group: str) -> list[str]:
    rows = []
    for method, means in _means(accuracy).items():
        seconds = np.mean([result.seconds for result in _of_group(accuracy.results[method], group)])
        figures = figures_of(means[group], FIGURES)
        rows.append([bold(method), *figures, rooms_of(means[group]), f"{seconds:.2f}"])
    for name, published in accuracy.published.groups.get(group, {}).items():
        rows.append([f"{name}, published", *figures_of(published, FIGURES), "", ""])
    if group in accuracy.published.targets:
        rows.append(["target", *figures_of(accuracy.published.targets[group], FIGURES), "", ""])
    return table(["method", *FIGURES, "rooms", "s per map"], rows)


def _maps(accuracy: Accuracy, group: str, folder: Path) -> list[str]:
    """Every map of a group, method by method, with a link to its picture where there is one."""
    lines = []
    for method, results in accuracy.results.items():
        rows = []
        for result in _of_group(results, group):
            name = result.case.name
            picture = Path("pictures") / method / group / f"{name}.png"
            label = f"[{name}]({quote(picture.as_posix())})" if (folder / picture).exists() else name
            rows.append([label, *figures_of(result.scores, FIGURES), rooms_of(result.scores), result.truth])
        lines += [f"### {group}: each map, {method}", "", *table(["map", *FIGURES, "rooms", "truth"], rows)]
    return lines


def _sheets(accuracy: Accuracy, group: str, folder: Path) -> list[str]:
    lines = []
    for method in accuracy.results:
        for sheet in sorted((folder / "pictures" / method).glob(f"{group}.sheet_*.png")):
            lines += [
                f"![{group}, {method}: truth, found, errors]({quote(sheet.relative_to(folder).as_posix())})",
                "",
            ]
    return lines


def _along(accuracy: Accuracy, group: str, folder: Path) -> list[str]:
    """Draw the curves of a run, one chart a figure with all methods, and show them."""
    runs = {method: points[group] for method, points in accuracy.runs.items() if group in points}
    if not runs:
        return []
    coverage = np.array([100 * point.coverage for point in next(iter(runs.values()))])

    def curves(figure: str) -> list[Curve]:
        return [
            Curve(method, coverage, np.array([getattr(point.scores, figure) for point in points]))
            for method, points in runs.items()
        ]

    true = Curve("true", coverage, curves("rooms_gt")[0].y)
    label = "coverage, %"
    charts = [line_chart(curves(name), title=name, x_label=label, y_range=(0.0, 100.0)) for name in IOU]
    charts.append(line_chart([*curves("rooms_seg"), true], title="number of rooms", x_label=label))
    path = Path("along") / f"{group}.png"
    stacked(charts).save(folder / path, width_px=None)
    rows = [
        [points[0].name, f"{points[0].coverage:.1%}", *(_at_a_glance(point.scores) for point in points)]
        for points in zip(*runs.values(), strict=True)
    ]
    return [
        f"### {group}: along the run",
        "",
        f"![{group} over coverage]({quote(path.as_posix())})",
        "",
        "iou_sym (iou_seg, iou_gt), rooms.",
        "",
        *table(["map", "coverage", *runs], rows),
    ]


def _at_a_glance(scores: Scores) -> str:
    symmetric, found, true = figures_of(scores, IOU)
    return f"{symmetric} ({found}, {true}), {rooms_of(scores)}"


def _ablations(accuracy: Accuracy) -> list[str]:
    if not accuracy.ablations:
        return []
    means = _means(accuracy)
    head = ["without", *accuracy.groups, "mean of groups", "rooms"]
    lines = [
        "## Ablations",
        "",
        "Difference to the defaults with one part turned off: iou_sym (iou_seg, iou_gt). Below zero, the"
        " part helps.",
        "",
    ]
    rows = []
    for ablation, changed in accuracy.ablations:
        usual = means[ablation.method]
        changes = np.array(
            [
                [getattr(changed[group], name) - getattr(usual[group], name) for name in IOU]
                for group in accuracy.groups
            ]
        )
        cells = [
            f"{bold(difference(sym))} ({difference(seg)}, {difference(true)})"
            for sym, seg, true in [*changes.tolist(), changes.mean(axis=0).tolist()]
        ]
        # A setting that breaks the method instead of turning a part off shows in the number of rooms.
        rows.append([ablation.name, *cells, rooms_of(mean_scores(changed.values()))])
    lines += table(head, rows)
    lines += [
        f"- **{ablation.name}** ({ablation.method}): {ablation.sentence} `{'`, `'.join(ablation.settings)}`"
        for ablation, _ in accuracy.ablations
    ]
    return [*lines, ""]


def _robustness(accuracy: Accuracy) -> list[str]:
    if not accuracy.robustness:
        return []
    lines = [
        "## Robustness",
        "",
        "iou_sym between the rooms of a map, changed like the map, and those found in the changed map: mean"
        " over the maps, and the worst of them.",
        "",
        *(f"- **{transform.name}**: {transform.sentence}" for transform in TRANSFORMS),
        "",
    ]
    for method, rows in accuracy.robustness.items():
        lines += [f"### {method}: mean / worst", "", *robustness_table(rows)]
    return lines


def _elsewhere(accuracy: Accuracy) -> list[str]:
    if not accuracy.published.elsewhere:
        return []
    rows = [[name, *figures_of(figures, IOU)] for name, figures in accuracy.published.elsewhere.items()]
    return ["## The paper's implementation on other maps, published", "", *table(["maps", *IOU], rows)]


def _made_with() -> list[str]:
    versions = ", ".join(f"{name} {version}" for name, version in software_versions().items())
    return [
        "## Made with",
        "",
        f"{versions}. The resolved parameters and every figure stand in `report.json`.",
        "",
    ]
