"""The report's curves, each over coverage and over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rose2_logs.drawing.chart import ON_PAGE, Curve, Mark, lane_chart, line_chart
from rose2_logs.drawing.palette import TEMPORARY, state_colors, track_color
from rose2_logs.drawing.shapes import Color
from rose2_logs.model.occupancy import BoolArray, FloatArray, IntArray
from rose2_logs.model.room_quality import UNSURE_SIGN, unsure_sign
from rose2_logs.outputs.report.words import css, duration
from rose2_logs.runs.run import Run, is_last
from rose2_logs.system.text import percent

BLUE, ORANGE, GREEN, VIOLET = (47, 126, 216), (224, 123, 26), (42, 157, 92), (138, 95, 208)
AREAS_MOST = 8
"""Rooms whose area is drawn: the largest of the last map."""
TRACK_COLUMNS = ["track", "in_last_map", "shape_right_snapshot", "area_settled_snapshot", "wall_support"]
LANES_MOST = 80
"""Rooms whose presence is drawn: those that were there in most maps."""


@dataclass(frozen=True)
class Chart:
    """A chart twice, and what its curves are.

    Attributes
    ----------
    title, meaning : str
    legend : tuple of (str, str)
        Names and CSS colors of the curves; empty where the chart names them itself.
    over_coverage, over_time : str
        SVG.
    is_wide : bool
        Whether it takes the page's width.
    """

    title: str
    meaning: str
    legend: tuple[tuple[str, str], ...]
    over_coverage: str
    over_time: str
    is_wide: bool = False


@dataclass(frozen=True, eq=False)
class RunAxis:
    """A horizontal axis along the run: its values at the maps, ascending, its name, its ends, its marks."""

    x: FloatArray
    label: str
    ends: tuple[float, float] | None
    marks: list[Mark]


def run_charts(results: Run) -> list[Chart]:
    """Draw everything that changes along a run."""
    snapshots = results.columns
    axes = run_axes(results)
    numbers, present, areas = _rooms(results)

    def chart(
        title: str,
        meaning: str,
        curves: Sequence[tuple[str, FloatArray, Color]],
        y_range: tuple[float, float] | None = None,
    ) -> Chart:
        drawn = [_drawn(title, axis, curves, y_range) for axis in axes]
        return Chart(
            title, meaning, tuple((name, css(color)) for name, _, color in curves), drawn[0], drawn[1]
        )

    def in_percent(name: str) -> FloatArray:
        return 100 * snapshots[name].astype(float)

    whole = (0.0, 100.0)
    in_last = np.flatnonzero(present[:, -1])
    largest = in_last[np.argsort(-areas[in_last, -1], kind="stable")[:AREAS_MOST]]
    charts = [
        chart(
            "Agreement with the final layout, %",
            _final_meaning(results),
            [
                ("same rooms", in_percent("final_share"), GREEN),
                ("same rooms, where known", in_percent("known_final_share"), ORANGE),
                ("overlap", in_percent("final_iou"), BLUE),
            ],
            whole,
        ),
        chart(
            "How much the layout changed from map to map",
            "Variation of information between the rooms of a map and of the one before; 0 is the same rooms.",
            [("variation, bits", snapshots["variation_bits"].astype(float), VIOLET)],
        ),
        chart(
            "Rooms and doorways",
            "",
            [
                ("rooms", snapshots["rooms"].astype(float), BLUE),
                ("doorways", snapshots["doorways"].astype(float), ORANGE),
            ],
        ),
        chart(
            "Area, m²",
            "Known free floor, and the rooms with their predicted parts.",
            [
                ("free", snapshots["free_area_m2"].astype(float), GREEN),
                ("rooms, seen", snapshots["rooms_area_m2"].astype(float), BLUE),
                ("rooms with predicted parts", snapshots["rooms_predicted_area_m2"].astype(float), ORANGE),
            ],
        ),
        _coverage_chart(axes[1], in_percent("coverage")),
        chart(
            "Area of the largest rooms, m²",
            "As far as they were seen.",
            [(results.name_of(int(numbers[k])), areas[k], track_color(int(numbers[k]))) for k in largest],
        )
        if len(largest)
        else None,
    ]
    return [each for each in charts if each is not None] + _lanes(results, axes, numbers, present)


def _final_meaning(results: Run) -> str:
    """Say what counts as a final layout."""
    tracking = results.parameters.tracking
    return (
        "Same rooms: share of the last layout, by area, in rooms that were there, which some room of the map "
        f"overlaps by {tracking.final_room_min_iou:g}. Where known: the same of the part known at the time, "
        "so that rooms not seen yet do not count. Overlap: the mean of all rooms. "
        f"The layout is final from the map on after which the first share stays at "
        f"{percent(tracking.final_min_share)} or above: a few rooms at the frontier may still change. "
        "The known part is final likewise, by the second share."
    )


def _drawn(
    title: str,
    axis: RunAxis,
    curves: Sequence[tuple[str, FloatArray, Color]],
    y_range: tuple[float, float] | None,
) -> str:
    """Curves along one axis as SVG."""
    return line_chart(
        [Curve(name, axis.x, values, color) for name, values, color in curves],
        title=title,
        x_label=axis.label,
        marks=axis.marks,
        x_range=axis.ends,
        y_range=y_range,
        style=ON_PAGE,
    ).svg(is_inline=True)


def _coverage_chart(axis: RunAxis, coverage: FloatArray) -> Chart:
    """Coverage, which stands over time in any case."""
    title = "Coverage over time, %"
    drawn = _drawn(title, axis, [("coverage", coverage, GREEN)], (0.0, 100.0))
    return Chart(title, "Known free area over that of the last map.", (), drawn, drawn)


def run_marks(results: Run) -> list[tuple[int, str, str]]:
    """What the curves mark: at which map, in words, and its kind, ``final`` or ``shifted``."""
    final = results.summary.get("layout", {}).get("final_since")
    marks: list[tuple[int, str, str]] = []
    if final is not None and not is_last(final, results.choose()):
        marks.append((final["snapshot"], f"layout final from here on, {duration(final['time_s'])}", "final"))
    events = results.table("events", ["snapshot", "kind"]).to_pylist()
    marks += [
        (event["snapshot"], "the whole map shifted", "shifted")
        for event in events
        if event["kind"] == "shifted"
    ]
    return [mark for mark in marks if mark[0] in results.columns["snapshot"]]


def run_axes(results: Run) -> tuple[RunAxis, RunAxis]:
    """Coverage in percent, and time in minutes or seconds."""
    snapshots = results.columns
    time_s = snapshots["time_s"].astype(float)
    in_minutes = time_s[-1] >= 300
    time = time_s / 60 if in_minutes else time_s
    # A map that covers less than one before it, as after a loop closure, does not draw the curve back.
    coverage = 100 * np.maximum.accumulate(snapshots["coverage"].astype(float))
    marks = run_marks(results)
    places = {int(number): place for place, number in enumerate(snapshots["snapshot"])}

    def axis(x: FloatArray, label: str, ends: tuple[float, float] | None) -> RunAxis:
        return RunAxis(x, label, ends, [Mark(float(x[places[at]]), text, kind) for at, text, kind in marks])

    lowest = min(float(np.floor(coverage[0] / 10) * 10), 90.0)
    ends = (0.0, float(time[-1])) if time[-1] > 0 else None
    return (
        axis(coverage, "coverage, %", (lowest, 100.0)),
        axis(time, "time, min" if in_minutes else "time, s", ends),
    )


def _rooms(results: Run) -> tuple[np.ndarray, BoolArray, FloatArray]:
    """Tracks (R,), which maps show them (R, N), and their areas (R, N), NaN where they are not."""
    table = results.table("rooms", ["snapshot", "track", "area_m2"])
    snapshot, track, area = (table[name].to_numpy() for name in ("snapshot", "track", "area_m2"))
    numbers, row = np.unique(track, return_inverse=True)
    column = np.searchsorted(results.columns["snapshot"], snapshot)
    areas = np.full((len(numbers), len(results.columns["snapshot"])), np.nan)
    areas[row, column] = area
    return numbers, np.isfinite(areas), areas


def _lanes(results: Run, axes: Sequence[RunAxis], numbers: np.ndarray, present: BoolArray) -> list[Chart]:
    shown = np.sort(np.argsort(-present.sum(1), kind="stable")[:LANES_MOST])
    if not len(shown):
        return []
    histories = {row["track"]: row for row in results.table("tracks", TRACK_COLUMNS).to_pylist()}
    rows = [histories[int(number)] for number in numbers[shown]]
    title = "When each room was there, and when it was right"
    names = [f"{row['track']}{unsure_sign(row['wall_support'])}" for row in rows]
    colors = [state_colors(row["track"]) for row in rows]
    states = _states(results.columns["snapshot"], rows, present[shown])
    draw: Callable[[RunAxis], str] = lambda axis: lane_chart(  # noqa: E731
        axis.x,
        states,
        names,
        colors,
        title=title,
        x_label=axis.label,
        marks=axis.marks,
        x_range=axis.ends,
    ).svg(is_inline=True)
    left_out = len(numbers) - len(shown)
    meaning = (
        "A lane for each room, by its number: pale while it forms, stronger once its shape was right, full "
        f"once its area has settled, gray if the last map does not show it. {UNSURE_SIGN}: little of its "
        "last outline is supported by walls."
    ) + (f" {left_out} rooms that were there only shortly are left out." if left_out else "")
    legend = tuple(
        (state, css(color))
        for number, (state, color) in enumerate(colors[0].items(), start=1)
        if (states == number).any()
    )
    return [Chart(title, meaning, legend, draw(axes[0]), draw(axes[1]), is_wide=True)]


def _states(snapshots: np.ndarray, rows: Sequence[dict[str, Any]], present: BoolArray) -> IntArray:
    """State (R, N) of each room at each map: its place in `state_colors` from 1 on, 0 where it is not."""
    never = np.inf
    shaped, settled = (
        np.array([never if row[name] is None else row[name] for row in rows], float)[:, None]
        for name in ("shape_right_snapshot", "area_settled_snapshot")
    )
    states = np.where(snapshots >= settled, 3, np.where(snapshots >= shaped, 2, 1))
    in_last = np.array([row["in_last_map"] for row in rows])[:, None]
    temporary = list(state_colors(0)).index(TEMPORARY) + 1
    return np.where(present, np.where(in_last, states, temporary), 0)
