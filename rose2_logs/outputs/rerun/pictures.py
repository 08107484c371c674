"""Cells of a map as the pictures of a recording: their pixels, painted by tables of colors."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rose2_logs.drawing.palette import track_color
from rose2_logs.model.labels import known_window
from rose2_logs.model.occupancy import FloatArray, OccupancySnapshot
from rose2_logs.outputs.rerun.columns import Picture

FILL_OPACITY = 0.45
"""Share of a room's color in its cells: the map shows through, and black names can be read."""
CLUTTER_VALUE = 20
"""Occupancy that cells left out of the clean map are drawn with: they can be seen and do not matter."""
_VALUES = np.arange(256, dtype=np.uint8)
CLUTTER_VALUES = np.where(_VALUES.view(np.int8) > 0, np.uint8(CLUTTER_VALUE), _VALUES)
"""What a cell of each value, as an unsigned byte, is drawn with that is no structure."""
UNKNOWN_SHADE = 205
"""Gray of unknown cells, as map_server draws them."""


class MapPictures:
    """The known part of one map, painted in several ways."""

    def __init__(self, snapshot: OccupancySnapshot) -> None:
        rows, columns = known_window(snapshot.cells >= 0)
        # A picture begins at its top, a grid at its origin.
        self._part = (slice(rows.stop - 1, rows.start - 1 if rows.start else None, -1), columns)
        # As an unsigned byte unknown is 255, which is what the RViz colors expect.
        self._cells = np.ascontiguousarray(snapshot.cells[self._part]).view(np.uint8)
        self._place = snapshot.geometry.part((rows, columns))

    def map(self, height_m: float) -> Picture:
        """Draw the map as RViz does, at a height in the world."""
        return self._picture(self._cells, height_m, rr.components.Colormap.RvizMap)

    def rooms(self, labels: NDArray[np.int32], track_ids: Sequence[int], height_m: float) -> Picture:
        """Draw the map with each room of a label image (H, W) in the color of its track."""
        shades = _shades()
        colors = np.array([track_color(track) for track in track_ids], float).reshape(-1, 1, 3)
        painted = FILL_OPACITY * colors + (1 - FILL_OPACITY) * shades
        tables = np.concatenate([shades[None], painted])
        return self._picture(self._painted(labels[self._part], tables), height_m)

    def clean_map(self, clean: NDArray[np.bool_], height_m: float) -> Picture:
        """Draw the clean map (H, W): structure black, what was left out of it light gray."""
        cells = np.asarray(cv2.LUT(self._cells, CLUTTER_VALUES), np.uint8)
        np.copyto(cells, 100, where=clean[self._part])
        return self._picture(cells, height_m, rr.components.Colormap.RvizMap)

    def score(self, score: NDArray[np.float32], height_m: float) -> Picture:
        """Draw the structure score (H, W) of occupied cells, from dark to bright."""
        shown = cv2.convertScaleAbs(np.ascontiguousarray(score[self._part]), alpha=255)
        return self._picture(np.asarray(shown, np.uint8), height_m, rr.components.Colormap.Inferno)

    def _painted(
        self, labels: NDArray[np.integer] | NDArray[np.bool_], colors: FloatArray
    ) -> NDArray[np.uint8]:
        """Pixels (H, W, 4): for each label 0..K one of the tables (256, 3) of the color of a cell's value."""
        opaque = np.full((*colors.shape[:2], 4), 255, np.uint8)
        opaque[..., :3] = colors
        # A pixel as one number is looked up several times faster than as four.
        table = opaque.view(np.uint32).ravel()
        index = labels.astype(np.intp)
        index <<= 8
        index |= self._cells
        # No index is beyond the table; the mode saves a separate pass that would check for it.
        pixels: NDArray[np.uint8] = table.take(index, mode="clip").view(np.uint8)
        return pixels.reshape(*self._cells.shape, 4)

    def _picture(
        self, pixels: NDArray[np.uint8], height_m: float, colormap: rr.components.Colormap | None = None
    ) -> Picture:
        place = self._place
        return Picture(pixels, place.resolution_m, (*place.origin_xy_m, height_m), place.yaw_rad, colormap)


def spectrum_picture(spectrum: NDArray[np.uint8], yaw_rad: float) -> Picture:
    """Draw a spectrum (S, S) around the origin, from -1 to 1 in both directions, turned into the world."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    corner = (float(sine - cosine), float(-sine - cosine), 0.0)
    pixels = np.ascontiguousarray(spectrum[::-1])
    return Picture(pixels, 2 / len(spectrum), corner, yaw_rad, rr.components.Colormap.Magma)


def _shades() -> FloatArray:
    """Gray (256, 3) of each value of a cell as an unsigned byte: white free, black occupied, gray unknown."""
    values = np.arange(256, dtype=np.uint8).view(np.int8)
    shade = np.where(values < 0, UNKNOWN_SHADE, 255 * (1 - np.minimum(values, 100) / 100.0))
    return np.repeat(shade[:, None], 3, axis=1)
