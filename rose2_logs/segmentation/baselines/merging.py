"""Joining the pieces of the Voronoi segmentation to rooms, by the borders that they share."""

from __future__ import annotations

import heapq
import operator

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.baselines import VoronoiMergeParameters
from rose2_logs.model.labels import contacts, distinct_labels
from rose2_logs.model.regions import RegionGraph, best_first
from rose2_logs.segmentation.baselines.regions import ranks_by_size

WALL = 0


def merge_rooms(
    labels: NDArray[np.int32], resolution_m: float, parameters: VoronoiMergeParameters
) -> NDArray[np.int32]:
    """Join rooms to the neighbor with which they share the longest border, the smallest room first.

    Whenever two rooms were joined, the search starts anew with the smallest room.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms 1.., 0 for none.
    resolution_m : float
        Side of a cell.
    parameters : VoronoiMergeParameters

    Returns
    -------
    labels : (H, W) int32
        Rooms 1.. in the order of the labels that the others were joined to.
    """
    rooms = _Rooms(labels, resolution_m)

    def join(room: int) -> list[int]:
        target = rooms.widest_neighbor(room)
        if target is None or not _is_joined(rooms, room, target, parameters):
            return []
        rooms.join(room, target)
        # Only rooms near the last two that were joined can have become joinable.
        return sorted(rooms.within_two(target))

    best_first(range(WALL + 1, len(rooms.area_m2)), rooms.smallest_first, join)
    present, _ = distinct_labels(labels)
    holder = rooms.holders()
    kept = np.unique(holder[present[present != WALL]])
    number = np.zeros(len(holder), np.int32)
    number[kept] = np.arange(1, len(kept) + 1)
    return number[holder][labels]


def _is_joined(rooms: _Rooms, room: int, target: int, p: VoronoiMergeParameters) -> bool:
    """Return whether a room is part of the neighbor with which it shares the longest border."""
    border, wall = rooms.share(room, target), rooms.share(room, WALL)
    border_back, target_wall = rooms.share(target, room), rooms.share(target, WALL)
    has_one_neighbor = rooms.neighbor_count(room) == 1
    dead_end = has_one_neighbor and rooms.area_m2[room] < p.dead_end_max_area_m2
    small = rooms.area_m2[room] < p.small_max_area_m2
    niche = has_one_neighbor or wall + border > p.niche_min_cover
    target_is_hub = (
        rooms.neighbor_count(target) > 2
        and target_wall + rooms.two_longest(target) < p.niche_target_min_cover
    )
    corridor = border > p.half_open_min_border and p.half_open_wall - 2 * border < wall < 1 - border
    return (
        (dead_end and wall <= p.dead_end_max_wall)
        or (small and border > p.small_min_border and target_wall <= p.small_target_max_wall)
        or (niche and wall > p.niche_min_wall and border > p.niche_min_border and not target_is_hub)
        or ((border > p.open_min_border or corridor) and border_back > p.open_min_border_back)
        or border > p.wide_min_border
    )


class _Rooms(RegionGraph[int]):
    """Rooms while they are joined, with the walls as region `WALL`; borders count sides of cells.

    Attributes
    ----------
    area_m2 : list of float
        By label; the first, of cells of no room, is not used.
    """

    def __init__(self, labels: NDArray[np.int32], resolution_m: float) -> None:
        size = np.bincount(labels.ravel(), minlength=1)
        pairs, pair = contacts(np.pad(labels, 1)).pairs()
        lengths = np.bincount(pair, minlength=len(pairs)).tolist()
        super().__init__(len(size), dict(zip(pairs, lengths, strict=True)), operator.add)
        self.area_m2: list[float] = (size * resolution_m**2).tolist()
        self._rank: list[int] = ranks_by_size(labels).tolist()
        self._perimeter = [sum(border.values()) for border in self.borders]

    def smallest_first(self, room: int) -> tuple[float, int] | None:
        """When a room is looked at, as a key of order; None for one that was joined to another."""
        return (self.area_m2[room], -self._rank[room]) if self.exists(room) else None

    def share(self, room: int, other: int) -> float:
        """Share of a room's perimeter along another room, or along walls."""
        return self.borders[room].get(other, 0) / self._perimeter[room]

    def neighbor_count(self, room: int) -> int:
        """Number of rooms that touch a room."""
        return len(self.borders[room].keys() - {WALL})

    def widest_neighbor(self, room: int) -> int | None:
        """Return the room with the longest common border; of several the largest."""
        borders = self.borders[room]
        return min(
            borders.keys() - {WALL},
            key=lambda other: (-borders[other], -self.area_m2[other], self._rank[other]),
            default=None,
        )

    def two_longest(self, room: int) -> float:
        """Share of a room's perimeter along the two rooms with which it shares most."""
        borders = (length for other, length in self.borders[room].items() if other != WALL)
        return sum(heapq.nlargest(2, borders)) / self._perimeter[room]

    def within_two(self, room: int) -> set[int]:
        """Return a room, its neighbors and theirs."""
        near = {room, *self.borders[room]} - {WALL}
        return near.union(*(self.borders[other] for other in near)) - {WALL}

    def join(self, region: int, target: int) -> list[int]:
        """Make a room part of another; return the neighbors that came with it."""
        self._perimeter[target] += self._perimeter[region] - 2 * self.borders[target][region]
        self.area_m2[target] += self.area_m2[region]
        return super().join(region, target)
