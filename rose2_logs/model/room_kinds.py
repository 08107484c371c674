"""What kind of room a room may be, guessed from its shape alone."""

from __future__ import annotations

import math

from shapely.geometry.base import BaseGeometry

from rose2_logs.config.kinds import KindParameters


def guess_kind(shape: BaseGeometry, parameters: KindParameters) -> str:
    """Guess the kind of a room: a plain rule, no more.

    Parameters
    ----------
    shape : shapely Polygon or MultiPolygon
        With the predicted part, meters.
    parameters : KindParameters

    Returns
    -------
    str
        One of `KINDS`; empty for an empty shape.

    Examples
    --------
    >>> import shapely
    >>> guess_kind(shapely.box(0, 0, 20, 2), KindParameters())
    'corridor'
    """
    if shape.is_empty:
        return ""
    length_m, width_m = _sides_m(shape.simplify(parameters.detail_m))
    is_long = length_m >= parameters.corridor_min_elongation * width_m
    if is_long and width_m <= parameters.corridor_max_width_m:
        return "corridor"
    if shape.area >= parameters.hall_min_m2:
        return "hall"
    return "closet" if shape.area <= parameters.closet_max_m2 else "room"


def _sides_m(shape: BaseGeometry) -> tuple[float, float]:
    """Sides of the rectangle with the area and the perimeter of a shape, or of a square."""
    half = shape.length / 4
    apart = math.sqrt(max(half**2 - shape.area, 0.0))
    side = math.sqrt(shape.area)
    return (half + apart, half - apart) if apart > 0 else (side, side)
