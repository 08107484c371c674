"""Large floors: wings of a university with lobbies and lecture halls, galleries, warehouses."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from fit_grouping.buildings.plans import (
    Plan,
    Rectangle,
    bays,
    corner_rooms,
    notches,
    row_of_rooms,
)
from fit_grouping.buildings.raster import CELL_M, Generator, between, cells, chance, larger_than
from fit_grouping.buildings.workplaces import (
    double_doors,
    furnish_large_as_halls,
    scattered,
    strip_beside,
    unbuilt,
    uneven_row,
)

LONGEST_WING_M = {1: 78.0, 2: 64.0, 3: 44.0}
"""Longest wing of a building with as many."""
GALLERY_M2 = 14.0
"""Smaller rooms of a gallery are closed by doors."""
YARD_M = (2.0, 6.0)
"""Ground around a warehouse."""


def wings(rng: Generator) -> Plan:
    """One to three wings of a university, each with one corridor or two around a core, and links between."""
    count = int(rng.choice([1, 2, 3], p=[0.4, 0.45, 0.15]))
    tilt = rng.choice([0.0, 1.0, 3.0])
    parts = [_turned(_wing(rng, LONGEST_WING_M[count]), rng.normal(0, tilt)) for _ in range(count)]
    apart = [between(rng, 4, 18) for _ in range(count)]
    width = max(part.rooms.shape[1] for part in parts)
    height = sum(part.rooms.shape[0] for part in parts) + sum(apart[1:])
    plan = Plan.empty("wings", width, height)
    x0, y, *_ = plan.inner
    places = []
    for number, part in enumerate(parts):
        rows, columns = part.rooms.shape
        y += apart[number] if number else 0
        x = x0 + int(rng.integers(0, width - columns + 1))
        first = int(plan.rooms.max())
        window = plan.rooms[y : y + rows, x : x + columns]
        window[part.rooms > 0] = part.rooms[part.rooms > 0] + first
        for own, marked in zip(plan.marks, part.marks, strict=True):
            own |= {n + first for n in marked}
        places.append((x, y, x + columns, y + rows))
        y += rows
    for upper, lower in pairwise(places):
        _link(rng, plan, upper, lower)
    furnish_large_as_halls(plan)
    bays(rng, plan, 1.5)
    corner_rooms(rng, plan, 1.0, 1.2, 3.0)
    unbuilt(rng, plan, rng.choice([0.0, 0.2, 0.5]))
    plan.frayed = rng.choice([0.0, 0.0, 0.15])
    plan.open_fronts = rng.choice([0.02, 0.2, 0.4])
    return plan


def _wing(rng: Generator, longest_m: float) -> Plan:
    """One wing, without ground around it."""
    long = between(rng, 22, longest_m)
    if chance(rng, 0.5):
        return _ring_wing(rng, long)
    deep = between(rng, 4, 14)
    width = between(rng, 1.6, 3.4)
    plan = Plan.empty("wings", long, 2 * deep + width, margin_m=0.0)
    area = plan.inner
    segments = [(0, deep, long, deep + width)]
    plan.corridor(segments[0])
    for _ in range(rng.integers(0, 3)):  # foyers and halls that the corridor opens into, or ends in
        broad, reach = between(rng, 5, 16), between(rng, 3, 12)
        at = int(rng.integers(0, max(1, long - broad)))
        whole = chance(rng, 0.4)
        room = (at, deep - reach, at + broad, deep + (width if whole else 0))
        if chance(rng, 0.5):
            room = (at, deep + (0 if whole else width), at + broad, deep + width + reach)
        plan.lobbies.add(plan.paint(room, over=True))
    _beside_corridors(rng, plan, segments, area)
    return plan


def _ring_wing(rng: Generator, long: int) -> Plan:
    """Two corridors with a core of rooms and courts between them and lobbies at their ends."""
    core, width = between(rng, 4, 11), between(rng, 1.6, 3.2)
    sides = [between(rng, 3.5, 9) for _ in range(2)]
    plan = Plan.empty("wings", long, sum(sides) + core + 2 * width, margin_m=0.0)
    low, high = sides[0], sides[0] + width + core
    ends = [between(rng, 3, 10) if chance(rng, 0.8) else 0 for _ in range(2)]
    left, right = ends[0], long - ends[1]
    segments = [(left, low, right, low + width), (left, high, right, high + width)]
    numbers = [plan.corridor(segment) for segment in segments]
    for a, b, broad in ((0, left, ends[0]), (right, long, ends[1])):
        if broad:
            past = [between(rng, 0, 2) * int(chance(rng, 0.3)) for _ in range(2)]
            plan.lobbies.add(plan.paint((a, low - past[0], b, high + width + past[1])))
        else:
            across = (0, low + width, width, high) if a == 0 else (long - width, low + width, long, high)
            plan.merge(numbers[0], plan.corridor(across))
    within = (left, low + width, right, high)
    if chance(rng, 0.5):
        before = int(plan.rooms.max())
        uneven_row(rng, plan, within)
        opened = rng.uniform(0.1, 0.5)
        built = range(before + 1, int(plan.rooms.max()) + 1)
        plan.lobbies |= {n for n in built if chance(rng, opened)}
    else:
        scattered(rng, plan, within, (0, 1))
    _beside_corridors(rng, plan, segments, plan.inner)
    return plan


def _beside_corridors(rng: Generator, plan: Plan, segments: list[Rectangle], area: Rectangle) -> None:
    """Offices, class rooms and lecture halls at both sides of corridors, in stretches with gaps between."""
    double_doors(rng, plan, segments)
    for segment in segments:
        for side in (0, 1):
            strip = strip_beside(segment, side, between(rng, 3.5, 13), area)
            way = rng.choice(["offices", "classes", "halls", "scattered"], p=[0.3, 0.2, 0.2, 0.3])
            if way == "scattered":
                scattered(rng, plan, strip, (side,))
                continue
            x0, y0, x1, y1 = strip
            at = x0
            while at < x1 - cells(3):
                end = min(x1, at + between(rng, 8, 36))
                part = (at, y0, end, y1)
                if way == "offices":
                    uneven_row(rng, plan, part)
                elif way == "classes":
                    row_of_rooms(rng, plan, part, rng.uniform(6, 12), least_m=4.5)
                else:
                    row_of_rooms(rng, plan, part, rng.uniform(9, 22), least_m=7)
                at = end + between(rng, 0, 10) * int(chance(rng, 0.5))


def _turned(plan: Plan, degrees: float) -> Plan:
    """A wing at an angle, on as much ground as it then needs."""
    if degrees == 0.0:
        return plan
    height, width = plan.rooms.shape
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), degrees, 1.0)
    sine, cosine = abs(turn[0, 1]), abs(turn[0, 0])
    size = (int(width * cosine + height * sine) + 1, int(width * sine + height * cosine) + 1)
    turn[:, 2] = turn[:, 2] + (np.array(size) - np.array([width, height])) / 2
    rooms = cv2.warpAffine(plan.rooms.astype(np.float32), turn, size, flags=cv2.INTER_NEAREST)
    plan.rooms = rooms.astype(np.int32)
    return plan


def _link(rng: Generator, plan: Plan, upper: Rectangle, lower: Rectangle) -> None:
    """A corridor or a hall between two wings, at times broad in its middle."""
    left, right = max(upper[0], lower[0]), min(upper[2], lower[2])
    broad = between(rng, 2.0, 12.0 if chance(rng, 0.3) else 4.0)
    if right - left <= broad:
        return
    at = int(rng.integers(left, right - broad))
    column = np.isin(plan.rooms[:, at + broad // 2], list(plan.corridors | plan.lobbies))
    above, below = (np.flatnonzero(column[wing[1] : wing[3]]) for wing in (upper, lower))
    first = upper[1] + int(above[-1]) + 1 if len(above) else (upper[1] + upper[3]) // 2
    last = lower[1] + int(below[0]) if len(below) else (lower[1] + lower[3]) // 2
    plan.rooms[first:last, at : at + broad] = 0
    stops = [first, last]
    if last - first > cells(10) and chance(rng, 0.6):
        stops = [first, first + between(rng, 3, 5), last - between(rng, 3, 5), last]
    for number, (a, b) in enumerate(pairwise(stops)):
        if len(stops) == 4 and number == 1:
            aside = between(rng, 0, 6)
            plan.halls.add(
                plan.paint((at - int(chance(rng, 0.5)) * aside, a, at + broad + aside, b), over=True)
            )
        elif chance(rng, 0.5):
            plan.corridor((at, a, at + broad, b))
        else:
            plan.lobbies.add(plan.paint((at, a, at + broad, b), over=True))


def gallery(rng: Generator) -> Plan:
    """Halls that open widely into halls, a foyer along them, few small rooms; at slants at times."""
    plan = Plan.empty("gallery", between(rng, 12, 56), between(rng, 10, 42))
    x0, y0, x1, y1 = plan.inner
    height, width = plan.rooms.shape
    slant = rng.choice([0.0, 0.0, 0.06, 0.2])
    y, x = np.mgrid[:height, :width].astype(np.float32)
    inside = np.zeros(plan.rooms.shape, bool)
    inside[y0:y1, x0:x1] = True
    if chance(rng, 0.4):  # a foyer along a side, that all halls open to
        deep = between(rng, 2.5, 9)
        strip = [(x0, y0, x0 + deep, y1), (x0, y0, x1, y0 + deep), (x1 - deep, y0, x1, y1)][rng.integers(3)]
        plan.corridors.add(plan.paint(strip))
    _cut(
        rng,
        plan,
        inside & (plan.rooms == 0),
        float(np.exp(rng.uniform(np.log(35), np.log(600)))),
        slant,
        x,
        y,
    )
    for _ in range(rng.poisson(0.4)):  # a round hall
        center = rng.uniform(x0, x1), rng.uniform(y0, y1)
        radii = rng.uniform(2.5, 7, 2) / CELL_M
        round_hall = ((x - center[0]) / radii[0]) ** 2 + ((y - center[1]) / radii[1]) ** 2 <= 1
        plan.rooms[round_hall & inside] = int(plan.rooms.max()) + 1
    large = larger_than(plan.rooms, GALLERY_M2)
    plan.galleries = {n for n in large if chance(rng, 0.9)} | plan.corridors
    plan.halls = large - plan.corridors
    corner_rooms(rng, plan, 2.0, 1.4, 4.5)
    notches(rng, plan, 0.8)
    plan.gates = 0.7
    return plan


def _cut(
    rng: Generator,
    plan: Plan,
    area: NDArray[np.bool_],
    stop_m2: float,
    slant: float,
    x: NDArray[np.float32],
    y: NDArray[np.float32],
) -> None:
    """Cut an area in two again and again, along lines that may be off the axes."""
    size = np.count_nonzero(area)
    if size < cells(2.0) ** 2:
        return
    rows, columns = np.flatnonzero(area.any(1)), np.flatnonzero(area.any(0))
    tall, wide = np.ptp(rows) + 1, np.ptp(columns) + 1
    if size * CELL_M**2 < stop_m2 * rng.uniform(0.5, 1.8) or max(tall, wide) < cells(7):
        plan.rooms[area] = int(plan.rooms.max()) + 1
        return
    angle = float(rng.normal(0, slant)) + (0.0 if wide > tall else np.pi / 2)
    at = rng.uniform(0.3, 0.7)
    spot = columns[0] + at * wide, rows[0] + at * tall
    beyond = np.cos(angle) * (x - spot[0]) + np.sin(angle) * (y - spot[1]) > 0
    for part in (area & beyond, area & ~beyond):
        _cut(rng, plan, part, stop_m2, slant, x, y)


def warehouse(rng: Generator) -> Plan:
    """A hall of goods: racks, blocks of pallets, crates that can be looked into; offices in a corner."""
    plan = Plan.empty("warehouse", between(rng, 14, 58), between(rng, 10, 36), margin_m=rng.uniform(*YARD_M))
    x0, y0, x1, y1 = plan.inner
    if chance(rng, 0.5):  # built into a corner or along a side
        long, deep = between(rng, 3, 16), between(rng, 2.5, 6)
        x = x0 if chance(rng, 0.5) else x1 - long
        y = y0 if chance(rng, 0.5) else y1 - deep
        row_of_rooms(rng, plan, (x, y, x + long, y + deep), rng.uniform(2.5, 6))
    if chance(rng, 0.25):
        middle = x0 + round((x1 - x0) * rng.uniform(0.3, 0.7))
        plan.hall((x0, y0, middle, y1))
    plan.hall(plan.inner)
    if chance(rng, 0.4):
        plan.galleries = set(plan.halls)
    notches(rng, plan, 0.4)
    plan.gates = rng.choice([0.3, 2.0])
    if chance(rng, 0.3):
        plan.yard = (plan.rooms == 0).astype(np.uint8)
    return plan
