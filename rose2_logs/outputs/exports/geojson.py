"""Floor plans as GeoJSON (RFC 7946), in meters."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.analysis import Walls
from rose2_logs.model.room_plan import RoomPlan, predicted_parts

DECIMALS = 4
"""Decimals of coordinates in meters: a tenth of a millimeter."""
CAVEAT = (
    "x and y are meters in the frame of the robot's map, not longitude and latitude; in programs that expect "
    "degrees, assign an engineering (local) coordinate system"
)


def plan_geojson(plan: RoomPlan, walls: Walls | None = None) -> dict[str, Any]:
    """Return rooms, their unseen parts, doorways and walls as a feature collection.

    The property ``kind`` of each feature is room, predicted, doorway, wall or line. The member ``map_frame``,
    which is not part of the standard, names the frame and says that coordinates are meters. Rings have the
    orientation that the standard requires.

    Parameters
    ----------
    plan : RoomPlan
    walls : Walls, optional
        Adds what the plan does not contain: directions of the walls, and the representative lines with their
        weights.

    Returns
    -------
    dict
        A GeoJSON FeatureCollection, ready for `json.dump`.
    """
    strengths = {border.rooms: border.strength for border in plan.borders}
    features = [
        _feature(
            room.shape,
            f"room/{room.number}",
            kind="room",
            room=room.number,
            name=room.name,
            area_m2=room.area_m2,
            predicted_area_m2=room.predicted_area_m2,
            wall_support=room.wall_support,
            frontier_m=room.frontier_m,
            neighbors=list(room.neighbors),
        )
        for room in plan.rooms
    ]
    features += [
        _feature(part, f"predicted/{number}", kind="predicted", room=number, area_m2=part.area)
        for number, part in predicted_parts(plan).items()
    ]
    features += [
        _feature(
            shapely.LineString(door.ends_m),
            f"doorway/{number}",
            kind="doorway",
            rooms=list(door.rooms),
            width_m=door.width_m,
            strength=strengths.get(door.rooms),
        )
        for number, door in enumerate(plan.doorways, start=1)
    ]
    if walls is not None:
        features += _structure(walls)
    elif plan.walls_m is not None:
        features += [
            _feature(shapely.LineString(ends), f"wall/{number}", kind="wall")
            for number, ends in enumerate(plan.walls_m, start=1)
        ]
    return {
        "type": "FeatureCollection",
        "name": plan.title,
        "map_frame": {"frame_id": plan.frame_id, "unit": "meter", "note": CAVEAT},
        "features": features,
    }


def _structure(walls: Walls) -> list[dict[str, Any]]:
    segments = zip(walls.segments_m.reshape(-1, 2, 2), walls.segment_direction.tolist(), strict=True)
    lines = zip(
        walls.lines_m.reshape(-1, 2, 2),
        walls.line_direction.tolist(),
        walls.line_weight.tolist(),
        strict=True,
    )
    features = [
        _feature(shapely.LineString(ends), f"wall/{number}", kind="wall", direction=direction)
        for number, (ends, direction) in enumerate(segments, start=1)
    ]
    features += [
        _feature(shapely.LineString(ends), f"line/{number}", kind="line", direction=direction, weight=weight)
        for number, (ends, direction, weight) in enumerate(lines, start=1)
    ]
    return features


def _feature(shape: BaseGeometry, identity: str, **properties: Any) -> dict[str, Any]:
    turned = shapely.transform(shapely.orient_polygons(shape), lambda xy: np.round(xy, DECIMALS))
    geometry = None if shape.is_empty else shapely.geometry.mapping(turned)
    return {"type": "Feature", "id": identity, "properties": properties, "geometry": geometry}
