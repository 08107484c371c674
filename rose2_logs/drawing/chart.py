"""Charts as SVG within an HTML page, which gives text and axes their color: so they fit light and dark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rose2_logs.drawing.axes import Axis, axis_of
from rose2_logs.drawing.svg import escape, quoteattr
from rose2_logs.model.occupancy import FloatArray, IntArray

WIDTH, HEIGHT = 420.0, 210.0
LEFT, RIGHT, TOP, BOTTOM = 44.0, 12.0, 10.0, 36.0
"""Space around the axes."""
TICK_GAP_MIN = 34.0
"""Marks of the horizontal axis that would stand closer are thinned."""
POINTS_MAX = 800
"""Of longer curves so many points are drawn, evenly taken: more than a screen shows."""
DOTS_MAX = 60
"""Curves of more points are drawn without dots."""
LANE = 9.0
"""Height of a room's lane."""
SHARE_LANE = 15.0
"""Height of a lane in which a share rises."""
LAST_WIDTH = 4.0
"""The last share, which nothing follows, is drawn so wide."""
TINT_OPACITY = 0.18
"""How strongly the rest of such a lane is tinted: what is still to come."""


@dataclass(frozen=True, eq=False)
class Series:
    """One curve.

    Attributes
    ----------
    name : str
    values : (N,) float
        NaN where there is none; the curve has a gap there.
    color : str
        As CSS has it.
    """

    name: str
    values: FloatArray
    color: str


@dataclass(frozen=True)
class Mark:
    """A vertical line: where it stands, what it means, its class in the page's style."""

    x: float
    text: str
    kind: str


@dataclass(frozen=True, eq=False)
class ShareLane:
    """One lane of shares.

    Attributes
    ----------
    name, text : str
        What stands beside it, and what it says when pointed at.
    shares : (N,) float
        In [0, 1].
    color : str
        As CSS has it.
    reached : int, optional
        Index of the value that is marked by a line across the lane.
    """

    name: str
    text: str
    shares: FloatArray
    color: str
    reached: int | None = None


def line_chart(
    x: FloatArray,
    series: Sequence[Series],
    *,
    title: str,
    x_label: str,
    marks: Sequence[Mark] = (),
    x_range: tuple[float, float] | None = None,
    y_range: tuple[float, float] | None = None,
) -> str:
    """Draw curves over one axis.

    Parameters
    ----------
    x : (N,) float
        Common to all curves, without NaN; at least one.
    series : sequence of Series
    title, x_label : str
        What it shows, for those who cannot see it; what the axis is.
    marks : sequence of Mark
    x_range, y_range : (float, float), optional
        Ends of the axes; by default round numbers around the values, the vertical one from 0.
    """
    x_axis = axis_of(x, False) if x_range is None else Axis(*x_range, is_log=False)
    if y_range is None:
        known = np.concatenate([each.values for each in series])
        y_axis = axis_of(np.append(known[np.isfinite(known)], 0.0), False)
        y_axis = Axis(0.0, y_axis.high, is_log=False)
    else:
        y_axis = Axis(*y_range, is_log=False)
    chosen = np.unique(np.linspace(0, len(x) - 1, min(len(x), POINTS_MAX)).round().astype(int))
    columns = LEFT + (x - x_axis.low) / (x_axis.high - x_axis.low) * (WIDTH - LEFT - RIGHT)
    are_counts = all(np.array_equal(each.values, np.round(each.values)) for each in series)
    rows = [value for value in y_axis.ticks() if not are_counts or value == round(value)]
    parts = [*_frame(x_axis, y_axis, rows, x_label, HEIGHT), *_marks(marks, x_axis, HEIGHT)]
    for each in series:
        shares = (each.values - y_axis.low) / (y_axis.high - y_axis.low)
        heights = HEIGHT - BOTTOM - shares * (HEIGHT - TOP - BOTTOM)
        parts.append(
            f'<path class="curve" stroke="{escape(each.color)}" '
            f'd="{_path(columns[chosen], heights[chosen])}"/>'
        )
        if len(x) <= DOTS_MAX:
            parts += [
                f'<circle cx="{column:.1f}" cy="{row:.1f}" r="2.4" fill="{escape(each.color)}">'
                f"<title>{escape(each.name)}: {value:.3g} at {place:.4g}</title></circle>"
                for column, row, value, place in zip(columns, heights, each.values, x, strict=True)
                if np.isfinite(value)
            ]
    return _svg(title, HEIGHT, parts)


def lane_chart(
    x: FloatArray,
    states: IntArray,
    names: Sequence[str],
    colors: Sequence[Mapping[str, str]],
    *,
    title: str,
    x_label: str,
    marks: Sequence[Mark] = (),
    x_range: tuple[float, float] | None = None,
) -> str:
    """Draw when each room was there and in which state, a lane each.

    Parameters
    ----------
    x : (N,) float
        Where the maps stand, ascending.
    states : (R, N) int
        State of each room at each map, which lasts until the next map: its place in `colors`, from 1 on; 0
        where the room is not there.
    names : sequence of R str
        Of the rooms.
    colors : sequence of R mappings
        For each room, the color of each state by the state's name.
    title, x_label, marks, x_range
        As of `line_chart`.
    """
    x_axis = axis_of(x, False) if x_range is None else Axis(*x_range, is_log=False)
    height = TOP + BOTTOM + LANE * len(names)
    parts = [*_frame(x_axis, None, (), x_label, height), *_marks(marks, x_axis, height)]
    ends = np.append(x[1:], x_axis.high)
    for lane, (name, color) in enumerate(zip(names, colors, strict=True)):
        y = TOP + LANE * lane
        parts.append(
            f'<text class="lane" x="{LEFT - 5:.0f}" y="{y + 0.8 * LANE:.1f}" text-anchor="end">'
            f"{escape(name)}</text>"
        )
        edges = np.flatnonzero(np.diff(states[lane], prepend=0, append=0)).tolist()
        for first, stop in pairwise(edges):
            if not states[lane, first]:
                continue
            state, tint = list(color.items())[states[lane, first] - 1]
            left, right = (_column(value, x_axis) for value in (x[first], ends[stop - 1]))
            parts.append(
                f'<rect x="{left:.1f}" y="{y + 1:.1f}" width="{max(right - left, 1.5):.1f}" '
                f'height="{LANE - 2:.1f}" rx="1.5" fill="{escape(tint)}">'
                f"<title>{escape(name)}: {escape(state)}</title></rect>"
            )
    return _svg(title, height, parts)


def share_lanes(
    x: FloatArray,
    lanes: Sequence[ShareLane],
    *,
    title: str,
    x_label: str,
    x_range: tuple[float, float] | None = None,
) -> str:
    """Draw how shares rise from nothing to the whole, a lane each, one below the other.

    Parameters
    ----------
    x : (N,) float
        Common to all lanes, ascending; at least one. A share holds until the next.
    lanes : sequence of ShareLane
    title, x_label, x_range
        As of `line_chart`.
    """
    x_axis = axis_of(x, False) if x_range is None else Axis(*x_range, is_log=False)
    height = TOP + BOTTOM + SHARE_LANE * len(lanes)
    parts = _frame(x_axis, None, (), x_label, height)
    columns = np.array([_column(value, x_axis) for value in x.tolist()])
    for number, lane in enumerate(lanes):
        bottom = TOP + SHARE_LANE * (number + 1) - 1
        parts += _share_lane(columns, lane, bottom - SHARE_LANE + 2, bottom)
    return _svg(title, height, parts)


def _share_lane(columns: FloatArray, lane: ShareLane, top: float, bottom: float) -> list[str]:
    """Name, tint from the first share on, the shares as steps, and the line across."""
    fill = escape(lane.color)
    parts = [f'<text x="{LEFT - 5:.0f}" y="{bottom - 2:.1f}" text-anchor="end">{escape(lane.name)}</text>']
    seen = np.flatnonzero(lane.shares > 0)
    if len(seen):
        left, right = float(columns[seen[0]]), float(columns[-1]) + LAST_WIDTH
        parts.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
            f'height="{bottom - top:.1f}" fill="{fill}" fill-opacity="{TINT_OPACITY:g}"/>'
        )
        # Where the share stays the same nothing needs to be drawn.
        steps = seen[0] + np.flatnonzero(np.diff(lane.shares[seen[0] :], prepend=0.0))
        rows = bottom - lane.shares[steps] * (bottom - top)
        path = "".join(f"H{x:.1f}V{y:.1f}" for x, y in zip(columns[steps], rows, strict=True))
        parts.append(
            f'<path fill="{fill}" d="M{left:.1f} {bottom:.1f}{path}H{right:.1f}V{bottom:.1f}Z">'
            f"<title>{escape(lane.text)}</title></path>"
        )
    if lane.reached is not None:
        parts.append(f'<path class="axis" d="M{columns[lane.reached]:.1f} {top:.1f}V{bottom:.1f}"/>')
    return parts


def _svg(title: str, height: float, parts: Sequence[str]) -> str:
    head = (
        f'<svg class="chart" viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="img" aria-label={quoteattr(title)}>'
    )
    return "\n".join([head, *parts, "</svg>"])


def _frame(
    x_axis: Axis, y_axis: Axis | None, rows: Sequence[float], x_label: str, height: float
) -> list[str]:
    """Axes with their marks and numbers."""
    bottom, right = height - BOTTOM, WIDTH - RIGHT
    parts = []
    columns = [(value, _column(value, x_axis)) for value in x_axis.ticks()]
    step = (
        max(1, int(np.ceil(TICK_GAP_MIN / max(abs(columns[1][1] - columns[0][1]), 1e-9))))
        if len(columns) > 1
        else 1
    )
    for value, column in columns[::step]:
        parts.append(f'<path class="grid" d="M{column:.1f} {TOP:.0f}V{bottom:.1f}"/>')
        parts.append(f'<text x="{column:.1f}" y="{bottom + 14:.1f}" text-anchor="middle">{value:g}</text>')
    for value in rows:
        row = bottom - y_axis.share(value) * (bottom - TOP) if y_axis is not None else bottom
        parts.append(f'<path class="grid" d="M{LEFT:.0f} {row:.1f}H{right:.0f}"/>')
        parts.append(f'<text x="{LEFT - 5:.0f}" y="{row + 4:.1f}" text-anchor="end">{value:g}</text>')
    parts.append(f'<path class="axis" d="M{LEFT:.0f} {TOP:.0f}V{bottom:.1f}H{right:.0f}"/>')
    middle = (LEFT + right) / 2
    parts.append(f'<text x="{middle:.0f}" y="{height - 5:.1f}" text-anchor="middle">{escape(x_label)}</text>')
    return parts


def _marks(marks: Sequence[Mark], x_axis: Axis, height: float) -> list[str]:
    return [
        f'<path class="mark {escape(mark.kind)}" d="M{_column(mark.x, x_axis):.1f} {TOP:.0f}'
        f'V{height - BOTTOM:.1f}">'
        f"<title>{escape(mark.text)}</title></path>"
        for mark in marks
    ]


def _column(value: float, x_axis: Axis) -> float:
    return LEFT + x_axis.share(value) * (WIDTH - LEFT - RIGHT)


def _path(columns: NDArray[np.float64], rows: NDArray[np.float64]) -> str:
    """Path data with gaps where a value is missing."""
    parts, pen_down = [], False
    for column, row in zip(columns.tolist(), rows.tolist(), strict=True):
        known = np.isfinite(row)
        if known:
            parts.append(f"{'L' if pen_down else 'M'}{column:.1f} {row:.1f}")
        pen_down = bool(known)
    return "".join(parts)
