"""The graph of regions: sums from which every feature of a join follows, after any joins."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.labels import contacts, distance_from, numbered
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.regions.plan_frame import Labels, grown_labels, without_specks
from rose2_logs.segmentation.regions.plan_raster import OFFSETS, PlanRaster

GROW_M = 0.3
"""Regions face one another across walls of this thickness."""
LINE_WINDOWS_M = (1.5, 3.0, 6.0)
"""Wall is looked for along the line of a border within windows of these lengths."""
STRONG_SCORE = 0.6
"""Structure score of walls that go on for more than half of a room's side."""
WIDE_M = 0.5
"""What is wider than this is open floor, not a ray."""
WALL_MIN_CELLS = 3
"""Occupied pieces below this size do not narrow the clearance."""
ATOM_REACH_CELLS = 1.5
"""Atoms are taken to reach over gaps of noise this wide."""

NODE_SUMS = ("area", "wall_edges", "unknown_edges", "wide", "outside")
NODE_MAXIMA = (
    "clear",
    "clear_strong",
    "x_high",
    "x_low",
    "y_high",
    "y_low",
    "sum_high",
    "sum_low",
    "dif_high",
    "dif_low",
)
"""Maxima: of the clearance, and of the coordinates and their negatives, so that boxes and octagons follow."""
BORDER_SUMS = (
    "upright", "level", "facing_wall", "facing_unknown", "clear", "on_face",
    "line_0", "line_1", "line_2",
    "different_0", "different_1", "different_2", "pairs_0", "pairs_1", "pairs_2",
)  # fmt: skip
BORDER_MAXIMA = ("saddle", "saddle_strong", "x_high", "x_low", "y_high", "y_low")


@dataclass(eq=False)
class RegionGraph:
    """Regions and their borders.

    Attributes
    ----------
    node_sums, node_maxima : (N, ...) float
        Columns as in `NODE_SUMS`, `NODE_MAXIMA`; meters and square meters.
    ends : (M, 2) int
        The two regions of each border, the lower number first; each pair once. Pairs that do not touch but
        are near are listed too, with a contact of 0.
    border_sums, border_maxima : (M, ...) float
        Columns as in `BORDER_SUMS`, `BORDER_MAXIMA`.
    """

    node_sums: FloatArray
    node_maxima: FloatArray
    ends: NDArray[np.int64]
    border_sums: FloatArray
    border_maxima: FloatArray

    def joined(self, root: NDArray[np.int64]) -> tuple[RegionGraph, NDArray[np.int64]]:
        """Join regions.

        Parameters
        ----------
        root : (N,) int
            New number 0..K-1 of each region; those with the same are joined.

        Returns
        -------
        graph : RegionGraph
        border : (M,) int
            New number of each border, -1 for those that are gone.
        """
        count = int(root.max(initial=-1)) + 1
        node_sums = _summed(self.node_sums, root, count)
        node_maxima = np.full((count, self.node_maxima.shape[1]), -np.inf)
        np.maximum.at(node_maxima, root, self.node_maxima)
        ends = np.sort(root[self.ends], axis=1)
        kept = ends[:, 0] != ends[:, 1]
        key, index = np.unique(ends[kept, 0] * count + ends[kept, 1], return_inverse=True)
        border = np.full(len(ends), -1, np.int64)
        border[kept] = index
        border_maxima = np.full((len(key), self.border_maxima.shape[1]), -np.inf)
        np.maximum.at(border_maxima, index, self.border_maxima[kept])
        graph = RegionGraph(
            node_sums,
            node_maxima,
            np.column_stack(np.divmod(key, max(count, 1))),
            _summed(self.border_sums[kept], index, len(key)),
            border_maxima,
        )
        return graph, border


def _summed(values: FloatArray, index: NDArray[np.int64], count: int) -> FloatArray:
    columns = [np.bincount(index, column, minlength=count) for column in values.T]
    return np.stack(columns, axis=1) if columns else np.zeros((count, 0))


def build_graph(
    atoms: Labels,
    raster: PlanRaster,
    strong: BoolArray,
    faces: Labels,
    answers: NDArray[np.float32] | None,
    cell_m: float,
    count: int,
) -> RegionGraph:
    """Measure atoms and their borders on the plan frame.

    Parameters
    ----------
    atoms : (H, W) int32
        Atom 1..N of each cell, 0 for none.
    raster : PlanRaster
    strong : (H, W) bool
        Cells of walls that go on for long, see `STRONG_SCORE`.
    faces : (H, W) int32
    answers : (OUTPUTS, H, W) float32, optional
        The network's.
    cell_m : float
    count : int
        Number of atoms; those that no center of a plan cell meets are not in the image.
    """
    wall = raster.wall > 0
    inside = (raster.free > 0) | (atoms > 0)
    atoms = np.where(inside, grown_labels(atoms, ATOM_REACH_CELLS), 0).astype(np.int32)
    solid = without_specks(wall, WALL_MIN_CELLS)
    clear, clear_strong = (_clearance(mask, cell_m) for mask in (solid, strong))
    at = np.flatnonzero(atoms > 0)
    row, column = np.divmod(at, atoms.shape[1])
    node = atoms.take(at).astype(np.int64) - 1
    node_sums = np.zeros((count, len(NODE_SUMS)))
    node_sums[:, 0] = np.bincount(node, minlength=count) * cell_m**2
    kind = np.full((atoms.shape[0] + 2, atoms.shape[1] + 2), 2, np.uint8)
    kind[1:-1, 1:-1] = np.where(wall, np.uint8(1), np.where(atoms > 0, np.uint8(0), np.uint8(2)))
    in_kind = (row + 1) * kind.shape[1] + column + 1
    for step in (-kind.shape[1], -1, 1, kind.shape[1]):
        beside = kind.take(in_kind + step)
        for which in (1, 2):
            node_sums[:, which] += np.bincount(node.compress(beside == which), minlength=count) * cell_m
    width = 2 * round(WIDE_M / cell_m / 2) + 1
    wide = cv2.morphologyEx(inside.astype(np.uint8), cv2.MORPH_OPEN, np.ones((width, width), np.uint8))
    node_sums[:, 3] = np.bincount(node.compress(wide.take(at) > 0), minlength=count) * cell_m**2
    if answers is not None:
        node_sums[:, 4] = np.bincount(node, answers[-1].take(at), minlength=count) * cell_m**2
    node_maxima = np.full((count, len(NODE_MAXIMA)), -np.inf)
    _fill_maxima(node_maxima[:, :2], node, (clear.take(at), clear_strong.take(at)))
    # What reaches farthest has no cell of its atom on its left, or none on its right.
    is_end = np.ones(atoms.shape, bool)
    is_end[:, 1:-1] = (atoms[:, 1:-1] != atoms[:, :-2]) | (atoms[:, 1:-1] != atoms[:, 2:])
    outer = np.flatnonzero(is_end.take(at))
    x, y = (column.take(outer) + 0.5) * cell_m, (row.take(outer) + 0.5) * cell_m
    half = cell_m / 2
    reaches = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1))
    extents = (a * x + b * y + half * (abs(a) + abs(b)) for a, b in reaches)
    _fill_maxima(node_maxima[:, 2:], node.take(outer), extents)
    # An atom that no center of a plan cell meets.
    missed = np.isinf(node_maxima[:, 0])
    node_maxima[missed] = 0
    node_sums[missed, 0] = cell_m**2
    keys, sums, maxima = _border_records(atoms, wall, clear, clear_strong, faces, answers, cell_m, count)
    key, index = numbered(keys)
    border_maxima = np.full((len(key), len(BORDER_MAXIMA)), -np.inf)
    touching = np.isfinite(maxima[:, 0])
    _fill_maxima(border_maxima, index[touching], maxima[touching].T)
    ends = np.column_stack(np.divmod(key, max(count, 1)))
    return RegionGraph(node_sums, node_maxima, ends, _summed(sums, index, len(key)), border_maxima)


def _fill_maxima(out: FloatArray, index: NDArray[np.int64], values: Iterable[NDArray[np.floating]]) -> None:
    """Greatest of the values of each index, a column at a time, by sorting once."""
    if len(index) == 0:
        return
    order = np.argsort(index, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(index[order]) != 0))
    which = index[order][first]
    for column, value in enumerate(values):
        out[which, column] = np.maximum.reduceat(np.asarray(value)[order], first)


def _border_records(
    atoms: Labels,
    wall: BoolArray,
    clear: NDArray[np.float32],
    clear_strong: NDArray[np.float32],
    faces: Labels,
    answers: NDArray[np.float32] | None,
    cell_m: float,
    count: int,
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """One row for each pair of cells beside one another (or asked about) that lie in two regions."""
    grown = grown_labels(atoms, GROW_M / cell_m)
    keys, sums, maxima = [], [], []
    meet = contacts(grown)
    meet = meet.chosen(meet.low > 0)
    in_one_row = meet.first // grown.shape[1] == meet.second // grown.shape[1]
    for upright in (True, False):
        of_kind = meet.chosen(in_one_row == upright)
        one, other = of_kind.first, of_kind.second
        row, column = np.divmod(one, grown.shape[1])
        row2, column2 = (row, column + 1) if upright else (row + 1, column)
        open_contact = (atoms.take(one) > 0) & (atoms.take(other) > 0)
        walled = wall.take(one) | wall.take(other)
        record = np.zeros((len(one), len(BORDER_SUMS)))
        record[:, 0 if upright else 1] = open_contact * cell_m
        record[:, 2] = (~open_contact & walled) * cell_m
        record[:, 3] = (~open_contact & ~walled) * cell_m
        narrow = np.minimum(clear.take(one), clear.take(other))
        record[:, 4] = open_contact * narrow * cell_m
        record[:, 5] = (open_contact & (faces.take(one) != faces.take(other))) * cell_m
        near = cv2.dilate(wall.astype(np.uint8), np.ones((1, 3) if upright else (3, 1), np.uint8))
        for k, length in enumerate(LINE_WINDOWS_M):
            along = _share_along(near, upright, length / cell_m, one, other)
            record[:, 6 + k] = open_contact * along * cell_m
        extreme = np.full((len(one), len(BORDER_MAXIMA)), -np.inf)
        x, y = (column + column2 + 1) / 2 * cell_m, (row + row2 + 1) / 2 * cell_m
        half_x, half_y = (0.0, cell_m / 2) if upright else (cell_m / 2, 0.0)
        narrow_strong = np.minimum(clear_strong.take(one), clear_strong.take(other))
        for k, value in enumerate((narrow, narrow_strong, x + half_x, half_x - x, y + half_y, half_y - y)):
            extreme[:, k] = np.where(open_contact, value, -np.inf)
        keys.append(_pair_key(of_kind.low, of_kind.high, count))
        sums.append(record)
        maxima.append(extreme)
    if answers is not None:
        for k, (down, right) in enumerate(OFFSETS):
            a = atoms[down:, right:]
            b = atoms[: max(atoms.shape[0] - down, 0), : max(atoms.shape[1] - right, 0)]
            row, column = np.divmod(np.flatnonzero((a != b) & (a > 0) & (b > 0)), max(a.shape[1], 1))
            upper = row * atoms.shape[1] + column
            lower = upper + down * atoms.shape[1] + right
            key, index = numbered(_pair_key(atoms.take(lower), atoms.take(upper), count))
            record = np.zeros((len(key), len(BORDER_SUMS)))
            record[:, 9 + k // 2] = np.bincount(index, answers[k].take(lower), minlength=len(key))
            record[:, 12 + k // 2] = np.bincount(index, minlength=len(key))
            keys.append(key)
            sums.append(record)
            maxima.append(np.full((len(key), len(BORDER_MAXIMA)), -np.inf))
    return np.concatenate(keys), np.concatenate(sums), np.concatenate(maxima)


def _pair_key(a: NDArray[np.integer], b: NDArray[np.integer], count: int) -> NDArray[np.int64]:
    low, high = np.minimum(a, b).astype(np.int64) - 1, np.maximum(a, b).astype(np.int64) - 1
    key: NDArray[np.int64] = low * count + high
    return key


def _share_along(
    mask: NDArray[Any],
    upright: bool,
    length_cells: float,
    one: NDArray[np.intp],
    other: NDArray[np.intp],
) -> NDArray[np.float32]:
    """Share of a mask in a window along a line through one cell or the other, whichever (N,) is greater."""
    size = 2 * round(length_cells / 2) + 1
    window = (1, size) if upright else (size, 1)
    cells = cv2.boxFilter(mask, cv2.CV_32S, window, normalize=False, borderType=cv2.BORDER_CONSTANT)
    return (np.maximum(cells.take(one), cells.take(other)) / np.float32(size)).astype(np.float32)


def _clearance(blocked: BoolArray, cell_m: float) -> NDArray[np.float32]:
    # Where nothing is blocked, OpenCV says the greatest number that there is.
    with np.errstate(over="ignore"):
        clearance = distance_from(blocked) * np.float32(cell_m)
    finite: NDArray[np.float32] = np.minimum(clearance, np.finfo(np.float32).max).astype(np.float32)
    return finite
