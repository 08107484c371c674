"""Rooms whose Voronoi graph is not connected, or only through narrow passages, are split (paper, III-D)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree, box, linestrings

from rose2_logs.config.topology import TopologyParameters
from rose2_logs.model.labels import LabelRuns, known_window
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.topology.voronoi import clearance_m, parts_of_room


def split_rooms(
    labels: NDArray[np.int32],
    distance: NDArray[np.float32],
    lines_m: FloatArray,
    directions_rad: FloatArray,
    resolution_m: float,
    parameters: TopologyParameters,
) -> NDArray[np.int32]:
    """Split rooms until the Voronoi graph of each is connected by more than narrow passages.

    Two large parts of a room are divided along the representative line near it that best keeps them apart;
    where none does, along the dominant direction that does, midway between the parts. A cut touches the cells
    of its own room only.

    Parameters
    ----------
    labels : (H, W) int32
        Room 1.. of each cell, 0 for none.
    distance : (H, W) float32
        Of each cell from the nearest wall cell, in cells.
    lines_m : (L, 4) float
        Representative lines.
    directions_rad : (D,) float
        Dominant directions.
    resolution_m : float
    parameters : TopologyParameters

    Returns
    -------
    labels : (H, W) int32
        With new numbers for the split off parts, above the old ones.
    """
    labels = labels.copy()
    clear = clearance_m(distance, resolution_m, parameters.clearance_blur_cells)
    lines = _Lines.of(lines_m)
    number = int(labels.max(initial=0))
    pending = [
        (room, window, 0)
        for room, window in enumerate(LabelRuns.of(labels).windows(), start=1)
        if window is not None
    ]
    while pending:
        room, window, rounds = pending.pop()
        beyond = _beyond_cut(
            labels[window] == room, window, clear, lines, directions_rad, resolution_m, parameters
        )
        if beyond is None:
            continue
        number += 1
        labels[window][beyond] = number
        if rounds + 1 < parameters.max_rounds:
            pending += [(part, _shrunk(window, labels, part), rounds + 1) for part in (room, number)]
    return labels


def _shrunk(window: tuple[slice, slice], labels: NDArray[np.int32], label: int) -> tuple[slice, slice]:
    """Shrink a window of a label image (H, W) to what holds all of a label."""
    rows, columns = known_window(labels[window] == label)
    top, left = window[0].start, window[1].start
    return slice(top + rows.start, top + rows.stop), slice(left + columns.start, left + columns.stop)


@dataclass(frozen=True, eq=False)
class _Lines:
    """The representative lines: normals (L, 2) and offsets (L,), and a tree to find those that meet a box."""

    normals: FloatArray
    offsets: FloatArray
    tree: STRtree

    @classmethod
    def of(cls, ends_m: FloatArray) -> _Lines:
        return cls(*_as_normals(ends_m), STRtree(linestrings(ends_m.reshape(-1, 2, 2))))

    def near(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Normals and offsets of the lines that meet the box around some points."""
        x, y = points.T  # each by itself: NumPy is slow at the minimum of rows of two
        near = np.sort(self.tree.query(box(x.min(), y.min(), x.max(), y.max()), predicate="intersects"))
        return self.normals[near], self.offsets[near]


def _beyond_cut(
    inside: BoolArray,
    window: tuple[slice, slice],
    clear: NDArray[np.float32],
    lines: _Lines,
    directions_rad: FloatArray,
    resolution_m: float,
    parameters: TopologyParameters,
) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Rows and columns of the cells beyond the cut through a room, in its window; None if it stays whole."""
    if np.count_nonzero(inside) * resolution_m**2 < 2 * parameters.split_min_area_m2:
        return None  # too small for two parts
    part = parts_of_room(inside, clear[window], resolution_m, parameters)
    if part is None:
        return None
    size = np.bincount(part.ravel())[1:] * resolution_m**2
    # The two largest parts are divided first; the rest follow in later rounds.
    largest = np.argsort(-size, kind="stable")[:2]
    if len(largest) < 2 or size[largest[1]] < parameters.split_min_area_m2:
        return None
    cell = np.flatnonzero(inside)
    row, column = np.divmod(cell, inside.shape[1])
    in_cells = np.empty((len(row), 2), np.float32)
    in_cells[:, 0], in_cells[:, 1] = column, row
    in_cells += np.array([window[1].start, window[0].start], np.float32) + 0.5
    in_cells *= resolution_m
    points = in_cells.astype(float)  # once, not for every line
    of_cell = part.take(cell)
    one, two = (points.compress(of_cell == number + 1, axis=0) for number in largest)
    normals, offsets = lines.near(points)
    beyond = _cut(points, one, two, normals, offsets, parameters.split_min_purity)
    if beyond is None:
        normals, offsets = _between(one, two, directions_rad, parameters.cut_tail_share)
        beyond = _cut(points, one, two, normals, offsets, parameters.split_min_purity)
    return None if beyond is None else (row[beyond], column[beyond])


def _cut(
    points: FloatArray,
    one: FloatArray,
    two: FloatArray,
    normals: FloatArray,
    offsets: FloatArray,
    min_purity: float,
) -> BoolArray | None:
    """Find which points (P,) are on the second part's side of the best line; None if none divides."""
    purity = np.array([_purity(one, two, n, d, min_purity) for n, d in zip(normals, offsets, strict=True)])
    best = int(purity.argmax()) if len(purity) else -1
    if best < 0 or purity[best] < min_purity:
        return None
    above = points @ normals[best] > offsets[best]
    beyond: BoolArray = above == ((two @ normals[best] > offsets[best]).mean() > 0.5)
    return beyond


def _purity(one: FloatArray, two: FloatArray, normal: FloatArray, offset: float, least: float) -> float:
    """Share of the worse part that is on its own side of a line; 0 where that of one part is too low."""
    a = np.count_nonzero(one @ normal > offset) / len(one)
    if max(a, 1 - a) < least:
        return 0.0
    b = np.count_nonzero(two @ normal > offset) / len(two)
    return max(min(a, 1 - b), min(1 - a, b))


def _as_normals(lines_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lines x0, y0, x1, y1 as unit normals (L, 2) and offsets (L,)."""
    vector = lines_m[:, 2:] - lines_m[:, :2]
    normal = np.column_stack([-vector[:, 1], vector[:, 0]])
    normal /= np.maximum(np.hypot(normal[:, 0], normal[:, 1]), 1e-12)[:, None]
    return normal, np.einsum("ij,ij->i", normal, lines_m[:, :2])


def _between(
    one: FloatArray, two: FloatArray, directions_rad: FloatArray, tail_share: float
) -> tuple[FloatArray, FloatArray]:
    """Lines along the dominant directions, each at the offset that best divides two sets of points."""
    normals = np.column_stack([-np.sin(directions_rad), np.cos(directions_rad)])
    offsets = np.zeros(len(normals))
    for k, normal in enumerate(normals):
        a, b = one @ normal, two @ normal
        low, high = (a, b) if np.median(a) <= np.median(b) else (b, a)
        offsets[k] = (np.quantile(low, 1 - tail_share) + np.quantile(high, tail_share)) / 2
    return normals, offsets
