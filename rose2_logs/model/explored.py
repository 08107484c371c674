"""The explored part of a map, at the resolution it is analyzed at, and the way back to canvas and world."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.model.far_cells import find_far_cells
from rose2_logs.model.labels import known_window
from rose2_logs.model.occupancy import BoolArray, CellValues, FloatArray, GridGeometry, Scalar, classify

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

NEIGHBORS = ((0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))
"""Where a coarse cell without a room looks for one: cells with a common side first."""


SCATTERED_SIDES = 1.0
"""Sides to other cells, for each free cell, from which on these are scattered: floors of buildings have 0.1,
full of clutter 0.6, noise 2."""
SCATTERED_MAX_CELLS = 500_000
"""Scattered cells are no floor: a map of them is analyzed in so few blocks, as its rooms mean nothing."""


@dataclass(frozen=True, eq=False)
class ExploredPart:
    """The smallest window of a canvas that holds its known cells, with blocks of cells taken as one.

    Stray cells far away are not in it, see `find_far_cells`.

    Attributes
    ----------
    geometry : GridGeometry
        Of the whole canvas.
    window : (slice, slice)
        Rows and columns of the canvas.
    factor : int
        Cells along a block's side; 1 leaves the map as it is.
    free, occupied : (H, W) bool
        Masks of blocks: occupied where any of its cells is, else free where at least half of its cells are.
    known_free, known_occupied : (h, w) bool
        Free and occupied cells of the window.
    """

    geometry: GridGeometry
    window: tuple[slice, slice]
    factor: int
    free: BoolArray
    occupied: BoolArray
    known_free: BoolArray
    known_occupied: BoolArray

    @classmethod
    def of(
        cls, cells: NDArray[np.int8], geometry: GridGeometry, parameters: OccupancyParameters
    ) -> ExploredPart:
        """Take the explored part of a canvas (H, W) of occupancy in percent, -1 for unknown."""
        # Cells of neither kind may surround the others; masks of a large canvas are not held for them.
        far = find_far_cells(cells, geometry.resolution_m, parameters)
        known = known_window(cells >= 0) if far is None else far.window
        free, occupied = classify(cells[known], parameters)
        if not free.any():
            nothing = np.zeros((1, 1), bool)  # walls alone enclose no room
            return cls(geometry, (slice(0, 1), slice(0, 1)), 1, nothing, nothing, nothing, nothing)
        window = known_window(free | occupied)
        free, occupied = free[window].copy(), occupied[window].copy()
        window = _within(known, window)
        factor = block_side(geometry.resolution_m, free.size, parameters)
        if free.size > SCATTERED_MAX_CELLS and is_scattered(free):
            factor = max(factor, int(np.ceil(np.sqrt(free.size / SCATTERED_MAX_CELLS))))
        if factor == 1:
            return cls(geometry, window, 1, free, occupied, free, occupied)
        any_occupied: BoolArray = np.any(_blocks(occupied, factor), axis=(1, 3))
        mostly_free = 2 * np.count_nonzero(_blocks(free, factor), axis=(1, 3)) >= factor**2
        return cls(geometry, window, factor, mostly_free & ~any_occupied, any_occupied, free, occupied)

    def in_cells(self) -> ExploredPart:
        """Return the same part with one block per cell."""
        return replace(self, factor=1, free=self.known_free, occupied=self.known_occupied)

    @property
    def resolution_m(self) -> float:
        """Side of a block in meters."""
        return self.geometry.resolution_m * self.factor

    @property
    def free_area_m2(self) -> float:
        """Area of the free cells in square meters."""
        return float(np.count_nonzero(self.known_free)) * self.geometry.cell_area_m2

    def points(self, xy_m: FloatArray) -> FloatArray:
        """World positions of points (..., 2) of the window's frame."""
        corner = np.array([self.window[1].start, self.window[0].start]) * self.geometry.resolution_m
        return self.geometry.grid_to_world(xy_m + corner)

    def segments(self, ends_m: FloatArray) -> FloatArray:
        """World ends (N, 4) of segments of the window's frame."""
        return self.points(ends_m.reshape(-1, 2, 2)).reshape(-1, 4)

    def shape(self, geometry: BaseGeometry) -> BaseGeometry:
        """Shapely geometry in the world."""
        import shapely

        return shapely.transform(geometry, self.points)

    def occupied_cells(self) -> NDArray[np.int32]:
        """Row and column (N, 2) on the canvas of its occupied cells."""
        row, column = np.divmod(np.flatnonzero(self.known_occupied), self.known_occupied.shape[1])
        cells = np.empty((len(row), 2), np.int32)
        cells[:, 0], cells[:, 1] = row + self.window[0].start, column + self.window[1].start
        return cells

    def values_at(self, cells: NDArray[np.int32], values: NDArray[Scalar]) -> CellValues[Scalar]:
        """Values of blocks (H, W) as values of cells (N, 2) of the canvas."""
        row, column = (cells[:, axis] - self.window[axis].start for axis in (0, 1))
        if self.factor > 1:
            row, column = row // self.factor, column // self.factor
        return CellValues(self.geometry.shape, cells, values.ravel().take(row * values.shape[1] + column))

    def labels(self, labels: NDArray[np.int32]) -> NDArray[np.int32]:
        """Labels of blocks as labels of the canvas's free cells.

        A free cell in a block without a label, next to a wall that is thinner than a block, takes that of a
        neighboring block.
        """
        full = np.zeros(self.geometry.shape, np.int32)
        if self.factor > 1:
            padded = np.pad(labels, 1)
            height, width = labels.shape
            labels = labels.copy()
            for down, right in NEIGHBORS:
                beside = padded[1 + down : 1 + down + height, 1 + right : 1 + right + width]
                np.copyto(labels, beside, where=labels == 0)
        np.multiply(self._unblocked(labels), self.known_free, out=full[self.window])
        return full

    def _unblocked(self, values: NDArray[Scalar]) -> NDArray[Scalar]:
        if self.factor == 1:
            return values
        height, width = self.known_free.shape
        return values.repeat(self.factor, axis=0).repeat(self.factor, axis=1)[:height, :width]


def sides_per_cell(free: BoolArray) -> float:
    """Sides between free cells of a map (H, W) and others, per free cell; 0 without any."""
    sides = np.count_nonzero(free[:, :-1] != free[:, 1:]) + np.count_nonzero(free[:-1] != free[1:])
    return int(sides) / max(int(np.count_nonzero(free)), 1)


def is_scattered(free: BoolArray) -> bool:
    """Whether the free cells of a map (H, W) are strewn as in noise, and no floor."""
    return sides_per_cell(free) > SCATTERED_SIDES


def block_side(resolution_m: float, cells: int, parameters: OccupancyParameters) -> int:
    """Cells along the side of the blocks that a map is analyzed in.

    Parameters
    ----------
    resolution_m : float
        Side of a cell.
    cells : int
        Number of cells of the explored part.
    """
    finer = int(parameters.working_resolution_m / resolution_m * (1 + 1e-9))
    larger = int(np.ceil(np.sqrt(cells / parameters.analyzed_max_cells)))
    return max(1, finer, larger)


def coarser_for_its_size(
    geometry: GridGeometry, analyzed_resolution_m: float, parameters: OccupancyParameters
) -> str | None:
    """Say that a map was analyzed coarser than it is because it is large; None if it was not."""
    usual = max(geometry.resolution_m, parameters.working_resolution_m) * (1 + 1e-9)
    if analyzed_resolution_m <= usual or np.prod(geometry.shape) <= parameters.analyzed_max_cells:
        return None
    return (
        f"more than {parameters.analyzed_max_cells} explored cells: analyzed at "
        f"{analyzed_resolution_m:.3g} m instead of {geometry.resolution_m:.3g} m; "
        "occupancy.analyzed_max_cells sets the limit"
    )


def _within(outer: tuple[slice, slice], inner: tuple[slice, slice]) -> tuple[slice, slice]:
    """Rows and columns of a canvas of a window's window."""
    rows, columns = (
        slice(whole.start + part.start, whole.start + part.stop)
        for whole, part in zip(outer, inner, strict=True)
    )
    return rows, columns


def _blocks(mask: BoolArray, side: int) -> BoolArray:
    """View (H, side, W, side) of a mask filled up to whole blocks."""
    height, width = (-mask.shape[0] % side), (-mask.shape[1] % side)
    padded = np.pad(mask, ((0, height), (0, width)))
    return padded.reshape(padded.shape[0] // side, side, padded.shape[1] // side, side)
