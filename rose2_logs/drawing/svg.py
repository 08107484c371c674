"""Drawings as SVG: text, with the picture inside as PNG."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator
from xml.sax import saxutils

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.drawing.shapes import Area, Color, Dot, Lines, Page, Picture, Shape, Text

FONTS = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"
DECIMALS = 2
FEW_COLORS = 128
NAMESPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
"""Programs that know SVG 1.1 only, as Inkscape 1.2, find pictures by xlink."""
FOR_PROGRAMS = ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
MIDDLE_EM = 0.36
"""A text's baseline is this far below the middle of its capitals: half their height in usual fonts."""

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that no XML may hold, not even escaped; names in a log may."""


def as_svg(page: Page, *, is_inline: bool = False) -> str:
    """Write a drawing.

    Parameters
    ----------
    page : Page
    is_inline : bool
        For a place within an HTML page: no XML declaration, no layers and ids, which a page may hold once
        only, and it fills the width it is given.
    """
    width, height = _number(page.width), _number(page.height)
    about = "" if is_inline else f'{FOR_PROGRAMS} width="{width}" height="{height}"'
    head = (
        f'<svg {NAMESPACES}{_class(page.kind)} viewBox="0 0 {width} {height}"{about} '
        f'role="img" aria-label={quoteattr(page.title)} font-family="{FONTS}">'
    )
    title = "" if is_inline else f"<title>{escape(page.title)}</title>"
    paper = (
        ""
        if page.paper is None
        else f'<rect width="{width}" height="{height}" fill="{css_color(page.paper)}"/>'
    )
    shown = map(_element, page.shapes) if is_inline else _layered(page)
    body = "\n".join([head, title + paper, *filter(None, shown), "</svg>"])
    return body if is_inline else f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'


def _layered(page: Page) -> Iterator[str]:
    """Yield the elements of a page with their ids, each layer within a group."""
    starts = dict(page.layers)
    is_open = False
    for place, shape in enumerate(page.shapes):
        if place in starts:
            name = quoteattr(starts[place])
            if is_open:
                yield "</g>"
            yield f'<g id={name} inkscape:groupmode="layer" inkscape:label={name}>'
            is_open = True
        yield _element(shape, getattr(shape, "id", ""))
    if is_open:
        yield "</g>"


def png_uri(pixels: NDArray[np.uint8], *, few_colors: bool = False) -> str:
    """Return pixels (H, W, 3 or 4) as a PNG in a data URI, with few colors a third as large."""
    from PIL import Image

    stream = io.BytesIO()
    image = Image.fromarray(pixels)
    image = image.quantize(FEW_COLORS, dither=Image.Dither.NONE) if few_colors else image
    image.save(stream, format="PNG", optimize=True)
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"


def _element(shape: Shape, identity: str = "") -> str:
    """Write a shape; nothing for one without any line, whose path no browser could read."""
    named = f" id={quoteattr(identity)}" if identity else ""
    path = _path(shape.shape) if isinstance(shape, Area | Lines) else ""
    if isinstance(shape, Area | Lines) and not path:
        return ""
    match shape:
        case Picture(pixels, matrix):
            height, width = pixels.shape[:2]
            parts = " ".join(f"{value:.6g}" for value in np.asarray(matrix).T.ravel())
            return (
                f'<image width="{width}" height="{height}" transform="matrix({parts})" '
                f'preserveAspectRatio="none" style="image-rendering:pixelated" '
                f'xlink:href="{png_uri(pixels)}"/>'
            )
        case Area(_, fill, opacity, title):
            shown = "" if opacity == 1 else f' fill-opacity="{opacity:g}"'
            return (
                f'<path{named} d="{path}" fill="{css_color(fill)}"{shown} fill-rule="evenodd"'
                f"{_end('path', title)}"
            )
        case Lines(_, color, thickness, kind, title):
            return (
                f'<path{named}{_class(kind)} d="{path}" fill="none" stroke="{css_color(color)}" '
                f'stroke-width="{_number(thickness)}" stroke-linejoin="round" stroke-linecap="butt"'
                f"{_end('path', title)}"
            )
        case Dot(x, y, radius, fill, title):
            return (
                f'<circle cx="{_number(x)}" cy="{_number(y)}" r="{_number(radius)}" '
                f'fill="{css_color(fill)}"{_end("circle", title)}'
            )
        case Text():
            return _text(shape)


def _end(tag: str, title: str) -> str:
    """End of an element, with the title that it holds."""
    return f"><title>{escape(title)}</title></{tag}>" if title else "/>"


def _class(kind: str) -> str:
    return f" class={quoteattr(kind)}" if kind else ""


def _text(text: Text) -> str:
    rim = (
        f' stroke="#fff" stroke-width="{_number(text.rim * 2)}" stroke-linejoin="round" paint-order="stroke"'
        if text.rim
        else ""
    )
    return (
        f'<text{_class(text.kind)} x="{_number(text.x)}" y="{_number(text.y + MIDDLE_EM * text.size)}" '
        f'font-size="{_number(text.size)}" fill="{css_color(text.color)}"{rim}'
        f"{'' if text.anchor == 'start' else ' text-anchor=' + quoteattr(text.anchor)}"
        f"{' font-weight=' + quoteattr('bold') if text.is_bold else ''}>{escape(text.text)}</text>"
    )


def _path(shape: BaseGeometry) -> str:
    """Path data of the rings of polygons and of lines."""
    parts = []
    for part in shapely.get_parts(np.array([shape], object)):
        if part.is_empty:
            continue
        if shapely.get_dimensions(part) == 2:
            rings = shapely.get_rings(part)
            parts += [f"M{_points(shapely.get_coordinates(ring)[:-1])}Z" for ring in rings]
        elif shapely.get_dimensions(part) == 1:
            parts.append(f"M{_points(shapely.get_coordinates(part))}")
    return "".join(parts)


def _points(points: NDArray[np.float64]) -> str:
    return "L".join(f"{_number(x)} {_number(y)}" for x, y in points.tolist())


def escape(text: str) -> str:
    """Return a text as it stands between the tags of SVG; what XML cannot hold becomes U+FFFD."""
    return saxutils.escape(_NOT_XML.sub("\ufffd", text))


def quoteattr(text: str) -> str:
    """Return a text as the value of an attribute, with its quotes."""
    return saxutils.quoteattr(_NOT_XML.sub("\ufffd", text))


def _number(value: float) -> str:
    # Adding nothing turns a negative zero into zero.
    return f"{round(value, DECIMALS) + 0.0:.{DECIMALS}f}".rstrip("0").rstrip(".")


def css_color(color: Color) -> str:
    """Return a color as CSS has it."""
    return f"#{color[0]:02x}{color[1]:02x}{color[2]:02x}"
