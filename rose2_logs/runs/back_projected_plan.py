"""The floor plan of a map by the layout of the run's last one, from the results of the run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.model.room_plan import PlanMap, PlanRoom, RoomPlan
from rose2_logs.model.rooms import Doorway, RoomMap
from rose2_logs.runs.stored_run import StoredRun
from rose2_logs.tracking.back_projection import BackProjector


def back_projected_plan(run: StoredRun, snapshot: int) -> RoomPlan:
    """Find what a map shows of the last map's rooms; their shapes are those of the last map.

    Parameters
    ----------
    run : StoredRun
        It need not have been projected back when it was analyzed.
    snapshot : int
        Number of the map.

    Raises
    ------
    ResultsError
        If a file of the results cannot be read.
    """
    last_number = run.choose()
    last, then = run.plan(last_number), run.plan(snapshot)
    assert last.map is not None and then.map is not None  # noqa: PT018 (plans come with their maps)
    tracks = np.array([room.number for room in last.rooms], np.int32)
    # Rooms of the plan are numbered by their tracks, ascending; the projector counts them.
    counted = np.where(last.map.labels > 0, np.searchsorted(tracks, last.map.labels) + 1, 0).astype(np.int32)
    rooms = RoomMap(
        last.map.geometry,
        counted,
        tuple(room.shape for room in last.rooms),
        np.array([room.area_m2 for room in last.rooms]),
    )
    tracking = run.parameters.tracking
    to_last = run.drift(snapshot).inverse().then(run.drift(last_number))
    projector = BackProjector(_snapshot(last_number, last.map), rooms, tracking, last.map.occupancy)
    found = projector.rooms(_snapshot(snapshot, then.map), to_last)
    back = to_last.inverse()
    points = RoomMap(then.map.geometry, found.labels, rooms.polygons, found.areas_m2).label_points_m.tolist()
    shown = {
        room.number: PlanRoom(
            room.number,
            shapely.transform(room.shape, back.points),
            float(area),
            (point[0], point[1]),
            room.neighbors,
            given_name=room.given_name,
        )
        for room, area, point in zip(last.rooms, found.areas_m2, points, strict=True)
        if area > 0
    }
    doorways = tuple(
        Doorway(door.rooms, back.points(door.ends_m))
        for door in last.doorways
        if set(door.rooms) <= set(shown)
    )
    borders = tuple(border for border in last.borders if set(border.rooms) <= set(shown))
    below = replace(then.map, labels=np.append(np.int32(0), tracks)[found.labels])
    title = f"{then.title}, rooms of the last map"
    return RoomPlan(title, then.frame_id, tuple(shown.values()), doorways, None, below, borders)


def _snapshot(number: int, below: PlanMap) -> OccupancySnapshot:
    return OccupancySnapshot(number, 0, 0, "", below.cells, below.geometry)
