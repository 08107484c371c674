"""Drawings as pixels: parts in holes, raised figures, pictures that see through."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.shapes import Area, Dot, Picture, Text


@pytest.mark.parametrize("turn", [1, -1])
def test_what_lies_in_a_hole_is_drawn(turn: int):
    """Whichever part of a room comes first; and in the hole around it there is nothing."""
    ring = shapely.box(0, 0, 90, 90).difference(shapely.box(20, 20, 70, 70))
    room = shapely.MultiPolygon([ring, shapely.box(40, 40, 50, 50)][::turn])
    drawing = Drawing(90.0, 90.0)
    drawing.add(Area(room, (200, 0, 0)))
    image = drawing.pixels()
    assert image[10, 10].tolist() == image[45, 45].tolist() == [200, 0, 0]
    assert image[30, 30].tolist() == [255, 255, 255]


def test_a_raised_two_is_drawn():
    """The square of meters is no empty box: it is there, smaller and higher than a plain two."""

    def ink(text):
        page = Drawing(100, 40)
        page.add(Text(text, 50, 20, 24))
        return page.pixels().min(2) < 128

    plain, raised = ink("m2"), ink("m²")
    assert 0 < raised.sum() < plain.sum()
    right = slice(int(np.flatnonzero(raised.any(0))[-1]) - 5, None)
    assert np.flatnonzero(raised[:, right].any(1))[-1] < np.flatnonzero(plain.any(1))[-1] - 3


def test_a_picture_with_opacity_lets_what_is_below_show_through():
    pixels = np.zeros((1, 2, 4), np.uint8)
    pixels[0, 1] = (0, 0, 200, 255)
    page = Drawing(40, 20, paper=(250, 250, 0))
    page.add(Picture(pixels, np.array([[20.0, 0, 0], [0, 20, 0]])))
    image = page.pixels()
    assert image[10, 5].tolist() == [250, 250, 0]
    assert image[10, 35].tolist() == [0, 0, 200]


def test_a_picture_partly_beyond_the_page_is_cut():
    page = Drawing(10, 10)
    page.add(Picture(np.full((4, 4, 3), 7, np.uint8), np.array([[5.0, 0, 5], [0, 5, -15]])))
    page.add(Picture(np.full((4, 4, 3), 9, np.uint8), np.array([[5.0, 0, 50], [0, 5, 0]])))
    image = page.pixels()
    assert (image[:5, 5:] == 7).all()
    assert (image[5:] == 255).all()
    assert (image[:, :5] == 255).all()


def test_texts_stand_by_their_anchor():
    columns = []
    for anchor in ("start", "middle", "end"):
        page = Drawing(200, 40)
        page.add(Text("long word", 100, 20, 16, anchor))
        columns.append(np.flatnonzero((page.pixels().min(2) < 128).any(0)))
    assert columns[0][0] >= 99
    assert columns[1].mean() == pytest.approx(100, abs=4)
    assert columns[2][-1] <= 101


def test_a_dot_is_round():
    page = Drawing(40, 40)
    page.add(Dot(20, 20, 10, (0, 0, 0)))
    assert (page.pixels()[..., 0] < 128).sum() == pytest.approx(np.pi * 100, rel=0.1)
