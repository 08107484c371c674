"""What stands in rooms that people work in: desks in rows and combs, cabinets, screens, rows of seats."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fit_grouping.buildings.raster import Generator, Mask, between, cells, chance

DESK_DEEP_M, DESK_LONG_M = (0.6, 0.9), (1.2, 2.0)
SCREEN_REACH = (0.2, 0.6)
"""Share of a room that a half-height screen reaches across: people walk around its end."""
SCREEN_DOT_STEP_M = (0.2, 0.7)
"""Steps of the dots that are seen of a screen on feet."""
WAY_M = (1.2, 2.4)
"""Ways between rows of desks."""
SEAT_STEP_M, SEAT_ROW_M = (0.5, 0.9), (0.8, 1.4)
NICHE_STEP_M, NICHE_LONG_M = (0.9, 2.4), (0.2, 0.9)
"""Steps and lengths of cabinets that stand out from walls like teeth."""
SIDE_SEEN = 0.85
"""Share of the sides of boxes that are seen."""
SMALL_M = 2.2
"""Narrower rooms are stores, with shelves only."""
PIECES = {"desks": 0.22, "islands": 0.2, "ring": 0.1, "comb": 0.12, "seats": 0.1, "none": 0.26}
"""What the middle of a room is full of, and how often."""


def furnish_workroom(rng: Generator, drawn: Mask) -> None:
    """Put cabinets along the walls, desks or seats into the middle, screens between them, and clutter."""
    if min(drawn.shape) < cells(SMALL_M):
        if chance(rng, 0.5):
            _along_wall(rng, drawn)
        return
    for _ in range(rng.poisson(2.0)):
        _along_wall(rng, drawn)
    middles: dict[str, Callable[[Generator, Mask], None]] = {
        "desks": _desks,
        "islands": _islands,
        "ring": _ring,
        "comb": _comb,
        "seats": _seats,
    }
    kind = str(rng.choice(list(PIECES), p=list(PIECES.values())))
    if kind in middles:
        middles[kind](rng, drawn if chance(rng, 0.5) else drawn.T)
    for _ in range(rng.poisson(0.6)):
        _screen(rng, np.rot90(drawn, int(rng.integers(4))))
    _clutter(rng, drawn, rng.choice([0.0, 0.1, 0.4]))


def furnish_niches(rng: Generator, drawn: Mask) -> None:
    """Put cabinets, shelves and desks at steps along all walls, so that the floor reaches between them."""
    step, long = between(rng, *NICHE_STEP_M), between(rng, *NICHE_LONG_M)
    deep = between(rng, 0.3, 1.0)
    seen = rng.uniform(0.4, 0.95)
    for turn in range(4):
        image = np.rot90(drawn, turn)
        if image.shape[0] < 2 * deep + cells(0.8):
            continue
        for at in range(between(rng, 0.0, 1.5), image.shape[1], step):
            if chance(rng, seen):
                start = max(0, at + int(rng.normal(0, 2)))
                own = max(1, round(deep * rng.uniform(0.5, 1.2)))
                image[:own, start : start + max(2, round(long * rng.uniform(0.6, 1.4)))] = 1
    if chance(rng, 0.5):
        _islands(rng, drawn)
    _clutter(rng, drawn, rng.choice([0.0, 0.1, 0.4]))


def _along_wall(rng: Generator, drawn: Mask) -> None:
    """Cabinets of different depth along a wall, which look like notches of the room, or before it."""
    image = np.rot90(drawn, int(rng.integers(4)))
    at, end = 0, int(image.shape[1] * rng.uniform(0.3, 1.0))
    off = int(chance(rng, 0.25)) * cells(0.1)
    share = rng.uniform(0.4, 0.95)
    while at < end:
        long, deep = between(rng, 0.4, 1.8), between(rng, 0.25, 0.9)
        if chance(rng, share):
            image[off : off + deep, at : min(at + long, end)] = 1
        at += long


def _desks(rng: Generator, drawn: Mask) -> None:
    """Rows of desks back to back, some with a screen between them, with chairs at both sides."""
    height, width = drawn.shape
    deep, long = between(rng, *DESK_DEEP_M), between(rng, *DESK_LONG_M)
    legs_only, screen = chance(rng, 0.35), chance(rng, 0.4)
    y = between(rng, 0.4, 1.6)
    while y + 2 * deep < height - cells(0.4):
        start = between(rng, 0.0, 1.5)
        for x in range(start, width - long - cells(0.3), long):
            if chance(rng, 0.15):
                continue
            for low in (y, y + deep):
                if legs_only:
                    _corners(rng, drawn, x, low, x + long, low + deep)
                elif chance(rng, 0.8):
                    _outline(rng, drawn, x, low, x + long, low + deep)
            _chair(rng, drawn, x + long // 2, y - cells(0.3))
            _chair(rng, drawn, x + long // 2, y + 2 * deep + cells(0.3))
        if screen:
            drawn[y + deep : y + deep + 1, start : width - cells(0.9)] = 1
        y += 2 * deep + between(rng, *WAY_M)


def _islands(rng: Generator, drawn: Mask) -> None:
    """One group of tables or a few in a row, looked into from all sides: outlines with chairs around."""
    height, width = drawn.shape
    long, deep = between(rng, 0.8, 2.4), between(rng, 0.6, 1.6)
    y = int(rng.integers(cells(0.6), max(cells(0.7), height - deep - cells(0.6))))
    step = long + between(rng, 1.0, 3.0)
    for x in range(between(rng, 0.6, 2.0), width - long - cells(0.5), step):
        low, high = y + int(rng.normal(0, 3)), y + deep
        _outline(rng, drawn, x, low, x + long, high)
        for _ in range(rng.poisson(4)):
            _chair(rng, drawn, x + int(rng.integers(-8, long + 8)), int(rng.choice([low - 7, high + 7])))


def _ring(rng: Generator, drawn: Mask) -> None:
    """Tables of a seminar in a ring: of its chairs and legs dots are seen."""
    height, width = drawn.shape
    rim = between(rng, 0.8, 1.6)
    if min(height, width) < 2 * rim + cells(1.0):
        return
    step = between(rng, 0.35, 0.7)
    for inset in (0, between(rng, 0.5, 0.9)):
        x0, y0, x1, y1 = rim + inset, rim + inset, width - rim - inset, height - rim - inset
        for x in range(x0, x1, step):
            _dot(rng, drawn, x, y0)
            _dot(rng, drawn, x, y1)
        for y in range(y0, y1, step):
            _dot(rng, drawn, x0, y)
            _dot(rng, drawn, x1, y)


def _comb(rng: Generator, drawn: Mask) -> None:
    """Work places in a comb: a line of screens with teeth to one side or both."""
    height, width = drawn.shape
    reach, step = between(rng, 0.8, 1.8), between(rng, 1.4, 2.4)
    y = int(rng.integers(reach, max(reach + 1, height - reach)))
    start, end = between(rng, 0.0, 1.2), width - between(rng, 1.0, 2.0)
    if end <= start:
        return
    thick = int(rng.integers(1, 3))
    drawn[y : y + thick, start:end] = 1
    both = chance(rng, 0.6)
    for x in range(start, end, step):
        drawn[max(0, y - reach) if both else y : y + reach, x : x + thick] = 1
        _chair(rng, drawn, x + step // 2, y + reach // 2 + cells(0.3))


def _seats(rng: Generator, drawn: Mask) -> None:
    """Rows of seats or tables of a class, as dots or thin lines, with ways at their ends."""
    height, width = drawn.shape
    rim = between(rng, 0.8, 1.5)
    lines = chance(rng, 0.4)
    seat, row = between(rng, *SEAT_STEP_M), between(rng, *SEAT_ROW_M)
    for y in range(rim, height - rim, row):
        if lines:
            drawn[y : y + 1, rim : width - rim] = 1
            continue
        for x in range(rim, width - rim, seat):
            if chance(rng, 0.85):
                _dot(rng, drawn, x, y)


def _screen(rng: Generator, drawn: Mask) -> None:
    """A screen of half height that stands out from a wall: a thin line, or the dots of its feet."""
    height, width = drawn.shape
    x, reach = int(rng.integers(width)), int(height * rng.uniform(*SCREEN_REACH))
    low = 0 if chance(rng, 0.7) else int(rng.integers(max(1, height - reach)))
    if chance(rng, 0.5):
        drawn[low : low + reach, x : x + 1] = 1
        if chance(rng, 0.3):
            drawn[low + reach : low + reach + 1, max(0, x - cells(0.5)) : x + cells(0.5)] = 1
        return
    for y in range(low, low + reach, between(rng, *SCREEN_DOT_STEP_M)):
        _dot(rng, drawn, x, y)


def _clutter(rng: Generator, drawn: Mask, per_m2: float) -> None:
    """Blots of things on the floor."""
    height, width = drawn.shape
    for _ in range(rng.poisson(per_m2 * height * width / cells(1.0) ** 2)):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        for _ in range(rng.integers(1, 9)):
            _dot(rng, drawn, x + int(rng.normal(0, 3)), y + int(rng.normal(0, 3)))


def _chair(rng: Generator, drawn: Mask, x: int, y: int) -> None:
    if chance(rng, 0.3):
        return
    for _ in range(rng.integers(1, 5)):
        _dot(rng, drawn, x + int(rng.normal(0, 3)), y + int(rng.normal(0, 3)))


def _corners(rng: Generator, drawn: Mask, x0: int, y0: int, x1: int, y1: int) -> None:
    for x, y in ((x0, y0), (x1, y0), (x0, y1), (x1, y1)):
        _dot(rng, drawn, x, y)


def _outline(rng: Generator, drawn: Mask, x0: int, y0: int, x1: int, y1: int) -> None:
    """Most sides of a box."""
    x0, y0 = max(0, x0), max(0, y0)
    sides = (
        np.s_[y0 : y0 + 1, x0:x1],
        np.s_[y1 : y1 + 1, x0:x1],
        np.s_[y0:y1, x0 : x0 + 1],
        np.s_[y0:y1, x1 : x1 + 1],
    )
    for side in sides:
        if chance(rng, SIDE_SEEN):
            drawn[side] = 1


def _dot(rng: Generator, drawn: Mask, x: int, y: int) -> None:
    half = int(rng.integers(1, 3))
    drawn[max(0, y) : max(0, y + half), max(0, x) : max(0, x + half)] = 1
