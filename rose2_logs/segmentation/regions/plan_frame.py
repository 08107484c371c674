"""The plan frame: a raster of 0.1 m along the strongest dominant direction, on which regions are judged."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.labels import Pieces, labels_near, row_ends
from rose2_logs.model.occupancy import BoolArray, FloatArray

Labels = NDArray[np.int32]
Number = TypeVar("Number", bound=np.integer)

PLAN_CELL_M = 0.1
"""Side of a plan cell, meters. The network and the trees were fitted on cells of this size."""
LEAST_PLAN_CELL = 0.5
"""A plan cell is at least this much of a map's cell: finer ones would tell nothing of a coarse map, but their
number would grow with the length that a header claims for a cell."""
POINTS_PER_SIDE = 3
"""A plan cell is looked at in this many points squared, so that walls of one map cell are met."""
COUNT_BITS = 4
"""Bits that hold the number of these points."""
POSITION_BITS = 16
POSITION_STEPS = 2**POSITION_BITS
"""Positions on a map are told in this many steps per cell, far less than a map is good for."""
ANGLE_DIGITS = 4
"""Directions are rounded to this many digits of a radian: over 100 m a tenth of a cell of 0.1 m."""
SIDE_SHARE = 0.01
"""A frame lies this share of a map's cell off the sides of cells, always to the same side of its own axes."""
CELLS_AT_ONCE = 2**17
"""Cells that are looked up at once: their positions stay in a CPU's cache."""


@dataclass(frozen=True, eq=False)
class PlanFrame:
    """Where the cells of a plan raster lie on the map.

    Attributes
    ----------
    shape : (int, int)
        Rows and columns.
    cell_m : float
        Side of a plan cell.
    to_map : (2, 3) float
        Center of a plan cell (column, row) to (column, row) of the map.
    """

    shape: tuple[int, int]
    cell_m: float
    to_map: FloatArray

    @classmethod
    def of(
        cls, known: BoolArray, direction_rad: float, resolution_m: float, cell_m: float = PLAN_CELL_M
    ) -> PlanFrame:
        """Frame around the known cells (H, W), turned by the direction; one cell where none is known.

        It lies down, and most of the floor lies towards its first row and column: so a map that is mirrored
        or turned by quarters looks the same on it.
        """
        cell_m = max(cell_m, LEAST_PLAN_CELL * resolution_m)
        # The extreme cells of each row hold the corners of the frame.
        rows, first, last = row_ends(known)
        if len(rows) == 0:
            return cls((1, 1), cell_m, np.column_stack([np.eye(2), np.zeros(2)]))
        within_quarter = round(direction_rad % (np.pi / 2), ANGLE_DIGITS)
        cos, sin = np.cos(within_quarter), np.sin(within_quarter)
        axes = np.array([[cos, sin], [-sin, cos]])
        column, row = np.concatenate([first, last]), np.concatenate([rows, rows])
        corners = np.stack([column + 0.5, row + 0.5]) * resolution_m
        across, along = np.ptp(axes @ corners, axis=1)
        if along > across + cell_m:
            axes = axes[::-1]
        points = axes @ corners
        middle = (points.min(1) + points.max(1)) / 2
        in_columns, in_rows = known.sum(0), known.sum(1)
        mean = [np.dot(sums, np.arange(len(sums)) + 0.5) / sums.sum() for sums in (in_columns, in_rows)]
        beyond = axes @ mean * resolution_m > middle + SIDE_SHARE * resolution_m
        axes = np.where(beyond, -1.0, 1.0)[:, None] * axes
        points = axes @ corners
        # From the side of the outermost cell, so that it does not matter where the map lies on its canvas.
        low = points.min(1) - resolution_m * (0.5 - SIDE_SHARE) - cell_m
        size = np.ceil((points.max(1) - low) / cell_m).astype(int) + 1
        scale = cell_m / resolution_m
        offset = axes.T @ (low / resolution_m + scale / 2) - 0.5
        return cls((int(size[1]), int(size[0])), cell_m, np.column_stack([axes.T * scale, offset]))

    def sampled(self, image: Labels) -> Labels:
        """Value of the map's cell below the center of each plan cell, 0 beside the map."""
        return _looked_up(image, self.to_map, self.shape)

    def counts(self, *masks: BoolArray) -> NDArray[np.uint8]:
        """How many of the `POINTS_PER_SIDE` squared points of each plan cell each mask covers: (M, P, Q)."""
        rows, columns = self.shape
        linear = self.to_map[:, :2] / POINTS_PER_SIDE
        offset = self.to_map[:, 2] + self.to_map[:, :2] @ np.full(2, (1 / POINTS_PER_SIDE - 1) / 2)
        # All masks are looked up and counted at once, each in some bits of its own.
        packed = np.zeros(masks[0].shape, np.min_scalar_type(2 ** (COUNT_BITS * len(masks)) - 1))
        for number, mask in enumerate(masks):
            packed |= mask.astype(packed.dtype) << packed.dtype.type(COUNT_BITS * number)
        fine_shape = rows * POINTS_PER_SIDE, columns * POINTS_PER_SIDE
        fine = _looked_up(packed, np.column_stack([linear, offset]), fine_shape)
        of_rows = functools.reduce(np.add, (fine[k::POINTS_PER_SIDE] for k in range(POINTS_PER_SIDE)))
        total = functools.reduce(np.add, (of_rows[:, k::POINTS_PER_SIDE] for k in range(POINTS_PER_SIDE)))
        places = (total >> total.dtype.type(COUNT_BITS * number) for number in range(len(masks)))
        return np.stack([(place & (2**COUNT_BITS - 1)).astype(np.uint8) for place in places])

    def back(self, image: Labels, shape: tuple[int, int]) -> Labels:
        """Plan labels at the cells of the map (H, W), 0 beside the plan frame."""
        linear = np.linalg.inv(self.to_map[:, :2])
        return _looked_up(image, np.column_stack([linear, -linear @ self.to_map[:, 2]]), shape)


def _looked_up(image: NDArray[Number], to_image: FloatArray, shape: tuple[int, int]) -> NDArray[Number]:
    """Value of the cell of an image in which each point (column, row) of a raster lies, 0 beside the image.

    Positions are whole numbers of a cell's `POSITION_STEPS`, so that they are the same whatever instructions
    a CPU has; none is on the side between two cells but by chance, for frames lie off the sides.
    """
    height, width = image.shape
    to_steps = to_image * POSITION_STEPS
    to_steps[:, 2] += POSITION_STEPS / 2
    column, row = np.arange(shape[1]), np.arange(shape[0])
    # Half the time where positions fit into 32 bits.
    farthest = np.abs(to_steps) @ (shape[1], shape[0], 1)
    whole = np.int32 if max(farthest.max(), image.size) < np.iinfo(np.int32).max else np.int64
    by_column = np.rint(to_steps[:, :1] * column).astype(whole)
    by_row = np.rint(to_steps[:, 1:2] * row + to_steps[:, 2:]).astype(whole)
    found = np.empty(shape, image.dtype)
    values = image.ravel()
    at_once = max(1, CELLS_AT_ONCE // shape[1])
    for start in range(0, shape[0], at_once):
        rows = slice(start, start + at_once)
        x, y = ((by_row[axis, rows, None] + by_column[axis]) >> POSITION_BITS for axis in (0, 1))
        beside = (x < 0) | (x >= width) | (y < 0) | (y >= height)
        y *= width
        y += x
        values.take(y, out=found[rows], mode="clip")
        found[rows][beside] = 0
    return found


def grown_labels(labels: Labels, reach_cells: float) -> Labels:
    """Labels also on the cells without one, from the nearest that has one, up to a distance."""
    grown, without = labels.copy(), np.flatnonzero(labels == 0)
    grown.reshape(-1)[without] = labels_near(labels, without, reach_cells)
    return grown


def without_specks(occupied: BoolArray, shortest_cells: float) -> BoolArray:
    """Occupied cells without the pieces whose longer side is less than `shortest_cells`."""
    pieces = Pieces.of(occupied)
    return pieces.cells(pieces.sides.max(1) >= shortest_cells, occupied.shape)
