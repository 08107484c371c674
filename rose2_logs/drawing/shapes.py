"""The parts of a drawing, whatever its file format: areas, lines, dots, texts and pictures on a page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

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
    pixels : (H, W, 3) or (H, W, 4) uint8
        RGB, or RGB and opacity; row 0 first.
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
        What a viewer shows when the pointer is over it; empty for nothing.
    id : str
        By which other programs find it in the drawing, once in a page; empty for none.
    """

    shape: BaseGeometry
    fill: Color
    opacity: float = 1.0
    title: str = ""
    id: str = ""


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
    kind : str
        Class in the style of an HTML page, which may give it another color; empty for none.
    title, id : str
        As of `Area`.
    """

    shape: BaseGeometry
    color: Color
    width: float
    kind: str = ""
    title: str = ""
    id: str = ""


@dataclass(frozen=True)
class Dot:
    """A filled circle around (x, y); its title is shown when the pointer is over it."""

    x: float
    y: float
    radius: float
    fill: Color
    title: str = ""


@dataclass(frozen=True)
class Text:
    """One line of text, with a pale rim that keeps it readable on anything.

    Attributes
    ----------
    text : str
    x, y : float
        Where its anchor lies; y at the middle of its height.
    size : float
        Height of the font.
    anchor : {"start", "middle", "end"}
        Which part of the text is at x.
    is_bold : bool
    color : Color
    rim : float
        Width of the rim, 0 for none.
    kind : str
        As of `Lines`.
    """

    text: str
    x: float
    y: float
    size: float
    anchor: Literal["start", "middle", "end"] = "middle"
    is_bold: bool = False
    color: Color = (25, 25, 25)
    rim: float = 0.0
    kind: str = ""


Shape = Picture | Area | Lines | Dot | Text


@dataclass(eq=False, repr=False)
class Page:
    """A page and the shapes on it, the lowest first.

    Attributes
    ----------
    width, height : float
        Of the page, in its own units; y goes down.
    title : str
        What it shows, for those who cannot see it.
    paper : Color or None
        None lets what lies below an SVG show through; pixels are white there.
    kind : str
        Class of the whole in the style of an HTML page; empty for none.
    shapes : list of Shape
    layers : list of (int, str)
        Layers as drawing programs have them: number of the first shape and name.
    """

    width: float
    height: float
    title: str = ""
    paper: Color | None = (255, 255, 255)
    kind: str = ""
    shapes: list[Shape] = field(default_factory=list)
    layers: list[tuple[int, str]] = field(default_factory=list)

    def add(self, *shapes: Shape) -> None:
        """Lay shapes on top."""
        self.shapes += shapes

    def begin_layer(self, name: str) -> None:
        """Put what is added from here on into a layer."""
        self.layers.append((len(self.shapes), name))

    def lay(self, page: Page, x: float, y: float, scale: float = 1.0) -> None:
        """Lay what is on another page on top, its upper left corner at (x, y)."""
        self.shapes += _moved(page.shapes, x, y, scale)


def _moved(shapes: list[Shape], x: float, y: float, scale: float) -> Iterator[Shape]:
    """Yield shapes scaled about the page's corner and then shifted."""

    def there(shape: BaseGeometry) -> BaseGeometry:
        return shapely.transform(shape, lambda xy: xy * scale + (x, y))

    for each in shapes:
        match each:
            case Picture():
                matrix = np.asarray(each.matrix) * scale
                matrix[:, 2] += (x, y)
                yield replace(each, matrix=matrix)
            case Area():
                yield replace(each, shape=there(each.shape))
            case Lines():
                yield replace(each, shape=there(each.shape), width=each.width * scale)
            case Dot():
                yield replace(each, x=each.x * scale + x, y=each.y * scale + y, radius=each.radius * scale)
            case Text():
                yield replace(
                    each,
                    x=each.x * scale + x,
                    y=each.y * scale + y,
                    size=each.size * scale,
                    rim=each.rim * scale,
                )
