"""Floor plans as a labeled map that map_server and Nav2 can load: the cell values are the rooms."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.errors import OutputError
from rose2_logs.io.saved_maps import ROOMS_KEY
from rose2_logs.model.occupancy import classify
from rose2_logs.model.room_plan import PlanMap, RoomPlan
from rose2_logs.system.files import replacing

logger = logging.getLogger(__name__)

ROOM_VALUES = 99
"""In an occupancy grid 0 is free and 100 is occupied; the values between are used for rooms."""
FREE, OCCUPIED, UNKNOWN_PIXEL = 0, 100, 255
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
"""Defaults of map_server; required in the file, but without effect in the mode `raw`."""
ENDINGS = (".rooms.pgm", ".rooms.yaml", ".rooms.list.yaml", ".rooms.labels.png")
"""The image, its description for map_server, the list of rooms by value, and the image of room numbers."""


def write_labeled_map(plan: RoomPlan, folder: Path, stem: str) -> tuple[Path, ...]:
    """Write a plan's map with its rooms.

    The description has ``mode: raw``, so that cells load with the values of the image: 0 free, 100 occupied,
    255 unknown, 1 to 99 a room. The list says which room a value stands for, with its name, areas and
    neighbors. If there are more than 99 rooms, they share values; a second image of the same cells therefore
    contains the room numbers themselves, 0 for no room. Our reader of saved maps takes
    rooms as free.

    Returns
    -------
    tuple of Path
        The files, in the order of `ENDINGS`.

    Raises
    ------
    OutputError
        If the plan has no map, or a file cannot be written.
    """
    from PIL import Image

    if plan.map is None:
        raise OutputError(f"{folder / stem}: the plan has no map to label; choose another format")
    values = room_values(plan)
    if len(plan.rooms) > ROOM_VALUES:
        logger.warning(
            "%s: %d rooms share the %d values that a map_server map has for rooms; %s distinguishes them",
            folder / stem,
            len(plan.rooms),
            ROOM_VALUES,
            f"{stem}{ENDINGS[3]}",
        )
    image, about, listing, labels = (folder / f"{stem}{ending}" for ending in ENDINGS)
    pixels = labeled_pixels(plan.map, values)
    with replacing(image) as part:
        Image.fromarray(pixels).save(part, format="PPM")
    geometry = plan.map.geometry
    described = {
        "image": image.name,
        "mode": "raw",
        "resolution": geometry.resolution_m,
        "origin": [*geometry.origin_xy_m, geometry.yaw_rad],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESH,
        "free_thresh": FREE_THRESH,
        ROOMS_KEY: listing.name,
    }
    _write_yaml(about, described)
    _write_yaml(listing, _listing(plan, values, about.name, labels.name))
    numbers = np.where(np.isin(plan.map.labels, list(values)), plan.map.labels, 0)
    write_label_image(labels, np.flipud(numbers))
    return image, about, listing, labels


def room_values(plan: RoomPlan) -> dict[int, int]:
    """Cell value of each room, by room number."""
    return {room.number: 1 + place % ROOM_VALUES for place, room in enumerate(plan.rooms)}


def labeled_pixels(below: PlanMap, values: dict[int, int]) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Pixels (H, W) uint8 of a map and its rooms, row 0 at the top."""
    free, occupied = classify(below.cells, below.occupancy)
    pixels = np.full(below.cells.shape, UNKNOWN_PIXEL, np.uint8)
    pixels[free], pixels[occupied] = FREE, OCCUPIED
    of_room = np.zeros(int(below.labels.max(initial=0)) + 1, np.uint8)
    for number, value in values.items():
        if number < len(of_room):
            of_room[number] = value
    labeled = of_room[below.labels]
    return np.flipud(np.where(labeled > 0, labeled, pixels)).copy()


def _listing(plan: RoomPlan, values: dict[int, int], map_name: str, labels_name: str) -> dict[str, Any]:
    rooms = [
        {
            "value": values[room.number],
            "room": room.number,
            "name": room.name,
            "area_m2": round(room.area_m2, 4),
            "predicted_area_m2": round(room.predicted_area_m2, 4),
            "wall_support": None if room.wall_support is None else round(room.wall_support, 4),
            "center_m": None
            if room.label_point_m is None
            else [round(value, 4) for value in room.label_point_m],
            "neighbors": list(room.neighbors),
        }
        for room in plan.rooms
    ]
    doorways = [
        {
            "rooms": list(door.rooms),
            "width_m": round(door.width_m, 4),
            "ends_m": np.round(door.ends_m, 4).tolist(),
        }
        for door in plan.doorways
    ]
    return {
        "map": map_name,
        "labels": labels_name,
        "frame_id": plan.frame_id,
        "rooms": rooms,
        "doorways": doorways,
    }


def _write_yaml(path: Path, content: dict[str, Any]) -> None:
    with replacing(path) as part:
        part.write_text(yaml.safe_dump(content, sort_keys=False, allow_unicode=True), encoding="utf-8")
