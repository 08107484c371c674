"""Occupancy grids and the only conversion between cells and world coordinates."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.errors import InvalidMapError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int_]
Scalar = TypeVar("Scalar", bound=np.generic)
UNKNOWN = -1
HIGHEST_PERCENT = 100
SMALLEST_CELL_M, LARGEST_CELL_M = 1e-4, 100.0
"""Allowed cell sizes in meters: smaller cells are below a laser's noise, larger ones too coarse for rooms."""
FARTHEST_ORIGIN_M = 1e8
"""No place on earth is farther from the origin of its frame, in meters, in any projection."""


def _are_numbers(*values: object) -> bool:
    # Grids are made by the hundred for each map, and `Real` takes longer to ask than all the rest.
    return all(
        type(value) is float or (isinstance(value, Real) and not isinstance(value, bool | np.bool_))
        for value in values
    )


def _may_change(array: NDArray[Any]) -> bool:
    """Whether somebody may write to an array, or to the one that it shows a part of."""
    held: object = array
    while isinstance(held, np.ndarray):
        if held.flags.writeable:
            return True
        held = held.base
    return False


@dataclass(frozen=True)
class GridGeometry:
    """The position of a grid in the world.

    The *grid frame* has its origin at the outer corner of cell (0, 0), x along the columns and y along the
    rows, in meters. The *world* is the frame ``frame_id`` of the map message (REP 105).

    Attributes
    ----------
    resolution_m : float
        Side of a cell.
    origin_xy_m : (float, float)
        World position of the grid frame's origin.
    yaw_rad : float
        Rotation of the grid frame in the world, counter-clockwise.
    frame_id : str
        Name of the world frame.
    shape : (int, int)
        Rows and columns (H, W); row 0 is at the origin.

    Examples
    --------
    >>> import numpy as np, rose2_logs as rl
    >>> geometry = rl.GridGeometry(0.05, (-10.0, -5.0), 0.0, "map", (200, 400))
    >>> geometry.corners_m()[2]
    array([10.,  5.])
    >>> geometry.world_to_cell(np.array([0.01, 0.01]))
    array([100, 200])
    """

    resolution_m: float
    origin_xy_m: tuple[float, float]
    yaw_rad: float
    frame_id: str
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        try:
            height, width = map(operator.index, self.shape)
        except (TypeError, ValueError):
            height = width = -1
        if height < 0 or width < 0:
            raise InvalidMapError(f"a grid's shape must be rows and columns, not {self.shape!r}")
        object.__setattr__(self, "shape", (height, width))
        origin: Any = self.origin_xy_m
        if isinstance(origin, np.ndarray):
            object.__setattr__(self, "origin_xy_m", origin.tolist())
        is_pair = isinstance(self.origin_xy_m, Sequence) and len(self.origin_xy_m) == 2
        if not is_pair or not _are_numbers(self.resolution_m, self.yaw_rad, *self.origin_xy_m):
            raise InvalidMapError(
                f"a grid's resolution, origin and yaw must be numbers, not {self.resolution_m!r}, "
                f"{self.origin_xy_m!r}, {self.yaw_rad!r}"
            )
        self._hold_floats()
        if not SMALLEST_CELL_M <= self.resolution_m <= LARGEST_CELL_M:
            raise InvalidMapError(
                f"the map's resolution is {self.resolution_m:g} m; it must be positive, from "
                f"{SMALLEST_CELL_M:g} to {LARGEST_CELL_M:g} m"
            )
        if not all(map(math.isfinite, (*self.origin_xy_m, self.yaw_rad))):
            raise InvalidMapError(
                f"the map's origin {self.origin_xy_m}, yaw {self.yaw_rad} is not made of finite numbers"
            )
        if max(map(abs, self.origin_xy_m)) > FARTHEST_ORIGIN_M:
            raise InvalidMapError(
                f"the map's origin {self.origin_xy_m} is farther than {FARTHEST_ORIGIN_M:g} m away"
            )

    def _hold_floats(self) -> None:
        """Turn numbers of other types into floats, so that equal geometries are equal whatever they held."""
        values = (self.resolution_m, self.yaw_rad, *self.origin_xy_m)
        if type(self.origin_xy_m) is tuple and all(type(value) is float for value in values):
            return
        try:
            resolution_m, yaw_rad, *origin = map(float, values)
        except OverflowError as error:
            raise InvalidMapError(
                "a grid's resolution, origin and yaw must be numbers as floats can be; one is larger"
            ) from error
        object.__setattr__(self, "resolution_m", resolution_m)
        object.__setattr__(self, "origin_xy_m", tuple(origin))
        object.__setattr__(self, "yaw_rad", yaw_rad)

    def part(self, window: tuple[slice, slice], block: int = 1) -> GridGeometry:
        """Return where a part of the grid lies: its rows and columns, in blocks of so many cells a side."""
        rows, columns = window
        x, y = self.grid_to_world(np.array([columns.start, rows.start]) * self.resolution_m).tolist()
        shape = (-(-(rows.stop - rows.start) // block), -(-(columns.stop - columns.start) // block))
        return replace(self, resolution_m=self.resolution_m * block, origin_xy_m=(x, y), shape=shape)

    @property
    def size_text(self) -> str:
        """Columns, rows and side of the cells, for people."""
        return f"{self.shape[1]} x {self.shape[0]} cells of {self.resolution_m:g} m"

    @property
    def cell_area_m2(self) -> float:
        """Area of one cell in square meters."""
        return self.resolution_m**2

    @property
    def rotation(self) -> FloatArray:
        """The (2, 2) matrix that turns grid-frame vectors into world vectors."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return np.array([[c, -s], [s, c]])

    def grid_to_world(self, xy_m: FloatArray) -> FloatArray:
        """Convert points (..., 2) from the grid frame to the world, meters to meters."""
        world: FloatArray = np.asarray(xy_m, float) @ self.rotation.T + np.asarray(self.origin_xy_m)
        return world

    def world_to_grid(self, xy_m: FloatArray) -> FloatArray:
        """Convert points (..., 2) from the world to the grid frame, meters to meters."""
        grid: FloatArray = (np.asarray(xy_m, float) - np.asarray(self.origin_xy_m)) @ self.rotation
        return grid

    def cell_centers(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> FloatArray:
        """World positions (..., 2) in meters of the centers of cells."""
        return self.grid_to_world(
            (np.stack([columns, rows], axis=-1) + 0.5).astype(float) * self.resolution_m
        )

    def world_to_cell(self, xy_m: FloatArray) -> NDArray[np.intp]:
        """Cells (..., 2) as row, column that hold world points; they may be outside the grid."""
        cells = np.floor(self.world_to_grid(xy_m) / self.resolution_m).astype(np.intp)
        return cells[..., ::-1]

    def corners_m(self) -> FloatArray:
        """World positions (4, 2) of the outer corners, counter-clockwise from the origin."""
        height, width = self.shape[0] * self.resolution_m, self.shape[1] * self.resolution_m
        return self.grid_to_world(np.array([[0, 0], [width, 0], [width, height], [0, height]], float))


@dataclass(frozen=True, eq=False)
class OccupancySnapshot:
    """One map of a run.

    Attributes
    ----------
    index : int
        Number of the snapshot among the distinct maps taken from the log, from 0.
    log_time_ns : int
        When the message was recorded, nanoseconds since the epoch.
    stamp_ns : int
        The message's header stamp, nanoseconds.
    topic : str
        Topic (or file) that the map comes from.
    cells : (H, W) int8, read-only
        -1 unknown, 0..100 occupancy in percent; row 0 at the origin, as in the message. Other integers are
        converted.
    geometry : GridGeometry
        Position of the grid in the world.
    repeats_before : int
        Identical maps that were received, and dropped, since the snapshot before.
    is_percent : bool
        Whether the cells are known to be percent, as those of a reader are. Of others it is decided from
        their values what they mean.
    read_by : OccupancyParameters, optional
        What a reader has read the cells by; none of a map that no reader made.
    z_m : float
        Height of the grid in the world, at which the annotated MCAP shows what was found.

    Raises
    ------
    InvalidMapError
        If `cells` does not have the geometry's shape, or holds anything but integers from -1 to 100.

    Examples
    --------
    >>> import numpy as np, rose2_logs as rl
    >>> cells = np.full((200, 400), -1, np.int8)
    >>> geometry = rl.GridGeometry(0.05, (0.0, 0.0), 0.0, "map", cells.shape)
    >>> rl.OccupancySnapshot(0, 0, 0, "/map", cells, geometry)
    OccupancySnapshot(index=0, topic='/map', 400 x 200 cells of 0.05 m)
    """

    index: int
    log_time_ns: int
    stamp_ns: int
    topic: str
    cells: NDArray[np.int8]
    geometry: GridGeometry
    repeats_before: int = 0
    is_percent: bool = False
    read_by: OccupancyParameters | None = None
    z_m: float = 0.0

    def __repr__(self) -> str:
        return f"OccupancySnapshot(index={self.index}, topic={self.topic!r}, {self.geometry.size_text})"

    def __post_init__(self) -> None:
        if not isinstance(self.geometry, GridGeometry):
            raise InvalidMapError(f"map {self.index} of {self.topic}: {self.geometry!r} is no GridGeometry")
        fill = getattr(self.cells, "filled", None)  # of a masked array
        given = np.asarray(self.cells if fill is None else fill(UNKNOWN))
        if given.shape != self.geometry.shape:
            raise InvalidMapError(
                f"map {self.index} of {self.topic}: data of shape {given.shape} "
                f"but its header says {self.geometry.shape}"
            )
        if given.dtype.kind not in "iu":
            raise InvalidMapError(
                f"map {self.index} of {self.topic}: cells must be integers, -1 for unknown and 0 to 100 "
                f"percent, not {given.dtype}"
            )
        if given.size and not (given.min() >= UNKNOWN and given.max() <= HIGHEST_PERCENT):
            raise InvalidMapError(
                f"map {self.index} of {self.topic}: cells must lie between {UNKNOWN} and {HIGHEST_PERCENT}, "
                f"not from {given.min()} to {given.max()}"
            )
        # What can be written to may hold the next map when this one is looked at.
        cells = given.astype(np.int8, copy=_may_change(given)).view()
        cells.flags.writeable = False
        object.__setattr__(self, "cells", cells)


@dataclass(frozen=True, eq=False)
class CellValues(Generic[Scalar]):
    """Values of some cells of a canvas; those of the others are zero and not kept.

    Attributes
    ----------
    shape : (int, int)
        Of the canvas (H, W).
    cells : (N, 2) int32
        Row and column of each cell that has a value.
    values : (N,)
        Its value.
    """

    shape: tuple[int, int]
    cells: NDArray[np.int32]
    values: NDArray[Scalar]

    def whole(self) -> NDArray[Scalar]:
        """Values (H, W) of the whole canvas."""
        canvas = np.zeros(self.shape, self.values.dtype)
        canvas[self.cells[:, 0], self.cells[:, 1]] = self.values
        return canvas


def classify(cells: NDArray[np.int8], parameters: OccupancyParameters) -> tuple[BoolArray, BoolArray]:
    """Masks of the free and of the occupied cells.

    Parameters
    ----------
    cells : (H, W) int8
        -1 unknown, 0..100 occupancy in percent.
    parameters : OccupancyParameters
        Cells above `occupied_min_percent` are occupied, known cells below `free_max_percent` are free
        (map_server's convention).

    Returns
    -------
    free, occupied : (H, W) bool
        Cells between the two thresholds are in neither.
    """
    # Compared with whole numbers, as they are themselves: with others, each cell becomes a float first.
    free = (cells >= 0) & (cells < math.ceil(parameters.free_max_percent))
    occupied = cells > math.floor(parameters.occupied_min_percent)
    return free, occupied


def is_same_to_analysis(
    before: OccupancySnapshot, now: OccupancySnapshot, parameters: OccupancyParameters
) -> bool:
    """Whether two maps have the same free, occupied and unknown cells at the same place: all that counts.

    Maps that hold probabilities change at every scan, mostly without passing a threshold.
    """
    if before.geometry != now.geometry:
        return False
    changed = before.cells != now.cells
    kind_before, kind_now = (
        np.stack([*classify(cells[changed], parameters), cells[changed] == UNKNOWN])
        for cells in (before.cells, now.cells)
    )
    return np.array_equal(kind_before, kind_now)


def free_area_m2(snapshot: OccupancySnapshot, parameters: OccupancyParameters) -> float:
    """Known free area of a map in square meters."""
    free, _ = classify(snapshot.cells, parameters)
    return float(free.sum()) * snapshot.geometry.cell_area_m2
