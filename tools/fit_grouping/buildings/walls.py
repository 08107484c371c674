"""Walls between rooms, and the openings in them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from fit_grouping.buildings.plans import Plan
from fit_grouping.buildings.raster import Generator, Labels, Mask, between, cells, chance


@dataclass(frozen=True)
class Run:
    """A straight piece of border between two rooms.

    Attributes
    ----------
    upright : bool
        Whether it runs along y.
    at : int
        The column (of an upright one) or row before the border.
    low, high : int
        First cell along it, and the one after the last.
    """

    upright: bool
    at: int
    low: int
    high: int

    @property
    def length(self) -> int:
        """In cells."""
        return self.high - self.low


@dataclass(frozen=True, eq=False)
class WalledPlan:
    """A plan with its walls.

    Attributes
    ----------
    plan : Plan
    walls : (H, W) uint8
        1 where there is wall, door leaves included.
    glass : (H, W) uint8
        1 where a wall lets rays through.
    neighbors : dict
        Rooms that can be walked to from each room.
    other : (H, W) int32
        The rooms, with those united that nothing but taste parts: openings without any jamb.
    """

    plan: Plan
    walls: Mask
    glass: Mask
    neighbors: dict[int, list[int]]
    other: Labels


def border_runs(rooms: Labels) -> dict[tuple[int, int], list[Run]]:
    """Straight pieces of the border of each pair of rooms that touch, 0 (outside) among them."""
    runs: dict[tuple[int, int], list[Run]] = {}
    for upright in (True, False):
        image = rooms if upright else rooms.T
        one, other = image[:, :-1], image[:, 1:]
        column, row = np.nonzero((one != other).T)
        if len(row) == 0:
            continue
        low = np.minimum(one[row, column], other[row, column])
        high = np.maximum(one[row, column], other[row, column])
        new = np.ones(len(row), bool)
        new[1:] = (np.diff(column) != 0) | (np.diff(row) != 1) | (np.diff(low) != 0) | (np.diff(high) != 0)
        first = np.flatnonzero(new)
        last = np.append(first[1:], len(row)) - 1
        for i, j in zip(first, last, strict=True):
            run = Run(upright, int(column[i]), int(row[i]), int(row[j]) + 1)
            runs.setdefault((int(low[i]), int(high[i])), []).append(run)
    return runs


def _clear(walls: Mask, run: Run, low: int, high: int, thickness: int) -> None:
    reach = thickness // 2 + 2
    across = slice(max(0, run.at - reach), run.at + reach + 2)
    along = slice(low, high)
    walls[(along, across) if run.upright else (across, along)] = 0


def _leaf(rng: Generator, walls: Mask, run: Run, low: int, high: int) -> None:
    """A door leaf that stands open at an angle."""
    width = high - low
    angle = np.deg2rad(rng.uniform(40, 115))
    hinge, way = (low, 1) if chance(rng, 0.5) else (high - 1, -1)
    side = rng.choice([-1, 1])
    tip = (hinge + way * width * np.cos(angle), run.at + side * width * np.sin(angle))
    ends = [(hinge, run.at), (round(tip[0]), round(tip[1]))]
    if run.upright:
        ends = [(b, a) for a, b in ends]
    cv2.line(walls, ends[0], ends[1], 1, 1)


def build_walls(rng: Generator, plan: Plan) -> WalledPlan:
    """Draw walls, cut doors and wider openings, make some of the walls glass, add stubs and pillars."""
    rooms = plan.rooms
    border = np.zeros(rooms.shape, np.uint8)
    border[:, :-1] |= rooms[:, :-1] != rooms[:, 1:]
    border[:-1] |= rooms[:-1] != rooms[1:]
    thickness = max(2, cells(rng.choice([0.1, 0.1, 0.15, 0.2, 0.3])))
    walls = cv2.dilate(border, np.ones((thickness, thickness), np.uint8)).astype(np.uint8)
    outer = cv2.dilate(
        (rooms == 0).astype(np.uint8), np.ones((2 * thickness + 1, 2 * thickness + 1), np.uint8)
    )
    inner_side = (walls * outer).astype(np.uint8)
    runs = border_runs(rooms)
    neighbors: dict[int, list[int]] = {int(n): [] for n in np.unique(rooms[rooms > 0])}
    root = {n: n for n in neighbors}
    taste = {n: n for n in neighbors}

    def find(tree: dict[int, int], n: int) -> int:
        while tree[n] != n:
            n = tree[n]
        return n

    pairs = [p for p, parts in runs.items() if p[0] > 0 and max(r.length for r in parts) >= cells(0.9)]
    ways = plan.corridors | plan.halls
    order = sorted(pairs, key=lambda p: (not (p[0] in ways or p[1] in ways)) + rng.uniform(0, 0.9))
    usual_m = rng.uniform(0.75, 1.1)
    leaves = rng.choice([0.0, 0.15, 0.4])
    for a, b in order:
        both_corridors = a in plan.corridors and b in plan.corridors
        toward_way = (a in ways) != (b in ways)
        joined = find(root, a) == find(root, b)
        if joined and not both_corridors and not chance(rng, 0.1 if toward_way else 0.05):
            continue
        lengths = np.array([r.length for r in runs[a, b]], float)
        run = runs[a, b][rng.choice(len(lengths), p=lengths**2 / (lengths**2).sum())]
        room_for = run.length - 2 * thickness
        if room_for < cells(0.6):
            continue
        if both_corridors:
            kind = rng.choice(["door", "wide", "stub", "open"], p=[0.3, 0.25, 0.3, 0.15])
        elif chance(rng, plan.open_fronts):
            kind = rng.choice(["wide", "stub", "open"], p=[0.55, 0.38, 0.07])
        else:
            kind = "door"
        least_stub = cells(0.2)
        if kind == "door" or room_for < cells(1.5):
            width = min(max(between(rng, usual_m * 0.9, usual_m * 1.15), cells(0.6)), room_for)
            if chance(rng, 0.06):
                width = min(2 * width, room_for)
            stub = int(rng.integers(0, run.length - width - thickness + 1)) if chance(rng, 0.5) else None
            stub = stub if stub is not None else rng.choice([thickness, run.length - width - thickness])
            low = run.low + max(thickness // 2 + 1, int(stub))
        elif kind == "wide":
            width = round(room_for * rng.uniform(0.3, 0.8))
            low = run.low + thickness + int(rng.integers(0, room_for - width + 1))
        elif kind == "stub":
            width = max(cells(0.8), room_for - 2 * least_stub - between(rng, 0, 0.6))
            low = run.low + (run.length - width) // 2
        else:
            low, width = run.low + thickness // 2, run.length - thickness
            taste[find(taste, a)] = find(taste, b)
        high = min(low + width, run.high - thickness // 2)
        _clear(walls, run, low, high, thickness)
        if kind == "door" and high - low < cells(1.3) and chance(rng, leaves):
            _leaf(rng, walls, run, low, high)
        root[find(root, a)] = find(root, b)
        neighbors[a].append(b)
        neighbors[b].append(a)
    for (low_room, _), parts in runs.items():
        if low_room == 0 and chance(rng, 0.04):
            run = max(parts, key=lambda r: r.length)
            if run.length > cells(1.6):
                middle = (run.low + run.high) // 2
                _clear(walls, run, middle - cells(0.45), middle + cells(0.45), thickness)
    _stubs(rng, walls, thickness, rng.poisson(1.5 if plan.kind == "home" else 4))
    glass = _glass(rng, walls, inner_side)
    united = np.array([0, *(find(taste, n) for n in sorted(taste))], np.int32)
    number = np.zeros(int(rooms.max()) + 1, np.int32)
    number[[0, *sorted(taste)]] = united
    return WalledPlan(plan, walls, glass, neighbors, number[rooms])


def _stubs(rng: Generator, walls: Mask, thickness: int, count: int) -> None:
    """Pillars and short pieces of wall that stand into rooms."""
    rows, columns = np.nonzero(walls)
    for _ in range(count):
        at = int(rng.integers(len(rows)))
        along = [(1, 0), (-1, 0), (0, 1), (0, -1)][rng.integers(4)]
        reach = between(rng, 0.2, 0.8)
        end = (int(columns[at] + along[0] * reach), int(rows[at] + along[1] * reach))
        cv2.line(walls, (int(columns[at]), int(rows[at])), end, 1, max(1, thickness - 1))


def _glass(rng: Generator, walls: Mask, outer_walls: Mask) -> Mask:
    """Stretches of wall that rays pass: windows mostly, panes of inner walls at times."""
    if chance(rng, 0.05):  # a front of glass
        return outer_walls.copy()
    glass = np.zeros_like(walls)
    for mask, mean, low_m, high_m in ((outer_walls, 2.0, 0.3, 1.5), (walls, 0.5, 0.3, 0.8)):
        rows, columns = np.nonzero(mask)
        if len(rows) == 0 or chance(rng, 0.5):
            continue
        for _ in range(rng.poisson(mean)):
            at = rng.integers(len(rows))
            half = between(rng, low_m / 2, high_m / 2)
            y, x = rows[at], columns[at]
            glass[max(0, y - half) : y + half, max(0, x - half) : x + half] = 1
    return (glass & walls).astype(np.uint8)
