"""Sheets of several drawings: captions, legends, and panels below and next to each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely

from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.fonts import text_width
from rose2_logs.drawing.hatching import hatching
from rose2_logs.drawing.palette import shaded
from rose2_logs.drawing.shapes import Area, Color, Lines, Shape, Text

SIGN_WIDTH, SIGN_GAP, KEY_GAP = 1.8, 0.5, 1.4
"""Width of the sign of a key, between it and its text, and from one key to the next, in sizes of the font."""
ROW_HEIGHT = 1.6
"""Height of a row of keys, and of a line of text with the space around it, in sizes of the font."""
SIGN_HATCH_GAP = 0.45
"""Between the lines of a hatched sign, in sizes of the font."""


@dataclass(frozen=True)
class Key:
    """What a color or a sign means.

    Attributes
    ----------
    text : str
    color : Color
    kind : {"area", "hatched", "line", "arrow", "cross", "sign"}
        A filled box, a pale one with hatching, a thick line, an arrowhead, a cross, or a text.
    opacity : float
        Of the box.
    sign : str
        The text that stands for it.
    """

    text: str
    color: Color = (25, 25, 25)
    kind: Literal["area", "hatched", "line", "arrow", "cross", "sign"] = "area"
    opacity: float = 1.0
    sign: str = ""

    def width(self, font: float) -> float:
        """Width of sign and text."""
        return (SIGN_WIDTH + SIGN_GAP) * font + text_width(self.text, font)

    def shapes(self, x: float, y: float, font: float) -> list[Shape]:
        """Sign and text from x on, their middle at y."""
        right, line = x + SIGN_WIDTH * font, 0.1 * font
        box = shapely.box(x, y - 0.5 * font, right, y + 0.5 * font)
        words = Text(self.text, right + SIGN_GAP * font, y, font, "start")
        match self.kind:
            case "sign":
                return [Text(self.sign, (x + right) / 2, y, font, is_bold=True, color=self.color), words]
            case "line":
                return [Lines(shapely.LineString([(x, y), (right, y)]), self.color, 2.5 * line), words]
            case "arrow":
                head = np.array([[0.5, 0.0], [-0.5, 0.32], [-0.3, 0.0], [-0.5, -0.32]])
                there = shapely.Polygon(head * 1.2 * font + ((x + right) / 2, y))
                return [Lines(there, self.color, 1.5 * line), words]
            case "cross":
                ends = np.array([[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]]) * 0.35 * font + ((x + right) / 2, y)
                return [
                    Lines(shapely.multilinestrings(shapely.linestrings(ends)), self.color, 1.5 * line),
                    words,
                ]
            case "hatched":
                lines = hatching(box, SIGN_HATCH_GAP * font)
                filled: list[Shape] = [Lines(lines, shaded(self.color, 0.8), 0.7 * line)]
            case "area":
                filled = []
        outline = Lines(box, shaded(self.color, 0.6), line)
        return [Area(box, self.color, self.opacity), *filled, outline, words]


def legend(keys: Sequence[Key], width: float, font: float, *, indent: float = 0.0) -> Drawing:
    """Draw what colors and signs mean, in as many rows as the width requires.

    Parameters
    ----------
    keys : sequence of Key
    width : float
        Of the page.
    font : float
        Size of the texts.
    indent : float
        Left free in the first row.
    """
    row, x = 0, max(indent, font)
    shapes: list[Shape] = []
    for key in keys:
        needed = key.width(font)
        if x > font and x + needed > width:
            row, x = row + 1, font
        shapes += key.shapes(x, (row + 0.5) * ROW_HEIGHT * font, font)
        x += needed + KEY_GAP * font
    page = Drawing(width, (row + 1) * ROW_HEIGHT * font)
    page.add(*shapes)
    return page


def text_line(text: str, width: float, font: float) -> Drawing:
    """Draw one line of text in a given width; a longer text is set smaller until it fits."""
    page = Drawing(width, ROW_HEIGHT * font)
    fitting = font * min(1.0, (width - font) / max(text_width(text, font), 1.0))
    page.add(Text(text, 0.5 * font, page.height / 2, fitting, "start"))
    return page


def captioned(panel: Drawing, caption: str, font: float) -> Drawing:
    """Put a line of text above a drawing."""
    return stacked([text_line(caption, panel.width, font), panel])


def stacked(parts: Sequence[Drawing], gap: float = 0.0, title: str = "") -> Drawing:
    """Put drawings below each other, their left sides aligned."""
    page = Drawing(
        max(part.width for part in parts), sum(part.height for part in parts) + gap * (len(parts) - 1), title
    )
    y = 0.0
    for part in parts:
        page.lay(part, 0.0, y)
        y += part.height + gap
    return page


def side_by_side(parts: Sequence[Drawing], gap: float = 0.0) -> Drawing:
    """Put drawings next to each other, aligned at the top."""
    page = Drawing(
        sum(part.width for part in parts) + gap * (len(parts) - 1), max(part.height for part in parts)
    )
    x = 0.0
    for part in parts:
        page.lay(part, x, 0.0)
        x += part.width + gap
    return page


def tiled(parts: Sequence[Drawing], columns: int, gap: float = 0.0) -> Drawing:
    """Put drawings of one size into rows; where the last row is not full, the page is left white."""
    return stacked(
        [side_by_side(parts[first : first + columns], gap) for first in range(0, len(parts), columns)], gap
    )


def arranged(parts: Sequence[Drawing], aspect: float, gap: float = 0.0) -> Drawing:
    """Put drawings of one size into as many full rows as bring the whole nearest to width over height."""
    shape = parts[0].width / parts[0].height
    columns = min(
        (count for count in range(1, len(parts) + 1) if len(parts) % count == 0),
        key=lambda count: abs(math.log(shape * count * count / len(parts) / aspect)),
    )
    return tiled(parts, columns, gap)
