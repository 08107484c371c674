"""Curves: where points are drawn, round axes, runs of one point."""

from __future__ import annotations

import numpy as np
import pytest
from rose2_logs.drawing.curves import (
    BOTTOM_PX,
    HEIGHT_PX,
    LEFT_PX,
    LINE_COLORS,
    RIGHT_PX,
    TOP_PX,
    WIDTH_PX,
    Curve,
    draw_along,
    draw_curves,
)

from rose2_logs.evaluation.along import RunPoint
from rose2_logs.evaluation.scores import Scores


def pixels_of(image, color) -> np.ndarray:
    """Rows and columns within the axes that have a color."""
    inside = image[:, : WIDTH_PX - RIGHT_PX + 1]
    return np.argwhere((np.abs(inside.astype(int) - color) < 8).all(-1))


def test_ends_of_a_curve_lie_where_the_axes_say():
    """A line from the lower left to the upper right corner of the axes."""
    image = draw_curves([Curve("up", np.array([0.0, 100.0]), np.array([0.0, 100.0]))], "t", "x", (0.0, 100.0))
    assert image.shape == (HEIGHT_PX, WIDTH_PX, 3)
    places = pixels_of(image, LINE_COLORS[0])
    left, right = places[places[:, 1].argmin()], places[places[:, 1].argmax()]
    assert left == pytest.approx([HEIGHT_PX - BOTTOM_PX, LEFT_PX], abs=5)
    assert right == pytest.approx([TOP_PX, WIDTH_PX - RIGHT_PX], abs=5)


def test_the_vertical_axis_holds_every_point_from_zero():
    """37 of an axis to 40 lies just below its top."""
    image = draw_curves([Curve("flat", np.array([1.0, 2.0]), np.array([37.0, 37.0]))], "t", "x")
    places = pixels_of(image, LINE_COLORS[0])
    height = HEIGHT_PX - BOTTOM_PX - TOP_PX
    assert places[:, 0].mean() == pytest.approx(TOP_PX + height * 3 / 40, abs=2)


def test_a_run_of_one_map_is_drawn():
    """An axis of no length would divide by zero."""
    scores = Scores(1.0, 2.0, 3.0, 40.0, 50.0, 6.0, 0, 0)
    image = draw_along("one", [RunPoint("m", 1.0, scores)])
    assert image.shape == (2 * HEIGHT_PX, WIDTH_PX, 3)
    assert len(pixels_of(image, LINE_COLORS[2]))


def test_powers_of_ten_lie_evenly_on_a_logarithmic_axis():
    """1 to 10000 over 0.1 to 1000: the curve is the diagonal, its middle in the middle."""
    y = np.array([1.0, 100.0, 10000.0])
    image = draw_curves([Curve("up", y / 10, y)], "t", "x", log_x=True, log_y=True)
    places = pixels_of(image, LINE_COLORS[0])
    middle = places[np.abs(places[:, 1] - (LEFT_PX + WIDTH_PX - RIGHT_PX) / 2) < 2]
    assert middle[:, 0].mean() == pytest.approx((TOP_PX + HEIGHT_PX - BOTTOM_PX) / 2, abs=3)
    assert places[:, 0].max() == pytest.approx(HEIGHT_PX - BOTTOM_PX, abs=5)


def test_points_that_are_not_joined_stand_alone():
    """Two dots at the ends, nothing between them."""
    ends = np.array([0.0, 100.0])
    image = draw_curves([Curve("dots", ends, ends, is_joined=False)], "t", "x", (0.0, 100.0))
    columns = pixels_of(image, LINE_COLORS[0])[:, 1]
    assert len(columns)
    middle = (LEFT_PX + WIDTH_PX - RIGHT_PX) / 2
    assert np.abs(columns - middle).min() > middle / 2
