"""Faces that no wall divides are grouped to rooms (paper, III-C)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.model.regions import RegionGraph, best_first
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

    With `walls` the two groups with the best connection are joined, again and again, until no connection is
    good enough; with `dbscan` pairs of faces are clustered as in the paper, for comparison.

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
    takes_part = free_m2 > 0
    borders = _borders(edge_faces, evidence, seen, takes_part, parameters.known_power)
    groups = _Groups(borders, free_m2, clearance_m)
    if parameters.grouping == "dbscan":
        _join_by_dbscan(groups, parameters)
    else:
        _join_by_whole_borders(groups, parameters)
    _absorb_small(groups, parameters)
    group = np.full(len(free_m2), -1, np.int32)
    group[takes_part] = np.unique(groups.holders()[takes_part], return_inverse=True)[1]
    return group


class _Groups(RegionGraph[Border]):
    """Groups of faces with their free area, their clearance, and the borders between them."""

    def __init__(
        self, borders: dict[tuple[int, int], Border], free_m2: FloatArray, clearance_m: FloatArray
    ) -> None:
        super().__init__(len(free_m2), borders, _add)
        self.free_m2 = free_m2.copy()
        self.clearance_m = clearance_m.copy()

    def join(self, region: int, target: int) -> list[int]:
        """Make a group part of another; return the neighbors that came with it."""
        self.free_m2[target] += self.free_m2[region]
        self.clearance_m[target] = max(self.clearance_m[target], self.clearance_m[region])
        return super().join(region, target)


def _add(one: Border, other: Border) -> Border:
    """Border of two borders together."""
    return one[0] + other[0], one[1] + other[1], max(one[2], other[2])


def _borders(
    edge_faces: NDArray[np.int32],
    evidence: EdgeEvidence,
    seen: FloatArray,
    takes_part: BoolArray,
    power: float,
) -> dict[tuple[int, int], Border]:
    """Border of each pair of neighboring faces that take part."""
    use = np.all(edge_faces >= 0, axis=1)
    use[use] &= np.all(takes_part[edge_faces[use]], axis=1)
    known = np.minimum(seen[edge_faces[use]].min(axis=1), 1.0) ** power
    closed = evidence.wall_m[use] - known * evidence.blind_m[use]
    borders: dict[tuple[int, int], Border] = {}
    for pair, *border in zip(
        map(tuple, np.sort(edge_faces[use], axis=1).tolist()),
        evidence.open_m[use].tolist(),
        closed.tolist(),
        evidence.passage_share[use].tolist(),
        strict=True,
    ):
        borders[pair] = _add(borders.get(pair, (0.0, 0.0, 0.0)), (border[0], border[1], border[2]))
    return borders


def _join_by_dbscan(groups: _Groups, parameters: FloorPlanParameters) -> None:
    """Join faces by DBSCAN with the weight of the edges between them as their distance (paper, III-C)."""
    # Takes longer to import than a map to analyze, and this is not the usual way of joining.
    from scipy.sparse import csr_matrix
    from sklearn.cluster import DBSCAN

    count = len(groups.borders)
    pairs = [
        (a, b, border[1] / (border[0] + border[1]))
        for a, neighbors in enumerate(groups.borders)
        for b, border in neighbors.items()
        if border[0] >= parameters.join_min_open_m
    ]
    first, second, weight = np.array(pairs or np.zeros((0, 3))).reshape(-1, 3).T
    # A distance of nothing would be read as no neighbor by the sparse matrix.
    distance = csr_matrix((weight + 1e-9, (first.astype(int), second.astype(int))), shape=(count, count))
    model = DBSCAN(eps=parameters.dbscan_max_weight, min_samples=1, metric="precomputed")
    cluster = model.fit_predict(distance)
    takes_part = groups.free_m2 > 0
    for number in np.unique(cluster):
        members = np.flatnonzero((cluster == number) & takes_part).tolist()
        for member in members[1:]:
            groups.join(member, members[0])


def _join_by_whole_borders(groups: _Groups, parameters: FloorPlanParameters) -> None:
    """Join the pair of groups with the best border, as long as there is one that is open enough."""

    def worst_last(pair: tuple[int, int]) -> tuple[float, float] | None:
        border = groups.borders[pair[0]].get(pair[1])
        if border is None or border[0] < parameters.join_min_open_m:
            return None
        open_m, closed_m, passage = border
        openness = open_m / (open_m + closed_m)
        if openness < parameters.join_min_openness or passage < parameters.join_min_passage:
            return None
        return -openness * min(passage, parameters.passage_wide), -open_m

    def join(pair: tuple[int, int]) -> list[tuple[int, int]]:
        target, region = pair
        return [(min(target, c), max(target, c)) for c in groups.join(region, target)]

    pairs = [(a, b) for a, neighbors in enumerate(groups.borders) for b in neighbors if a < b]
    best_first(pairs, worst_last, join)


def _absorb_small(groups: _Groups, parameters: FloorPlanParameters) -> None:
    """Join what is too small or too narrow for a room to the neighbor that it opens to most."""

    def smallest_first(group: int) -> float | None:
        return float(groups.free_m2[group]) if groups.exists(group) else None

    def absorb(group: int) -> list[int]:
        small = groups.free_m2[group] < parameters.room_min_area_m2
        narrow = groups.clearance_m[group] < parameters.room_min_clearance_m
        neighbors = groups.borders[group]
        if not (small or narrow) or not neighbors:
            return []
        best = max(neighbors, key=lambda other: (neighbors[other][0], -other))
        if neighbors[best][0] < parameters.join_min_open_m:
            return []
        groups.join(group, best)
        return [best]

    best_first(np.flatnonzero(groups.free_m2 > 0).tolist(), smallest_first, absorb)
