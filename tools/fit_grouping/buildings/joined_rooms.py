"""Plans in which rooms meet widely: suites of offices, floors around a ring, open homes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fit_grouping.buildings.plans import (
    Plan,
    Rectangle,
    alcoves,
    bays,
    corner_rooms,
    corridor_segments,
    cuts_along,
    halved,
    notches,
    row_of_rooms,
    unite_touching,
    united_rooms,
    unvisited,
)
from fit_grouping.buildings.raster import Generator, between, cells, chance, larger_than, numbers_in
from fit_grouping.buildings.villas import villa
from fit_grouping.buildings.workplaces import (
    double_doors,
    empty_building,
    strip_beside,
    unbuilt,
    uneven_row,
)

LOUNGE_LONG_M = (2.5, 8.0)
"""Length of places along a corridor where it is as broad as the rooms beside it."""
ZONE_MIN_M2 = 5.0
"""Smaller parts of an open floor are closed by doors."""
CONNECTOR_M = (1.0, 2.4)
"""Lengths of the pieces of a hallway before the doors that end it."""


def suites(rng: Generator) -> Plan:
    """Offices along corridors with wide gaps in the walls between them, behind which stand cabinets."""
    plan = empty_building(
        rng, "suites", between(rng, 14, 56), between(rng, 9, 34 if chance(rng, 0.3) else 20)
    )
    area = plan.inner
    width, depth = between(rng, 1.3, 4.0), between(rng, 3.2, 8.0)
    segments = corridor_segments(rng, area, width, depth)
    if chance(rng, 0.3):
        segments = _with_step(rng, segments, area)
    numbers = {plan.corridor(segment) for segment in segments}
    if chance(rng, 0.6):
        unite_touching(plan, numbers)
    double_doors(rng, plan, segments)
    for segment in segments:
        for _ in range(rng.poisson(0.5)):
            _lounge(rng, plan, segment, depth)
        for side in (0, 1):
            if chance(rng, 0.08):
                continue
            own = depth if chance(rng, 0.6) else between(rng, 2.6, 8.5)
            strip = strip_beside(segment, side, own, area)
            if chance(rng, 0.75):
                _suite(rng, plan, strip)
            else:
                uneven_row(rng, plan, strip)
    if chance(rng, 0.5):
        halved(rng, plan, area, rng.uniform(12, 50), 2.4)
    numbers = set(numbers_in(plan.rooms))
    plan.suite = numbers - plan.corridors - plan.lobbies
    corner_rooms(rng, plan, 0.4, 1.0, 2.4)
    bays(rng, plan, 0.6)
    notches(rng, plan, 0.3)
    unbuilt(rng, plan, rng.choice([0.0, 0.06, 0.15]))
    plan.joined = rng.choice([0.3, 0.65, 0.95])
    plan.frayed = rng.choice([0.0, 0.0, 0.2])
    plan.open_fronts = rng.choice([0.02, 0.2, 0.6])
    return plan


def _suite(rng: Generator, plan: Plan, strip: Rectangle) -> None:
    """Offices side by side, at times in two rows one behind the other."""
    x0, y0, x1, y1 = strip
    usual_m = rng.uniform(2.0, 5.6)
    regular = chance(rng, 0.55)
    lies = x1 - x0 >= y1 - y0
    deep = min(x1 - x0, y1 - y0)
    if deep < cells(5.0) or not chance(rng, 0.3):
        row_of_rooms(rng, plan, strip, usual_m, least_m=1.5, regular=regular)
        return
    cut = round(deep * rng.uniform(0.35, 0.65))
    parts = (
        [(x0, y0, x1, y0 + cut), (x0, y0 + cut, x1, y1)]
        if lies
        else [(x0, y0, x0 + cut, y1), (x0 + cut, y0, x1, y1)]
    )
    for part in parts:
        row_of_rooms(rng, plan, part, usual_m, least_m=1.5, regular=regular)


def _lounge(rng: Generator, plan: Plan, segment: Rectangle, depth: int) -> None:
    """A place where a corridor is as broad as the rooms beside it: a part of it, or a lobby that it meets."""
    x0, y0, x1, y1 = segment
    lies = x1 - x0 >= y1 - y0
    long = between(rng, *LOUNGE_LONG_M)
    length = max(x1 - x0, y1 - y0)
    if length <= long:
        return
    at = int(rng.integers(0, length - long))
    piece = (x0 + at, y0, x0 + at + long, y1) if lies else (x0, y0 + at, x1, y0 + at + long)
    deep = round(depth * rng.uniform(0.3, 1.0))
    room = plan.paint(strip_beside(piece, int(rng.integers(2)), deep, plan.inner))
    if not (plan.rooms == room).any():
        return
    if chance(rng, 0.5):
        plan.lobbies.add(room)
        return
    middle = int(plan.rooms[(piece[1] + piece[3]) // 2, (piece[0] + piece[2]) // 2])
    plan.merge(middle, room)


def _with_step(rng: Generator, segments: list[Rectangle], area: Rectangle) -> list[Rectangle]:
    """Let the first corridor go on beside its line from some place on."""
    (x0, y0, x1, y1), *others = segments
    if x1 - x0 < cells(8) or x1 - x0 < y1 - y0:
        return segments
    at = int(rng.integers(x0 + cells(3), x1 - cells(3)))
    broad = y1 - y0
    aside = int(rng.choice([-1, 1])) * between(rng, 0.5, 4.0)
    aside = min(max(aside, area[1] + cells(2) - y0), area[3] - cells(2) - y1)
    cross = (at, min(y0, y0 + aside), at + broad, max(y1, y1 + aside))
    return [(x0, y0, at, y1), cross, (at + broad, y0 + aside, x1, y1 + aside), *others]


def loop(rng: Generator) -> Plan:
    """Rooms around a ring corridor that is one room, with few small rooms and alleys in its core."""
    plan = empty_building(rng, "loop", between(rng, 17, 44), between(rng, 15, 40))
    x0, y0, x1, y1 = plan.inner
    usual = rng.uniform(2.4, 6.0)
    deep = [cells(usual * rng.uniform(0.8, 1.25)) if chance(rng, 0.93) else 0 for _ in range(4)]
    ring = (x0 + deep[0], y0 + deep[1], x1 - deep[2], y1 - deep[3])
    floor = plan.corridor(ring)
    broad = [between(rng, 1.4, 3.4) for _ in range(4)]
    if chance(rng, 0.5):
        broad = [broad[0]] * 4
    core = (ring[0] + broad[0], ring[1] + broad[1], ring[2] - broad[2], ring[3] - broad[3])
    if min(core[2] - core[0], core[3] - core[1]) > cells(2.0):
        _core(rng, plan, core)
    for side, strip in enumerate(
        (
            (x0, y0, ring[0], y1),
            (x0, y0, x1, ring[1]),
            (ring[2], y0, x1, y1),
            (x0, ring[3], x1, y1),
        )
    ):
        if not deep[side]:
            continue
        if chance(rng, 0.5):
            row_of_rooms(rng, plan, strip, rng.uniform(2.2, 5.5), least_m=1.5, regular=chance(rng, 0.6))
        else:
            uneven_row(rng, plan, strip)
    for _ in range(rng.poisson(0.7)):  # the ring reaches to the outer wall
        width = between(rng, 1.2, 3.0)
        at = int(rng.integers(ring[0], max(ring[0] + 1, ring[2] - width)))
        arm = (at, y0, at + width, ring[1]) if chance(rng, 0.5) else (at, ring[3], at + width, y1)
        plan.merge(floor, plan.corridor(arm))
    if chance(rng, 0.45):
        _corner_room(rng, plan, floor, deep)
    rooms = set(numbers_in(plan.rooms)) - {floor}
    plan.suite = rooms - plan.lobbies if chance(rng, 0.4) else set()
    plan.joined = rng.choice([0.1, 0.4])
    bays(rng, plan, 1.0)
    corner_rooms(rng, plan, 0.5, 1.0, 2.4)
    unbuilt(rng, plan, rng.choice([0.0, 0.08, 0.2]))
    plan.frayed = rng.choice([0.0, 0.0, 0.2])
    plan.open_fronts = rng.choice([0.02, 0.15, 0.4])
    return plan


def _core(rng: Generator, plan: Plan, core: Rectangle) -> None:
    """What a ring goes around: a court with rounded or cut corners, rooms at its rim, alleys through it."""
    x0, y0, x1, y1 = core
    height, width = plan.rooms.shape
    y, x = np.mgrid[:height, :width].astype(np.float32)
    u = np.abs(x - (x0 + x1) / 2) / ((x1 - x0) / 2)
    v = np.abs(y - (y0 + y1) / 2) / ((y1 - y0) / 2)
    shape = rng.choice(["box", "round", "cut"], p=[0.5, 0.25, 0.25])
    inside: NDArray[np.bool_] = (u <= 1) & (v <= 1)
    if shape == "round":
        power = rng.uniform(2.5, 6.0)
        inside &= u**power + v**power <= 1
    elif shape == "cut":
        inside &= u + v <= rng.uniform(1.45, 1.85)
    corridor = plan.rooms.copy()
    plan.rooms[inside] = 0
    way = rng.choice(["court", "few", "many"], p=[0.25, 0.45, 0.3])
    if way != "court":
        before = int(plan.rooms.max())
        halved(rng, plan, core, rng.uniform(6, 26), 1.6)
        built = rng.uniform(0.2, 0.5) if way == "few" else rng.uniform(0.7, 1.0)
        for room in range(before + 1, int(plan.rooms.max()) + 1):
            if not chance(rng, built):
                plan.rooms[plan.rooms == room] = 0
            elif chance(rng, 0.4):
                plan.lobbies.add(room)
    plan.rooms[~inside] = corridor[~inside]
    floor = next(iter(plan.corridors))
    if way != "court" or chance(rng, 0.4):
        for _ in range(rng.integers(0, 3)):
            broad = between(rng, 0.9, 2.0)
            if chance(rng, 0.5):
                at = int(rng.integers(x0, max(x0 + 1, x1 - broad)))
                plan.merge(floor, plan.corridor((at, y0, at + broad, y1)))
            else:
                at = int(rng.integers(y0, max(y0 + 1, y1 - broad)))
                plan.merge(floor, plan.corridor((x0, at, x1, at + broad)))


def _corner_room(rng: Generator, plan: Plan, floor: int, deep: list[int]) -> None:
    """Cut a corner off the building: a room lies along the slanting wall, and the ring goes around it."""
    x0, y0, x1, y1 = plan.inner
    height, width = plan.rooms.shape
    left, low = chance(rng, 0.5), chance(rng, 0.5)
    y, x = np.mgrid[:height, :width]
    along = (x - x0 if left else x1 - 1 - x) + (y - y0 if low else y1 - 1 - y)
    broad = max(deep[0] if left else deep[2], cells(2.0)) + max(deep[1] if low else deep[3], cells(2.0))
    cut = round(broad * rng.uniform(0.4, 1.4))
    band = round(broad * rng.uniform(0.7, 1.0))
    plan.rooms[along < cut] = 0
    room = int(plan.rooms.max()) + 1
    plan.rooms[(along >= cut) & (along < cut + band) & (plan.rooms > 0)] = room
    way = (along >= cut + band) & (along < cut + band + between(rng, 1.4, 3.0))
    near = np.isin(plan.rooms, list(plan.corridors)) & (along < cut + band + cells(6))
    if near.any():
        rows, columns = np.nonzero(near)
        box = np.zeros_like(near)
        box[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] = True
        plan.rooms[way & box & (plan.rooms > 0)] = floor


def openhome(rng: Generator) -> Plan:
    """A home whose living rooms, kitchen and hallways are zones of one floor, parted by stubs or counters."""
    if chance(rng, 0.4):
        plan = villa(rng)
        plan.kind = "openhome"
        plan.zones = set(plan.public)
        return plan
    plan = Plan.empty("openhome", between(rng, 8, 25), between(rng, 7, 19))
    x0, y0, x1, y1 = plan.inner
    share = rng.uniform(0.3, 0.65)
    first = x0 + round((x1 - x0) * rng.uniform(0.0, 1 - share)) if chance(rng, 0.4) else x0
    last = first + round((x1 - x0) * share)
    zones = _zones(rng, plan, (first, y0, last, y1))
    for part in ((x0, y0, first, y1), (last, y0, x1, y1)):
        if part[2] - part[0] >= cells(1.5):
            zones |= _private(rng, plan, part)
    plan.rooms = np.rot90(plan.rooms, int(rng.integers(4))).copy()
    corner_rooms(rng, plan, 2.0, 0.9, 2.2)
    notches(rng, plan, 0.9)
    united_rooms(rng, plan, rng.choice([0.0, 0.06]))
    unvisited(rng, plan, rng.choice([0.0, 0.1, 0.25]))
    alcoves(rng, plan, rng.choice([0.0, 0.3, 0.7]))
    plan.zones = (zones & larger_than(plan.rooms, ZONE_MIN_M2)) | plan.corridors
    plan.open_fronts = rng.choice([0.05, 0.15, 0.3])
    return plan


def _zones(rng: Generator, plan: Plan, area: Rectangle) -> set[int]:
    """Cut the open part of a home into its zones, some of L shape; their numbers."""
    before = int(plan.rooms.max())
    halved(rng, plan, area, rng.uniform(9, 55), rng.uniform(2.0, 3.4))
    numbers = list(range(before + 1, int(plan.rooms.max()) + 1))
    if len(numbers) > 2 and chance(rng, 0.45):  # a living room around a corner
        _unite_one_pair(rng, plan, set(numbers))
    return {n for n in numbers if (plan.rooms == n).any()}


def _unite_one_pair(rng: Generator, plan: Plan, numbers: set[int]) -> None:
    """Unite one pair of zones that touch."""
    pairs = set()
    for one, other in ((plan.rooms[:, :-1], plan.rooms[:, 1:]), (plan.rooms[:-1], plan.rooms[1:])):
        meet = (one != other) & np.isin(one, list(numbers)) & np.isin(other, list(numbers))
        pairs |= set(zip(one[meet].tolist(), other[meet].tolist(), strict=True))
    if pairs:
        plan.merge(*sorted(pairs)[rng.integers(len(pairs))])


def _private(rng: Generator, plan: Plan, area: Rectangle) -> set[int]:
    """Bedrooms, baths and closets off a hallway that widens or turns; its numbers."""
    x0, y0, x1, y1 = area
    broad = between(rng, 0.95, 1.9)
    y = y0 + round((y1 - y0 - broad) * rng.uniform(0.2, 0.8))
    reach = x1 if chance(rng, 0.6) else x1 - round((x1 - x0) * rng.uniform(0.1, 0.4))
    stops = [x0, reach]
    if reach - x0 > cells(3.5) and chance(rng, 0.5):
        stops.insert(1, x0 + between(rng, *CONNECTOR_M) if chance(rng, 0.5) else (x0 + reach) // 2)
    ways = set()
    for low, high in pairwise(stops):
        wider = between(rng, 0.3, 1.4) * int(len(stops) > 2 and chance(rng, 0.5))
        ways.add(plan.corridor((low, y - wider, high, y + broad)))
    if reach < x1 and chance(rng, 0.6):  # around a corner
        across = (reach, y, reach + broad, min(y1, y + between(rng, 2.5, 6.0)))
        ways.add(plan.corridor(across if chance(rng, 0.5) else (reach, max(y0, y - cells(4)), *across[2:])))
    usual_m, stop_m2 = rng.uniform(2.4, 5.0), rng.uniform(6, 22)
    for strip in ((x0, y0, x1, y), (x0, y + broad, x1, y1)):
        if min(strip[2] - strip[0], strip[3] - strip[1]) < cells(1.0):
            continue
        for low, high in pairwise(cuts_along(rng, x1 - x0, usual_m, 1.1, regular=False)):
            cell = (x0 + low, strip[1], x0 + high, strip[3])
            if strip[3] - strip[1] > cells(4.5) and chance(rng, 0.5):
                halved(rng, plan, cell, stop_m2, 1.2)
            else:
                plan.paint(cell)
    return ways
