"""The floor plan of one map as people and other programs take it: rooms, doorways, walls, and the map."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.borders import Border, unsure_of
from rose2_logs.model.labels import known_window
from rose2_logs.model.mitred import mitred
from rose2_logs.model.occupancy import UNKNOWN, BoolArray, FloatArray, GridGeometry, OccupancySnapshot
from rose2_logs.model.outlines import outline
from rose2_logs.model.room_names import room_name
from rose2_logs.model.room_quality import RoomQuality, is_unsure
from rose2_logs.model.rooms import Doorway

PREDICTED_MIN_WIDTH_M = 0.3
"""Narrower unseen parts of rooms are not drawn or exported: they are walls, whose inside is never seen."""
RAY_WIDTH_M = 0.5
"""Display only: known parts that are narrower, rays that left through a gap, do not enlarge a picture."""
WALL_JOIN_M = 0.1
"""Segments up to twice this far apart are one wall, whose two faces and rows of cells gave several."""
WALL_EDGE_M = 0.025
"""The outline of a wall is this far from its segments, which run along the middles of cells."""
WALL_DETAIL_M = 0.03
"""Steps up to this high in the outline of a wall are straightened: less than a cell."""
ROUNDING_CELLS = 0.25
"""Half the distance that a corner may have from the cell that it is rounded to."""


@dataclass(frozen=True, eq=False)
class PlanRoom:
    """A room.

    Attributes
    ----------
    number : int
        Its track in a run, its number in a single map.
    shape : shapely Polygon or MultiPolygon
        With the predicted part, world meters; may be empty.
    area_m2 : float
        As far as it was seen.
    label_point_m : (float, float) or None
        Point well inside what was seen of the room, None for an empty shape.
    neighbors : tuple of int
        Rooms behind its doorways, ascending.
    wall_support : float or None
        Share of its outline supported by walls, see `RoomQuality`; None where it was not measured.
    frontier_m : float or None
        Its open frontier.
    given_name : str
        Name that it was given, empty for none.
    """

    number: int
    shape: BaseGeometry
    area_m2: float
    label_point_m: tuple[float, float] | None
    neighbors: tuple[int, ...]
    wall_support: float | None = None
    frontier_m: float | None = None
    given_name: str = ""

    @property
    def name(self) -> str:
        """What it is called."""
        return room_name(self.number, self.given_name)

    @property
    def is_unsure(self) -> bool:
        """Whether little of its outline is supported by walls."""
        return is_unsure(self.wall_support)

    @property
    def predicted_area_m2(self) -> float:
        """Area of its shape, the predicted part included."""
        return float(self.shape.area)


@dataclass(frozen=True, eq=False)
class PlanMap:
    """The map that a plan was found in.

    Attributes
    ----------
    geometry : GridGeometry
        Where it lies.
    cells : (H, W) int8
        -1 unknown, 0..100 occupancy in percent; row 0 at the origin.
    labels : (H, W) int32
        Number of the room that a cell belongs to, 0 for none.
    occupancy : OccupancyParameters
        Which cells are free and which occupied.
    """

    geometry: GridGeometry
    cells: NDArray[np.int8]
    labels: NDArray[np.int32]
    occupancy: OccupancyParameters = field(default_factory=OccupancyParameters)

    def cropped(self) -> PlanMap:
        """Return the smallest part that holds all known cells and all rooms."""
        window = known_window((self.cells != UNKNOWN) | (self.labels > 0))
        return replace(
            self, geometry=self.geometry.part(window), cells=self.cells[window], labels=self.labels[window]
        )

    def corners_m(self) -> FloatArray:
        """Corners (4, 2) of the smallest part that holds all rooms and all that is known but for rays."""
        import cv2

        known = (self.cells != UNKNOWN).astype(np.uint8)
        side = max(1, round(RAY_WIDTH_M / self.geometry.resolution_m))
        broad = cv2.morphologyEx(known, cv2.MORPH_OPEN, np.ones((side, side), np.uint8)) > 0
        shown = broad | (self.labels > 0)
        window = known_window(shown if shown.any() else known > 0)
        return self.geometry.part(window).corners_m()


@dataclass(frozen=True, eq=False)
class RoomPlan:
    """A floor plan.

    Attributes
    ----------
    title : str
        What it is of.
    frame_id : str
        The world frame.
    rooms : tuple of PlanRoom
        By ascending number.
    doorways : tuple of Doorway
        Between rooms of these numbers.
    walls_m : (N, 2, 2) float or None
        Ends of the wall segments, None where they are not known.
    map : PlanMap or None
        None where only shapes are known.
    borders : tuple of Border
        Between rooms of these numbers, where they have a strength.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> run = rl.analyze("sample_logs/office.mcap", max_snapshots=3)
    >>> plan = run[-1].plan()
    >>> plan.title, len(plan.rooms), len(plan.doorways)
    ('office, snapshot 2, coverage 100%', 18, 17)
    """

    title: str
    frame_id: str
    rooms: tuple[PlanRoom, ...]
    doorways: tuple[Doorway, ...]
    walls_m: FloatArray | None = None
    map: PlanMap | None = None
    borders: tuple[Border, ...] = ()

    @property
    def unsure_doorways(self) -> tuple[Doorway, ...]:
        """Doorways between rooms that may well be read as one."""
        return unsure_of(self.doorways, self.borders)

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """Least and greatest x and y that the plan takes up, as x0, y0, x1, y1; a square meter if none.

        Rays that leave through windows and doors do not count.
        """
        points = [shapely.get_coordinates([room.shape for room in self.rooms])]
        points += [door.ends_m for door in self.doorways]
        if self.map is not None and (self.map.cells != UNKNOWN).any():
            points.append(self.map.corners_m())
        corners = np.concatenate(points)
        if not len(corners):
            return 0.0, 0.0, 1.0, 1.0
        return (*corners.min(0).tolist(), *corners.max(0).tolist())


def plan_of_analysis(
    snapshot: OccupancySnapshot,
    analysis: SnapshotAnalysis,
    evidence: RoomQuality,
    title: str,
    occupancy: OccupancyParameters,
) -> RoomPlan:
    """Make the plan of a single map, whose rooms are named by their numbers in it."""
    found = analysis.rooms
    rooms = []
    for number, (shape, area, point) in enumerate(
        zip(found.polygons, found.areas_m2.tolist(), found.label_points_m.tolist(), strict=True), start=1
    ):
        share = float(evidence.wall_support[number - 1])
        rooms.append(
            PlanRoom(
                number,
                shape,
                area,
                None if shape.is_empty else (point[0], point[1]),
                found.neighbors(number),
                None if np.isnan(share) else share,
                float(evidence.frontier_m[number - 1]),
            )
        )
    walls = None if analysis.walls is None else analysis.walls.segments_m.reshape(-1, 2, 2)
    below = PlanMap(snapshot.geometry, snapshot.cells, found.labels, occupancy)
    return RoomPlan(
        title, snapshot.geometry.frame_id, tuple(rooms), found.doorways, walls, below, analysis.borders
    )


def wall_outlines(plan: RoomPlan) -> list[shapely.Polygon]:
    """Join the many wall segments that overlap into the outlines of walls.

    Returns
    -------
    list of Polygon
        Walls that meet are one; world meters, by the lowest corner from left to right. Empty where no walls
        are known.
    """
    if plan.walls_m is None or not len(plan.walls_m):
        return []
    lines = shapely.linestrings(plan.walls_m)
    wide = shapely.union_all(mitred(lines, WALL_JOIN_M, cap_style="square"))
    walls = mitred(wide, WALL_EDGE_M - WALL_JOIN_M).simplify(WALL_DETAIL_M)
    return sorted(shapely.get_parts(walls), key=lambda wall: wall.bounds)


def predicted_parts(plan: RoomPlan) -> dict[int, BaseGeometry]:
    """Find what of each room's shape was not seen: its unknown cells, where they are wide enough.

    Returns
    -------
    dict
        Polygons or multipolygons, world meters, by the number of the room; rooms without such a part, and all
        rooms of a plan without a map, are left out.
    """
    if plan.map is None:
        return {}
    below = plan.map.cropped()
    found = {}
    for room in plan.rooms:
        part = _unknown_within(room.shape, below)
        if not part.is_empty:
            found[room.number] = part
    return found


def _unknown_within(shape: BaseGeometry, below: PlanMap) -> BaseGeometry:
    """Outline of the cells within a shape, world meters, that are unknown over some width."""
    import cv2

    geometry = below.geometry
    if shape.is_empty:
        return shapely.Polygon()
    in_cells = shapely.transform(shape, lambda xy: geometry.world_to_grid(xy) / geometry.resolution_m)
    # A little smaller: a cell whose side is on the outline is in or out by its middle, not by rounding.
    in_cells = mitred(in_cells, -ROUNDING_CELLS)
    if in_cells.is_empty:
        return in_cells
    x0, y0, x1, y1 = (int(value) for value in np.round(in_cells.bounds))
    height, width = y1 - y0 + 1, x1 - x0 + 1
    inside = np.zeros((height, width), np.uint8)
    # Corners are between cells; fillPoly counts from their centers.
    rings = [
        np.round(shapely.get_coordinates(ring) - (x0 + 0.5, y0 + 0.5)).astype(np.int32)
        for ring in shapely.get_rings(shapely.get_parts(in_cells))
    ]
    cv2.fillPoly(inside, rings, 1)
    known = np.zeros((height, width), np.bool_)
    rows, columns = below.cells.shape
    top, left = max(y0, 0), max(x0, 0)
    bottom, right = min(y0 + height, rows), min(x0 + width, columns)
    if bottom > top and right > left:
        part = below.cells[top:bottom, left:right] != UNKNOWN
        known[top - y0 : bottom - y0, left - x0 : right - x0] = part
    side = max(1, round(PREDICTED_MIN_WIDTH_M / geometry.resolution_m))
    unseen = _opened(inside.astype(bool) & ~known, side)
    # Without the steps of cells along slanted sides.
    cells = outline(unseen, geometry.resolution_m).simplify(geometry.resolution_m)
    corner = np.array([x0, y0]) * geometry.resolution_m
    return shapely.transform(cells, lambda xy: geometry.grid_to_world(xy + corner))


def _opened(mask: BoolArray, side: int) -> BoolArray:
    """Mask without its parts that are narrower than some cells."""
    import cv2

    square = np.ones((side, side), np.uint8)
    result = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, square, borderValue=0)
    return result.astype(bool)
