"""The end of stage D in one call: from labels of cells to rooms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.config.parameters import Parameters
from rose2_logs.model.labels import LabelRuns, number_rooms
from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.floor_plan.stage import FloorPlanResult
from rose2_logs.segmentation.regions.stage import RegionsResult
from rose2_logs.segmentation.rooms.borders import adopt_left_out, settle_borders
from rose2_logs.segmentation.rooms.pieces import rooms_in_one_piece
from rose2_logs.segmentation.rooms.shapes import most_seen_rooms, room_shapes, rooms_of_faces, seen_cells


@dataclass(frozen=True, eq=False)
class RoomsResult:
    """The rooms in the grid frame, meters.

    Attributes
    ----------
    labels : (H, W) int32
        Rooms 1..R of the free cells, by their first cell; 0 for none.
    shapes : list of R shapely geometries
        With the predicted part.
    room_of_face : (F,) int32
        Room of each face, 0 for none.
    """

    labels: NDArray[np.int32]
    shapes: list[BaseGeometry]
    room_of_face: NDArray[np.int32]


def make_rooms(
    labels: NDArray[np.int32],
    plan: FloorPlanResult,
    free: BoolArray,
    occupied: BoolArray,
    resolution_m: float,
    parameters: FloorPlanParameters,
) -> RoomsResult:
    """Make rooms of what splitting left: whole, with straight borders, numbers, and predicted shapes.

    Parameters
    ----------
    labels : (H, W) int32
        Split groups of faces of the free cells, 0 for none.
    plan : FloorPlanResult
        Result of stage C.
    free, occupied : (H, W) bool
        Free and occupied cells.
    resolution_m : float
        Side of a cell.
    parameters : FloorPlanParameters
    """
    whole = adopt_left_out(labels, free, resolution_m, parameters)
    settled = settle_borders(whole, resolution_m, parameters.border_strip_m)
    runs = LabelRuns.of(settled)
    number = number_rooms(runs, int(whole.max(initial=0)), parameters.room_min_area_m2, resolution_m)
    settled = runs.renumbered(number)
    # Faces belong to the rooms whose labels they had before borders settled.
    room_of_face = rooms_of_faces(whole, number, plan)
    cells_of_face = seen_cells(settled, free, plan.face_of_cell, len(room_of_face))
    shapes = room_shapes(
        settled, free, occupied, plan.face_of_cell, cells_of_face, room_of_face, resolution_m, parameters
    )
    return RoomsResult(settled, shapes, room_of_face)


def finish_rooms(
    found: RegionsResult,
    plan: FloorPlanResult,
    free: BoolArray,
    occupied: BoolArray,
    resolution_m: float,
    parameters: Parameters,
) -> tuple[RoomsResult, NDArray[np.int32]]:
    """Finish rooms by fitted borders: in one piece, with straight borders, numbers, and predicted shapes.

    Parameters
    ----------
    found : RegionsResult
        Rooms of the free cells.
    plan : FloorPlanResult
        The faces.
    free, occupied : (H, W) bool
        Free and occupied cells.
    resolution_m : float
        Side of a cell.
    parameters : Parameters

    Returns
    -------
    rooms : RoomsResult
    found_as : (R + 1,) int32
        Number that each room, or what it is a piece of, has in `found`, 0 first.
    """
    of_regions = parameters.regions
    settled = settle_borders(found.labels, resolution_m, parameters.floor_plan.border_strip_m)
    pieces, room_of_piece = rooms_in_one_piece(settled, occupied, resolution_m, of_regions)
    runs = LabelRuns.of(pieces)
    number = number_rooms(runs, len(room_of_piece) - 1, of_regions.room_min_area_m2, resolution_m)
    labels = runs.renumbered(number)
    faces = plan.face_of_cell
    cells_of_face = seen_cells(labels, free, faces, len(plan.graph.polygons))
    room_of_face = most_seen_rooms(cells_of_face)
    shapes = room_shapes(
        labels, free, occupied, faces, cells_of_face, room_of_face, resolution_m, parameters.floor_plan
    )
    found_as = np.zeros(int(number.max(initial=0)) + 1, np.int32)
    found_as[number] = np.where(number > 0, room_of_piece, 0)
    return RoomsResult(labels, shapes, room_of_face), found_as
