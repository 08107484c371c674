"""Charts are XML whose curves stand where the axes say."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from rose2_logs.drawing.chart import (
    BOTTOM,
    HEIGHT,
    LEFT,
    RIGHT,
    SHARE_LANE,
    TOP,
    WIDTH,
    Mark,
    Series,
    ShareLane,
    lane_chart,
    line_chart,
    share_lanes,
)


def curves(svg: str) -> list[np.ndarray]:
    root = ET.fromstring(svg)
    paths = [each.get("d") for each in root.iter("path") if each.get("class") == "curve"]
    return [np.array([part.split() for part in re.split("[ML]", path)[1:]], float) for path in paths]


def test_a_curve_goes_from_corner_to_corner():
    (points,) = curves(
        line_chart(
            np.array([0.0, 50.0, 100.0]),
            [Series("a", np.array([0.0, 2.5, 10.0]), "#123456")],
            title="t",
            x_label="x",
            x_range=(0.0, 100.0),
        )
    )
    assert points[0] == pytest.approx([LEFT, HEIGHT - BOTTOM])
    assert points[1] == pytest.approx(
        [(LEFT + WIDTH - RIGHT) / 2, HEIGHT - BOTTOM - 0.25 * (HEIGHT - TOP - BOTTOM)]
    )
    assert points[2] == pytest.approx([WIDTH - RIGHT, TOP])


def test_missing_values_are_gaps():
    svg = line_chart(
        np.arange(5.0), [Series("a", np.array([1, 2, np.nan, 3, 4]), "#000")], title="t", x_label="x"
    )
    (path,) = re.findall(r'class="curve"[^>]* d="([^"]+)"', svg)
    assert path.count("M") == 2
    assert "nan" not in svg


def test_names_are_escaped_and_a_flat_curve_has_an_axis():
    svg = line_chart(
        np.array([3.0]),
        [Series("<b>&", np.array([0.0]), "#000")],
        title='"<title>"',
        x_label="<x>",
        marks=[Mark(3.0, "<mark>", "final")],
    )
    root = ET.fromstring(svg)
    assert root.get("aria-label") == '"<title>"'
    assert "<b>&: 0 at 3" in [each.text for each in root.iter("title")]


def test_long_curves_are_thinned():
    x = np.arange(100_000.0)
    (points,) = curves(line_chart(x, [Series("a", np.sin(x), "#000")], title="t", x_label="x"))
    assert len(points) == 800


def test_lanes_show_when_rooms_were_there_and_in_which_state():
    """A room that went and came back has two bars; a bar reaches to the next map, or to the next state."""
    x = np.array([0.0, 10.0, 20.0, 30.0, 40.0])
    states = np.array([[1, 0, 1, 2, 0], [0, 0, 0, 0, 2]])
    colors = [{"forming": "#100", "settled": "#200"}, {"forming": "#300", "settled": "#400"}]
    root = ET.fromstring(
        lane_chart(x, states, ["1", "2"], colors, title="t", x_label="x", x_range=(0.0, 40.0))
    )
    bars = [(float(each.get("x")), float(each.get("width"))) for each in root.iter("rect")]
    quarter = (WIDTH - LEFT - RIGHT) / 4
    assert bars[:3] == [pytest.approx((LEFT + at * quarter, quarter), abs=0.1) for at in (0, 2, 3)]
    assert [each.get("fill") for each in root.iter("rect")] == ["#100", "#100", "#200", "#400"]
    assert [each.find("title").text for each in root.iter("rect")][2:] == ["1: settled", "2: settled"]


def test_a_share_rises_in_steps_within_its_lane():
    """In the second lane: nothing before the second value, half of the lane from there on, then all of it."""
    first = ShareLane("1", "one", np.ones(4), "#111111", reached=0)
    second = ShareLane("2 & <3>", "two", np.array([0.0, 0.5, 0.5, 1.0]), "#222222", reached=3)
    root = ET.fromstring(
        share_lanes(
            np.array([0.0, 25.0, 50.0, 100.0]), [first, second], title="t", x_label="x", x_range=(0.0, 100.0)
        )
    )
    (path,) = (each.get("d") for each in root.iter("path") if each.get("fill") == "#222222")
    across = [float(value) for value in re.findall(r"[MH]([0-9.]+)", path)]
    down = [float(value) for value in re.findall(r"V([0-9.]+)", path)]
    bottom, height = TOP + 2 * SHARE_LANE - 1, SHARE_LANE - 2
    width = WIDTH - LEFT - RIGHT
    assert across == pytest.approx([LEFT + width / 4, LEFT + width / 4, LEFT + width, LEFT + width + 4])
    assert down == pytest.approx([bottom - height / 2, bottom - height, bottom])
    lines = [each.get("d") for each in root.iter("path") if each.get("class") == "axis"]
    assert len(lines) == 3  # the axes, and a line across each lane
    assert "2 & <3>" in [each.text for each in root.iter("text")]


def test_a_share_that_is_never_there_is_an_empty_lane():
    root = ET.fromstring(
        share_lanes(
            np.array([0.0, 1.0]), [ShareLane("1", "one", np.zeros(2), "#111111")], title="t", x_label="x"
        )
    )
    assert not list(root.iter("rect"))
