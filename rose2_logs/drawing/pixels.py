"""Drawings as pixels, drawn larger and then reduced: smooth lines and text without a plotting library."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from shapely.geometry.base import BaseGeometry

from rose2_logs.drawing.fonts import font_of
from rose2_logs.drawing.shapes import Area, Dot, Lines, Page, Picture, Text

SMOOTHING = 2
"""Drawn so many times as large and then reduced."""
BOLD_SHARE = 0.025
"""The default font has no bold face; its strokes are made so much of its size thicker."""

ANCHORS = {"start": 0.0, "middle": 0.5, "end": 1.0}
"""Share of a text that is before its anchor."""
SQUARED = "\N{SUPERSCRIPT TWO}"
RAISED_SIZE, RAISED_BY = 0.62, 0.22
"""Size and rise of a raised two, in sizes of the font."""


def as_pixels(page: Page, width_px: int) -> NDArray[np.uint8]:
    """Draw at a width in pixels.

    Returns
    -------
    (H, W, 3) uint8
        RGB.
    """
    scale = width_px * SMOOTHING / page.width
    size = (width_px * SMOOTHING, math.ceil(page.height * scale / SMOOTHING) * SMOOTHING)
    image = Image.new("RGB", size, page.paper or (255, 255, 255))
    draw = ImageDraw.Draw(image)
    for shape in page.shapes:
        match shape:
            case Picture():
                _picture(image, shape, scale)
            case Area():
                _area(image, shape, scale)
            case Lines(geometry, color, width):
                thick = max(1, round(width * scale))
                for line in _lines(geometry, scale):
                    draw.line(line, color, thick, "curve" if len(line) > 2 and thick > 1 else None)
            case Dot(x, y, radius, fill):
                middle, reach = np.array([x, y]) * scale, radius * scale
                draw.ellipse([*(middle - reach).tolist(), *(middle + reach).tolist()], fill)
            case Text():
                _text(draw, shape, scale)
    return np.asarray(image.reduce(SMOOTHING))


def _picture(image: Image.Image, picture: Picture, scale: float) -> None:
    import cv2

    pixels, matrix = picture.pixels, np.asarray(picture.matrix) * scale
    # Reduced beforehand, because the warp below looks at a few pixels only.
    step = math.sqrt(abs(np.linalg.det(matrix[:, :2])))
    block = max(1, round(1 / step)) if step > 0 else 1
    if block > 1:
        height, width = pixels.shape[:2]
        smaller = (max(1, width // block), max(1, height // block))
        matrix = matrix @ np.diag([width / smaller[0], height / smaller[1], 1.0])
        pixels = np.asarray(cv2.resize(pixels, smaller, interpolation=cv2.INTER_AREA), np.uint8)
    height, width = pixels.shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) @ matrix[:, :2].T + matrix[:, 2]
    left, top = np.maximum(np.floor(corners.min(axis=0)), 0).astype(int).tolist()
    right, bottom = np.minimum(np.ceil(corners.max(axis=0)), image.size).astype(int).tolist()
    if right <= left or bottom <= top:
        return
    # The matrix goes from corners of pixels, OpenCV counts from their middles.
    matrix = matrix.copy()
    matrix[:, 2] += matrix[:, :2] @ (0.5, 0.5) - 0.5 - (left, top)
    flags = cv2.INTER_NEAREST if block == 1 else cv2.INTER_LINEAR
    part, size = image.crop((left, top, right, bottom)), (right - left, bottom - top)
    if pixels.shape[2] == 3:
        page = np.array(part)
        cv2.warpAffine(pixels, matrix, size, dst=page, flags=flags, borderMode=cv2.BORDER_TRANSPARENT)
        image.paste(Image.fromarray(page), (left, top))
    else:
        overlay = Image.fromarray(np.asarray(cv2.warpAffine(pixels, matrix, size, flags=flags), np.uint8))
        image.paste(overlay, (left, top), overlay)


def _area(image: Image.Image, area: Area, scale: float) -> None:
    if area.shape.is_empty or area.opacity == 0:
        return
    x0, y0, x1, y1 = (value * scale for value in area.shape.bounds)
    left, top = math.floor(x0), math.floor(y0)
    mask = Image.new("L", (math.ceil(x1) - left + 1, math.ceil(y1) - top + 1))
    draw = ImageDraw.Draw(mask)
    level = round(255 * area.opacity)
    parts = [part for part in shapely.get_parts(area.shape) if shapely.get_dimensions(part) == 2]
    # The largest first: a part may be inside a hole of another, which would be cut out of it.
    for part in sorted(parts, key=lambda part: -part.envelope.area):
        for number, ring in enumerate(shapely.get_rings(part)):
            points = shapely.get_coordinates(ring) * scale - (left, top)
            draw.polygon([(x, y) for x, y in points.tolist()], level if number == 0 else 0)
    image.paste(area.fill, (left, top), mask)


def _lines(shape: BaseGeometry, scale: float) -> Iterator[list[tuple[float, float]]]:
    """Points of the rings of polygons and of the lines of a shape."""
    parts = shapely.get_parts(np.array([shape], object))
    dimensions = shapely.get_dimensions(parts)
    lines = np.concatenate([shapely.get_rings(parts[dimensions == 2]), parts[dimensions == 1]])
    points, line = shapely.get_coordinates(lines, return_index=True)
    pairs = [(x, y) for x, y in (points * scale).tolist()]
    ends = np.flatnonzero(np.diff(line, append=-1)) + 1
    for begin, end in pairwise([0, *ends.tolist()]):
        yield pairs[begin:end]


def _text(draw: ImageDraw.ImageDraw, text: Text, scale: float) -> None:
    """Write a text; the default font has no raised two, so that it is written smaller and higher."""
    size = text.size * scale
    runs = [(part, size * share, rise * size) for part, share, rise in _runs(text.text)]
    fonts = [font_of(height) for _, height, _ in runs]
    length = sum(font.getlength(part) for (part, _, _), font in zip(runs, fonts, strict=True))
    x = text.x * scale - ANCHORS[text.anchor] * length
    bold = round(BOLD_SHARE * size) if text.is_bold else 0
    for color, rim in (((255, 255, 255), round(text.rim * scale)), (text.color, 0)):
        if rim == 0 and color != text.color:
            continue
        place = x
        for (part, _, rise), font in zip(runs, fonts, strict=True):
            where = (place, text.y * scale - rise)
            draw.text(where, part, color, font, "lm", stroke_width=rim + bold, stroke_fill=color)
            place += font.getlength(part)


def _runs(text: str) -> list[tuple[str, float, float]]:
    """Parts of a text, each with its share of the font's size and of it how much higher it stands."""
    parts = text.split(SQUARED)
    runs = [(parts[0], 1.0, 0.0)]
    for part in parts[1:]:
        runs += [("2", RAISED_SIZE, RAISED_BY), (part, 1.0, 0.0)]
    return [run for run in runs if run[0]]
