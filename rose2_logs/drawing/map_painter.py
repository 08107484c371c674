"""The painter of maps with rooms: it draws every part of the world."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.palette import shaded
from rose2_logs.drawing.shapes import Area, Color, Lines, Picture, Text
from rose2_logs.model.labels import distinct_labels
from rose2_logs.model.occupancy import UNKNOWN, FloatArray, GridGeometry

UNKNOWN_GRAY, FREE_GRAY, OCCUPIED_GRAY = 216, 255, 25
WHITE, INK = (255, 255, 255), (25, 25, 25)
OUTLINE_SHADE, HATCH_SHADE = 0.6, 0.8
"""Shares of the brightness of a room's color."""
DOORWAY_COLOR: Color = (205, 45, 20)
UNSURE_COLOR: Color = (150, 40, 200)
"""Of doorways through borders that are unsure."""
HOLE_MIN = 60.0
"""Holes in a room's shape are drawn from this area on, square units of the page: no single cells."""
TALLEST = 1.3
"""A drawing is at most so many times as high as wide; a higher part of the world is drawn narrower."""

Bounds = tuple[float, float, float, float]


class MapPainter:
    """Draws a part of the world; x goes right and y up.

    Parameters
    ----------
    bounds_m : (x0, y0, x1, y1)
        The part, meters.
    width : float
        Of the page.
    title : str
        What the drawing shows.
    tallest : float
        Most height of the page for each unit of its width.
    """

    def __init__(self, bounds_m: Bounds, width: float, title: str = "", tallest: float = TALLEST) -> None:
        x0, y0, x1, y1 = bounds_m
        self.scale = min(width / (x1 - x0), tallest * width / (y1 - y0))
        """Units of the page to a meter."""
        left = (width - (x1 - x0) * self.scale) / 2
        self.drawing = Drawing(width, (y1 - y0) * self.scale, title)
        self._to_page = np.array(
            [[self.scale, 0.0, left - x0 * self.scale], [0.0, -self.scale, y1 * self.scale]]
        )

    def on_page(self, shape: BaseGeometry) -> BaseGeometry:
        """Return a shape of the world, meters, where it lies on the page."""
        matrix = self._to_page
        return shapely.transform(shape, lambda xy: xy @ matrix[:, :2].T + matrix[:, 2])

    def ground(self) -> None:
        """Make all of the page unknown."""
        box = shapely.box(0, 0, self.drawing.width, self.drawing.height)
        self.drawing.add(Area(box, (UNKNOWN_GRAY,) * 3))

    def picture(self, pixels: NDArray[np.uint8], geometry: GridGeometry, most_px: int = 4000) -> None:
        """Lay a picture with a pixel for each cell of a grid; reduced where it has more along a side."""
        import cv2

        height, width = pixels.shape[:2]
        block = -(-max(height, width) // most_px)
        size = (-(-width // block), -(-height // block))
        if block > 1:
            pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
        meters = np.array([width / size[0], height / size[1]]) * geometry.resolution_m
        to_world = np.column_stack([geometry.rotation * meters, geometry.origin_xy_m])
        matrix = self._to_page[:, :2] @ to_world
        matrix[:, 2] += self._to_page[:, 2]
        self.drawing.add(Picture(pixels, matrix))

    def area(
        self, shape: BaseGeometry, color: Color, opacity: float, title: str = "", identity: str = ""
    ) -> None:
        """Fill a shape on the page."""
        self.drawing.add(Area(shape, color, opacity, title, identity))

    def outline(self, shape: BaseGeometry, color: Color, width: float, identity: str = "") -> None:
        """Draw the rings of a room's shape on the page, in a darker color than that of the room."""
        self.drawing.add(Lines(shape, shaded(color, OUTLINE_SHADE), width, id=identity))

    def hatch(self, lines: BaseGeometry, color: Color, width: float, identity: str = "") -> None:
        """Draw hatching on the page in a room's color."""
        self.drawing.add(Lines(lines, shaded(color, HATCH_SHADE), width, id=identity))

    def lines(self, ends_m: FloatArray, color: Color, width: float, rim: float = 0.0) -> None:
        """Draw straight lines of the world (N, 2, 2), meters, with a pale rim on both sides."""
        if not len(ends_m):
            return
        shape = self.on_page(shapely.multilinestrings(shapely.linestrings(ends_m.reshape(-1, 2, 2))))
        if rim:
            self.drawing.add(Lines(shape, WHITE, width + 2 * rim))
        self.drawing.add(Lines(shape, color, width))

    def name(self, text: str, x: float, y: float, font: float, *, is_bold: bool = True) -> None:
        """Write a name on the page, readable on anything."""
        self.drawing.add(Text(text, x, y, font, is_bold=is_bold, rim=0.14 * font))


def tinted_cells(
    cells: NDArray[np.int8],
    labels: NDArray[np.integer] | None = None,
    colors: Mapping[int, Color] | None = None,
    opacity: float = 1.0,
) -> NDArray[np.uint8]:
    """Color the cells of a map: gray by their occupancy, and tinted by the color of their label.

    Parameters
    ----------
    cells : (H, W) int8
        -1 unknown, 0..100 occupancy in percent.
    labels : (H, W) int, optional
        0 where there is no tint.
    colors : mapping of int to Color, optional
        Color of each label; without one a cell stays gray.
    opacity : float
        Of the tint on cells that are free or unknown; the more a cell is occupied, the less it is tinted.

    Returns
    -------
    (H, W, 3) uint8
        RGB.
    """
    # The color of each value of a cell, one row for each label after that of none.
    values = np.arange(2**8)
    gray = np.interp(values, (0, 100), (FREE_GRAY, OCCUPIED_GRAY))
    is_unknown = values == np.array(UNKNOWN, np.int8).view(np.uint8)
    gray[is_unknown] = UNKNOWN_GRAY
    tint = opacity * np.where(is_unknown, 1.0, np.interp(values, (0, 100), (1.0, 0.0)))[:, None]
    present = [] if labels is None or colors is None else distinct_labels(labels)[0].tolist()
    numbers = [number for number in present if number in (colors or {})]
    tints = np.array([(colors or {})[number] for number in numbers], float).reshape(-1, 1, 3)
    table = np.concatenate(
        [np.repeat(gray[:, None], 3, axis=1)[None], (1 - tint) * gray[:, None] + tint * tints]
    )
    table = np.round(table).astype(np.uint8)
    if labels is None or not numbers:
        grays: NDArray[np.uint8] = table[0][cells.view(np.uint8)]
        return grays
    row = np.zeros(max(present) + 1, np.uint16)
    row[numbers] = np.arange(1, len(numbers) + 1)
    colored: NDArray[np.uint8] = table[row[labels], cells.view(np.uint8)]
    return colored


def simpler(shape: BaseGeometry, detail: float) -> BaseGeometry:
    """Return a shape on the page without what is too small to be read there."""
    parts = []
    for part in shapely.get_parts(shape.simplify(detail)):
        if part.is_empty:
            continue
        rings = shapely.polygons(shapely.get_rings(part))
        holes = [ring.exterior for ring in rings[1:] if ring.area >= HOLE_MIN]
        parts.append(shapely.Polygon(rings[0].exterior, holes))
    simple = shapely.MultiPolygon(parts)
    if simple.is_valid:
        return simple
    # Without a hole that is too small, a part that lies in it is part of what is around it.
    return shapely.multipolygons(shapely.get_parts(shapely.union_all(parts)))
