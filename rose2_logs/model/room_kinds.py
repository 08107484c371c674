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
        One of `KINDS`; empty for a shape without area.

    Examples
    --------
    >>> import shapely
    >>> guess_kind(shapely.box(0, 0, 20, 2), KindParameters())
    'corridor'
    """
    if shape.area == 0:
        return ""
    if not _is_compact(shape, parameters.corridor_min_elongation) and _is_corridor(shape, parameters):
        return "corridor"
    if shape.area >= parameters.hall_min_m2:
        return "hall"
    return "closet" if shape.area <= parameters.closet_max_m2 else "room"


def _is_compact(shape: BaseGeometry, elongation: float) -> bool:
    """Whether a shape has more area for its perimeter than any that is so elongated, as most rooms have.

    An area A around a largest circle of width w has a perimeter of at least 2 A / w + pi w / 2 (Bonnesen).
    """
    least = (2 * elongation + math.pi / 2) ** 2 / elongation
    return bool(shape.length**2 < least * shape.area)


def _is_corridor(shape: BaseGeometry, parameters: KindParameters) -> bool:
    filled = _filled(shape, parameters)
    if _is_compact(filled, parameters.corridor_min_elongation):
        return False
    smooth = _cut_back(filled, parameters.detail_m)
    width_m = 2 * shapely.maximum_inscribed_circle(smooth, tolerance=parameters.detail_m / 10).length
    is_long = smooth.area >= parameters.corridor_min_elongation * width_m**2
    return bool(is_long and parameters.corridor_min_width_m <= width_m <= parameters.corridor_max_width_m)


def _filled(shape: BaseGeometry, parameters: KindParameters) -> BaseGeometry:
    """Fill furniture, pillars and notches, up to twice a detail in width.

    Of a shape in many pieces, specks that are smaller than a detail do not count.
    """
    detail_m = parameters.detail_m
    parts = shapely.get_parts(shape)
    areas = shapely.area(parts)
    large = parts[areas >= min(detail_m**2, areas.max())]
    for number in shapely.get_num_interior_rings(large).nonzero()[0]:
        large[number] = _without_islands(large[number], parameters.island_max_m2)
    grown = shapely.union_all(large).buffer(detail_m, join_style="mitre")
    return grown.buffer(-detail_m, join_style="mitre")


def _without_islands(part: shapely.Polygon, most_m2: float) -> shapely.Polygon:
    """Fill the small holes of a polygon."""
    holes = [hole for hole in part.interiors if shapely.Polygon(hole).area > most_m2]
    return shapely.Polygon(part.exterior, holes)


def _cut_back(filled: BaseGeometry, detail_m: float) -> BaseGeometry:
    """Take away what juts out, up to twice a detail in width; a shape that is nowhere wider stays."""
    smooth = filled.buffer(-detail_m, join_style="mitre").buffer(detail_m, join_style="mitre")
    return smooth.simplify(detail_m) if smooth.area > filled.area / 2 else filled
