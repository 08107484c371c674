"""What kind of room a room may be, guessed from its shape alone."""

from __future__ import annotations

import math

import shapely
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
    length_m, width_m = _sides_m(_smooth(shape, parameters.detail_m))
    is_long = length_m >= parameters.corridor_min_elongation * width_m
    if is_long and width_m <= parameters.corridor_max_width_m:
        return "corridor"
    if shape.area >= parameters.hall_min_m2:
        return "hall"
    return "closet" if shape.area <= parameters.closet_max_m2 else "room"


def _smooth(shape: BaseGeometry, detail_m: float) -> BaseGeometry:
    """Fill holes and notches of a shape, and take away what juts out, up to twice a detail in width."""
    whole = shapely.union_all([shapely.Polygon(part.exterior) for part in shapely.get_parts(shape)])
    filled = whole.buffer(detail_m, join_style="mitre").buffer(-detail_m, join_style="mitre")
    smooth = filled.buffer(-detail_m, join_style="mitre").buffer(detail_m, join_style="mitre")
    # A shape that is nowhere wider than that stays.
    return smooth.simplify(detail_m) if smooth.area > filled.area / 2 else filled


def _sides_m(shape: BaseGeometry) -> tuple[float, float]:
    """Sides of the rectangle with the area and the perimeter of a shape, or of a square."""
    half = shape.length / 4
    apart = math.sqrt(max(half**2 - shape.area, 0.0))
    side = math.sqrt(shape.area)
    return (half + apart, half - apart) if apart > 0 else (side, side)
