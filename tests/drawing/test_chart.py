"""Charts: curves stand where the axes say, lanes show what was there, SVG has what the page's style needs."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
import shapely

from rose2_logs.drawing.chart import (
    LANE,
    LINE_COLORS,
    ON_PAGE,
    POINTS_MAX,
    SHARE_LANE,
    TINT_OPACITY,
    WHOLE,
    Curve,
    Mark,
    ShareLane,
    lane_chart,
    line_chart,
    share_lanes,
)
from rose2_logs.drawing.shapes import Area, Dot, Lines, Page, Text

RED, GREEN, BLUE = (200, 0, 0), (0, 200, 0), (0, 0, 200)
LEFT, RIGHT = ON_PAGE.left, ON_PAGE.width - ON_PAGE.right
TOP, BOTTOM = ON_PAGE.top, ON_PAGE.height - ON_PAGE.bottom


def points(page: Page, color=RED) -> list[np.ndarray]:
    """Corners of the parts of a curve; a sign beside its name comes after it."""
    lines = next(each for each in page.shapes if isinstance(each, Lines) and each.color == color)
    return [shapely.get_coordinates(part) for part in shapely.get_parts(lines.shape)]


def texts(page: Page) -> list[str]:
    return [each.text for each in page.shapes if isinstance(each, Text)]


def test_a_curve_goes_from_corner_to_corner():
    curve = Curve("a", np.array([0.0, 50.0, 100.0]), np.array([0.0, 2.5, 10.0]), RED)
    page = line_chart([curve], title="t", x_label="x", x_range=(0.0, 100.0), style=ON_PAGE)
    (corners,) = points(page)
    assert corners == pytest.approx(
        np.array([[LEFT, BOTTOM], [(LEFT + RIGHT) / 2, BOTTOM - 0.25 * (BOTTOM - TOP)], [RIGHT, TOP]]),
        abs=0.1,
    )
    assert sum(isinstance(each, Dot) for each in page.shapes) == 3


def test_missing_values_are_gaps():
    curve = Curve("a", np.arange(5.0), np.array([1, 2, np.nan, 3, 4]), RED)
    page = line_chart([curve], title="t", x_label="x")
    assert [len(part) for part in points(page)] == [2, 2]
    assert "nan" not in page.svg()


def test_names_are_escaped_and_a_flat_curve_has_an_axis():
    page = line_chart(
        [Curve("<b>&", np.array([3.0]), np.array([0.0]))],
        title='"<title>"',
        x_label="<x>",
        marks=[Mark(3.0, "<mark>", "final")],
        style=ON_PAGE,
    )
    root = ET.fromstring(page.svg(is_inline=True))
    assert root.get("aria-label") == '"<title>"'
    titles = {each.text for each in root.iter("{http://www.w3.org/2000/svg}title")}
    assert {"<b>&: 0 at 3", "<mark>"} <= titles


def test_on_a_page_its_style_gives_the_colors():
    """Classes of the style sheet, no paper, and no title or names of curves, which the page has."""
    page = line_chart(
        [Curve("a", np.array([0.0, 1.0]), np.array([0.0, 1.0]), RED)],
        title="t",
        x_label="x",
        marks=[Mark(0.5, "m", "shifted")],
        style=ON_PAGE,
    )
    root = ET.fromstring(page.svg(is_inline=True))
    assert root.get("class") == "chart"
    kinds = {each.get("class") for each in root.iter() if each is not root}
    assert {"grid", "axis", "mark shifted"} <= kinds
    assert not list(root.iter("{http://www.w3.org/2000/svg}rect"))
    assert {"t", "a"}.isdisjoint(texts(page))
    whole = line_chart([Curve("a", np.array([0.0]), np.array([1.0]))], title="t", x_label="x")
    assert {"t", "a", "x"} <= set(texts(whole))
    assert whole.paper == (255, 255, 255)


def test_long_curves_are_thinned():
    x = np.arange(100_000.0)
    page = line_chart([Curve("a", x, np.sin(x), RED)], title="t", x_label="x")
    (corners,) = points(page)
    assert len(corners) == POINTS_MAX
    assert not any(isinstance(each, Dot) for each in page.shapes)


def test_the_vertical_axis_holds_every_point_from_zero():
    """37 of an axis to 40 lies just below its top."""
    page = line_chart(
        [Curve("flat", np.array([1.0, 2.0]), np.array([37.0, 37.0]), RED)], title="t", x_label="x"
    )
    height = WHOLE.height - WHOLE.bottom - WHOLE.top
    assert points(page)[0][:, 1] == pytest.approx(WHOLE.top + height * 3 / 40, abs=0.1)


def test_powers_of_ten_lie_evenly_on_a_logarithmic_axis():
    """1 to 10000 over 0.1 to 1000: the curve is the diagonal, its middle in the middle."""
    y = np.array([1.0, 100.0, 10000.0])
    page = line_chart([Curve("up", y / 10, y, RED)], title="t", x_label="x", log_x=True, log_y=True)
    (corners,) = points(page)
    assert corners[1] == pytest.approx((corners[0] + corners[2]) / 2, abs=0.1)
    assert corners[0] == pytest.approx([WHOLE.left, WHOLE.height - WHOLE.bottom])


def test_points_that_are_not_joined_stand_alone():
    ends = np.array([0.0, 100.0])
    page = line_chart([Curve("dots", ends, ends, RED, is_joined=False)], title="t", x_label="x")
    assert sum(isinstance(each, Dot) for each in page.shapes) == 2
    # What is left of its color is the sign beside its name.
    assert points(page)[0][0][0] > WHOLE.width - WHOLE.right


def test_counts_have_no_ticks_between_whole_numbers():
    """And curves without a color get colors of their own."""
    x = np.array([0.0, 1.0])
    page = line_chart(
        [Curve("a", x, np.array([1.0, 2.0])), Curve("b", x, np.array([0.0, 1.0]))], title="t", x_label="x"
    )
    rows = [each.text for each in page.shapes if isinstance(each, Text) and each.anchor == "end"]
    assert rows == ["0", "1", "2"]
    assert {each.fill for each in page.shapes if isinstance(each, Dot)} == set(LINE_COLORS[:2])


def test_lanes_show_when_rooms_were_there_and_in_which_state():
    """A room that went and came back has two bars; a bar reaches to the next map, or to the next state."""
    x = np.array([0.0, 10.0, 20.0, 30.0, 40.0])
    states = np.array([[1, 0, 1, 2, 0], [0, 0, 0, 0, 2]])
    colors = [{"forming": RED, "settled": GREEN}, {"forming": RED, "settled": BLUE}]
    page = lane_chart(x, states, ["1", "2"], colors, title="t", x_label="x", x_range=(0.0, 40.0))
    bars = [each for each in page.shapes if isinstance(each, Area)]
    quarter = (RIGHT - LEFT) / 4
    for bar, at in zip(bars[:3], (0, 2, 3), strict=True):
        assert bar.shape.bounds == pytest.approx(
            (LEFT + at * quarter, TOP + 1, LEFT + (at + 1) * quarter, TOP + LANE - 1)
        )
    assert [bar.fill for bar in bars] == [RED, RED, GREEN, BLUE]
    assert [bar.title for bar in bars][2:] == ["1: settled", "2: settled"]


def test_a_share_rises_in_steps_within_its_lane():
    """In the second lane: nothing before the second value, half of the lane from there on, then all of it."""
    first = ShareLane("1", "one", np.ones(4), RED, reached=0)
    second = ShareLane("2 & <3>", "two", np.array([0.0, 0.5, 0.5, 1.0]), GREEN, reached=3)
    page = share_lanes(
        np.array([0.0, 25.0, 50.0, 100.0]), [first, second], title="t", x_label="x", x_range=(0.0, 100.0)
    )
    tint, steps = (each for each in page.shapes if isinstance(each, Area) and each.fill == GREEN)
    assert (tint.opacity, steps.title) == (TINT_OPACITY, "two")
    bottom, height, width = TOP + 2 * SHARE_LANE - 1, SHARE_LANE - 2, RIGHT - LEFT
    assert tint.shape.bounds == pytest.approx((LEFT + width / 4, bottom - height, RIGHT + 4, bottom))
    expected = shapely.union(
        shapely.box(LEFT + width / 4, bottom - height / 2, RIGHT + 4, bottom),
        shapely.box(RIGHT, bottom - height, RIGHT + 4, bottom),
    )
    assert steps.shape.symmetric_difference(expected).area == pytest.approx(0, abs=1e-6)
    lines = [each for each in page.shapes if isinstance(each, Lines) and each.kind == "axis"]
    assert len(lines) == 3  # the axes, and a line across each lane
    assert "2 & <3>" in texts(page)


def test_a_share_that_is_never_there_is_an_empty_lane():
    page = share_lanes(
        np.array([0.0, 1.0]), [ShareLane("1", "one", np.zeros(2), RED)], title="t", x_label="x"
    )
    assert not any(isinstance(each, Area) for each in page.shapes)
