"""Joining regions to larger ones: who borders on whom, and which two are joined next."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Border = TypeVar("Border")


class _Ordered(Protocol):
    def __lt__(self, other: Any, /) -> bool: ...


Item = TypeVar("Item", bound=_Ordered)


def connected(
    count: int, one: NDArray[np.integer], other: NDArray[np.integer]
) -> tuple[int, NDArray[np.int32]]:
    """Find what hangs together, as SciPy's ``connected_components``, which first makes a matrix of it.

    Each thing takes the lowest number that any of its pairs has, and then what that one has taken, until all
    that hang together have one.

    Parameters
    ----------
    count : int
        Number of things.
    one, other : (K,) int
        Pairs that hang together.

    Returns
    -------
    groups : int
    group : (count,) int32
        Of each thing: 0.., by their first things.
    """
    lowest = np.arange(count)
    while True:
        ends = lowest.take(one), lowest.take(other)
        apart = np.flatnonzero(ends[0] != ends[1])
        if len(apart) == 0:
            break
        one, other = one.take(apart), other.take(apart)
        low, high = np.minimum(*ends).take(apart), np.maximum(*ends).take(apart)
        np.minimum.at(lowest, high, low)
        while not np.array_equal(above := lowest.take(lowest), lowest):
            lowest = above
    number = np.cumsum(lowest == np.arange(count), dtype=np.int32) - 1
    return int(number.max(initial=-1)) + 1, number.take(lowest)


def root_of(above: list[int], number: int) -> int:
    """Follow steps towards a root, a number above which is itself; the steps on the way become longer."""
    while above[number] != number:
        above[number] = above[above[number]]
        number = above[number]
    return number


def roots_of(above: NDArray[np.intp]) -> NDArray[np.intp]:
    """Root (N,) of each number, as `root_of` finds one."""
    while not np.array_equal(further := above[above], above):
        above = further
    return above


class RegionGraph(Generic[Border]):
    """Regions 0..N - 1 and the borders between neighbors, while regions are joined.

    Parameters
    ----------
    count : int
        Number of regions.
    borders : mapping of (int, int) to border
        What is known of the border of two neighboring regions, each pair once.
    add : callable
        Border of two borders that become one.

    Attributes
    ----------
    borders : list of N dict
        The border with each neighbor of each region; empty for one that was made part of another.
    """

    def __init__(
        self,
        count: int,
        borders: Mapping[tuple[int, int], Border],
        add: Callable[[Border, Border], Border],
    ) -> None:
        self.borders: list[dict[int, Border]] = [{} for _ in range(count)]
        for (one, other), border in borders.items():
            self.borders[one][other] = self.borders[other][one] = border
        self._add = add
        self._holder = np.arange(count)

    def exists(self, region: int) -> bool:
        """Whether a region was not made part of another."""
        return bool(self._holder[region] == region)

    def join(self, region: int, target: int) -> list[int]:
        """Make a region part of another; return the neighbors that came with it."""
        self._holder[region] = target
        taken, self.borders[region] = self.borders[region], {}
        taken.pop(target, None)
        own = self.borders[target]
        own.pop(region, None)
        for other, border in taken.items():
            together = self._add(own[other], border) if other in own else border
            own[other] = self.borders[other][target] = together
            del self.borders[other][region]
        return list(taken)

    def holders(self) -> NDArray[np.intp]:
        """Region (N,) that each belongs to after all joins."""
        return roots_of(self._holder)


def best_first(
    items: Iterable[Item],
    key: Callable[[Item], _Ordered | None],
    act: Callable[[Item], Iterable[Item]],
) -> None:
    """Act on items, always the one with the least key next, while acting changes the keys of others.

    Parameters
    ----------
    items : iterable
        Of equal keys the lesser item comes first.
    key : callable
        Key of an item as it stands now, None for one that is not to be acted on (any more).
    act : callable
        Acts on an item; returns those whose keys it changed.
    """
    heap: list[tuple[_Ordered, Item]] = []

    def push(changed: Iterable[Item]) -> None:
        for item in changed:
            value = key(item)
            if value is not None:
                heapq.heappush(heap, (value, item))

    push(items)
    while heap:
        value, item = heapq.heappop(heap)
        # What was pushed before the item changed is out of date.
        if key(item) == value:
            push(act(item))
