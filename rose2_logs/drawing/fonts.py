"""The font of pictures, and how long its texts are."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont, ImageFont

SPARE = 1.1
"""Fonts of browsers and drawing programs are up to so many times wider than that of the pixels."""
MEASURED_PX = 40.0
"""Size at which lengths are measured; they grow with the size."""


@lru_cache(maxsize=64)
def font_of(size: float) -> FreeTypeFont | ImageFont:
    """Return the font that pixels are written with."""
    from PIL import ImageFont

    return ImageFont.load_default(size)


def text_width(text: str, size: float) -> float:
    """Return how wide a text may be, in the unit of its size."""
    return float(font_of(MEASURED_PX).getlength(text)) / MEASURED_PX * size * SPARE
