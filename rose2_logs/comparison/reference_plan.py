"""Outlines of a floor plan, in a frame of its own, laid over a map as two maps are laid over each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.comparison.placement import PlacedMap, Placement, place, placement_by
from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.model.occupancy import UNKNOWN, GridGeometry, OccupancySnapshot
from rose2_logs.tracking.registration import RigidMotion

MOST_CELLS = 4_000_000
"""Larger plans are drawn with larger cells."""
MARGIN_M = 1.0


def place_outlines(outlines: Sequence[BaseGeometry], below: PlacedMap) -> Placement | None:
    """Find where outlines lie in a map: their rims are taken for walls, what is inside for floor.

    Parameters
    ----------
    outlines : sequence of shapely geometry
        Rooms, meters in any frame.
    below : PlacedMap
        The map.

    Returns
    -------
    Placement or None
        Brings the outlines' frame into the map's; None where there are too few walls.
    """
    drawn = PlacedMap(_drawn(outlines, below.resolution_m), OccupancyParameters(), below.parameters)
    best = place(drawn, below)
    if best is None:
        return None
    # A plan that was drawn over the map is where it belongs; a symmetric building could be turned otherwise.
    as_it_is = placement_by(drawn, below, RigidMotion.none())
    share = below.parameters.comparison.ambiguous_share
    return as_it_is if as_it_is.score >= share * best.score > 0 else best


def _drawn(outlines: Sequence[BaseGeometry], resolution_m: float) -> OccupancySnapshot:
    """Draw outlines as an occupancy map."""
    import cv2

    x0, y0, x1, y1 = shapely.total_bounds(np.array(outlines, object)).tolist()
    width_m, height_m = x1 - x0 + 2 * MARGIN_M, y1 - y0 + 2 * MARGIN_M
    cell_m = max(resolution_m, float(np.sqrt(width_m * height_m / MOST_CELLS)))
    shape = int(height_m / cell_m) + 1, int(width_m / cell_m) + 1
    geometry = GridGeometry(cell_m, (x0 - MARGIN_M, y0 - MARGIN_M), 0.0, "plan", shape)
    free, occupied = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    for outline in outlines:
        for part in shapely.get_parts(outline):
            if shapely.get_dimensions(part) < 2:
                continue
            rings = [
                np.floor(geometry.world_to_grid(shapely.get_coordinates(ring)) / cell_m).astype(np.int32)
                for ring in shapely.get_rings(part)
            ]
            cv2.fillPoly(free, rings, 1)
            cv2.polylines(occupied, rings, isClosed=True, color=1)
    cells = np.full(shape, UNKNOWN, np.int8)
    cells[free > 0], cells[occupied > 0] = 0, 100
    return OccupancySnapshot(0, 0, 0, "plan", cells, geometry)
