"""Charts: curves, lanes of states and lanes of shares over one axis.

On an HTML page text and axes take their colors from the page's style, by their kind, so that charts fit light
and dark.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from rose2_logs.drawing.axes import Axis, axis_of
from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.shapes import Area, Color, Dot, Lines, Shape, Text
from rose2_logs.model.occupancy import FloatArray, IntArray

TICK_GAP_MIN = 34.0
"""Marks of the horizontal axis that would be closer are thinned out."""
POINTS_MAX = 800
"""A longer curve is drawn with this many of its points, evenly spaced: more than a screen shows."""
DOTS_MAX = 60
"""Curves of more points are drawn without dots."""
LANE, LANE_FONT = 9.0, 8.0
"""Height of a room's lane, and size of its name."""
LANE_MIN_WIDTH = 1.5
"""Width of the lane of a room that only one map shows."""
SHARE_LANE = 15.0
"""Height of a lane in which a share rises."""
LAST_WIDTH = 4.0
"""Width of the last share, which nothing follows."""
TINT_OPACITY = 0.18
"""How strongly the rest of such a lane is tinted: what is still to come."""
INK, GRID_COLOR, MARK_COLOR = (60, 68, 76), (217, 222, 228), (91, 101, 112)
LINE_COLORS: tuple[Color, ...] = (
    (31, 119, 180),
    (214, 39, 40),
    (44, 160, 44),
    (255, 127, 14),
    (148, 103, 189),
    (140, 86, 75),
    (23, 190, 207),
)


@dataclass(frozen=True)
class ChartStyle:
    """Size of a chart, and what is written in it.

    Attributes
    ----------
    width, height : float
        Of the page; lanes are as high as they need.
    left, right, top, bottom : float
        Space around the axes.
    font : float
        Size of the texts.
    line, dot : float
        Width of curves and radius of their points.
    is_whole : bool
        Whether title and names of the curves are in the chart, on white, or left to the page around it.
    """

    width: float
    height: float
    left: float
    right: float
    top: float
    bottom: float
    font: float
    line: float
    dot: float
    is_whole: bool


ON_PAGE = ChartStyle(420.0, 210.0, 44.0, 12.0, 10.0, 36.0, 11.0, 1.8, 2.4, is_whole=False)
WHOLE = ChartStyle(900.0, 360.0, 60.0, 190.0, 40.0, 50.0, 14.0, 2.0, 3.0, is_whole=True)


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve.

    Attributes
    ----------
    name : str
    x, y : (N,) float
        Its points; where y is NaN the curve has a gap.
    color : Color, optional
        By default one of `LINE_COLORS`.
    is_joined : bool
        Whether a line joins them in their order.
    """

    name: str
    x: FloatArray
    y: FloatArray
    color: Color | None = None
    is_joined: bool = True


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
        Its label, and the text shown when the pointer is over it.
    shares : (N,) float
        In [0, 1].
    color : Color
    reached : int, optional
        Index of the value that is marked by a line across the lane.
    """

    name: str
    text: str
    shares: FloatArray
    color: Color
    reached: int | None = None


def line_chart(
    curves: Sequence[Curve],
    *,
    title: str,
    x_label: str,
    marks: Sequence[Mark] = (),
    x_range: tuple[float, float] | None = None,
    y_range: tuple[float, float] | None = None,
    log_x: bool = False,
    log_y: bool = False,
    style: ChartStyle = WHOLE,
) -> Drawing:
    """Draw curves with axes and grid.

    Parameters
    ----------
    curves : sequence of Curve
        At least one, with at least one point.
    title, x_label : str
        What it shows; what the horizontal axis is.
    marks : sequence of Mark
    x_range, y_range : (float, float), optional
        Ends of the axes; by default round numbers around the values, the vertical one from 0 or, on a
        logarithmic axis, the power of ten below.
    log_x, log_y : bool
        Whether an axis is logarithmic: then all its values are above 0.
    style : ChartStyle
    """
    x = np.concatenate([curve.x for curve in curves])
    y = np.concatenate([curve.y for curve in curves])
    y = y[np.isfinite(y)]
    x_axis = axis_of(x, log_x) if x_range is None else Axis(*x_range, log_x)
    if y_range is not None:
        y_axis = Axis(*y_range, log_y)
    elif log_y:
        y_axis = axis_of(y, True)
    else:
        y_axis = Axis(0.0, axis_of(np.append(y, 0.0), False).high, is_log=False)
    chart = _Chart(style, style.height, title, x_axis, y_axis)
    are_counts = np.array_equal(y, np.round(y))
    rows = [value for value in y_axis.ticks() if not are_counts or value == round(value)]
    chart.frame(x_label, rows)
    chart.marks(marks)
    for number, curve in enumerate(curves):
        chart.curve(curve, curve.color or LINE_COLORS[number % len(LINE_COLORS)])
    if style.is_whole:
        chart.names(title, curves)
    return chart.page


def lane_chart(
    x: FloatArray,
    states: IntArray,
    names: Sequence[str],
    colors: Sequence[Mapping[str, Color]],
    *,
    title: str,
    x_label: str,
    marks: Sequence[Mark] = (),
    x_range: tuple[float, float] | None = None,
    style: ChartStyle = ON_PAGE,
) -> Drawing:
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
    title, x_label, marks, x_range, style
        As of `line_chart`.
    """
    x_axis = axis_of(x, False) if x_range is None else Axis(*x_range, is_log=False)
    chart = _Chart(style, style.top + style.bottom + LANE * len(names), title, x_axis)
    chart.frame(x_label)
    chart.marks(marks)
    ends = np.append(x[1:], x_axis.high)
    for lane, (name, color) in enumerate(zip(names, colors, strict=True)):
        y = style.top + LANE * lane
        chart.row_name(name, y + LANE / 2, LANE_FONT, kind="lane")
        edges = np.flatnonzero(np.diff(states[lane], prepend=0, append=0)).tolist()
        for first, stop in pairwise(edges):
            if not states[lane, first]:
                continue
            state, tint = list(color.items())[states[lane, first] - 1]
            left, right = chart.columns(np.array([x[first], ends[stop - 1]])).tolist()
            bar = shapely.box(left, y + 1, max(right, left + LANE_MIN_WIDTH), y + LANE - 1)
            chart.page.add(Area(bar, tint, title=f"{name}: {state}"))
    return chart.page


def share_lanes(
    x: FloatArray,
    lanes: Sequence[ShareLane],
    *,
    title: str,
    x_label: str,
    x_range: tuple[float, float] | None = None,
    style: ChartStyle = ON_PAGE,
) -> Drawing:
    """Draw how shares rise from nothing to the whole, a lane each, one below the other.

    Parameters
    ----------
    x : (N,) float
        Common to all lanes, ascending; at least one. A share holds until the next.
    lanes : sequence of ShareLane
    title, x_label, x_range, style
        As of `line_chart`.
    """
    x_axis = axis_of(x, False) if x_range is None else Axis(*x_range, is_log=False)
    chart = _Chart(style, style.top + style.bottom + SHARE_LANE * len(lanes), title, x_axis)
    chart.frame(x_label)
    columns = chart.columns(x)
    for number, lane in enumerate(lanes):
        top = style.top + SHARE_LANE * number
        chart.row_name(lane.name, top + SHARE_LANE / 2)
        chart.page.add(*_share_lane(columns, lane, top + 1, top + SHARE_LANE - 1))
    return chart.page


def _share_lane(columns: FloatArray, lane: ShareLane, top: float, bottom: float) -> list[Shape]:
    """Tint from the first share on, the shares as steps, and the line across."""
    shapes: list[Shape] = []
    seen = np.flatnonzero(lane.shares > 0)
    if len(seen):
        left, right = float(columns[seen[0]]), float(columns[-1]) + LAST_WIDTH
        shapes.append(Area(shapely.box(left, top, right, bottom), lane.color, TINT_OPACITY))
        # Where the share stays the same nothing needs to be drawn.
        steps = seen[0] + np.flatnonzero(np.diff(lane.shares[seen[0] :], prepend=0.0))
        rows = bottom - lane.shares[steps] * (bottom - top)
        corners = np.column_stack([np.repeat(columns[steps], 2)[1:], np.repeat(rows, 2)[:-1]])
        rim = [[left, bottom], [left, float(rows[0])], *corners.tolist()]
        rim += [[right, float(rows[-1])], [right, bottom]]
        shapes.append(Area(shapely.Polygon(rim), lane.color, title=lane.text))
    if lane.reached is not None:
        shapes.append(_upright(float(columns[lane.reached]), top, bottom, "axis", INK))
    return shapes


def _upright(x: float, top: float, bottom: float, kind: str, color: Color, title: str = "") -> Lines:
    return Lines(shapely.LineString([(x, top), (x, bottom)]), color, 1.0, kind, title)


class _Chart:
    """A page with axes that things are drawn along.

    Parameters
    ----------
    style : ChartStyle
    height : float
        Of the page.
    title : str
    x_axis : Axis
    y_axis : Axis, optional
    """

    def __init__(
        self, style: ChartStyle, height: float, title: str, x_axis: Axis, y_axis: Axis | None = None
    ) -> None:
        paper = (255, 255, 255) if style.is_whole else None
        self.page = Drawing(style.width, height, title, paper, "" if style.is_whole else "chart")
        self._style, self._x_axis, self._y_axis = style, x_axis, y_axis
        self._left, self._right = style.left, style.width - style.right
        self._top, self._bottom = style.top, height - style.bottom

    def columns(self, values: FloatArray) -> FloatArray:
        """Positions on the page of values of the horizontal axis."""
        return self._left + self._x_axis.share(values) * (self._right - self._left)

    def _rows(self, values: FloatArray) -> FloatArray:
        shares = np.zeros_like(values) if self._y_axis is None else self._y_axis.share(values)
        return self._bottom - shares * (self._bottom - self._top)

    def row_name(self, text: str, y: float, font: float | None = None, kind: str = "") -> None:
        """Write what a row is, left of the axes."""
        self.page.add(Text(text, self._left - 5, y, font or self._style.font, "end", color=INK, kind=kind))

    def frame(self, x_label: str, rows: Sequence[float] = ()) -> None:
        """Draw axes with their ticks and numbers."""
        font, left, right, top, bottom = self._style.font, self._left, self._right, self._top, self._bottom
        ticks = self._x_axis.ticks()
        columns = self.columns(np.array(ticks)).tolist()
        gap = abs(columns[1] - columns[0]) if len(columns) > 1 else TICK_GAP_MIN
        step = max(1, int(np.ceil(TICK_GAP_MIN / max(gap, 1e-9))))
        for value, column in zip(ticks[::step], columns[::step], strict=True):
            self.page.add(_upright(column, top, bottom, "grid", GRID_COLOR))
            self.page.add(Text(f"{value:g}", column, bottom + 0.9 * font, font, color=INK))
        for value, row in zip(rows, self._rows(np.array(rows, float)).tolist(), strict=True):
            self.page.add(Lines(shapely.LineString([(left, row), (right, row)]), GRID_COLOR, 1.0, "grid"))
            self.row_name(f"{value:g}", row)
        corner = shapely.LineString([(left, top), (left, bottom), (right, bottom)])
        self.page.add(Lines(corner, INK, 1.0, "axis"))
        self.page.add(Text(x_label, (left + right) / 2, self.page.height - 0.8 * font, font, color=INK))

    def marks(self, marks: Sequence[Mark]) -> None:
        """Draw vertical lines at values of the horizontal axis."""
        columns = self.columns(np.array([mark.x for mark in marks]))
        for mark, column in zip(marks, columns.tolist(), strict=True):
            kind = f"mark {mark.kind}"
            self.page.add(_upright(column, self._top, self._bottom, kind, MARK_COLOR, mark.text))

    def curve(self, curve: Curve, color: Color) -> None:
        """Draw a curve, with dots where there are few."""
        count = len(curve.x)
        points = np.column_stack([self.columns(curve.x), self._rows(curve.y)]).round(1)
        known = np.isfinite(curve.y)
        if curve.is_joined:
            chosen = np.unique(np.linspace(0, count - 1, min(count, POINTS_MAX)).round().astype(int))
            runs = np.split(chosen, np.flatnonzero(np.diff(known[chosen])) + 1)
            lines = [shapely.LineString(points[run]) for run in runs if known[run[0]] and len(run) > 1]
            self.page.add(Lines(shapely.MultiLineString(lines), color, self._style.line))
        if count <= DOTS_MAX or not curve.is_joined:
            for place in np.flatnonzero(known).tolist():
                x, y = points[place].tolist()
                tooltip = f"{curve.name}: {curve.y[place]:.3g} at {curve.x[place]:.4g}"
                self.page.add(Dot(x, y, self._style.dot, color, tooltip))

    def names(self, title: str, curves: Sequence[Curve]) -> None:
        """Write the title above the axes, and the names of the curves next to them."""
        font = self._style.font
        self.page.add(Text(title, self._left, self._top / 2, 1.2 * font, "start", color=INK))
        for number, curve in enumerate(curves):
            y = self._top + (number + 0.5) * 1.6 * font
            color = curve.color or LINE_COLORS[number % len(LINE_COLORS)]
            sign = shapely.LineString([(self._right + 10, y), (self._right + 34, y)])
            self.page.add(Lines(sign, color, self._style.line))
            self.page.add(Text(curve.name, self._right + 42, y, font, "start", color=INK))
