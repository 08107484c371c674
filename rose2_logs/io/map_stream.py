"""From successive map messages to distinct maps: patches applied, repeats and small changes dropped."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.errors import InvalidMapError
from rose2_logs.io.grids import Cells, Grid, MapWarning, Patch
from rose2_logs.model.far_cells import FarCells, find_far_cells
from rose2_logs.model.occupancy import UNKNOWN, BoolArray, OccupancySnapshot
from rose2_logs.system.text import apart

USUAL = OccupancyParameters()


@dataclass
class ReadCounts:
    """What happened to the map messages in the time range; updated while the snapshots are read.

    Once all are read, `messages` is the number of snapshots plus repeats, skipped, damaged and invalid.

    Attributes
    ----------
    messages : int
        Map messages (grids and patches) on the topic in the time range.
    repeats : int
        Messages that leave the map as it was.
    skipped : int
        Messages not selected, or without a map: a grid without cells, a patch before any grid.
    updates_applied : int
        Patches applied to the grid before them, whether selected or not.
    damaged : int
        Messages that cannot be read: wrong checksum or damaged compression.
    invalid : int
        Messages that are inconsistent, or patches that extend beyond their map.
    """

    messages: int = 0
    repeats: int = 0
    skipped: int = 0
    updates_applied: int = 0
    damaged: int = 0
    invalid: int = 0


class MapStream:
    """The map after each message, and whether it has changed enough to be a new snapshot.

    Parameters
    ----------
    topic : str
        Topic name that the snapshots get.
    counts : ReadCounts
        Updated along the way.
    min_change_m2 : float, optional
        Minimum change of the known area since the previous snapshot.
    occupancy : OccupancyParameters, optional
        What is left out of a map as far from the rest of it.
    has_patches : bool
        Whether patches may come, which need the whole of the map before them.

    Attributes
    ----------
    far_cells : FarCells or None
        What was left out of the latest map.
    """

    def __init__(
        self,
        topic: str,
        counts: ReadCounts,
        min_change_m2: float | None = None,
        occupancy: OccupancyParameters = USUAL,
        *,
        has_patches: bool = True,
    ) -> None:
        self._has_patches = has_patches
        self.far_cells: FarCells | None = None
        self._topic = topic
        self._counts = counts
        self._min_change_m2 = min_change_m2
        self._occupancy = occupancy
        self._map: Grid | None = None
        self._cells_are_shared = True
        self._seen: Grid | None = None
        self._yielded: Grid | None = None
        self._index = 0
        self._repeats = 0

    @property
    def is_empty(self) -> bool:
        """Whether there is no map: none has arrived yet, or the last one was unreadable."""
        return self._map is None

    def forget(self) -> None:
        """Drop the map until the next full one: the last one was unreadable, and patches refer to it."""
        self._map = None

    def apply(self, message: Grid | Patch | None) -> None:
        """Update the map; None clears it, and a patch without a grid before it is ignored.

        Raises
        ------
        InvalidMapError
            If a patch extends beyond the grid.
        """
        if not isinstance(message, Patch):
            self._map = message
            self._cells_are_shared = True
            return
        if self._map is None:
            return
        height, width = message.cells.shape
        rows, columns = self._map.cells.shape
        top, left = message.row, message.column
        if top < 0 or left < 0 or top + height > rows or left + width > columns:
            raise InvalidMapError(
                f"the patch of {width} x {height} cells at column {left}, row {top} "
                f"extends beyond the map of {columns} x {rows} cells"
            )
        # Cells that belong to a message or a snapshot are not modified.
        cells = self._map.cells.copy() if self._cells_are_shared else self._map.cells
        cells[top : top + height, left : left + width] = message.cells
        self._map = Grid(message.stamp_ns, self._map.geometry, cells, z_m=self._map.z_m)
        self._cells_are_shared = False
        self._counts.updates_applied += 1

    def snapshot(self, log_time_ns: int) -> OccupancySnapshot | None:
        """Return the current map, or None (and count why) if there is none or it changed too little."""
        now = self._map
        if now is None:
            self._counts.skipped += 1
            return None
        now, self.far_cells = without_far_cells(now, self._occupancy)
        if not self._has_patches:
            self._map = now
        if self._seen is not None and _equal(now, self._seen):
            self._counts.repeats += 1
            self._repeats += 1
            return None
        self._seen = now
        self._cells_are_shared = True
        if (
            self._min_change_m2
            and self._yielded is not None
            and known_area_change_m2(self._yielded, now) < self._min_change_m2
        ):
            self._counts.skipped += 1
            return None
        taken = OccupancySnapshot(
            self._index,
            log_time_ns,
            now.stamp_ns,
            self._topic,
            now.cells,
            now.geometry,
            self._repeats,
            is_percent=True,
            read_by=self._occupancy,
            z_m=now.z_m,
        )
        self._yielded = now
        self._index += 1
        self._repeats = 0
        return taken


def without_far_cells(grid: Grid, occupancy: OccupancyParameters) -> tuple[Grid, FarCells | None]:
    """Return the part of a map that is analyzed, and what was left out; the map itself if nothing was."""
    found = find_far_cells(grid.cells, grid.geometry.resolution_m, occupancy)
    if found is None:
        return grid, None
    # A copy, so that the canvas is not kept.
    cells, geometry = grid.cells[found.window].copy(), grid.geometry.part(found.window)
    return replace(grid, geometry=geometry, cells=cells), found


def _equal(one: Grid, other: Grid) -> bool:
    return one.geometry == other.geometry and np.array_equal(one.cells, other.cells)


def known_area_change_m2(before: Grid, now: Grid) -> float:
    """Area that is known in only one of two maps, in square meters.

    Grids with the same resolution, yaw and frame are aligned to the nearest cell; other grids cannot be
    compared, and the change is infinite.
    """
    old, new = before.geometry, now.geometry
    if (old.resolution_m, old.yaw_rad, old.frame_id) != (new.resolution_m, new.yaw_rad, new.frame_id):
        return float("inf")
    column, row = (
        np.round(old.world_to_grid(np.array(new.origin_xy_m)) / old.resolution_m).astype(int).tolist()
    )
    shared = _overlap(before.cells, row, column, new.shape) & _overlap(now.cells, -row, -column, old.shape)
    known = np.count_nonzero(before.cells != UNKNOWN) + np.count_nonzero(now.cells != UNKNOWN)
    return float((known - 2 * np.count_nonzero(shared)) * new.cell_area_m2)


def _overlap(cells: Cells, row: int, column: int, shape: tuple[int, int]) -> BoolArray:
    """Known cells in the part of a grid that another grid of `shape`, placed at (row, column), covers."""
    top, left = max(row, 0), max(column, 0)
    bottom, right = max(row + shape[0], top), max(column + shape[1], left)
    known: BoolArray = cells[top:bottom, left:right] != UNKNOWN
    return known


BACK_NS = 10**9
"""Concurrently published maps may have stamps out of order by up to this; more means a clock was set back."""


FORWARD_NS = 366 * 86400 * 10**9
"""No two maps of a run are a year apart; a clock was set between those that are."""


class MapChecks:
    """Checks the maps of a topic as they arrive."""

    def __init__(self) -> None:
        self._stamp_ns: int | None = None
        self._frame: str | None = None

    def of(self, message: Grid | Patch | None, log_time_ns: int) -> tuple[MapWarning, ...]:
        """Return warnings about a map or a patch, by itself and compared with the previous one."""
        if message is None:
            return (MapWarning("no_cells", "a map without cells; skipped"),)
        map_warnings = list(message.map_warnings)
        before = self._stamp_ns
        if message.stamp_ns != 0:
            self._stamp_ns = message.stamp_ns
        # Sources without times, such as saved maps, have a log time of 0 too.
        if message.stamp_ns == 0 and log_time_ns != 0:
            map_warnings.append(MapWarning("stamp_zero", "its stamp is zero; only its log time is valid"))
        elif before is not None and message.stamp_ns < before - BACK_NS:
            map_warnings.append(
                MapWarning("stamp_back", f"its stamp goes back by {apart(before - message.stamp_ns)}")
            )
        elif before is not None and message.stamp_ns > before + FORWARD_NS:
            map_warnings.append(
                MapWarning("stamp_forward", f"its stamp goes forward by {apart(message.stamp_ns - before)}")
            )
        if isinstance(message, Grid):
            frame, self._frame = self._frame, message.geometry.frame_id
            if frame is not None and frame != self._frame:
                text = (
                    f"its frame changes from {frame!r} to {self._frame!r}; rooms are tracked by coordinates"
                )
                map_warnings.append(MapWarning("frame_changes", text))
        return tuple(map_warnings)
