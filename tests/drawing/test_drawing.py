"""Drawings are saved as what their name says, shown by notebooks, and laid on one another."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from PIL import Image

from rose2_logs.drawing import PRINT_WIDTH_PX
from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.shapes import Area, Dot, Lines, Picture, Text
from rose2_logs.errors import OutputError, ParameterError


@pytest.fixture
def drawing() -> Drawing:
    """Return one of each shape."""
    page = Drawing(200, 100, "all & <some>")
    page.add(
        Picture(np.full((2, 2, 3), 90, np.uint8), np.array([[10.0, 0, 5], [0, 10, 5]])),
        Area(shapely.box(30, 10, 60, 40), (200, 0, 0), 0.5, "an area"),
        Lines(shapely.LineString([(70, 10), (90, 40)]), (0, 0, 0), 2.0, "axis"),
        Dot(120, 30, 5, (0, 0, 200)),
        Text("words", 150, 60, 12, "start", rim=1.0),
    )
    return page


def test_the_name_says_what_it_is_saved_as(drawing: Drawing, tmp_path: Path):
    assert drawing.save(str(tmp_path / "a.svg")) == tmp_path / "a.svg"
    assert ET.parse(tmp_path / "a.svg").getroot().get("width") == "200"
    drawing.save(tmp_path / "a.png")
    drawing.save(tmp_path / "b.PNG", width_px=None)
    with Image.open(tmp_path / "a.png") as large, Image.open(tmp_path / "b.PNG") as small:
        assert large.size == (PRINT_WIDTH_PX, PRINT_WIDTH_PX // 2)
        assert small.size == (200, 100)


@pytest.mark.parametrize(
    ("name", "width_px"),
    [("a.pdf", 100), ("a", 100), *(("a.png", width) for width in (0, 10**6, 10**400, True, "9", 2.5))],
)
def test_what_cannot_be_saved_is_told_in_a_line(drawing: Drawing, tmp_path: Path, name: str, width_px: Any):
    with pytest.raises(ParameterError) as caught:
        drawing.save(tmp_path / name, width_px=width_px)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())
    with pytest.raises(ParameterError):
        drawing.pixels(10**6)


def test_a_folder_that_is_none_is_told(drawing: Drawing, tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        drawing.save(tmp_path / "file" / "a.svg")


def test_notebooks_show_it(drawing: Drawing):
    root = ET.fromstring(drawing._repr_svg_())
    assert root.get("viewBox") == "0 0 200 100"
    assert repr(drawing) == "Drawing('all & <some>', 200 x 100, 5 shapes)"


def test_a_page_is_laid_on_another(drawing: Drawing):
    """Half as large, 100 to the right: every shape of it."""
    page = Drawing(200, 100)
    page.lay(drawing, 100.0, 20.0, 0.5)
    small, large = page.pixels(400), drawing.pixels(400)
    part = small[40:140, 200:400].astype(int)
    reduced = large.reshape(100, 2, 200, 2, 3).mean((1, 3))
    assert np.abs(part - reduced).mean() < 3
    assert (small[:, :200] == 255).all()


@pytest.mark.parametrize(
    "shape",
    [
        shapely.LineString(),
        shapely.Polygon(),
        shapely.MultiLineString(),
        shapely.GeometryCollection([shapely.Point(1, 1), shapely.LineString()]),
        shapely.MultiLineString([[(0, 0), (1, 1)], [(2, 2), (3, 3)]]),
        shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.Polygon()]),
        shapely.GeometryCollection([shapely.Point(1, 1), shapely.box(0, 0, 1, 1)]),
    ],
    ids=lambda shape: shape.wkt[:40],
)
def test_every_path_of_an_svg_begins_with_a_point(shape):
    """Browsers complain of others; what has no line is left out, title and all."""
    drawing = Drawing(10, 10, "shapes")
    drawing.add(Lines(shape, (0, 0, 0), 1.0, title="told"), Area(shape, (0, 0, 0)))
    paths = re.findall(r' d="([^"]*)"', drawing.svg())
    assert all(re.fullmatch(r"(M-?\d[^MZ]*Z?)+", path) for path in paths)
    has_lines = shapely.length(shape) > 0
    assert len(paths) == (2 if has_lines else 0)
    assert ("told" in drawing.svg()) == has_lines
