"""What is true about a map of a simulated building, and the files that say so."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rose2_logs.model.occupancy import GridGeometry
from simulation.building import Building

FREE_GRAY, OCCUPIED_GRAY, UNKNOWN_GRAY = 254, 0, 205
"""map_server's convention for map images."""
MIN_ROOM_CELLS = 200
"""Rooms of which a map knows this few cells, or fewer, are not asked for."""


def true_labels(building: Building, cells: NDArray[np.int8], geometry: GridGeometry) -> NDArray[np.uint16]:
    """True rooms of the cells that a map knows as free.

    Parameters
    ----------
    building : Building
        Where the map was made.
    cells : (H, W) int8
        The map: -1 unknown, 0 free, 100 occupied.
    geometry : GridGeometry
        Where it lies; not rotated, its origin a multiple of its resolution, as the simulator's maps are.

    Returns
    -------
    (H, W) uint16
        0 = none, else the room's number in the building; rooms of `MIN_ROOM_CELLS` or fewer are left out.
    """
    whole, origin = building.room_labels(geometry.resolution_m)
    shift = np.rint((np.array(geometry.origin_xy_m) - np.array(origin)) / geometry.resolution_m).astype(int)
    rows, columns = np.arange(cells.shape[0]) + shift[1], np.arange(cells.shape[1]) + shift[0]
    row_in, column_in = ((rows >= 0) & (rows < whole.shape[0])), ((columns >= 0) & (columns < whole.shape[1]))
    labels = np.zeros(cells.shape, np.uint16)
    labels[np.ix_(row_in, column_in)] = whole[np.ix_(rows[row_in], columns[column_in])]
    labels[cells != 0] = 0
    small = np.flatnonzero(np.bincount(labels.ravel()) <= MIN_ROOM_CELLS)
    labels[np.isin(labels, small)] = 0
    return labels


def map_image(cells: NDArray[np.int8]) -> NDArray[np.uint8]:
    """A map as an image (H, W) in map_server's convention, the row of largest y on top."""
    image = np.full(cells.shape, UNKNOWN_GRAY, np.uint8)
    image[cells == 0] = FREE_GRAY
    image[cells > 50] = OCCUPIED_GRAY
    return np.flipud(image)


def write_case(
    directory: Path,
    group: str,
    name: str,
    building: Building,
    cells: NDArray[np.int8],
    geometry: GridGeometry,
) -> dict[str, Any]:
    """Write a map and its true rooms as two images; returns the case's entry in ``cases.json``."""
    labels = true_labels(building, cells, geometry)
    numbers, dense = np.unique(labels, return_inverse=True)
    if numbers[0] != 0:
        dense, numbers = dense + 1, np.concatenate([[0], numbers])
    rooms = dense.reshape(labels.shape).astype(np.uint16)
    (directory / group).mkdir(parents=True, exist_ok=True)
    map_file, rooms_file = f"{group}/{name}.png", f"{group}/{name}.rooms.png"
    Image.fromarray(map_image(cells)).save(directory / map_file, optimize=True)
    Image.fromarray(np.flipud(rooms)).save(directory / rooms_file, optimize=True)
    return {
        "group": group,
        "name": name,
        "map": map_file,
        "rooms": rooms_file,
        "resolution_m": geometry.resolution_m,
        "resolution_note": "simulated",
        "n_rooms": len(numbers) - 1,
        "shape": list(cells.shape),
        "free": int((cells == 0).sum()),
        "occupied": int((cells > 50).sum()),
        "origin_xy_m": list(geometry.origin_xy_m),
        "building": building.name,
        "room_numbers": [int(number) for number in numbers[1:]],
    }


def write_truth(directory: Path, name: str, building: Building, resolution_m: float) -> None:
    """Write the rooms of a whole building: ``<name>.rooms.png`` and ``<name>.rooms.json``."""
    labels, origin = building.room_labels(resolution_m)
    Image.fromarray(np.flipud(labels)).save(directory / f"{name}.rooms.png", optimize=True)
    truth = {
        "building": building.name,
        "frame_id": "map",
        "image": f"{name}.rooms.png",
        "resolution_m": resolution_m,
        "origin_xy_m": _rounded(origin),
        "shape": list(labels.shape),
        "rooms": [
            {
                "label": room.number,
                "name": room.name,
                "area_m2": round(room.polygon.area, 3),
                "outline_m": [_rounded(point) for point in room.polygon.exterior.coords],
                "holes_m": [[_rounded(point) for point in hole.coords] for hole in room.polygon.interiors],
            }
            for room in building.rooms
        ],
        "doorways": [
            {"rooms": list(pair), "outline_m": [_rounded(point) for point in door.exterior.coords]}
            for pair, door in zip(building.doorway_rooms, building.doorways, strict=True)
        ],
    }
    (directory / f"{name}.rooms.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


def _rounded(point: tuple[float, ...]) -> list[float]:
    """Coordinates in meters to the millimeter."""
    return [round(float(value), 3) for value in point]
