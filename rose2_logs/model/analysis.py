"""What the analysis of one map gives: structure, walls, floor plan, rooms."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.borders import Border, unsure_of
from rose2_logs.model.occupancy import BoolArray, CellValues, FloatArray, GridGeometry, OccupancySnapshot
from rose2_logs.model.room_quality import RoomQuality
from rose2_logs.model.rooms import Doorway, RoomMap
from rose2_logs.system.text import counted, percent

LEFT_OUT_TOLD = 0.1
"""From this share of the free area on it is told that floor was left out as outside; less is the rays and the
white around a building that are on most maps."""


@dataclass(frozen=True, eq=False)
class Structure:
    """The regular structure of one map (paper, section III-A).

    Attributes
    ----------
    directions_rad : (D,) float
        Directions of walls in [0, pi), world frame, strongest first.
    strengths : (D,) float
        Share of the spectrum's energy that each direction holds.
    threshold : float
        Cells with at least this score make the clean map.
    scores, clean_cells : CellValues
        What `score` and `clean` hold, of the occupied cells alone.
    spectrum : (S, S) uint8
        Picture of the spectrum in the grid's frame, see `rose.spectrum.spectrum_picture`.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> with rl.open_log("sample_logs/office.mcap") as reader:
    ...     found = rl.segment(reader.last())
    >>> found.structure
    Structure(directions of 1.0, 90.4 degrees, threshold=...)
    """

    directions_rad: FloatArray
    strengths: FloatArray
    threshold: float
    scores: CellValues[np.float32]
    clean_cells: CellValues[np.bool_]
    spectrum: NDArray[np.uint8]

    def __repr__(self) -> str:
        degrees = ", ".join(f"{angle:.1f}" for angle in np.degrees(self.directions_rad))
        return f"Structure(directions of {degrees} degrees, threshold={self.threshold:.2f})"

    @property
    def score(self) -> NDArray[np.float32]:
        """Structure score (H, W) of each occupied cell in [0, 1]; 0 elsewhere."""
        return self.scores.whole()

    @property
    def clean(self) -> BoolArray:
        """The clean map (H, W): occupied cells that belong to the structure."""
        return self.clean_cells.whole()


@dataclass(frozen=True, eq=False)
class Walls:
    """The walls of one map (paper, section III-B). All lengths in meters, world frame.

    Attributes
    ----------
    segments_m : (N, 4) float
        Line segments x0, y0, x1, y1.
    segment_direction : (N,) int
        Index of each segment's direction: of a dominant one into `Structure.directions_rad`; from their
        number on, of a local one, which is not kept: segments of one index are parallel.
    segment_cluster : (N,) int
        Index of each segment's wall cluster, which is that of its representative line; -1 for none.
    lines_m : (L, 4) float
        Representative lines x0, y0, x1, y1 as far as they divide the map.
    line_direction : (L,) int
        Index of each line's direction, as of the segments.
    line_weight : (L,) float
        Share of each line that walls cover, in [0, 1].

    Examples
    --------
    >>> import rose2_logs as rl
    >>> with rl.open_log("sample_logs/office.mcap") as reader:
    ...     found = rl.segment(reader.last())
    >>> found.walls
    Walls(... segments, ... lines)
    """

    segments_m: FloatArray
    segment_direction: NDArray[np.int32]
    segment_cluster: NDArray[np.int32]
    lines_m: FloatArray
    line_direction: NDArray[np.int32]
    line_weight: FloatArray

    def __repr__(self) -> str:
        return f"Walls({counted(len(self.segments_m), 'segment')}, {counted(len(self.lines_m), 'line')})"


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """The plane cut into faces by the representative lines (paper, section III-C). World meters.

    Attributes
    ----------
    edges_m : (E, 4) float
        Edges x0, y0, x1, y1.
    edge_weight : (E,) float
        Share of each edge that walls cover, in [0, 1].
    edge_faces : (E, 2) int
        The faces at both sides of each edge; -1 where there is none.
    faces_wkb : tuple of F bytes
        The faces as WKB, which goes to another process and to the disk many times faster than shapes.
    face_inside : (F,) bool
        Faces that belong to the building as far as it was seen.
    room_of_face : (F,) int
        Room number 1..R of each face, 0 for none.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> with rl.open_log("sample_logs/office.mcap") as reader:
    ...     found = rl.segment(reader.last())
    >>> found.floor_plan
    FloorPlan(... faces, ... edges)
    """

    edges_m: FloatArray
    edge_weight: FloatArray
    edge_faces: NDArray[np.int32]
    faces_wkb: tuple[bytes, ...]
    face_inside: NDArray[np.bool_]
    room_of_face: NDArray[np.int32]

    def __repr__(self) -> str:
        return f"FloorPlan({counted(len(self.faces_wkb), 'face')}, {counted(len(self.edges_m), 'edge')})"

    @property
    def faces(self) -> tuple[Polygon, ...]:
        """The faces (F,) as shapes."""
        return tuple(shapely.from_wkb(self.faces_wkb))


@dataclass(frozen=True, eq=False)
class SnapshotAnalysis:
    """The paper's output <clean map, lines, faces, floor plan, segmented map> for one snapshot.

    Attributes
    ----------
    index, log_time_ns, stamp_ns : int
        Those of the snapshot.
    geometry : GridGeometry
        Position of the map in the world.
    free_area_m2 : float
        Area of the known free cells.
    resolution_m : float
        Side of the cells that the map was analyzed in: its own, or of blocks where that is finer than needed
        or the map is large.
    rooms : RoomMap
        The segmented map with the predicted shapes.
    structure, walls, floor_plan
        What the stages found; None from a method that does not have them.
    quality : RoomQuality
        How sure the rooms are.
    seconds : dict
        Time per stage.
    voronoi_m : (V, 4) float or None
        Lines x0, y0, x1, y1 of the free space's Voronoi graph, world meters, if it was requested.
    borders : tuple of Border
        What parts neighboring rooms, from the fitted grouping.
    outside_m2 : float
        Free area that the fitted grouping left out as outside the building.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> with rl.open_log("sample_logs/office.mcap") as reader:
    ...     found = rl.segment(reader.last())
    >>> found.labels.shape, int(found.labels.max()), len(found.polygons)
    ((512, 704), 18, 18)
    """

    index: int
    log_time_ns: int
    stamp_ns: int
    geometry: GridGeometry
    free_area_m2: float
    resolution_m: float
    rooms: RoomMap
    structure: Structure | None
    walls: Walls | None
    floor_plan: FloorPlan | None
    quality: RoomQuality
    seconds: dict[str, float]
    voronoi_m: FloatArray | None = None
    borders: tuple[Border, ...] = ()
    outside_m2: float = 0.0

    def __repr__(self) -> str:
        parts = [f"index={self.index}", repr(self.rooms)]
        if self.walls is not None:
            parts.append(counted(len(self.walls.segments_m), "wall segment"))
        if self.floor_plan is not None:
            parts.append(counted(len(self.floor_plan.faces_wkb), "face"))
        return f"{type(self).__name__}({', '.join(parts)})"

    @property
    def labels(self) -> NDArray[np.int32]:
        """Rooms (H, W) of the cells: 0 = no room, 1..R."""
        return self.rooms.labels

    @property
    def polygons(self) -> tuple[BaseGeometry, ...]:
        """Shape of each room with its predicted part, world meters."""
        return self.rooms.polygons

    @property
    def areas_m2(self) -> FloatArray:
        """Area (R,) of the labeled cells of each room."""
        return self.rooms.areas_m2

    @property
    def doorways(self) -> tuple[Doorway, ...]:
        """Passages between rooms."""
        return self.rooms.doorways

    @property
    def unsure_doorways(self) -> tuple[Doorway, ...]:
        """Doorways between rooms that may well be read as one."""
        return unsure_of(self.rooms.doorways, self.borders)

    def again_for(self, snapshot: OccupancySnapshot) -> SnapshotAnalysis:
        """Return the same for another snapshot of the same free and occupied cells at the same place."""
        return replace(
            self,
            index=snapshot.index,
            log_time_ns=snapshot.log_time_ns,
            stamp_ns=snapshot.stamp_ns,
            seconds=dict.fromkeys(self.seconds, 0.0),
        )


def left_out_note(outside_m2: float, free_area_m2: float) -> str | None:
    """Say that much of a map's free floor was left out as outside the building; None if it was not."""
    if outside_m2 < LEFT_OUT_TOLD * free_area_m2 or not outside_m2:
        return None
    return (
        f"{outside_m2:.0f} m2 of free floor, {percent(outside_m2 / free_area_m2)}, are taken to be outside "
        "the building and in no room; regions.outside_max_share=0 and regions.surroundings_min_edge=1 keep "
        "all of it"
    )
