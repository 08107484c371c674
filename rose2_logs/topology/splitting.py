"""Rooms whose Voronoi graph is not connected, or only through narrow passages, are split (paper, III-D)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import BoolArray, FloatArray, distinct_labels
from rose2_logs.parameters import TopologyParameters
from rose2_logs.topology.voronoi import parts_between_passages


def split_rooms(
    labels: NDArray[np.int32],
    walls: BoolArray,
    lines_m: FloatArray,
    directions_rad: FloatArray,
    resolution_m: float,
    parameters: TopologyParameters,
) -> NDArray[np.int32]:
    """Split rooms until the Voronoi graph of each is connected by more than narrow passages.

    Two large parts of a room are divided along the representative line that best keeps them apart;
    where none does, along the dominant direction that does, midway between the parts. A cut touches the cells
    of its own room only.

    Returns
    -------
    labels : (H, W) int32
        With new numbers for the split off parts, above the old ones.
    """
    labels = labels.copy()
    lines = _as_normals(lines_m)
    for _ in range(parameters.max_rounds):
        part = parts_between_passages(labels, walls, resolution_m, parameters)
        size = np.bincount(part.ravel()) * resolution_m**2
        size[0] = 0
        large = np.flatnonzero(size >= parameters.split_min_area_m2)
        if len(large) == 0:
            break
        present, first = distinct_labels(part)
        room_of_part = labels.ravel()[first[np.searchsorted(present, large)]]
        rooms, count = np.unique(room_of_part, return_counts=True)
        divided = False
        for room in rooms[count > 1]:
            parts = large[room_of_part == room]
            # The two largest parts are divided first; the rest follow in later rounds.
            parts = parts[np.lexsort((parts, -size[parts]))][:2]
            divided |= _split(labels, int(room), part, parts, lines, directions_rad, resolution_m, parameters)
        if not divided:
            break
    return labels


def _split(
    labels: NDArray[np.int32],
    room: int,
    part: NDArray[np.int32],
    parts: NDArray[np.intp],
    lines: tuple[FloatArray, FloatArray],
    directions_rad: FloatArray,
    resolution_m: float,
    parameters: TopologyParameters,
) -> bool:
    """Cut one room between two parts of its graph; tell whether it was cut."""
    cells = np.argwhere(labels == room)
    points = (cells[:, ::-1] + 0.5) * resolution_m
    of_cell = part[cells[:, 0], cells[:, 1]]
    one, two = points[of_cell == parts[0]], points[of_cell == parts[1]]
    candidates = [lines, _between(one, two, directions_rad)]
    for normals, offsets in candidates:
        if len(offsets) == 0:
            continue
        purity = np.array([_purity(one, two, n, d) for n, d in zip(normals, offsets, strict=True)])
        best = int(purity.argmax())
        if purity[best] >= parameters.split_min_purity:
            above = points @ normals[best] > offsets[best]
            second_above = (two @ normals[best] > offsets[best]).mean() > 0.5
            chosen = cells[above == second_above]
            labels[chosen[:, 0], chosen[:, 1]] = labels.max() + 1
            return True
    return False


def _purity(one: FloatArray, two: FloatArray, normal: FloatArray, offset: float) -> float:
    """Share of the worse part that lies on its own side of a line."""
    a, b = (one @ normal > offset).mean(), (two @ normal > offset).mean()
    return float(max(min(a, 1 - b), min(1 - a, b)))


def _as_normals(lines_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lines x0, y0, x1, y1 as unit normals (L, 2) and offsets (L,)."""
    vector = lines_m[:, 2:] - lines_m[:, :2]
    normal = np.column_stack([-vector[:, 1], vector[:, 0]])
    normal /= np.maximum(np.hypot(normal[:, 0], normal[:, 1]), 1e-12)[:, None]
    return normal, np.einsum("ij,ij->i", normal, lines_m[:, :2])


def _between(one: FloatArray, two: FloatArray, directions_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lines along the dominant directions, each at the offset that best divides two sets of points."""
    normals = np.column_stack([-np.sin(directions_rad), np.cos(directions_rad)])
    offsets = np.zeros(len(normals))
    for k, normal in enumerate(normals):
        a, b = one @ normal, two @ normal
        low, high = (a, b) if np.median(a) <= np.median(b) else (b, a)
        offsets[k] = (np.quantile(low, 0.98) + np.quantile(high, 0.02)) / 2
    return normals, offsets
