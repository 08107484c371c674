"""Shapes that grow or shrink with their corners kept."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import shapely

Shapes = TypeVar("Shapes", bound=Any)


def mitred(shapes: Shapes, by_m: float, cap_style: str = "round") -> Shapes:
    """Move the outlines of shapely geometries outwards by a distance, inwards where it is negative.

    The same as ``shapely.buffer``, whose C code at times divides by zero at corners that hardly turn, which
    does no harm and which NumPy would warn the user of.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        moved: Shapes = shapely.buffer(shapes, by_m, cap_style=cap_style, join_style="mitre")
    return moved
