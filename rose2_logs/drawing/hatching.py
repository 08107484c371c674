"""Hatching of shapes, and of the parts of rooms that nobody has seen yet."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.occupancy import UNKNOWN, BoolArray, FloatArray
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

HATCH_GAP_M = 0.28
"""Distance of the lines in a recording: clearly no fill, and still some lines in a niche of a meter."""
HATCH_MIN_M = 0.3
"""Shorter lines are left out: gaps between rays and the inside of walls and chairs."""


def hatching(shape: BaseGeometry, gap: float) -> BaseGeometry:
    """Lines through a shape on a page, a gap apart, which rise at 45 degrees there.

    They are at multiples of the gap, so that they continue across neighboring shapes.
    """
    lines, _ = hatch_lines([shape], gap, (1.0, 1.0))
    return shapely.multilinestrings(shapely.linestrings(lines))


def hatch_lines(
    shapes: Sequence[BaseGeometry], gap: float, across: tuple[float, float]
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Find the lines through polygons or multipolygons, as scan lines fill them.

    Parameters
    ----------
    shapes : sequence of N shapely geometries
        May be empty.
    gap : float
        Distance of the lines, in the unit of the shapes.
    across : (float, float)
        Direction across the lines.

    Returns
    -------
    lines : (K, 2, 2) float
        Ends.
    shape : (K,) int
        Index of the shape of each.
    """
    rings, of_shape = _rings(shapes)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    # Sides cross the lines whose number lies between those of their ends, the upper one left out.
    side = np.flatnonzero(np.diff(ring) == 0)
    number = points @ np.array(across) / np.hypot(*across) / gap
    low, high = np.minimum(number[side], number[side + 1]), np.maximum(number[side], number[side + 1])
    first = np.ceil(low).astype(np.intp)
    counts = np.ceil(high).astype(np.intp) - first
    crossing = np.repeat(side, counts)
    line = np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(len(crossing))
    begin, end = number[crossing], number[crossing + 1]
    share = ((line - begin) / (end - begin))[:, None]
    crossings = (1 - share) * points[crossing] + share * points[crossing + 1]
    # Along a line the shape begins at one crossing and ends at the next.
    shape = of_shape[ring[crossing]]
    along = crossings @ np.array([across[1], -across[0]])
    order = np.lexsort((along, line, shape))
    return crossings[order].reshape(-1, 2, 2), shape[order][::2]


def _rings(shapes: Sequence[BaseGeometry]) -> tuple[NDArray[np.object_], NDArray[np.intp]]:
    """Rings of all polygons of some shapes, and the shape of each."""
    parts, of_shape = shapely.get_parts(np.array(shapes, object), return_index=True)
    rings, of_part = shapely.get_rings(parts, return_index=True)
    return rings, of_shape[of_part]


def hatch_unseen(step: TrackedSnapshot) -> tuple[FloatArray, NDArray[np.intp]]:
    """Hatch what the rooms' shapes hold of unknown cells.

    Returns
    -------
    lines_m : (N, 4) float
        x0, y0, x1, y1, world meters.
    room : (N,) int
        Index of the room of each.
    """
    # As on a page, where y goes down.
    lines, room = hatch_lines(step.analysis.rooms.polygons, HATCH_GAP_M, (1.0, -1.0))
    cells, geometry = step.snapshot.cells, step.analysis.geometry

    def is_unknown(points_m: FloatArray) -> BoolArray:
        row, column = geometry.world_to_cell(points_m).T
        height, width = cells.shape
        inside = (row >= 0) & (column >= 0) & (row < height) & (column < width)
        there: BoolArray = cells[row.clip(0, height - 1), column.clip(0, width - 1)] == UNKNOWN
        # Beyond the canvas all is.
        there |= ~inside
        return there

    stretches, line = stretches_of(lines, is_unknown, geometry.resolution_m)
    is_long = np.hypot(*(stretches[:, 1] - stretches[:, 0]).T) >= HATCH_MIN_M
    return stretches[is_long].reshape(-1, 4), room[line[is_long]]


def hatch_cells(mask: BoolArray, gap: float) -> FloatArray:
    """Lines (N, 2, 2) over the cells of a mask (H, W), a gap apart, all in cells from the first one's corner.

    They rise at 45 degrees where row 0 lies at the bottom.
    """
    height, width = mask.shape
    lines, _ = hatch_lines([shapely.box(0, 0, width, height)], gap, (1.0, -1.0))

    def is_inside(points: FloatArray) -> BoolArray:
        column, row = np.floor(points).astype(np.intp).T
        found: BoolArray = mask[row.clip(0, height - 1), column.clip(0, width - 1)]
        return found

    return stretches_of(lines, is_inside, 1.0)[0]


def stretches_of(
    lines: FloatArray, is_inside: Callable[[FloatArray], BoolArray], step: float
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Cut lines to their stretches over the given shape.

    Parameters
    ----------
    lines : (N, 2, 2) float
        Ends.
    is_inside : callable
        From points (K, 2) to a mask (K,).
    step : float
        So far apart it is asked along the lines.

    Returns
    -------
    stretches : (K, 2, 2) float
        Ends.
    line : (K,) int
        Index of the line of each.
    """
    begin, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    counts = np.ceil(np.hypot(*along.T) / step).astype(np.intp)
    line = np.repeat(np.arange(len(lines)), counts)
    number = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    samples = np.repeat(along, counts, axis=0)
    samples *= ((number + 0.5) / np.repeat(counts, counts))[:, None]
    samples += np.repeat(begin, counts, axis=0)
    inside = is_inside(samples)
    # A stretch begins and ends where the sample before and after is outside or of another line.
    is_new = np.diff(line, prepend=-1) != 0
    first = np.flatnonzero(inside & (is_new | ~np.roll(inside, 1)))
    last = np.flatnonzero(inside & (np.roll(is_new, -1) | ~np.roll(inside, -1)))
    line = line[first]
    shares = np.stack([number[first], number[last] + 1], axis=1) / counts[line, None]
    return begin[line, None] + shares[..., None] * along[line, None], line
