"""Which room of one map is which room of another: overlap in world coordinates, and the best assignment."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import BoolArray, FloatArray, GridGeometry
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.registration import RigidMotion

Pair = tuple[float, float]
ROWS_AT_ONCE = 256
"""Rows resampled together: bounds the memory for coordinates to some megabytes for the largest maps."""
BORDER_NUDGE = 1e-6
"""Cells: centers that lie on a border of the other grid, up to rounding, all fall to the same side."""
SAME_GRID_CELLS = 1e-9
"""Cells of two grids run along each other when one's step differs by less in the other's cells."""


def resample_labels(
    labels: NDArray[np.int32], source: GridGeometry, target: GridGeometry
) -> NDArray[np.int32]:
    """Look up labels at the cell centers of another grid.

    Parameters
    ----------
    labels : (H, W) int32
        Labels on the grid `source`.
    source, target : GridGeometry
        They may differ in origin, size, yaw and resolution, but share the world frame.

    Returns
    -------
    (H', W') int32
        The label of the source cell that holds each center, 0 outside the source grid.
    """
    height, width = target.shape
    result = np.zeros(target.shape, np.int32)
    origin, by_row, by_column = _cells_under(source, target)
    if (first := _first_cell(origin, by_row)) is not None:
        here, there = _common_windows(source.shape, first, target.shape)
        result[there] = labels[here]
        return result
    columns = np.arange(width)
    for begin in range(0, height, ROWS_AT_ONCE):
        rows = np.arange(begin, min(begin + ROWS_AT_ONCE, height))[:, None]
        x = np.floor(origin[0] + rows * by_row[0] + columns * by_column[0] + BORDER_NUDGE).astype(np.intp)
        y = np.floor(origin[1] + rows * by_row[1] + columns * by_column[1] + BORDER_NUDGE).astype(np.intp)
        inside = (x >= 0) & (x < source.shape[1]) & (y >= 0) & (y < source.shape[0])
        result[begin : begin + len(rows)][inside] = labels[y[inside], x[inside]]
    return result


def _cells_under(source: GridGeometry, target: GridGeometry) -> tuple[Pair, Pair, Pair]:
    """Find the place, in cells of a grid, under the center of another grid's first cell, as x and y.

    Returns
    -------
    first, by_row, by_column : (float, float)
        The place under the first center, and the steps to the next row and the next column.
    """
    scale = target.resolution_m / source.resolution_m
    turn = target.yaw_rad - source.yaw_rad
    right, up = scale * math.cos(turn), scale * math.sin(turn)
    cosine, sine = math.cos(source.yaw_rad), math.sin(source.yaw_rad)
    x, y = (
        (there - here) / source.resolution_m
        for there, here in zip(target.origin_xy_m, source.origin_xy_m, strict=True)
    )
    first = cosine * x + sine * y + (right - up) / 2, cosine * y - sine * x + (right + up) / 2
    return first, (-up, right), (right, up)


def _first_cell(first: Pair, by_row: Pair) -> tuple[int, int] | None:
    """Row and column under the first cell of a grid that runs along another; None where it does not."""
    if max(abs(by_row[0]), abs(by_row[1] - 1)) >= SAME_GRID_CELLS:
        return None
    return math.floor(first[1] + BORDER_NUDGE), math.floor(first[0] + BORDER_NUDGE)


def _common_windows(
    shape: tuple[int, int], first: tuple[int, int], part: tuple[int, int]
) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Windows of a grid and of a part of it that show the same cells.

    Parameters
    ----------
    shape, part : (int, int)
        Rows and columns of both.
    first : (int, int)
        Row and column of the part's first cell, which may lie outside, as may others.
    """
    low = [min(max(0, start), size) for start, size in zip(first, shape, strict=True)]
    high = [
        max(begin, min(size, start + count))
        for begin, size, start, count in zip(low, shape, first, part, strict=True)
    ]
    return (
        tuple(slice(begin, end) for begin, end in zip(low, high, strict=True)),
        tuple(slice(begin - at, end - at) for begin, end, at in zip(low, high, first, strict=True)),
    )


@dataclass(frozen=True, eq=False)
class RegionShape:
    """The cells of one room, cut out of its map and packed to bits.

    Attributes
    ----------
    geometry : GridGeometry
        The grid of the cut-out alone.
    packed : uint8
        The mask, eight cells a byte.
    area_m2 : float
        Area of the room's cells.
    """

    geometry: GridGeometry
    packed: NDArray[np.uint8]
    area_m2: float

    @cached_property
    def box_m(self) -> FloatArray:
        """World box (4,) x0, y0, x1, y1 around the cut-out."""
        corners = self.geometry.corners_m()
        return np.concatenate([corners.min(0), corners.max(0)])

    @property
    def mask(self) -> BoolArray:
        """The cells of the cut-out (H, W)."""
        count = self.geometry.shape[0] * self.geometry.shape[1]
        return np.unpackbits(self.packed, count=count).reshape(self.geometry.shape).view(bool)

    def moved(self, motion: RigidMotion) -> RegionShape:
        """The same cells where a motion of the map brings them."""
        return dataclasses.replace(self, geometry=motion.grid(self.geometry))

    def common_area_m2(self, labels: NDArray[np.int32], geometry: GridGeometry, count: int) -> FloatArray:
        """Area (count,) in square meters that this one shares with the rooms 1..count of another map."""
        origin, by_row, _ = _cells_under(geometry, self.geometry)
        if (first := _first_cell(origin, by_row)) is not None:
            here, there = _common_windows(geometry.shape, first, self.geometry.shape)
            under = labels[here][self.mask[there]]
        else:
            under = resample_labels(labels, geometry, self.geometry)[self.mask]
        cells = np.bincount(under, minlength=count + 1)[1 : count + 1].astype(np.float64)
        return cells * self.geometry.cell_area_m2


def cut_out_rooms(rooms: RoomMap) -> tuple[RegionShape | None, ...]:
    """Shapes of the rooms of a map, None for one without cells."""
    shapes: list[RegionShape | None] = []
    for number, window in enumerate(rooms.windows, start=1):
        if window is None:
            shapes.append(None)
            continue
        mask = rooms.labels[window] == number
        cut = rooms.geometry.part(window)
        cells = int(np.count_nonzero(mask))
        shapes.append(RegionShape(cut, np.packbits(mask), cells * cut.cell_area_m2))
    return tuple(shapes)


def assign(weight: FloatArray, admissible: BoolArray) -> list[tuple[int, int]]:
    """Pair rows with columns so that the sum of weights is greatest; only admissible pairs are made.

    Parameters
    ----------
    weight : (A, B) float
        Positive where admissible.
    admissible : (A, B) bool

    Returns
    -------
    list of (row, column), by row
    """
    from scipy.optimize import linear_sum_assignment

    if not admissible.any():
        return []
    rows, columns = linear_sum_assignment(np.where(admissible, weight, 0.0), maximize=True)
    chosen = admissible[rows, columns]
    return list(zip(rows[chosen].tolist(), columns[chosen].tolist(), strict=True))
