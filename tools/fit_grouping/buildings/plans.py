"""Plans: which cells belong to which room, as homes, offices, campuses and halls are laid out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from skimage.measure import label

from fit_grouping.buildings.raster import (
    CELL_M,
    Generator,
    Labels,
    Mask,
    between,
    cells,
    chance,
    larger_than,
    numbers_in,
)

Rectangle = tuple[int, int, int, int]
"""x0, y0, x1, y1 in cells."""
MARGIN_M = 3.0
"""Room around a building for rays that leave it."""
PUBLIC_MIN_M2 = 8.0
"""Smaller rooms of a home are closed by doors."""
ROOM_MIN_M2 = 0.9
ROOM_MIN_WIDTH_M = 0.8
"""Pieces of rooms below are taken by a neighbor."""


@dataclass
class Plan:
    """Rooms of a building.

    Attributes
    ----------
    kind : str
        Name of the maker.
    rooms : (H, W) int32
        Room of each cell, walls not yet taken off; 0 outside.
    corridors, halls, public : set of int
        Rooms of these kinds; public ones open widely to each other.
    lobbies : set of int
        Rooms that open on corridors along most of a wall.
    labs : set of int
        Rooms that a row of cabinets and pieces of wall parts from a corridor.
    suite : set of int
        Rooms whose walls to each other have wide gaps, in the share of them that `joined` is.
    galleries : set of int
        Halls that meet through portals, rows of pillars and pieces of wall.
    zones : set of int
        Parts of an open floor of a home, which a counter, a stub or a change of width parts.
    flowing : set of int
        Rooms of a home that meet without a jamb, mostly.
    open_fronts : float
        Share of doors that are openings of most of the wall.
    joined : float
        Share of the walls between rooms of a suite that have gaps.
    frayed : float
        Share of the walls between rooms of which gaps, dots or cabinets are seen.
    gates : float
        Openings to the outside, on average.
    glazed : bool
        Whether whole outer walls let rays through.
    margin_m : float
        Ground around the building.
    things : (H, W) uint8 or None
        1 where something stands that the maker placed itself.
    yard : (H, W) uint8 or None
        1 on ground outside that the robot drives on.
    strip : (H, W) uint8 or None
        1 on ground outside that is free in the map however it was seen.
    """

    kind: str
    rooms: Labels
    corridors: set[int] = field(default_factory=set)
    halls: set[int] = field(default_factory=set)
    public: set[int] = field(default_factory=set)
    lobbies: set[int] = field(default_factory=set)
    labs: set[int] = field(default_factory=set)
    suite: set[int] = field(default_factory=set)
    galleries: set[int] = field(default_factory=set)
    zones: set[int] = field(default_factory=set)
    flowing: set[int] = field(default_factory=set)
    open_fronts: float = 0.05
    joined: float = 0.0
    frayed: float = 0.0
    gates: float = 0.0
    glazed: bool = False
    margin_m: float = MARGIN_M
    things: Mask | None = None
    yard: Mask | None = None
    strip: Mask | None = None

    @classmethod
    def empty(cls, kind: str, width: int, height: int, margin_m: float = MARGIN_M) -> Plan:
        """Nothing but ground, with a margin around."""
        margin = cells(margin_m)
        rooms = np.zeros((height + 2 * margin, width + 2 * margin), np.int32)
        return cls(kind, rooms, margin_m=margin_m)

    @property
    def inner(self) -> Rectangle:
        """The ground without its margin."""
        margin = cells(self.margin_m)
        height, width = self.rooms.shape
        return margin, margin, width - margin, height - margin

    @property
    def marks(self) -> tuple[set[int], ...]:
        """Sets of the rooms of each kind."""
        return (
            self.corridors,
            self.halls,
            self.public,
            self.lobbies,
            self.labs,
            self.suite,
            self.galleries,
            self.zones,
            self.flowing,
        )

    def paint(self, rectangle: Rectangle, *, over: bool = False) -> int:
        """Make a room of the ground in a rectangle that is still free (or of all of it); its number."""
        x0, y0, x1, y1 = (max(0, int(v)) for v in rectangle)
        number = int(self.rooms.max()) + 1
        part = self.rooms[y0:y1, x0:x1]
        part[(part == 0) | over] = number
        return number

    def corridor(self, rectangle: Rectangle) -> int:
        """Paint a corridor over what is there."""
        number = self.paint(rectangle, over=True)
        self.corridors.add(number)
        return number

    def hall(self, rectangle: Rectangle) -> int:
        """Paint a hall."""
        number = self.paint(rectangle)
        self.halls.add(number)
        return number

    def merge(self, one: int, other: int) -> None:
        """Make two rooms one."""
        self.rooms[self.rooms == other] = one
        for kinds in self.marks:
            if other in kinds:
                kinds.discard(other)
                kinds.add(one)

    def tidy(self) -> None:
        """Number the connected pieces of rooms; slivers go to the ground or to the room around them."""
        pieces = label(self.rooms, connectivity=1, background=0)  # type: ignore[no-untyped-call]
        count = int(pieces.max()) + 1
        first = np.zeros(count, np.intp)
        first[pieces.ravel()[::-1]] = np.arange(pieces.size)[::-1]
        was = self.rooms.ravel()[first]
        size = np.bincount(pieces.ravel(), minlength=count) * CELL_M**2
        rows, columns = np.nonzero(pieces)
        piece = pieces[rows, columns]
        low = np.full((2, count), np.iinfo(np.int64).max)
        high = np.zeros((2, count), np.int64)
        for axis, place in enumerate((rows, columns)):
            np.minimum.at(low[axis], piece, place)
            np.maximum.at(high[axis], piece, place)
        narrow = (high - low + 1).min(0) < cells(ROOM_MIN_WIDTH_M)
        number = np.arange(count)
        number[(size < ROOM_MIN_M2) | narrow] = 0
        number[0] = 0
        for kinds in self.marks:
            now = {int(n) for n in number if n and was[n] in kinds}
            kinds.clear()
            kinds.update(now)
        self.rooms = number[pieces].astype(np.int32)


def cuts_along(rng: Generator, length: int, usual_m: float, least_m: float, regular: bool) -> list[int]:
    """Where a strip is cut into rooms, from 0 to its length."""
    cuts = [0]
    while cuts[-1] < length:
        factor = 1.0 if regular else rng.choice([0.55, 0.75, 1.0, 1.0, 1.3, 1.6, 2.2])
        step = max(cells(least_m), round(cells(usual_m) * factor * rng.uniform(0.95, 1.05)))
        cuts.append(length if length - cuts[-1] - step < cells(least_m) else cuts[-1] + step)
    return cuts


def row_of_rooms(
    rng: Generator,
    plan: Plan,
    strip: Rectangle,
    usual_m: float,
    *,
    least_m: float = 1.6,
    regular: bool = False,
) -> None:
    """Cut a strip crosswise into rooms."""
    x0, y0, x1, y1 = strip
    if min(x1 - x0, y1 - y0) < cells(1.0):
        return
    lies = x1 - x0 >= y1 - y0
    for low, high in pairwise(cuts_along(rng, max(x1 - x0, y1 - y0), usual_m, least_m, regular)):
        plan.paint((x0 + low, y0, x0 + high, y1) if lies else (x0, y0 + low, x1, y0 + high))


def halved(rng: Generator, plan: Plan, area: Rectangle, stop_m2: float, least_m: float) -> None:
    """Cut an area in two again and again."""
    x0, y0, x1, y1 = area
    width, height = x1 - x0, y1 - y0
    longer, shorter = max(width, height), min(width, height)
    small = width * height * CELL_M**2 < stop_m2 * rng.uniform(0.5, 1.9)
    if (small and longer / max(shorter, 1) < 2.4) or longer < 2 * cells(least_m):
        plan.paint(area)
        return
    least = max(cells(least_m) / longer, 0.25)
    at = rng.uniform(least, 1 - least) if least < 0.5 else 0.5
    if width > height:
        middle = int(x0 + at * width)
        parts = [(x0, y0, middle, y1), (middle, y0, x1, y1)]
    else:
        middle = int(y0 + at * height)
        parts = [(x0, y0, x1, middle), (x0, middle, x1, y1)]
    for part in parts:
        halved(rng, plan, part, stop_m2, least_m)


def corner_rooms(rng: Generator, plan: Plan, mean: float, low_m: float, high_m: float) -> None:
    """Cut small rooms (toilets, stores, closets) out of corners of rooms."""
    for _ in range(rng.poisson(mean)):
        rooms = numbers_in(plan.rooms)
        room = int(rng.choice(rooms))
        rows, columns = np.nonzero(plan.rooms == room)
        x0, x1, y0, y1 = columns.min(), columns.max() + 1, rows.min(), rows.max() + 1
        width, height = between(rng, low_m, high_m), between(rng, low_m, high_m)
        if x1 - x0 < width + cells(1.0) and y1 - y0 < height + cells(1.0):
            continue
        left = x0 if chance(rng, 0.5) else x1 - width
        low = y0 if chance(rng, 0.5) else y1 - height
        part = plan.rooms[low : low + height, left : left + width]
        part[part == room] = int(plan.rooms.max()) + 1


def notches(rng: Generator, plan: Plan, mean: float) -> None:
    """Take corners off the building, so that its outline is no rectangle."""
    x0, y0, x1, y1 = plan.inner
    for _ in range(rng.poisson(mean)):
        width, height = (round((b - a) * rng.uniform(0.1, 0.4)) for a, b in ((x0, x1), (y0, y1)))
        left = x0 if chance(rng, 0.5) else x1 - width
        low = y0 if chance(rng, 0.5) else y1 - height
        plan.rooms[low : low + height, left : left + width] = 0


def chamfers(rng: Generator, plan: Plan, outer: float, inner: float) -> None:
    """Cut corners off the building at an angle, and rooms in two along slanting lines."""
    height, width = plan.rooms.shape
    y, x = np.mgrid[:height, :width]
    for _ in range(rng.poisson(outer)):
        x0, y0, x1, y1 = plan.inner
        corner = (x0 if chance(rng, 0.5) else x1, y0 if chance(rng, 0.5) else y1)
        deep = between(rng, 1.5, 8.0)
        across = np.abs(x - corner[0]) * rng.uniform(0.6, 1.6) + np.abs(y - corner[1])
        plan.rooms[across < deep] = 0
    for _ in range(rng.poisson(inner)):
        rooms = numbers_in(plan.rooms)
        room = int(rng.choice(rooms))
        inside = plan.rooms == room
        if np.count_nonzero(inside) * CELL_M**2 < 9 or room in plan.corridors:
            continue
        angle = rng.uniform(0.3, 1.25) * rng.choice([-1, 1])
        beyond = np.cos(angle) * (x - x[inside].mean()) + np.sin(angle) * (y - y[inside].mean()) > 0
        new = int(plan.rooms.max()) + 1
        plan.rooms[inside & beyond] = new
        for kinds in (plan.zones, plan.galleries):
            if room in kinds:
                kinds.add(new)


def unvisited(rng: Generator, plan: Plan, share: float) -> None:
    """Leave out rooms that nobody has opened."""
    for room in numbers_in(plan.rooms):
        small = np.count_nonzero(plan.rooms == room) * CELL_M**2 < 12
        if small and room not in plan.corridors and chance(rng, share):
            plan.rooms[plan.rooms == room] = 0


def alcoves(rng: Generator, plan: Plan, mean: float) -> None:
    """Move parts of the borders of rooms: recesses, chimneys, built-in cupboards."""
    for room in numbers_in(plan.rooms):
        for _ in range(rng.poisson(mean)):
            inside = plan.rooms == room
            rim = inside & ~_shrunk(inside)
            rows, columns = np.nonzero(rim)
            if len(rows) == 0:
                continue
            at = int(rng.integers(len(rows)))
            half, deep = between(rng, 0.3, 1.2), between(rng, 0.2, 0.7)
            high, wide = (half, deep) if chance(rng, 0.5) else (deep, half)
            part = np.s_[
                max(0, rows[at] - high) : rows[at] + high, max(0, columns[at] - wide) : columns[at] + wide
            ]
            window = plan.rooms[part]
            if chance(rng, 0.6):
                window[(window != room) & (window > 0)] = room
            else:
                window[window == room] = 0


def _shrunk(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cells all of whose neighbors are in the mask too."""
    inner = mask.copy()
    inner[1:] &= mask[:-1]
    inner[:-1] &= mask[1:]
    inner[:, 1:] &= mask[:, :-1]
    inner[:, :-1] &= mask[:, 1:]
    return inner


def united_rooms(rng: Generator, plan: Plan, probability: float) -> None:
    """Unite some pairs of neighbors to rooms of L and other shapes."""
    for axis in (0, 1):
        one = plan.rooms[:, :-1] if axis else plan.rooms[:-1]
        other = plan.rooms[:, 1:] if axis else plan.rooms[1:]
        meet = (one != other) & (one > 0) & (other > 0)
        pairs, contact = np.unique(np.stack([one[meet], other[meet]]), axis=1, return_counts=True)
        for (a, b), length in zip(pairs.T.tolist(), contact, strict=True):
            kinds = plan.corridors | plan.halls
            if length > cells(1.2) and chance(rng, probability) and a not in kinds and b not in kinds:
                plan.merge(a, b)


def home(rng: Generator) -> Plan:
    """A flat or house: halved again and again, or rooms along a hallway with a living room at its end."""
    plan = Plan.empty("home", between(rng, 7, 24), between(rng, 7, 17))
    x0, y0, x1, y1 = plan.inner
    plan.open_fronts = rng.choice([0.05, 0.2, 0.35])
    if chance(rng, 0.45):
        halved(rng, plan, plan.inner, rng.uniform(7, 20), rng.uniform(1.3, 2.2))
    else:
        lies = chance(rng, 0.5)
        if lies:
            living = round((x1 - x0) * rng.uniform(0.2, 0.5))
            halved(rng, plan, (x0, y0, x0 + living, y1), rng.uniform(20, 60), 2.2)
            rest = (x0 + living, y0, x1, y1)
        else:
            living = round((y1 - y0) * rng.uniform(0.2, 0.5))
            halved(rng, plan, (x0, y0, x1, y0 + living), rng.uniform(20, 60), 2.2)
            rest = (x0, y0 + living, x1, y1)
        a0, b0, a1, b1 = rest
        width = between(rng, 0.9, 1.7)
        if lies:
            at = b0 + round((b1 - b0 - width) * rng.uniform(0.25, 0.75))
            hallway = (a0, at, a1 - between(rng, 0, 3) * int(chance(rng, 0.5)), at + width)
            strips = [(a0, b0, a1, at), (a0, at + width, a1, b1)]
        else:
            at = a0 + round((a1 - a0 - width) * rng.uniform(0.25, 0.75))
            hallway = (at, b0, at + width, b1 - between(rng, 0, 3) * int(chance(rng, 0.5)))
            strips = [(a0, b0, at, b1), (at + width, b0, a1, b1)]
        plan.corridor(hallway)
        for strip in strips:
            row_of_rooms(rng, plan, strip, rng.uniform(2.2, 4.0), least_m=1.2)
        halved(rng, plan, rest, 12, 1.5)
    corner_rooms(rng, plan, 1.2, 0.9, 2.4)
    notches(rng, plan, 1.0)
    united_rooms(rng, plan, rng.choice([0.03, 0.06, 0.15]))
    unvisited(rng, plan, rng.choice([0.0, 0.1, 0.25]))
    alcoves(rng, plan, rng.choice([0.0, 0.3, 0.8]))
    openness = rng.choice([0.0, 0.3, 0.7])
    large = sorted(larger_than(plan.rooms, PUBLIC_MIN_M2))
    plan.public = {n for n in large if chance(rng, openness)}
    return plan


def corridor_segments(rng: Generator, area: Rectangle, width: int, depth: int) -> list[Rectangle]:
    """Corridors of an office: along the middle, an L, a T, a U, an H, a ring or a comb."""
    x0, y0, x1, y1 = area
    across = y0 + round((y1 - y0 - width) * rng.uniform(0.35, 0.65))
    left, right = x0 + depth, x1 - depth - width
    low, high = y0 + depth, y1 - depth - width
    middle = x0 + round((x1 - x0 - width) * rng.uniform(0.25, 0.75))

    def level(y: int, a: int, b: int) -> Rectangle:
        return a, y, b, y + width

    def upright(x: int, a: int, b: int) -> Rectangle:
        return x, a, x + width, b

    shape = rng.choice(["I", "I", "L", "T", "U", "H", "O", "O", "E"])
    if shape == "I" or y1 - y0 < 2 * depth + 2 * width + cells(2):
        return [level(across, x0, x1)]
    if shape == "L":
        return [level(low, x0, right + width), upright(right, low + width, y1)]
    if shape == "T":
        return [level(low, x0, x1), upright(middle, low + width, y1)]
    if shape == "U":
        return [
            level(low, left, right + width),
            upright(left, low + width, y1),
            upright(right, low + width, y1),
        ]
    if shape == "H":
        return [level(low, x0, x1), level(high, x0, x1), upright(middle, low + width, high)]
    if shape == "E":
        count = rng.integers(2, 4)
        teeth = np.linspace(x0, x1 - width, count + 2)[1:-1].astype(int).tolist()
        return [level(low, x0, x1)] + [upright(x, low + width, y1) for x in teeth]
    return [
        level(low, left, right + width),
        level(high, left, right + width),
        upright(left, low + width, high),
        upright(right, low + width, high),
    ]


def office(rng: Generator) -> Plan:
    """Rows of rooms along corridors, which may be parted at crossings, bends and by doors."""
    large = chance(rng, 0.6)
    plan = Plan.empty("office", between(rng, 14, 48), between(rng, 9, 36) if large else between(rng, 8, 14))
    if chance(rng, 0.5):
        plan.rooms = plan.rooms.T.copy()
    area = plan.inner
    width, depth = between(rng, 1.3, 3.2), between(rng, 2.6, 6.8)
    regular = chance(rng, 0.5)
    usual_m = rng.uniform(2.3, 6.0)
    flip = plan.rooms.shape[0] > plan.rooms.shape[1]
    frame = (area[1], area[0], area[3], area[2]) if flip else area
    turned: Callable[[Rectangle], Rectangle] = lambda r: (r[1], r[0], r[3], r[2]) if flip else r  # noqa: E731
    segments = [turned(s) for s in corridor_segments(rng, frame, width, depth)]
    parted = chance(rng, 0.2)
    numbers = []
    for x0, y0, x1, y1 in segments:
        lies = x1 - x0 >= y1 - y0
        length = max(x1 - x0, y1 - y0)
        pieces = 1 + (rng.poisson(length * CELL_M / 18) if parted else int(chance(rng, 0.1)))
        at = np.sort(rng.uniform(0.15, 0.85, pieces - 1)) * length
        for low, high in pairwise([0, *at.astype(int).tolist(), length]):
            part = (x0 + low, y0, x0 + high, y1) if lies else (x0, y0 + low, x1, y0 + high)
            numbers.append(plan.corridor(part))
    for x0, y0, x1, y1 in segments:
        lies = x1 - x0 >= y1 - y0
        for side in (0, 1):
            if chance(rng, 0.12):
                continue
            own = depth if chance(rng, 0.7) else between(rng, 2.4, 8)
            if lies:
                strip = (x0, y0 - own, x1, y0) if side else (x0, y1, x1, y1 + own)
            else:
                strip = (x0 - own, y0, x0, y1) if side else (x1, y0, x1 + own, y1)
            strip = (
                max(strip[0], area[0]),
                max(strip[1], area[1]),
                min(strip[2], area[2]),
                min(strip[3], area[3]),
            )
            row_of_rooms(rng, plan, strip, usual_m, regular=regular, least_m=1.5)
    if chance(rng, 0.6):  # what is left: halls and inner rooms, or a courtyard
        halved(rng, plan, area, rng.uniform(15, 90), 2.5)
    corner_rooms(rng, plan, 0.5, 1.0, 3.0)
    bays(rng, plan, 0.8)
    notches(rng, plan, 0.5)
    united_rooms(rng, plan, 0.02)
    plan.open_fronts = rng.choice([0.02, 0.1, 0.3, 0.6])
    if not parted:
        unite_touching(plan, set(numbers))
    return plan


def unite_touching(plan: Plan, numbers: set[int]) -> None:
    """Make all corridors that touch one room, but for those behind a door of their own."""
    changed = True
    while changed:
        changed = False
        for one, other in ((plan.rooms[:, :-1], plan.rooms[:, 1:]), (plan.rooms[:-1], plan.rooms[1:])):
            meet = (one != other) & np.isin(one, list(numbers)) & np.isin(other, list(numbers))
            if meet.any():
                a, b = int(one[meet][0]), int(other[meet][0])
                plan.merge(a, b)
                numbers.discard(b)
                changed = True
                break


def bays(rng: Generator, plan: Plan, mean: float) -> None:
    """Widen corridors here and there: niches before doors, places to wait."""
    for corridor in list(plan.corridors):
        rows, columns = np.nonzero(plan.rooms == corridor)
        if len(rows) < cells(1) ** 2:
            continue
        for _ in range(rng.poisson(mean)):
            at = rng.integers(len(rows))
            half, deep = between(rng, 0.4, 1.6), between(rng, 0.3, 1.8)
            y, x = rows[at], columns[at]
            y0, y1, x0, x1 = y - deep, y + deep, x - half, x + half
            if np.ptp(rows) > np.ptp(columns):
                y0, y1, x0, x1 = y - half, y + half, x - deep, x + deep
            part = plan.rooms[max(y0, 0) : y1, max(x0, 0) : x1]
            if not np.isin(part, list(plan.corridors - {corridor})).any():
                part[part > 0] = corridor


def cubicles(rng: Generator) -> Plan:
    """Blocks of small rooms as islands in a floor, rows of rooms around it."""
    plan = Plan.empty("cubicles", between(rng, 16, 44), between(rng, 14, 34))
    x0, y0, x1, y1 = plan.inner
    depth = between(rng, 2.5, 5.5)
    usual_m = rng.uniform(2.4, 4.5)
    sides = rng.random(4) < 0.6
    inner = (x0 + depth * sides[0], y0 + depth * sides[1], x1 - depth * sides[2], y1 - depth * sides[3])
    floor = plan.corridor(inner)
    way = between(rng, 1.5, 3.0)
    a0, b0, a1, b1 = inner[0] + way, inner[1] + way, inner[2] - way, inner[3] - way
    block_depth = between(rng, 1.8, 3.6)
    cell_m = rng.uniform(1.8, 3.6)
    columns = rng.integers(1, 4)
    breadth = (a1 - a0 - (columns - 1) * way) // columns
    y = b0
    while y + block_depth <= b1 and breadth > cells(3):
        rows = 2 if y + 2 * block_depth <= b1 and chance(rng, 0.6) else 1
        for column in range(columns):
            x = a0 + column * (breadth + way)
            if chance(rng, 0.15):
                continue
            for row in range(rows):
                for low, high in pairwise(cuts_along(rng, breadth, cell_m, 1.5, chance(rng, 0.8))):
                    plan.paint(
                        (x + low, y + row * block_depth, x + high, y + (row + 1) * block_depth), over=True
                    )
        y += rows * block_depth + way
    for side, strip in enumerate(
        (
            (x0, y0, x0 + depth, y1),
            (x0, y0, x1, y0 + depth),
            (x1 - depth, y0, x1, y1),
            (x0, y1 - depth, x1, y1),
        )
    ):
        if sides[side]:
            row_of_rooms(rng, plan, strip, usual_m, regular=chance(rng, 0.7))
    plan.corridors = {floor}
    plan.open_fronts = rng.choice([0.02, 0.2])
    return plan


def campus(rng: Generator) -> Plan:
    """Long corridors with bays between halls and small rooms, parted where they cross, bend or end."""
    plan = Plan.empty("campus", between(rng, 30, 70), between(rng, 18, 45))
    x0, y0, x1, y1 = plan.inner
    width = between(rng, 1.6, 3.2)
    y = y0 + round((y1 - y0) * rng.uniform(0.25, 0.75))
    stops = [x0, *np.sort(rng.integers(x0 + cells(6), x1 - cells(6), rng.integers(1, 4))).tolist(), x1]
    segments: list[Rectangle] = []
    for low, high in pairwise(stops):
        if high - low < cells(4):
            continue
        segments.append((low, y, high, y + width))
        if high < x1 and chance(rng, 0.7):
            up = chance(rng, 0.5)
            reach = between(rng, 6, 20)
            own = between(rng, 1.5, 3.0)
            tooth = (high, y + width, high + own, min(y1, y + width + reach))
            segments.append(tooth if up else (high, max(y0, y - reach), high + own, y))
            if chance(rng, 0.4):  # the corridor goes on beside its line
                y = min(max(y + rng.choice([-1, 1]) * between(rng, 1, 5), y0 + cells(4)), y1 - cells(6))
    for segment in segments:
        plan.corridor(segment)
    for a0, b0, a1, b1 in segments:
        lies = a1 - a0 >= b1 - b0
        for side in (0, 1):
            what = rng.random()
            own = between(rng, 3, 12)
            strip = (
                ((a0, b0 - own, a1, b0) if side else (a0, b1, a1, b1 + own))
                if lies
                else ((a0 - own, b0, a0, b1) if side else (a1, b0, a1 + own, b1))
            )
            strip = (max(strip[0], x0), max(strip[1], y0), min(strip[2], x1), min(strip[3], y1))
            if what < 0.5:
                row_of_rooms(rng, plan, strip, rng.uniform(2.5, 7))
            elif what < 0.75:
                row_of_rooms(rng, plan, strip, rng.uniform(8, 18), least_m=5)
    for room in numbers_in(plan.rooms):
        area = np.count_nonzero(plan.rooms == room) * CELL_M**2
        if room not in plan.corridors and area > 50:
            plan.halls.add(int(room))
        if room not in plan.corridors and chance(rng, 0.12):
            plan.rooms[plan.rooms == room] = 0
    bays(rng, plan, 1.5)
    corner_rooms(rng, plan, 1.0, 1.2, 3.0)
    plan.open_fronts = rng.choice([0.05, 0.25])
    return plan


def _path(rng: Generator, width: int) -> list[Rectangle]:
    """Pieces of a corridor that turns at right angles, from its beginning on."""
    pieces: list[Rectangle] = []
    x = y = 0
    lies = chance(rng, 0.5)
    for _ in range(rng.integers(1, 5)):
        long = between(rng, 6, 32) * int(rng.choice([-1, 1], p=[0.25, 0.75]))
        end_x, end_y = (x + long, y) if lies else (x, y + long)
        pieces.append((min(x, end_x), min(y, end_y), max(x, end_x) + width, max(y, end_y) + width))
        x, y, lies = end_x, end_y, not lies
    return pieces


def passage(rng: Generator) -> Plan:
    """One long corridor with bays before its doors, round corners, and few of the rooms beside it."""
    width = between(rng, 1.5, 3.4)
    pieces = _path(rng, width)
    side = between(rng, 5, 9)
    left, low = (min(p[k] for p in pieces) - side for k in (0, 1))
    right, high = (max(p[k] for p in pieces) + side for k in (2, 3))
    plan = Plan.empty("passage", right - left, high - low)
    margin = cells(MARGIN_M)
    moved_to = [(a - left, b - low, c - left, d - low) for a, b, c, d in pieces]
    pieces = [(a + margin, b + margin, c + margin, d + margin) for a, b, c, d in moved_to]
    number = plan.corridor(pieces[0])
    for piece in pieces[1:]:
        plan.merge(number, plan.corridor(piece))
    for piece in pieces:
        for beside in (-1, 1):
            _row_of_bays(rng, plan, number, piece, beside)
    kept = rng.choice([0.15, 0.5, 0.9])
    for x0, y0, x1, y1 in pieces:
        deep = between(rng, 2.5, 6.5)
        lies = x1 - x0 >= y1 - y0
        for a, b in ((-deep, 0), (width, width + deep)):
            before = int(plan.rooms.max())
            strip = (x0, y0 + a, x1, y0 + b) if lies else (x0 + a, y0, x0 + b, y1)
            row_of_rooms(rng, plan, strip, rng.uniform(2.5, 7), regular=chance(rng, 0.5))
            for room in range(before + 1, int(plan.rooms.max()) + 1):
                if not chance(rng, kept):
                    plan.rooms[plan.rooms == room] = 0
    if chance(rng, 0.4):  # a hall at its end
        x0, y0, x1, y1 = pieces[-1]
        half = between(rng, 3, 5)
        x, y = (x0, y0) if chance(rng, 0.5) else (x1, y1)
        plan.hall((x - half, y - half, x + half, y + half))
    plan.open_fronts = rng.choice([0.02, 0.3])
    return plan


def _row_of_bays(rng: Generator, plan: Plan, number: int, piece: Rectangle, beside: int) -> None:
    """Bays at a side of a corridor: at equal steps, of equal size."""
    if chance(rng, 0.3):
        return
    x0, y0, x1, y1 = piece
    lies = x1 - x0 >= y1 - y0
    wide, deep = between(rng, 0.8, 2.6), between(rng, 0.15, 0.9)
    step = wide + between(rng, 0.6, 5.0)
    low, high = (x0, x1) if lies else (y0, y1)
    for at in range(low + between(rng, 0.3, 3.0), high - wide, step):
        if chance(rng, 0.15):
            continue
        if lies:
            bay = (at, y0 - deep, at + wide, y0) if beside < 0 else (at, y1, at + wide, y1 + deep)
        else:
            bay = (x0 - deep, at, x0, at + wide) if beside < 0 else (x1, at, x1 + deep, at + wide)
        plan.merge(number, plan.paint(bay))


def hall(rng: Generator) -> Plan:
    """A shop, depot, arena or hall: one or two large rooms, small ones at their sides."""
    sides_m = [((4, 10), (4, 10)), ((6, 34), (6, 28)), ((28, 55), (9, 16))][rng.choice(3, p=[0.2, 0.6, 0.2])]
    plan = Plan.empty("hall", between(rng, *sides_m[0]), between(rng, *sides_m[1]))
    x0, y0, x1, y1 = plan.inner
    for _ in range(rng.poisson(1.2)):
        depth = between(rng, 2, 6)
        strip = [
            (x0, y0, x0 + depth, y1),
            (x1 - depth, y0, x1, y1),
            (x0, y0, x1, y0 + depth),
            (x0, y1 - depth, x1, y1),
        ][rng.integers(4)]
        row_of_rooms(rng, plan, strip, rng.uniform(2.5, 8), regular=chance(rng, 0.4))
    if chance(rng, 0.35):
        middle = x0 + round((x1 - x0) * rng.uniform(0.3, 0.7))
        plan.hall((x0, y0, middle, y1))
    plan.hall(plan.inner)
    if chance(rng, 0.3):
        x, y = round(x0 + (x1 - x0) * rng.uniform(0.3, 0.5)), round(y0 + (y1 - y0) * rng.uniform(0.3, 0.5))
        plan.paint((x, y, x + between(rng, 2.5, 7), y + between(rng, 2.5, 6)), over=True)
    notches(rng, plan, 0.8)
    return plan
