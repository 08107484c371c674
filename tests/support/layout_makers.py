"""Final layouts made from maps as a run would have left them, and their changes."""

from __future__ import annotations

import dataclasses

import numpy as np
from drawn_maps import MARGIN_M, SIZE_M, office, snapshot

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.comparison.placement import PlacedMap
from rose2_logs.config.parameters import Parameters
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.segmentation.pipeline import analyze

RESOLUTION_M = 0.05
ROOM_1, ROOM_2, CORRIDOR = (2.5, 4.0), (7.5, 4.0), (5.0, 1.0)
"""A point in each room of the drawn office, in the office's own coordinates."""


def layout_of(map_: OccupancySnapshot, method: str = "rose2") -> FinalLayout:
    """The layout that a run with this last map ends with; rooms are numbered as in the map."""
    analysis = analyze(map_, Parameters(), method)
    tracks = tuple(range(1, len(analysis.rooms) + 1))
    placed = PlacedMap(map_, Parameters().occupancy)
    return FinalLayout(
        "run", placed, tracks, analysis.rooms.polygons, analysis.rooms.areas_m2, analysis.walls
    )


def drawn_office() -> OccupancySnapshot:
    """The drawn office as a map whose frame is the office's own: its lower left corner is 0, 0."""
    cells, _ = office()
    diagonal = float(np.hypot(*SIZE_M)) + 2 * MARGIN_M
    x, y = (np.array(SIZE_M) / 2 - diagonal / 2).tolist()
    return snapshot(cells, RESOLUTION_M, (x, y))


def painted(
    map_: OccupancySnapshot, box_m: tuple[float, float, float, float], value: int
) -> OccupancySnapshot:
    """The map with all cells of a box x0, y0, x1, y1 set to a value."""
    cells = map_.cells.copy()
    (row0, column0), (row1, column1) = (
        map_.geometry.world_to_cell(np.array(corner)).tolist() for corner in (box_m[:2], box_m[2:])
    )
    cells[row0:row1, column0:column1] = value
    return dataclasses.replace(map_, cells=cells)


def room_at(layout: FinalLayout, point_m: tuple[float, float]) -> int:
    """Number of the room that holds a point."""
    import shapely

    (number,) = (
        track
        for track, shape in zip(layout.tracks, layout.shapes, strict=True)
        if shapely.contains_xy(shape, *point_m)
    )
    return number
