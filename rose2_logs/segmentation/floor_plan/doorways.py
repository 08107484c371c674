"""Doorways: where free space of two rooms is connected."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from rose2_logs.model.occupancy import FloatArray

CONTACT_GAP_CELLS = 2.9
"""Contacts of the same two rooms this near belong to one doorway: one cell may be missing between them."""


def find_doorways(
    labels: NDArray[np.int32], resolution_m: float, min_width_m: float
) -> list[tuple[tuple[int, int], FloatArray]]:
    """Find the passages between rooms.

    Parameters
    ----------
    labels : (H, W) int32
        The segmented map.
    min_width_m : float
        Narrower contacts are noise of the map.

    Returns
    -------
    doorways : list of ((int, int), (2, 2) float)
        The two rooms, smaller first, and the ends of the passage in the grid frame, meters; sorted.
    """
    points, low, high = _contacts(labels)
    if len(points) == 0:
        return []
    pair = low * (int(labels.max()) + 1) + high
    near = cKDTree(points).query_pairs(CONTACT_GAP_CELLS, output_type="ndarray")
    near = near[pair[near[:, 0]] == pair[near[:, 1]]]
    graph = coo_matrix((np.ones(len(near), bool), near.T), shape=(len(points), len(points)))
    count, component = connected_components(graph, directed=False)
    order = np.argsort(component, kind="stable")
    bounds = np.searchsorted(component[order], np.arange(count + 1))
    found = []
    for first, last in itertools.pairwise(bounds):
        members = order[first:last]
        ends = _extremes(points[members]) * resolution_m
        if np.linalg.norm(ends[1] - ends[0]) + resolution_m >= min_width_m:
            found.append(((int(low[members[0]]), int(high[members[0]])), ends))
    return sorted(found, key=lambda item: (item[0], item[1].tolist()))


def _contacts(labels: NDArray[np.int32]) -> tuple[FloatArray, NDArray[np.int64], NDArray[np.int64]]:
    """Middles (K, 2) as x, y in cells between neighboring cells of two rooms, and the two rooms."""
    points, pairs = [], []
    for first, second, shift in (
        (labels[:, :-1], labels[:, 1:], (1.0, 0.5)),
        (labels[:-1], labels[1:], (0.5, 1.0)),
    ):
        row, column = np.nonzero((first != second) & (first > 0) & (second > 0))
        points.append(np.column_stack([column, row]) + np.array(shift))
        pairs.append(np.sort(np.column_stack([first[row, column], second[row, column]]), axis=1))
    both = np.concatenate(pairs).astype(np.int64)
    return np.concatenate(points), both[:, 0], both[:, 1]


def _extremes(points: FloatArray) -> FloatArray:
    """Two points (2, 2) farthest apart along the main axis of a few points."""
    centered = points - points.mean(0)
    axis = np.linalg.svd(centered, full_matrices=False)[2][0]
    along = centered @ axis
    ends: FloatArray = np.array([points[along.argmin()], points[along.argmax()]])
    return ends[np.lexsort((ends[:, 1], ends[:, 0]))]
