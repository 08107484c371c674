"""Sheets: panels below and beside each other, texts that fit, legends in rows."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.fonts import text_width
from rose2_logs.drawing.shapes import Area, Text
from rose2_logs.drawing.sheet import Key, arranged, legend, side_by_side, stacked, text_line, tiled


def box(width: float, height: float, color=(0, 0, 0)) -> Drawing:
    """Return a page that is full of a color."""
    page = Drawing(width, height)
    page.add(Area(shapely.box(0, 0, width, height), color))
    return page


@pytest.mark.parametrize("width", [120, 2000])
def test_text_fits_its_width(width: int):
    """A long title on a narrow page is set smaller instead of running out of it."""
    page = text_line("a title that is much longer than 120 pixels", width, 20)
    image = page.pixels()
    assert (image[:, -6:] == 255).all()
    assert (image < 128).any()


def test_drawings_stand_below_and_beside_each_other():
    below = stacked([box(30, 10, (200, 0, 0)), box(20, 40, (0, 0, 200))], 5)
    assert (below.width, below.height) == (30, 55)
    image = below.pixels()
    assert image[5, 25].tolist() == [200, 0, 0]
    assert image[30, 10].tolist() == [0, 0, 200]
    assert image[12, 10].tolist() == image[30, 25].tolist() == [255, 255, 255]
    beside = side_by_side([box(30, 10), box(20, 40)], 5)
    assert (beside.width, beside.height) == (55, 40)


def test_tiles_fill_rows():
    page = tiled([box(10, 10)] * 5, 2, 2)
    assert (page.width, page.height) == (22, 34)
    image = page.pixels()
    assert image[30, 5].tolist() == [0, 0, 0]
    assert image[30, 17].tolist() == [255, 255, 255]


@pytest.mark.parametrize(("width", "columns"), [(400, 1), (100, 2), (30, 4)])
def test_panels_are_arranged_to_the_shape_of_a_screen(width: float, columns: int):
    page = arranged([box(width, 100)] * 4, 1.5)
    assert page.width == columns * width


def test_a_legend_takes_as_many_rows_as_it_needs():
    keys = [Key(f"number {number} of the keys", (number, 0, 0)) for number in range(8)]
    for width in (250.0, 900.0):
        page = legend(keys, width, 12.0)
        words = [each for each in page.shapes if isinstance(each, Text)]
        assert [each.text for each in words] == [key.text for key in keys]
        assert max(each.x + text_width(each.text, each.size) for each in words) <= width
        assert max(each.y for each in words) < page.height
    assert legend(keys, 250.0, 12.0).height > legend(keys, 900.0, 12.0).height


def test_each_kind_of_key_has_its_sign():
    kinds = ("area", "hatched", "line", "sign")
    page = legend([Key(kind, (200, 0, 0), kind, sign="7?") for kind in kinds], 600.0, 20.0)
    image = page.pixels().astype(int)
    words = {each.text: each for each in page.shapes if isinstance(each, Text)}
    red = []
    for kind in ("area", "hatched", "line"):
        right = int(words[kind].x) - 10
        part = image[:, right - 36 : right]
        red.append(np.count_nonzero((part[..., 0] > 180) & (part[..., 1] < 60)))
    assert red[0] > red[2] > 0
    assert "7?" in words
