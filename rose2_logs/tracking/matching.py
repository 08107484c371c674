"""Which room of one map is which room of another: overlap in world coordinates, and the best assignment."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import BoolArray, FloatArray, GridGeometry
from rose2_logs.tracking.registration import RigidMotion

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
    # A center's source cell is affine in its row and column: three points give the whole map.
    corners = target.cell_centers(np.array([0, 1, 0]), np.array([0, 0, 1]))
    origin, by_row, by_column = source.world_to_grid(corners) / source.resolution_m
    by_row, by_column = by_row - origin, by_column - origin
    if np.abs(np.concatenate([by_row - (0, 1), by_column - (1, 0)])).max() < SAME_GRID_CELLS:
        return _shifted(labels, np.floor(origin + BORDER_NUDGE).astype(int).tolist(), target.shape)
    columns = np.arange(width)
    for begin in range(0, height, ROWS_AT_ONCE):
        rows = np.arange(begin, min(begin + ROWS_AT_ONCE, height))[:, None]
        x = np.floor(origin[0] + rows * by_row[0] + columns * by_column[0] + BORDER_NUDGE).astype(np.intp)
        y = np.floor(origin[1] + rows * by_row[1] + columns * by_column[1] + BORDER_NUDGE).astype(np.intp)
        inside = (x >= 0) & (x < source.shape[1]) & (y >= 0) & (y < source.shape[0])
        result[begin : begin + len(rows)][inside] = labels[y[inside], x[inside]]
    return result


def _shifted(labels: NDArray[np.int32], first: list[int], shape: tuple[int, int]) -> NDArray[np.int32]:
    """Part of a label array, of a given shape, from column and row `first` on; 0 outside the array."""
    result = np.zeros(shape, np.int32)
    low = [max(0, start) for start in first]
    high = [
        min(size, start + count)
        for size, start, count in zip(labels.shape[::-1], first, shape[::-1], strict=True)
    ]
    if low[0] < high[0] and low[1] < high[1]:
        rows, columns = (
            slice(low[1] - first[1], high[1] - first[1]),
            slice(low[0] - first[0], high[0] - first[0]),
        )
        result[rows, columns] = labels[low[1] : high[1], low[0] : high[0]]
    return result


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

    @property
    def box_m(self) -> FloatArray:
        """World box (4,) x0, y0, x1, y1 around the cut-out."""
        corners = self.geometry.corners_m()
        return np.concatenate([corners.min(0), corners.max(0)])

    @property
    def mask(self) -> BoolArray:
        """The cells of the cut-out (H, W)."""
        count = self.geometry.shape[0] * self.geometry.shape[1]
        return np.unpackbits(self.packed, count=count).reshape(self.geometry.shape).astype(bool)

    def moved(self, motion: RigidMotion) -> RegionShape:
        """The same cells where a motion of the map brings them."""
        return dataclasses.replace(self, geometry=motion.grid(self.geometry))

    def common_area_m2(self, labels: NDArray[np.int32], geometry: GridGeometry, count: int) -> FloatArray:
        """Area (count,) in square meters that this one shares with the rooms 1..count of another map."""
        under = resample_labels(labels, geometry, self.geometry)[self.mask]
        cells = np.bincount(under, minlength=count + 1)[1 : count + 1].astype(np.float64)
        return cells * self.geometry.cell_area_m2


def cut_out_rooms(
    labels: NDArray[np.int32], geometry: GridGeometry, count: int
) -> tuple[RegionShape | None, ...]:
    """Shapes of the rooms 1..count of a map, None for one without cells.

    Parameters
    ----------
    labels : (H, W) int32
    geometry : GridGeometry
        Where they lie.
    count : int
        Number of rooms.
    """
    from scipy.ndimage import find_objects

    shapes: list[RegionShape | None] = []
    for number, place in enumerate(find_objects(labels, max_label=count), start=1):
        if place is None:
            shapes.append(None)
            continue
        mask = labels[place] == number
        cut = geometry.part(place)
        shapes.append(RegionShape(cut, np.packbits(mask), float(mask.sum()) * cut.cell_area_m2))
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
