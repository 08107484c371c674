"""The Voronoi graph of free space as cells, and the narrowest places along it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import QhullError, Voronoi

from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.baselines.regions import (
    CROSS,
    cells_on_lines,
    eroded,
    middle_of,
    nearest_cells,
    opened,
)

AROUND = np.array([(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)])
"""Row and column of the eight neighbors of a cell."""


def boundary_cells(free: BoolArray) -> NDArray[np.intp]:
    """Row and column (K, 2) of the free cells of which a side touches an obstacle."""
    return np.argwhere(free & ~eroded(free, CROSS))


def voronoi_cells(free: BoolArray, clear_rounds: int, prune_passes: int) -> BoolArray:
    """Draw the Voronoi graph of the boundary cells where it keeps clear of them, without loose ends.

    Parameters
    ----------
    free : (H, W) bool
    clear_rounds : int
        The graph keeps this many cells away from obstacles, and out of what is narrower than three cells.
    prune_passes : int
        Each takes one cell off every end of the graph that is no node; nodes are cells of the graph with
        three neighbors or more.

    Returns
    -------
    graph : (H, W) bool
    """
    graph = np.zeros(free.shape, bool)
    clear = eroded(opened(free), rounds=clear_rounds)
    try:
        diagram = Voronoi(boundary_cells(free))
    except (QhullError, ValueError):
        # Fewer than three boundary cells, or all on one line: nothing lies between walls.
        return graph
    ends = np.array(diagram.ridge_vertices).reshape(-1, 2)
    ends = ends[(ends >= 0).all(1)]
    middle = middle_of(free)
    cell = nearest_cells(diagram.vertices, middle)
    inside: BoolArray = np.all((cell >= 0) & (cell < free.shape), axis=1)
    row, column = np.where(inside[:, None], cell, 0).T
    is_clear = inside & clear[row, column]
    ends = ends[is_clear[ends].all(1)]
    first, last = diagram.vertices[ends[:, 0]], diagram.vertices[ends[:, 1]]
    row, column = cells_on_lines(first, last, middle).T
    graph[row, column] = True
    return _pruned(graph, prune_passes)


def _pruned(graph: BoolArray, passes: int) -> BoolArray:
    nodes = graph & (_neighbor_count(graph) >= 3)
    for _ in range(passes):
        ends = graph & ~nodes & (_neighbor_count(graph) <= 1)
        if not ends.any():
            break
        graph = graph & ~ends
    return graph


def _neighbor_count(graph: BoolArray) -> NDArray[np.uint8]:
    kernel = np.ones((3, 3), np.float32)
    kernel[1, 1] = 0
    return np.asarray(cv2.filter2D(graph.astype(np.uint8), -1, kernel, borderType=cv2.BORDER_CONSTANT))


def narrowest_cells(
    graph: BoolArray, distance: NDArray[np.float32], neighborhood: float, max_rounds: int
) -> NDArray[np.intp]:
    """Find the cell that is nearest to obstacles in the neighborhood of each cell of the graph.

    A cell's neighborhood is what lies within a number of steps along the graph: the least with which there
    are more than ``neighborhood / distance`` cells in it, so that it is long where the passage is narrow.

    Parameters
    ----------
    graph : (H, W) bool
    distance : (H, W) float32
        Distance from obstacles in cells.
    neighborhood : float
        Cells of a neighborhood times its center's distance from obstacles.
    max_rounds : int
        Most steps from the center.

    Returns
    -------
    cells : (K, 2) int
        Row and column, in reading order. Of several cells at the same distance the fewest steps count, and
        all of those are taken.
    """
    cells = np.argwhere(graph)
    if len(cells) == 0:
        return cells
    value = distance[graph]
    wanted = np.floor(neighborhood / value).astype(np.int64)
    neighbors, start = _adjacency(graph, cells)
    count = np.diff(start)

    total = len(cells)
    everyone = np.arange(total)
    size = np.ones(total, np.int64)
    least = value.copy()
    found = [(everyone, everyone, value)]
    before = np.zeros(0, np.int64)
    front = everyone * total + everyone
    for _ in range(max_rounds):
        source, cell = np.divmod(front, total)
        going = size[source] <= wanted[source]
        source, cell = source[going], cell[going]
        if len(cell) == 0:
            break
        owner = np.repeat(np.arange(len(cell)), count[cell])
        first = np.concatenate([[0], np.cumsum(count[cell])[:-1]])
        reached = neighbors[start[cell][owner] + np.arange(len(owner)) - first[owner]]
        pairs = np.unique(source[owner] * total + reached)
        # One step from the front lie only the front, the one before it, and what is new.
        pairs = pairs[~_is_in(pairs, front) & ~_is_in(pairs, before)]
        before, front = front, pairs
        source, cell = np.divmod(front, total)
        size += np.bincount(source, minlength=total)
        narrower = value[cell] < least[source]
        found.append((source[narrower], cell[narrower], value[cell[narrower]]))
        np.minimum.at(least, source, value[cell])
    # The last round in which a neighborhood became narrower is the first that reached its least distance.
    source, cell, at = (np.concatenate(parts) for parts in zip(*found, strict=True))
    narrowest = np.unique(cell[at == least[source]])
    return np.asarray(cells[narrowest], np.intp)


def _is_in(sorted_values: NDArray[np.int64], others: NDArray[np.int64]) -> BoolArray:
    """Find which values are among others; both ascending."""
    if len(others) == 0:
        return np.zeros(len(sorted_values), bool)
    place = np.minimum(np.searchsorted(others, sorted_values), len(others) - 1)
    same: BoolArray = others[place] == sorted_values
    return same


def _adjacency(graph: BoolArray, cells: NDArray[np.intp]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Neighbors (E,) of the graph's cells, one cell after the other, and where each one's start (K + 1,)."""
    number = np.full((graph.shape[0] + 2, graph.shape[1] + 2), -1, np.int64)
    number[cells[:, 0] + 1, cells[:, 1] + 1] = np.arange(len(cells))
    around = cells[:, None] + 1 + AROUND
    table = number[around[..., 0], around[..., 1]]
    present = table >= 0
    return table[present], np.concatenate([[0], np.cumsum(present.sum(1))])
