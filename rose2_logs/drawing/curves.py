"""Curves over an axis as a picture: for figures along a run, without a plotting library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from rose2_logs.drawing.axes import Axis, axis_of
from rose2_logs.evaluation.along import RunPoint
from rose2_logs.model.occupancy import FloatArray

Image = NDArray[np.uint8]
Color = tuple[int, int, int]

WIDTH_PX, HEIGHT_PX = 900, 360
LEFT_PX, RIGHT_PX, TOP_PX, BOTTOM_PX = 60, 190, 40, 50
"""Space around the axes: for the numbers, the names of the curves, the title, the axis' name."""
TEXT_PX, LINE_PX, DOT_PX = 14, 2, 3
SMOOTHING = 2
"""Drawn so many times as large and then reduced: lines without steps."""
PAPER, INK, GRID = (255, 255, 255), (0, 0, 0), (225, 225, 225)
LINE_COLORS: tuple[Color, ...] = (
    (31, 119, 180),
    (214, 39, 40),
    (44, 160, 44),
    (255, 127, 14),
    (148, 103, 189),
    (140, 86, 75),
    (23, 190, 207),
)


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve.

    Attributes
    ----------
    name : str
        For the legend.
    x, y : (N,) float
        Its points.
    is_joined : bool
        Whether a line joins them in their order.
    """

    name: str
    x: FloatArray
    y: FloatArray
    is_joined: bool = True


def draw_along(title: str, points: Sequence[RunPoint]) -> Image:
    """Draw the figures of a run over its coverage, and below them the number of rooms found and true."""
    x = np.array([100 * point.coverage for point in points])

    def curve(figure: str, name: str | None = None) -> Curve:
        return Curve(name or figure, x, np.array([getattr(point.scores, figure) for point in points]))

    figures = [curve(name) for name in ("iou_seg", "iou_gt", "iou_sym")]
    rooms = [curve("rooms_seg", "rooms found"), curve("rooms_gt", "rooms true")]
    return np.concatenate(
        [
            draw_curves(figures, title, "coverage, %", y_range=(0.0, 100.0)),
            draw_curves(rooms, "number of rooms", "coverage, %"),
        ]
    )


def draw_curves(
    curves: Sequence[Curve],
    title: str,
    x_label: str,
    y_range: tuple[float, float] | None = None,
    *,
    log_x: bool = False,
    log_y: bool = False,
) -> Image:
    """Draw curves with axes, grid and legend.

    Parameters
    ----------
    curves : sequence of Curve
        At least one, with at least one point.
    title, x_label : str
        Above and below the axes.
    y_range : (float, float), optional
        Ends of the vertical axis; by default from 0, or the power of ten below on a logarithmic axis, to a
        round number above every curve.
    log_x, log_y : bool
        Whether an axis is logarithmic: then all its values are above 0.

    Returns
    -------
    (H, W, 3) uint8
        RGB.
    """
    x_axis = axis_of(np.concatenate([curve.x for curve in curves]), log_x)
    top = np.concatenate([curve.y for curve in curves])
    if y_range is not None:
        y_axis = Axis(*y_range, log_y)
    else:
        y_axis = axis_of(top if log_y else np.append(top, 0.0), log_y)
        y_axis = y_axis if log_y else Axis(0.0, y_axis.high, is_log=False)
    s = SMOOTHING
    image = PillowImage.new("RGB", (WIDTH_PX * s, HEIGHT_PX * s), PAPER)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(TEXT_PX * s)
    left, right = LEFT_PX * s, (WIDTH_PX - RIGHT_PX) * s
    upper, lower = TOP_PX * s, (HEIGHT_PX - BOTTOM_PX) * s

    def to_pixels(x: float, y: float) -> tuple[float, float]:
        return left + x_axis.share(x) * (right - left), lower - y_axis.share(y) * (lower - upper)

    for value in x_axis.ticks():
        place = to_pixels(value, y_axis.low)[0]
        draw.line((place, upper, place, lower), GRID, s)
        draw.text((place, lower + TEXT_PX * s), f"{value:g}", INK, font, anchor="mm")
    for value in y_axis.ticks():
        place = to_pixels(x_axis.low, value)[1]
        draw.line((left, place, right, place), GRID, s)
        draw.text((left - TEXT_PX * s / 2, place), f"{value:g}", INK, font, anchor="rm")
    draw.rectangle((left, upper, right, lower), outline=INK, width=s)
    draw.text((left, upper / 2), title, INK, ImageFont.load_default((TEXT_PX + 3) * s), anchor="lm")
    draw.text(((left + right) / 2, (HEIGHT_PX - TEXT_PX) * s), x_label, INK, font, anchor="mm")
    for number, curve in enumerate(curves):
        color = LINE_COLORS[number % len(LINE_COLORS)]
        pixels = [to_pixels(x, y) for x, y in zip(curve.x.tolist(), curve.y.tolist(), strict=True)]
        if curve.is_joined:
            draw.line(pixels, color, LINE_PX * s, joint="curve")
        for x, y in pixels:
            draw.ellipse((x - DOT_PX * s, y - DOT_PX * s, x + DOT_PX * s, y + DOT_PX * s), color)
        beside = upper + (number + 0.5) * 1.6 * TEXT_PX * s
        draw.line((right + 10 * s, beside, right + 34 * s, beside), color, LINE_PX * s)
        draw.text((right + 42 * s, beside), curve.name, INK, font, anchor="lm")
    return np.asarray(image.reduce(s))
