"""A drawing that can be saved, and that notebooks show."""

from __future__ import annotations

from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.drawing import PRINT_WIDTH_PX, WIDEST_PX
from rose2_logs.drawing.image_files import write_image
from rose2_logs.drawing.pixels import as_pixels
from rose2_logs.drawing.shapes import Page
from rose2_logs.drawing.svg import as_svg
from rose2_logs.errors import ParameterError
from rose2_logs.system.files import expanded, replacing, require_local

ENDINGS = (".png", ".svg")


class Drawing(Page):
    """A page with shapes that is shown by notebooks and saved as SVG or PNG.

    Examples
    --------
    >>> from rose2_logs.drawing.shapes import Text
    >>> drawing = Drawing(200, 100, "a greeting")
    >>> drawing.add(Text("hello", 100, 50, 20))
    >>> drawing
    Drawing('a greeting', 200 x 100, 1 shape)
    """

    def svg(self, *, is_inline: bool = False) -> str:
        """Return it as SVG; inline for a place within an HTML page, where it fills the width."""
        return as_svg(self, is_inline=is_inline)

    def pixels(self, width_px: int | None = None) -> NDArray[np.uint8]:
        """Return it as pixels (H, W, 3), RGB; by default one for each unit of the page."""
        return as_pixels(self, round(self.width) if width_px is None else _checked_width(width_px))

    def save(self, path: str | Path, width_px: int | None = PRINT_WIDTH_PX) -> Path:
        """Write it to a file, which replaces an earlier one.

        Parameters
        ----------
        path : str or path
            Its ending, ``.svg`` or ``.png``, says as what.
        width_px : int, optional
            Width of a PNG in pixels; None takes one pixel for each unit of the page.

        Returns
        -------
        path
            The file.

        Raises
        ------
        ParameterError
            If the file is a URL or has another ending, or the width is no number of pixels from 1 to 20,000.
        OutputError
            If it cannot be written.
        """
        path = expanded(Path(path))
        require_local(path)
        kind = path.suffix.lower()
        if kind not in ENDINGS:
            raise ParameterError(f"{path}: a drawing is saved as {' or '.join(ENDINGS)}; let its name end so")
        if width_px is not None:
            _checked_width(width_px)
        if kind == ".png":
            write_image(path, self.pixels(width_px))
        else:
            with replacing(path) as part:
                part.write_text(self.svg(), encoding="utf-8")
        return path

    def _repr_svg_(self) -> str:
        return self.svg(is_inline=True)

    def __repr__(self) -> str:
        many = "" if len(self.shapes) == 1 else "s"
        return (
            f"Drawing({self.title!r}, {self.width:.0f} x {self.height:.0f}, {len(self.shapes)} shape{many})"
        )


def _checked_width(width_px: Any) -> int:
    is_whole = isinstance(width_px, Integral) and width_px is not True
    if not is_whole or not 1 <= width_px <= WIDEST_PX:
        raise ParameterError(
            f"width_px={width_px!r}: it must be a whole number of pixels, 1 to {WIDEST_PX}, or None"
        )
    return int(width_px)
