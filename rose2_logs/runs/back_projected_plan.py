"""The floor plan of a map by the layout of the run's last one, from the results of the run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from rose2_logs.errors import LogError
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.model.room_plan import PlanMap, PlanRoom, RoomPlan
from rose2_logs.model.rooms import Doorway, RoomMap
from rose2_logs.runs.folder import RunResults
from rose2_logs.runs.maps import RunMaps
from rose2_logs.tracking.back_projection import BackProjector
from rose2_logs.tracking.registration import RigidMotion


def back_projected_plan(results: RunResults, snapshot: int, maps: RunMaps | None) -> RoomPlan:
    """Find what a map shows of the last map's rooms; their shapes are those of the last map.

    Parameters
    ----------
    results : RunResults
        Of the run; it need not have been back_projected.
    snapshot : int
        Number of the map.
    maps : RunMaps or None
        What `RunResults.open_maps` gave.

    Raises
    ------
    LogError
        If the maps are not there or cannot be read.
    """
    last_number = results.choose()
    last, then = results.plan(last_number, maps), results.plan(snapshot, maps)
    if last.map is None or then.map is None:
        raise LogError(
            f"{results.folder}: smoothing needs the maps, and the annotated MCAP with them is not there; "
            "analyze the log again without annotated_log=False"
        )
    tracks = np.array([room.number for room in last.rooms], np.int32)
    # Rooms of the plan go by their tracks, ascending; the projector counts them.
    counted = np.where(last.map.labels > 0, np.searchsorted(tracks, last.map.labels) + 1, 0).astype(np.int32)
    rooms = RoomMap(
        last.map.geometry,
        counted,
        tuple(room.shape for room in last.rooms),
        np.array([room.area_m2 for room in last.rooms]),
    )
    used = results.parameters("tracking", "occupancy")
    to_last = _drift(results, snapshot).inverse().then(_drift(results, last_number))
    projector = BackProjector(_snapshot(last_number, last.map), rooms, used.tracking, used.occupancy)
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
        )
        for room, area, point in zip(last.rooms, found.areas_m2, points, strict=True)
        if area > 0
    }
    doorways = tuple(
        Doorway(door.rooms, back.points(door.ends_m))
        for door in last.doorways
        if set(door.rooms) <= set(shown)
    )
    below = replace(then.map, labels=np.append(np.int32(0), tracks)[found.labels])
    title = f"{then.title}, rooms of the last map"
    return RoomPlan(title, then.frame_id, tuple(shown.values()), doorways, None, below)


def _drift(results: RunResults, snapshot: int) -> RigidMotion:
    """How the whole map moved from the run's first map to this one."""
    row = results.row(snapshot)
    return RigidMotion((0.0, 0.0), (row["drift_x_m"], row["drift_y_m"]), row["drift_yaw_rad"])


def _snapshot(number: int, below: PlanMap) -> OccupancySnapshot:
    return OccupancySnapshot(number, 0, 0, "", below.cells, below.geometry)
