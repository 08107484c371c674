"""One snapshot in, its building's structure and rooms out; reads like the paper."""

from __future__ import annotations

from dataclasses import dataclass

from rose2_logs.floor_plan.plan import FloorPlan
from rose2_logs.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.parameters import Parameters
from rose2_logs.rooms import RoomMap
from rose2_logs.rose.structure import Structure
from rose2_logs.walls.walls import Walls

METHODS = ("rose2",)


@dataclass(frozen=True, eq=False)
class SnapshotAnalysis:
    """The paper's output <clean map, lines, faces, floor plan, segmented map> for one snapshot.

    Attributes
    ----------
    index, log_time_ns, stamp_ns : int
        Those of the snapshot.
    geometry : GridGeometry
        Where the map lies in the world.
    free_area_m2 : float
        Area of the known free cells.
    rooms : RoomMap
        The segmented map with the predicted shapes.
    structure, walls, floor_plan
        What the stages found; None from a method that does not have them.
    seconds : dict
        Time per stage.
    """

    index: int
    log_time_ns: int
    stamp_ns: int
    geometry: GridGeometry
    free_area_m2: float
    rooms: RoomMap
    structure: Structure | None
    walls: Walls | None
    floor_plan: FloorPlan | None
    seconds: dict[str, float]


def analyse(snapshot: OccupancySnapshot, parameters: Parameters, method: str = "rose2") -> SnapshotAnalysis:
    """Segment one map into rooms."""
    raise NotImplementedError
