"""Floor plans as GeoJSON (RFC 7946), in meters."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.svg import css_color
from rose2_logs.model.analysis import Walls
from rose2_logs.model.room_plan import RoomPlan, predicted_parts, wall_outlines

DECIMALS = 4
"""Decimals of coordinates in meters: a tenth of a millimeter."""
CAVEAT = "x and y are meters in the frame of the robot's map, not longitude and latitude"
LOCAL_CRS = (
    'ENGCRS["{0}",EDATUM["{0}"],CS[Cartesian,2],AXIS["x",east,ORDER[1]],AXIS["y",north,ORDER[2]],'
    'LENGTHUNIT["metre",1]]'
)
"""A coordinate system that is nowhere on Earth, as well-known text with the name of the frame."""
Feature = dict[str, Any]


def plan_geojson(plan: RoomPlan, walls: Walls | None = None) -> dict[str, Any]:
    """Return rooms, their unseen parts, doorways and walls as a feature collection.

    The property ``kind`` of each feature is room, predicted, doorway, wall or line. The members ``map_frame``
    and ``crs``, which are not part of the standard, name the frame and say that coordinates are meters, the
    latter in the way that GDAL understands. Rings have the orientation that the standard requires.

    Parameters
    ----------
    plan : RoomPlan
    walls : Walls, optional
        Writes walls as their segments with directions, and the representative lines with their weights;
        without it walls are outlines.

    Returns
    -------
    dict
        A GeoJSON FeatureCollection, ready for `json.dump`.
    """
    features = plan_features(plan)
    if walls is not None:
        features |= _structure(walls)
    return feature_collection(plan, plan.title, [each for kind in features.values() for each in kind])


def feature_collection(plan: RoomPlan, name: str, features: list[Feature]) -> dict[str, Any]:
    """Return features as a collection in the frame of a plan."""
    frame = plan.frame_id.replace('"', '""')
    return {
        "type": "FeatureCollection",
        "name": name,
        "map_frame": {"frame_id": plan.frame_id, "unit": "meter", "note": CAVEAT},
        "crs": {"type": "name", "properties": {"name": LOCAL_CRS.format(frame)}},
        "features": features,
    }


def plan_features(plan: RoomPlan) -> dict[str, list[Feature]]:
    """Return the features of a plan by their kind: room, predicted, doorway, wall."""
    colors = {room.number: css_color(track_color(room.number)) for room in plan.rooms}
    strengths = {border.rooms: border.strength for border in plan.borders}
    rooms = [
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
            color=colors[room.number],
        )
        for room in plan.rooms
    ]
    predicted = [
        _feature(
            part,
            f"predicted/{number}",
            kind="predicted",
            room=number,
            area_m2=part.area,
            color=colors[number],
        )
        for number, part in predicted_parts(plan).items()
    ]
    doorways = [
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
    walls = [
        _feature(outline, f"wall/{number}", kind="wall")
        for number, outline in enumerate(wall_outlines(plan), start=1)
    ]
    return {"room": rooms, "predicted": predicted, "doorway": doorways, "wall": walls}


def _structure(walls: Walls) -> dict[str, list[Feature]]:
    segments = zip(walls.segments_m.reshape(-1, 2, 2), walls.segment_direction.tolist(), strict=True)
    lines = zip(
        walls.lines_m.reshape(-1, 2, 2),
        walls.line_direction.tolist(),
        walls.line_weight.tolist(),
        strict=True,
    )
    walls_found = [
        _feature(shapely.LineString(ends), f"wall/{number}", kind="wall", direction=direction)
        for number, (ends, direction) in enumerate(segments, start=1)
    ]
    lines_found = [
        _feature(shapely.LineString(ends), f"line/{number}", kind="line", direction=direction, weight=weight)
        for number, (ends, direction, weight) in enumerate(lines, start=1)
    ]
    return {"wall": walls_found, "line": lines_found}


def _feature(shape: BaseGeometry, identity: str, **properties: Any) -> Feature:
    turned = shapely.transform(shapely.orient_polygons(shape), lambda xy: np.round(xy, DECIMALS))
    geometry = None if shape.is_empty else shapely.geometry.mapping(turned)
    return {"type": "Feature", "id": identity, "properties": properties, "geometry": geometry}
