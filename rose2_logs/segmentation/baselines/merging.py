"""Joining the pieces of the Voronoi segmentation to rooms, by the borders that they share."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.baselines import VoronoiMergeParameters
from rose2_logs.model.labels import distinct_labels, roots
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
    # Only rooms near the last two that were joined can have become joinable.
    pending = [rooms.turn(room) for room in range(WALL + 1, len(rooms.area_m2))]
    heapq.heapify(pending)
    while pending:
        area, _, room = heapq.heappop(pending)
        if rooms.joined_to[room] != room or rooms.area_m2[room] != area:
            continue
        target = rooms.widest_neighbor(room)
        if target is None or not _is_joined(rooms, room, target, parameters):
            continue
        rooms.join(room, target)
        for changed in sorted(rooms.within_two(target)):
            heapq.heappush(pending, rooms.turn(changed))
    present, _ = distinct_labels(labels)
    holder = roots(rooms.joined_to)
    kept = np.unique(holder[present[present != WALL]])
    number = np.zeros(len(holder), np.int32)
    number[kept] = np.arange(1, len(kept) + 1)
    return number[holder][labels]


def _is_joined(rooms: _Rooms, room: int, target: int, p: VoronoiMergeParameters) -> bool:
    """Tell whether a room is part of the neighbor with which it shares the longest border."""
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


class _Rooms:
    """Areas and borders of rooms while they are joined; borders count sides of cells.

    Attributes
    ----------
    area_m2 : list of float
        By label; the first, of cells of no room, is not used.
    joined_to : (N,) int
        Label that each was made part of, which may be part of another since; itself where it was not.
    """

    def __init__(self, labels: NDArray[np.int32], resolution_m: float) -> None:
        size = np.bincount(labels.ravel(), minlength=1)
        self.area_m2: list[float] = (size * resolution_m**2).tolist()
        self.joined_to = np.arange(len(size))
        self._rank: list[int] = ranks_by_size(labels).tolist()
        self._border: list[dict[int, int]] = [{} for _ in size]
        for low, high, length in zip(*_borders(labels), strict=True):
            self._border[low][high] = length
            self._border[high][low] = length
        self._perimeter = [sum(border.values()) for border in self._border]

    def turn(self, room: int) -> tuple[float, int, int]:
        """When a room is looked at, as a key of order, with the room last: the smallest first."""
        return self.area_m2[room], -self._rank[room], room

    def share(self, room: int, other: int) -> float:
        """Share of a room's perimeter along another room, or along walls."""
        return self._border[room].get(other, 0) / self._perimeter[room]

    def neighbor_count(self, room: int) -> int:
        """Number of rooms that touch a room."""
        return len(self._border[room].keys() - {WALL})

    def widest_neighbor(self, room: int) -> int | None:
        """Return the room with the longest common border; of several the largest."""
        borders = self._border[room]
        return min(
            borders.keys() - {WALL},
            key=lambda other: (-borders[other], -self.area_m2[other], self._rank[other]),
            default=None,
        )

    def two_longest(self, room: int) -> float:
        """Share of a room's perimeter along the two rooms with which it shares most."""
        borders = (length for other, length in self._border[room].items() if other != WALL)
        return sum(heapq.nlargest(2, borders)) / self._perimeter[room]

    def within_two(self, room: int) -> set[int]:
        """Return a room, its neighbors and theirs."""
        near = {room, *self._border[room]} - {WALL}
        return near.union(*(self._border[other] for other in near)) - {WALL}

    def join(self, room: int, target: int) -> None:
        """Make a room part of another."""
        common = self._border[target].pop(room)
        for other, length in self._border[room].items():
            if other == target:
                continue
            del self._border[other][room]
            together = self._border[target].get(other, 0) + length
            self._border[target][other] = self._border[other][target] = together
        self._perimeter[target] += self._perimeter[room] - 2 * common
        self._border[room] = {}
        self.area_m2[target] += self.area_m2[room]
        self.joined_to[room] = target


def _borders(labels: NDArray[np.int32]) -> tuple[list[int], list[int], list[int]]:
    """Labels that touch, the lower and the higher one, and along how many sides of cells."""
    framed = np.pad(labels, 1).astype(np.int64)
    count = int(labels.max(initial=0)) + 1
    keys = []
    for first, second in ((framed[:, :-1], framed[:, 1:]), (framed[:-1], framed[1:])):
        differ = first != second
        one, other = first[differ], second[differ]
        keys.append(np.minimum(one, other) * count + np.maximum(one, other))
    key, length = np.unique(np.concatenate(keys), return_counts=True)
    low, high = np.divmod(key, count)
    return low.tolist(), high.tolist(), length.tolist()
