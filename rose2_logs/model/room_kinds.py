"""What kind of room a room may be, guessed from its shape alone."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.kinds import KindParameters
from rose2_logs.model.mitred import mitred
from rose2_logs.model.occupancy import BoolArray

Shapes = NDArray[np.object_]
"""Polygons or MultiPolygons (N,), meters. All rooms of a map go through GEOS together: one by one, the calls
take longer than what they do."""


def guess_kinds(shapes: Sequence[BaseGeometry], parameters: KindParameters) -> list[str]:
    """Guess the kinds of rooms: a plain rule, no more.

    Parameters
    ----------
    shapes : sequence of N shapely Polygon or MultiPolygon
        With the predicted parts, meters.
    parameters : KindParameters

    Returns
    -------
    list of N str
        One of `KINDS` each; empty for a shape without area.

    Examples
    --------
    >>> import shapely
    >>> guess_kinds([shapely.box(0, 0, 20, 2), shapely.box(0, 0, 5, 4)], KindParameters())
    ['corridor', 'room']
    """
    rooms = np.array(shapes, object)
    area_m2 = shapely.area(rooms)
    kinds = np.full(len(rooms), "room", object)
    kinds[area_m2 <= parameters.closet_max_m2] = "closet"
    kinds[area_m2 >= parameters.hall_min_m2] = "hall"
    elongated = np.flatnonzero((area_m2 > 0) & ~_are_compact(rooms, parameters.corridor_min_elongation))
    kinds[elongated[_are_corridors(rooms[elongated], parameters)]] = "corridor"
    kinds[area_m2 == 0] = ""
    found: list[str] = kinds.tolist()
    return found


def _are_compact(shapes: Shapes, elongation: float) -> BoolArray:
    """Whether shapes have more area for their perimeter than any that is so elongated, as most rooms have.

    An area A around a largest circle of width w has a perimeter of at least 2 A / w + pi w / 2 (Bonnesen).
    """
    least = (2 * elongation + math.pi / 2) ** 2 / elongation
    are_compact: BoolArray = shapely.length(shapes) ** 2 < least * shapely.area(shapes)
    return are_compact


def _are_corridors(shapes: Shapes, parameters: KindParameters) -> BoolArray:
    filled = _filled(shapes, parameters)
    # What grew from slivers that cross themselves may shrink to nothing.
    are_corridors: BoolArray = ~shapely.is_empty(filled)
    are_corridors &= ~_are_compact(filled, parameters.corridor_min_elongation)
    smooth = _cut_back(filled[are_corridors], parameters.detail_m)
    circles = shapely.maximum_inscribed_circle(smooth, tolerance=parameters.detail_m / 10)
    width_m = 2 * shapely.length(circles)
    are_long = shapely.area(smooth) >= parameters.corridor_min_elongation * width_m**2
    are_wide = (width_m >= parameters.corridor_min_width_m) & (width_m <= parameters.corridor_max_width_m)
    are_corridors[are_corridors] = are_long & are_wide
    return are_corridors


def _filled(shapes: Shapes, parameters: KindParameters) -> Shapes:
    """Fill furniture, pillars and notches, up to twice a detail in width.

    Of a shape in many pieces, specks that are smaller than a detail do not count.
    """
    detail_m = parameters.detail_m
    parts, shape = shapely.get_parts(shapes, return_index=True)
    area_m2, largest_m2 = shapely.area(parts), np.zeros(len(shapes))
    np.maximum.at(largest_m2, shape, area_m2)
    is_large = area_m2 >= np.minimum(detail_m**2, largest_m2)[shape]
    parts, shape = parts[is_large], shape[is_large]
    for number in shapely.get_num_interior_rings(parts).nonzero()[0]:
        parts[number] = _without_islands(parts[number], parameters.island_max_m2)
    pieces = np.full((len(shapes), np.bincount(shape).max(initial=0)), None)
    pieces[shape, np.arange(len(shape)) - np.searchsorted(shape, shape)] = parts
    return mitred(mitred(shapely.union_all(pieces, axis=1), detail_m), -detail_m)


def _without_islands(part: shapely.Polygon, most_m2: float) -> shapely.Polygon:
    """Fill the small holes of a polygon."""
    holes = [hole for hole in part.interiors if shapely.Polygon(hole).area > most_m2]
    return shapely.Polygon(part.exterior, holes)


def _cut_back(filled: Shapes, detail_m: float) -> Shapes:
    """Take away what juts out, up to twice a detail in width; shapes that are nowhere wider stay."""
    smooth = mitred(mitred(filled, -detail_m), detail_m)
    are_wider = shapely.area(smooth) > shapely.area(filled) / 2
    return np.where(are_wider, shapely.simplify(smooth, detail_m), filled)
