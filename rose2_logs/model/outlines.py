"""Outlines of cells as shapes."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import find_objects
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.occupancy import BoolArray, FloatArray


def outline(mask: BoolArray, resolution_m: float) -> BaseGeometry:
    """Outline of the cells of a mask as a polygon or multipolygon in the grid frame, meters."""
    padded = np.pad(mask, 1).astype(np.uint8)
    rows = np.diff(padded.astype(np.int8), axis=1)
    row, start = np.nonzero(rows == 1)
    _, end = np.nonzero(rows == -1)
    boxes = shapely.box(start, row - 1, end, row)
    return shapely.transform(shapely.union_all(boxes), lambda points: points * resolution_m)


def room_outlines(labels: NDArray[np.int32], resolution_m: float) -> list[BaseGeometry]:
    """Outlines of the cells of rooms 1.. in the grid frame, meters; empty for numbers without cells."""
    shapes: list[BaseGeometry] = []
    for room, window in enumerate(find_objects(labels), start=1):
        if window is None:
            shapes.append(shapely.Polygon())
            continue
        shape = outline(labels[window] == room, resolution_m)
        corner = window[1].start * resolution_m, window[0].start * resolution_m
        shapes.append(translate(shape, *corner))
    return shapes


def outer_rings(shape: BaseGeometry) -> list[FloatArray]:
    """Closed outer rings (K, 2) of the polygons of a shape, world meters."""
    parts = shapely.get_parts(shape)
    rings = shapely.get_exterior_ring(parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON])
    points, ring = shapely.get_coordinates(rings, return_index=True)
    return np.split(points, np.flatnonzero(np.diff(ring)) + 1) if len(points) else []
