"""Plans of places where people work: offices off corridors, faculties, depots, arenas and shops."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from fit_grouping.buildings.plans import (
    MARGIN_M,
    Plan,
    Rectangle,
    alcoves,
    bays,
    corner_rooms,
    corridor_segments,
    halved,
    notches,
    row_of_rooms,
    unite_touching,
)
from fit_grouping.buildings.raster import (
    CELL_M,
    Generator,
    Mask,
    between,
    cells,
    chance,
    larger_than,
    numbers_in,
)

WIDTHS_M = {
    "store": (1.0, 1.8),
    "office": (2.4, 5.2),
    "large": (5.5, 9.0),
    "lab": (9.0, 20.0),
}
"""Widths of the rooms along a corridor."""
WIDTH_SHARES = {"store": 0.17, "office": 0.56, "large": 0.17, "lab": 0.1}
GLAZED_SHARE, GLAZED_MARGIN_M = 0.12, 9.0
"""How often outer walls let rays through, and the ground that these reach."""
DOOR_EVERY_M = 22.0
"""A double door parts a corridor about once along this."""
ARM_MIN_M = 3.0
"""Corridors are parted no nearer to their ends."""
HALL_M2 = 60.0
"""Larger rooms are furnished as halls."""


def offices(rng: Generator) -> Plan:
    """Rooms of very different width along corridors that double doors part, labs open among them."""
    plan = empty_building(
        rng, "offices", between(rng, 20, 58), between(rng, 11, 38 if chance(rng, 0.5) else 18)
    )
    area = plan.inner
    width, depth = between(rng, 1.4, 3.2), between(rng, 3.6, 7.0)
    segments = corridor_segments(rng, area, width, depth)
    numbers = {plan.corridor(segment) for segment in segments}
    unite_touching(plan, numbers)
    double_doors(rng, plan, segments)
    for segment in segments:
        for side in (0, 1):
            if not chance(rng, 0.08):
                own = depth if chance(rng, 0.7) else between(rng, 2.6, 7.5)
                uneven_row(rng, plan, strip_beside(segment, side, own, area))
    if chance(rng, 0.5):
        halved(rng, plan, area, rng.uniform(15, 60), 2.5)
    corner_rooms(rng, plan, 0.6, 1.0, 2.4)
    bays(rng, plan, 0.8)
    notches(rng, plan, 0.3)
    alcoves(rng, plan, rng.choice([0.0, 0.0, 0.3]))
    unbuilt(rng, plan, rng.choice([0.0, 0.08, 0.2]))
    plan.frayed = rng.choice([0.0, 0.2, 0.5])
    plan.open_fronts = rng.choice([0.02, 0.1, 0.3])
    return plan


def faculty(rng: Generator) -> Plan:
    """A floor of a university: one corridor with an atrium, or two with a core and suites at their ends."""
    plan = empty_building(rng, "faculty", between(rng, 32, 72), between(rng, 20, 44))
    area = plan.inner
    corridors = _twin(rng, plan) if chance(rng, 0.5) else _spine(rng, plan)
    for segment in corridors:
        for side in (0, 1):
            way = rng.choice(["rooms", "classes", "scattered", "none"], p=[0.35, 0.2, 0.35, 0.1])
            strip = strip_beside(segment, side, between(rng, 3.5, 9), area)
            if way == "rooms":
                uneven_row(rng, plan, strip)
            elif way == "classes":
                before = int(plan.rooms.max())
                row_of_rooms(rng, plan, strip, rng.uniform(7, 14), least_m=5)
                plan.labs |= {n for n in range(before + 1, int(plan.rooms.max()) + 1) if chance(rng, 0.15)}
            elif way == "scattered":
                scattered(rng, plan, strip, (side,))
    furnish_large_as_halls(plan)
    bays(rng, plan, 1.0)
    corner_rooms(rng, plan, 1.0, 1.2, 3.0)
    unbuilt(rng, plan, 0.1)
    plan.frayed = rng.choice([0.0, 0.15])
    plan.open_fronts = rng.choice([0.02, 0.2, 0.4])
    return plan


def depot(rng: Generator) -> Plan:
    """A hall of goods with gates, few rooms in a corner, and the yard around it, which is no room."""
    plan = Plan.empty("depot", between(rng, 14, 46), between(rng, 10, 26), margin_m=rng.uniform(3.5, 8))
    x0, y0, x1, y1 = plan.inner
    for _ in range(rng.poisson(0.7)):
        deep = between(rng, 2.5, 5)
        strip = [(x0, y0, x0 + deep, y1), (x0, y1 - deep, x1, y1)][rng.integers(2)]
        uneven_row(rng, plan, strip)
    if chance(rng, 0.3):
        middle = x0 + round((x1 - x0) * rng.uniform(0.3, 0.7))
        plan.hall((x0, y0, middle, y1))
    plan.hall(plan.inner)
    notches(rng, plan, 0.3)
    plan.gates = rng.choice([0.5, 2.0])
    ground = (plan.rooms == 0).astype(np.uint8)
    if chance(rng, 0.5):  # a strip of the yard along a side or two, as simulated depots have it
        plan.strip = np.zeros_like(ground)
        for _ in range(rng.integers(1, 4)):
            _side_strip(rng, plan.strip, plan.inner, between(rng, 0.15, 1.5))
        plan.strip &= ground
    if chance(rng, 0.3):
        plan.yard = ground
    return plan


def arena(rng: Generator) -> Plan:
    """Rooms of low walls in a hall: the floor around them is no room, though it is seen and driven on."""
    plan = Plan.empty("arena", between(rng, 6, 17), between(rng, 5, 13), margin_m=rng.uniform(3, 7))
    halved(rng, plan, plan.inner, rng.uniform(10, 34), 2.2)
    notches(rng, plan, 0.7)
    numbers = numbers_in(plan.rooms)
    plan.public = {number for number in numbers if chance(rng, 0.8)}
    plan.gates = rng.uniform(1, 4)
    ground = (plan.rooms == 0).astype(np.uint8)
    plan.things = np.zeros_like(ground)
    if chance(rng, 0.7):  # the hall's own walls, stands of the visitors, tables of the teams
        height, width = ground.shape
        low = [between(rng, 0.2, 0.7 * plan.margin_m) for _ in range(4)]
        cv2.rectangle(plan.things, (low[0], low[1]), (width - low[2], height - low[3]), 1, 2)
    for _ in range(rng.poisson(12)):
        spot = float(rng.integers(ground.shape[1])), float(rng.integers(ground.shape[0]))
        size = (rng.uniform(0.3, 2.5) / CELL_M, rng.uniform(0.3, 0.9) / CELL_M)
        corners = cv2.boxPoints((spot, size, 90.0 * rng.integers(2) + rng.normal(0, 4)))
        cv2.fillPoly(plan.things, [corners.astype(np.int32)], 1)
    away = cv2.erode(ground, np.ones((9, 9), np.uint8), borderValue=1)
    plan.things &= away.astype(np.uint8)
    if chance(rng, 0.5):
        plan.yard = ground
    return plan


def shop(rng: Generator) -> Plan:
    """A shop: one floor of shelves and islands, of L shape at times, and few rooms behind it."""
    plan = empty_building(rng, "shop", between(rng, 8, 30), between(rng, 8, 24))
    x0, y0, x1, _ = plan.inner
    if chance(rng, 0.5):
        uneven_row(rng, plan, (x0, y0, x1, y0 + between(rng, 2, 4.5)))
    plan.hall(plan.inner)
    notches(rng, plan, 1.0)
    plan.gates = 1.0
    return plan


def empty_building(rng: Generator, kind: str, width: int, height: int) -> Plan:
    """Ground of a building, at times one whose outer walls let rays through."""
    glazed = chance(rng, GLAZED_SHARE)
    plan = Plan.empty(kind, width, height, margin_m=GLAZED_MARGIN_M if glazed else MARGIN_M)
    plan.glazed = glazed
    return plan


def strip_beside(segment: Rectangle, side: int, deep: int, area: Rectangle) -> Rectangle:
    """The strip along one side of a piece of corridor, within an area."""
    x0, y0, x1, y1 = segment
    if x1 - x0 >= y1 - y0:
        strip = (x0, y0 - deep, x1, y0) if side else (x0, y1, x1, y1 + deep)
    else:
        strip = (x0 - deep, y0, x0, y1) if side else (x1, y0, x1 + deep, y1)
    low_x, low_y, high_x, high_y = area
    return max(strip[0], low_x), max(strip[1], low_y), min(strip[2], high_x), min(strip[3], high_y)


def uneven_row(rng: Generator, plan: Plan, strip: Rectangle) -> None:
    """Cut a strip crosswise into stores, offices, large rooms and labs."""
    x0, y0, x1, y1 = strip
    lies = x1 - x0 >= y1 - y0
    length, deep = max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)
    if deep < cells(1.2):
        return
    at = 0
    while length - at >= cells(WIDTHS_M["store"][0]):
        use = str(rng.choice(list(WIDTH_SHARES), p=list(WIDTH_SHARES.values())))
        end = min(at + between(rng, *WIDTHS_M[use]), length)
        if length - end < cells(WIDTHS_M["store"][0]):
            end = length
        number = plan.paint((x0 + at, y0, x0 + end, y1) if lies else (x0, y0 + at, x1, y0 + end))
        if use == "lab" and end - at > 2 * deep // 3 and chance(rng, 0.7):
            plan.labs.add(number)
        at = end


def scattered(rng: Generator, plan: Plan, strip: Rectangle, sides: tuple[int, ...]) -> None:
    """Rooms here and there along a strip, some of which open widely: suites, stair wells, places to wait.

    They lie at its low side (0) or at its high one (1), of those at which there is a corridor.
    """
    x0, y0, x1, y1 = strip
    lies = x1 - x0 >= y1 - y0
    length, deep = max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)
    at = between(rng, 0, 6)
    while at < length - cells(2.0) and deep > cells(1.5):
        end = min(at + between(rng, 2.2, 8.0), length)
        own = round(deep * rng.uniform(0.5, 1.0))
        low, high = (deep - own, deep) if rng.choice(sides) else (0, own)
        if lies:
            number = plan.paint((x0 + at, y0 + low, x0 + end, y0 + high))
        else:
            number = plan.paint((x0 + low, y0 + at, x0 + high, y0 + end))
        if chance(rng, 0.4):
            plan.lobbies.add(number)
        at = end + between(rng, 0, 8) * int(chance(rng, 0.6))


def double_doors(rng: Generator, plan: Plan, segments: list[Rectangle]) -> None:
    """Part corridors across, away from their ends."""
    for x0, y0, x1, y1 in segments:
        lies = x1 - x0 >= y1 - y0
        length, arm = max(x1 - x0, y1 - y0), cells(ARM_MIN_M)
        if length < 2 * arm:
            continue
        count = rng.poisson(length * CELL_M / DOOR_EVERY_M * rng.choice([0.0, 1.0]))
        cuts = np.sort(rng.integers(arm, length - arm + 1, count)).tolist()
        for low, high in pairwise([*cuts, length]):
            if high - low >= arm:
                plan.corridor((x0 + low, y0, x1, y1) if lies else (x0, y0 + low, x1, y1))


def _twin(rng: Generator, plan: Plan) -> list[Rectangle]:
    """Two corridors side by side with a core of rooms and courts, suites at their ends, a hall across."""
    x0, y0, x1, y1 = plan.inner
    width, core = between(rng, 1.5, 3.0), between(rng, 4.0, 9.0)
    low = y0 + round(max(0, y1 - y0 - core - 2 * width) * rng.uniform(0.3, 0.7))
    high = low + width + core
    ends = [between(rng, 4, 9) if chance(rng, 0.75) else 0 for _ in range(2)]
    left, right = x0 + ends[0], x1 - ends[1]
    segments = [(left, low, right, low + width), (left, high, right, high + width)]
    numbers = [plan.corridor(segment) for segment in segments]
    double_doors(rng, plan, segments)
    for a, b, there in ((x0, left, ends[0]), (right, x1, ends[1])):
        if there:
            plan.lobbies.add(plan.paint((a, low, b, high + width)))
        else:
            across = (a, low + width, a + width, high) if a == x0 else (b - width, low + width, b, high)
            plan.merge(numbers[0], plan.corridor(across))
    for _ in range(rng.poisson(1.0)):  # ways across the core
        at = int(rng.integers(left + cells(3), right - cells(3) - width))
        plan.lobbies.add(plan.paint((at, low + width, at + between(rng, 1.5, 4.0), high)))
    if chance(rng, 0.6):
        uneven_row(rng, plan, (left, low + width, right, high))
    else:
        scattered(rng, plan, (left, low + width, right, high), (0, 1))
    if chance(rng, 0.5) and high + width + cells(4) < y1:  # a bridge to a hall
        at = int(rng.integers(left, right - cells(8)))
        reach = between(rng, 2, 5)
        broad = between(rng, 2.0, 4.5)
        plan.lobbies.add(plan.paint((at, high + width, at + broad, high + width + reach)))
        plan.hall((at, high + width + reach, at + between(rng, 6, 14), y1))
    return segments


def _spine(rng: Generator, plan: Plan) -> list[Rectangle]:
    """A corridor through the building, with an atrium that it meets along all of its width, and arms."""
    x0, y0, x1, y1 = plan.inner
    width = between(rng, 1.8, 3.4)
    y = y0 + round((y1 - y0 - width) * rng.uniform(0.3, 0.7))
    segments = [(x0, y, x1, y + width)]
    plan.corridor(segments[0])
    double_doors(rng, plan, segments)
    for _ in range(rng.integers(0, 3)):
        at, own = int(rng.integers(x0 + cells(4), x1 - cells(6))), between(rng, 1.5, 3.0)
        arm = (at, y + width, at + own, y1) if chance(rng, 0.5) else (at, y0, at + own, y)
        plan.corridor(arm)
        segments.append(arm)
    for _ in range(rng.integers(0, 3)):
        at, broad, deep = int(rng.integers(x0, x1 - cells(8))), between(rng, 4, 14), between(rng, 3, 12)
        low, high = (y - deep, y) if chance(rng, 0.5) else (y + width, y + width + deep)
        room = (at, max(low, y0), min(at + broad, x1), min(high, y1))
        if chance(rng, 0.3):  # the corridor ends in it and goes on behind it
            room = (room[0], min(room[1], y), room[2], max(room[3], y + width))
            plan.rooms[room[1] : room[3], room[0] : room[2]] = 0
        plan.lobbies.add(plan.paint(room))
    return segments


def furnish_large_as_halls(plan: Plan) -> None:
    """Furnish large rooms as halls."""
    plan.halls |= larger_than(plan.rooms, HALL_M2) - plan.corridors


def unbuilt(rng: Generator, plan: Plan, share: float) -> None:
    """Leave out rooms that nobody enters: shafts, courts, locked rooms."""
    for room in numbers_in(plan.rooms):
        if room not in plan.corridors | plan.lobbies and chance(rng, share):
            plan.rooms[plan.rooms == room] = 0


def _side_strip(rng: Generator, strip: Mask, inner: Rectangle, deep: int) -> None:
    """Mark the ground along one side of a building."""
    x0, y0, x1, y1 = inner
    side = [
        np.s_[y0 - deep : y0, x0:x1],
        np.s_[y1 : y1 + deep, x0:x1],
        np.s_[y0:y1, x0 - deep : x0],
        np.s_[y0:y1, x1 : x1 + deep],
    ][rng.integers(4)]
    strip[side] = 1
