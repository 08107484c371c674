"""Faces that no wall divides are grouped to rooms (paper, III-C)."""

from __future__ import annotations

import heapq
from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import FloorPlanParameters
from rose2_logs.model.labels import roots
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.segmentation.floor_plan.edge_weights import EdgeEvidence

Border = tuple[float, float, float]
"""Open and closed length of a border in meters, and its best passage (see `EdgeEvidence.passage_share`)."""


def group_faces(
    edge_faces: NDArray[np.int32],
    evidence: EdgeEvidence,
    free_m2: FloatArray,
    seen: FloatArray,
    clearance_m: FloatArray,
    parameters: FloorPlanParameters,
) -> NDArray[np.int32]:
    """Join faces that no wall divides.

    By default the two groups with the best connection are joined, again and again, until no connection is
    good enough; the paper's DBSCAN over pairs of faces is there to compare.

    The openness of a border is its open length over its known length, wall or open, taken over the whole
    border between two groups, so that a door in a long wall never joins what the wall divides. The best
    passage through it is held against the room on both sides: what narrows like a door does not join.
    What is too small for a room at the end joins the neighbor that it opens to most.

    A wall with nothing to be seen behind it closes a border as far as the faces are not known: a half seen
    room may go on there. Of faces seen to the full it is furniture, or a wall within.

    Parameters
    ----------
    free_m2 : (F,) float
        Free area of each face; faces without any take no part.
    seen : (F,) float
        Share of each face that is known to be free.
    clearance_m : (F,) float
        Greatest distance from a wall within each face.

    Returns
    -------
    group : (F,) int32
        0.. for faces with free area, -1 for the others.
    """
    groups = _Groups(_borders(edge_faces, evidence, seen, free_m2 > 0), free_m2, clearance_m)
    if parameters.grouping == "dbscan":
        _join_by_dbscan(groups, parameters)
    else:
        _join_by_whole_borders(groups, parameters)
    _absorb_small(groups, parameters)
    return groups.labels()


def _join_by_dbscan(groups: _Groups, parameters: FloorPlanParameters) -> None:
    """Join faces by DBSCAN with the weight of the edges between them as their distance (paper, III-C)."""
    # Takes longer to import than a map to analyze, and this is not the usual way of joining.
    from scipy.sparse import csr_matrix
    from sklearn.cluster import DBSCAN

    count = len(groups.alive)
    pairs = [
        (a, b, border[1] / (border[0] + border[1]))
        for a, neighbors in groups.borders.items()
        for b, border in neighbors.items()
        if border[0] >= parameters.join_min_open_m
    ]
    first, second, weight = np.array(pairs or np.zeros((0, 3))).reshape(-1, 3).T
    # A distance of nothing would be read as no neighbor by the sparse matrix.
    distance = csr_matrix((weight + 1e-9, (first.astype(int), second.astype(int))), shape=(count, count))
    model = DBSCAN(eps=parameters.dbscan_max_weight, min_samples=1, metric="precomputed")
    cluster = model.fit_predict(distance)
    for number in np.unique(cluster):
        members = np.flatnonzero((cluster == number) & groups.alive)
        for member in members[1:].tolist():
            groups.join(int(members[0]), member)


def _join_by_whole_borders(groups: _Groups, parameters: FloorPlanParameters) -> None:
    """Join the pair of groups with the best border, as long as there is one that is open enough."""
    heap: list[tuple[float, float, int, int, Border]] = []

    def push(a: int, b: int) -> None:
        border = groups.borders[a][b]
        if border[0] < parameters.join_min_open_m:
            return
        openness, passage = border[0] / (border[0] + border[1]), border[2]
        if openness >= parameters.join_min_openness and passage >= parameters.join_min_passage:
            heapq.heappush(heap, (-openness * min(passage, 2.0), -border[0], min(a, b), max(a, b), border))

    for a, neighbors in groups.borders.items():
        for b in neighbors:
            if a < b:
                push(a, b)
    while heap:
        _, _, a, b, border = heapq.heappop(heap)
        # An entry is stale when one of the two is gone or their border has changed since.
        if groups.borders.get(a, {}).get(b) != border:
            continue
        for c in groups.join(a, b):
            push(a, c)


def _absorb_small(groups: _Groups, parameters: FloorPlanParameters) -> None:
    """Join what is too small or too narrow for a room to the neighbor that it opens to most."""
    heap = [(groups.free_m2[a], a) for a in np.flatnonzero(groups.alive).tolist()]
    heapq.heapify(heap)
    while heap:
        area, a = heapq.heappop(heap)
        if not groups.alive[a] or area != groups.free_m2[a]:
            continue
        small = area < parameters.room_min_area_m2
        narrow = groups.clearance_m[a] < parameters.room_min_clearance_m
        neighbors = groups.borders.get(a, {})
        if not (small or narrow) or not neighbors:
            continue
        best = max(neighbors, key=lambda b: (neighbors[b][0], -b))
        if neighbors[best][0] < parameters.join_min_open_m:
            continue
        groups.join(best, a)
        heapq.heappush(heap, (groups.free_m2[best], best))


class _Groups:
    """Groups of faces with what is known of the borders between them."""

    def __init__(
        self, borders: dict[int, dict[int, Border]], free_m2: FloatArray, clearance_m: FloatArray
    ) -> None:
        self.alive = free_m2 > 0
        self.free_m2 = free_m2.copy()
        self.clearance_m = np.maximum(clearance_m, 1e-6)
        self.borders = borders
        self._active = self.alive.copy()
        self._parent = np.arange(len(free_m2))

    def join(self, a: int, b: int) -> list[int]:
        """Make `b` part of `a`; return the neighbors that `a` now has from it."""
        self.alive[b] = False
        self._parent[b] = a
        self.free_m2[a] += self.free_m2[b]
        self.clearance_m[a] = max(self.clearance_m[a], self.clearance_m[b])
        taken = self.borders.pop(b, {})
        self.borders[a].pop(b, None)
        taken.pop(a, None)
        for c, (open_m, closed_m, passage) in taken.items():
            before = self.borders[a].get(c, (0.0, 0.0, 0.0))
            border = (before[0] + open_m, before[1] + closed_m, max(before[2], passage))
            self.borders[a][c] = self.borders[c][a] = border
            del self.borders[c][b]
        return list(taken)

    def labels(self) -> NDArray[np.int32]:
        """Group of each face, 0.., -1 for faces that take no part."""
        root = roots(self._parent)
        group = np.full(len(root), -1, np.int32)
        group[self._active] = np.unique(root[self._active], return_inverse=True)[1]
        return group


def _borders(
    edge_faces: NDArray[np.int32], evidence: EdgeEvidence, seen: FloatArray, active: NDArray[np.bool_]
) -> dict[int, dict[int, Border]]:
    use = np.all(edge_faces >= 0, axis=1)
    use[use] &= np.all(active[edge_faces[use]], axis=1)
    # Squared, so that what is behind the walls of a face seen by half is still three quarters unknown.
    known = np.minimum(seen[edge_faces[use]].min(axis=1), 1.0) ** 2
    closed = evidence.wall_m[use] - known * evidence.blind_m[use]
    borders: dict[int, dict[int, Border]] = defaultdict(dict)
    for (a, b), open_m, closed_m, passage in zip(
        edge_faces[use].tolist(),
        evidence.open_m[use].tolist(),
        closed.tolist(),
        evidence.passage_share[use].tolist(),
        strict=True,
    ):
        before = borders[a].get(b, (0.0, 0.0, 0.0))
        border = (before[0] + open_m, before[1] + closed_m, max(before[2], passage))
        borders[a][b] = borders[b][a] = border
    return borders
