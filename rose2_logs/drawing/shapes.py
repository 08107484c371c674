"""What a drawing is made of, whatever it is written as: areas, lines, texts and a picture on a page."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.occupancy import FloatArray

Color = tuple[int, int, int]
"""Red, green, blue in 0..255."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Pixels laid onto the page.

    Attributes
    ----------
    pixels : (H, W, 3) uint8
        RGB, row 0 first.
    matrix : (2, 3) float
        From the corner of a pixel (column, row, 1) to the page.
    """

    pixels: NDArray[np.uint8]
    matrix: FloatArray


@dataclass(frozen=True, eq=False)
class Area:
    """A filled polygon or multipolygon.

    Attributes
    ----------
    shape : shapely geometry
        On the page.
    fill : Color
    opacity : float
        In [0, 1].
    title : str
        What a viewer tells when it is pointed at; empty for nothing.
    """

    shape: BaseGeometry
    fill: Color
    opacity: float = 1.0
    title: str = ""


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines of one kind.

    Attributes
    ----------
    shape : shapely geometry
        Lines, or polygons whose rings are drawn, on the page.
    color : Color
    width : float
        Units of the page.
    """

    shape: BaseGeometry
    color: Color
    width: float


@dataclass(frozen=True)
class Text:
    """One line of text with a pale rim that keeps it readable on anything.

    Attributes
    ----------
    text : str
    x, y : float
        Where its middle, or its left end, lies; y at the middle of its height.
    size : float
        Height of the font.
    is_bold, is_centered : bool
    color : Color
    rim : float
        Width of the rim, 0 for none.
    """

    text: str
    x: float
    y: float
    size: float
    is_bold: bool = False
    is_centered: bool = True
    color: Color = (25, 25, 25)
    rim: float = 0.0


Shape = Picture | Area | Lines | Text


@dataclass(eq=False)
class Drawing:
    """A page and what lies on it, the lowest first.

    Attributes
    ----------
    width, height : float
        Of the page, in its own units; y goes down.
    title : str
        What it shows, for those who cannot see it.
    paper : Color
    shapes : list of Shape
    """

    width: float
    height: float
    title: str = ""
    paper: Color = (255, 255, 255)
    shapes: list[Shape] = field(default_factory=list)

    def add(self, *shapes: Shape) -> None:
        """Lay shapes on top."""
        self.shapes += shapes


def hatching(shape: BaseGeometry, gap: float) -> BaseGeometry:
    """Lines through a shape, rising at 45 degrees, a gap apart from each other on the page."""
    if shape.is_empty:
        return shapely.MultiLineString()
    x0, y0, x1, y1 = shape.bounds
    step = gap * np.sqrt(2)
    # Where lines x + y = c cross the box; from a multiple of the step, so that areas side by side fit.
    sums = np.arange(np.floor((x0 + y0) / step) * step, x1 + y1 + step, step)
    lines = shapely.linestrings(
        np.stack(
            [
                np.column_stack([sums - y0, np.full_like(sums, y0)]),
                np.column_stack([sums - y1, np.full_like(sums, y1)]),
            ],
            axis=1,
        )
    )
    return shapely.intersection(shapely.multilinestrings(lines), shape)
