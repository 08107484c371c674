"""A picture of one map: as it was recorded, beside (or above) it with what was found."""

from __future__ import annotations

import colorsys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.occupancy import FloatArray, OccupancySnapshot

Image = NDArray[np.uint8]

SIDE_MIN_PX = 700
"""The longer side of a map is drawn at least this long, so that labels can be read on small maps."""
ROOM_OPACITY = 0.55
GOLDEN_RATIO = 0.618034
"""Hues that are this share of the circle apart stay well apart for any number of rooms."""
WIDE = 1.5
"""Width over height from which a map is drawn above its rooms and not beside them."""
MARGIN_CELLS = 10
UNKNOWN_GRAY, FREE_GRAY, OCCUPIED_GRAY = 205, 254, 0
WALL_COLOR, OUTLINE_COLOR, DOOR_COLOR = (200, 30, 30), (40, 40, 40), (20, 120, 220)


def room_colors(count: int) -> NDArray[np.uint8]:
    """Colors (count, 3) RGB, far apart for neighboring numbers, the same for each call."""
    hues = [(number * GOLDEN_RATIO) % 1.0 for number in range(1, count + 1)]
    rgb = [colorsys.hsv_to_rgb(hue, 0.6, 0.95) for hue in hues]
    return np.array(np.round(np.reshape(rgb, (-1, 3)) * 255.0), np.uint8)


def draw_rooms(snapshot: OccupancySnapshot, analysis: SnapshotAnalysis) -> Image:
    """Draw a map, and beside or below it the same with rooms, walls, doorways and predicted outlines.

    Returns
    -------
    (H', W', 3) uint8
        RGB, cropped to the known cells, row 0 at the top as in the world.
    """
    import cv2
    import shapely

    rooms = analysis.rooms
    known = (snapshot.cells >= 0) | (rooms.labels > 0)
    rows, columns = _window(known)
    gray = np.where(snapshot.cells < 0, UNKNOWN_GRAY, FREE_GRAY - np.round(snapshot.cells * 2.54))
    plain = np.repeat(gray[rows, columns].astype(np.uint8)[..., None], 3, axis=2)
    labels = rooms.labels[rows, columns]
    colors = np.concatenate([np.zeros((1, 3), np.uint8), room_colors(len(rooms))])
    filled = plain.copy()
    blend = (1 - ROOM_OPACITY) * plain + ROOM_OPACITY * colors[labels]
    filled[labels > 0] = blend[labels > 0].astype(np.uint8)

    scale = max(1, int(np.ceil(SIDE_MIN_PX / max(labels.shape))))
    plain, filled = (np.kron(image[::-1], np.ones((scale, scale, 1), np.uint8)) for image in (plain, filled))
    filled = np.ascontiguousarray(filled)

    def to_pixels(xy_m: FloatArray) -> NDArray[np.int32]:
        cells = analysis.geometry.world_to_grid(xy_m) / analysis.geometry.resolution_m
        cells = cells - (columns.start, rows.start)
        return np.round(np.column_stack([cells[:, 0], labels.shape[0] - cells[:, 1]]) * scale).astype(
            np.int32
        )

    for polygon in rooms.polygons:
        rings = [to_pixels(shapely.get_coordinates(ring)) for ring in shapely.get_rings(polygon)]
        cv2.polylines(filled, rings, True, OUTLINE_COLOR, 1, cv2.LINE_AA)
    if analysis.walls is not None:
        lines = to_pixels(analysis.walls.segments_m.reshape(-1, 2)).reshape(-1, 2, 2)
        cv2.polylines(filled, list(lines), False, WALL_COLOR, 1, cv2.LINE_AA)
    for doorway in rooms.doorways:
        cv2.polylines(filled, [to_pixels(doorway.ends_m)], False, DOOR_COLOR, 3, cv2.LINE_AA)
    for number, polygon in enumerate(rooms.polygons, start=1):
        if not polygon.is_empty:
            _write_number(filled, str(number), polygon.representative_point().coords[0], to_pixels)
    if filled.shape[1] > WIDE * filled.shape[0]:
        gap = np.full((MARGIN_CELLS, filled.shape[1], 3), 255, np.uint8)
        return np.concatenate([plain, gap, filled], axis=0)
    gap = np.full((filled.shape[0], MARGIN_CELLS, 3), 255, np.uint8)
    return np.concatenate([plain, gap, filled], axis=1)


def _write_number(
    image: Image,
    text: str,
    place_m: tuple[float, ...],
    to_pixels: Callable[[FloatArray], NDArray[np.int32]],
) -> None:
    import cv2

    x, y = to_pixels(np.array([place_m[:2]]))[0].tolist()
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
    where = (x - width // 2, y + height // 2)
    for color, thickness in (((255, 255, 255), 3), ((0, 0, 0), 1)):
        cv2.putText(image, text, where, cv2.FONT_HERSHEY_SIMPLEX, 0.5, color, thickness, cv2.LINE_AA)


def _window(known: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Rows and columns around the known cells, with a margin; all of a map without any."""
    spans = []
    for axis, size in ((1, known.shape[0]), (0, known.shape[1])):
        used = np.flatnonzero(known.any(axis))
        first, last = (used[0], used[-1]) if len(used) else (0, size - 1)
        spans.append(slice(max(int(first) - MARGIN_CELLS, 0), min(int(last) + 1 + MARGIN_CELLS, size)))
    return spans[0], spans[1]
