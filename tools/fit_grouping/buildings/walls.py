"""Walls between rooms, and the openings in them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fit_grouping.buildings.plans import Plan
from fit_grouping.buildings.raster import Generator, Labels, Mask, between, cells, chance, numbers_in

HOMES = frozenset({"home", "villa", "openhome", "hallways"})
"""Kinds of plans that people live in."""
DOOR_PLACE_MIN_M = 0.9
"""A border that is as long has place for a door."""
AXIS_SHARE_MIN = 0.4
"""A border lies along the axes where its longest straight run is this share of it; else it may slant."""
SLANT_TRIES, SLANT_NEAR_M, SLANT_TOLERANCE_CELLS = 4, 0.6, 1.5
"""A slanting border is followed from this many of its points: the direction is that of the points around, and
what is no farther from the line is on it."""
WIDE_MAX_M = 4.0
STUB_MIN_M = 0.2
SHOULDER_MIN_M = 0.4
"""Rooms without a jamb between them are parted where one is wider by this."""
LOOK_ALONG_M = 8.0
DOUBLE_DOOR_M, DOUBLE_LEAF_SHARE = (1.5, 2.6), 0.6
"""Width of the double doors that part corridors, and how often a leaf of them stands half open."""
CABINET_M, CABINET_GAP_M, CABINET_DEEP_M = (1.0, 3.2), (0.6, 2.4), (0.25, 0.6)
"""Cabinets and pieces of wall between a lab and a corridor, and the gaps between them."""
GAP_SHARE, LARGE_GAP_SHARE = (0.25, 0.67), (0.5, 0.9)
"""Share of a wall that a gap with a stub at each end takes: between offices, between halls and zones."""
SUITE_PIECE_M, SUITE_GAP_M, SUITE_DEEP_M = (0.4, 1.8), (0.8, 2.2), (0.2, 0.6)
"""Pieces of a wall between offices, the gaps between them, and the depth of cabinets in their place."""
PIER_M, PIER_GAP_M, PIER_DEEP_M = (0.3, 2.5), (1.0, 4.5), (0.3, 2.5)
"""Pillars, pieces of wall and booths between halls, and the gaps between them."""
CABINET_AT_STUB = 0.35
"""How often a cabinet stands at what is left of a wall beside a gap."""
COUNTER_SHARE, COUNTER_DEEP_M = (0.25, 0.65), (0.4, 0.7)
"""Share of an opening that a counter reaches into, and how deep it is."""
SUITE_OPENINGS = {"gap": 0.42, "pieces": 0.25, "end gap": 0.18, "stub": 0.15}
GALLERY_OPENINGS = {
    "large gap": 0.25,
    "piers": 0.25,
    "stub": 0.15,
    "one side": 0.1,
    "open": 0.05,
    "door": 0.2,
}
ZONE_OPENINGS = {
    "large gap": 0.24,
    "counter": 0.2,
    "stub": 0.16,
    "one side": 0.14,
    "piers": 0.04,
    "open": 0.12,
    "door": 0.1,
}
FLOWING_OPENINGS = {"open": 0.5, "one side": 0.18, "large gap": 0.12, "stub": 0.08, "door": 0.12}
"""How rooms of a suite, of a gallery and of an open floor meet, and rooms hardly parted by jambs."""
FRAYED_GAP_M, FRAYED_PIECE_M, FRAYED_DOT_STEP_M = (0.15, 0.7), (0.2, 1.6), (0.1, 0.22)
"""What is seen of a frayed wall: gaps between pieces, or dots too near to each other to walk through."""
GATE_M = (0.9, 3.5)
"""Width of openings to the outside: doors to gates."""
PUBLIC_AGAIN, ZONES_AGAIN = 0.4, 0.65
"""Probability of one more opening between living rooms (or halls), and zones, that are joined already."""
WINDOWS, HOME_WINDOWS = 2.0, 2.5
"""Windows of a building, on average."""


@dataclass(frozen=True)
class Pieces:
    """What stands on a border, with gaps between.

    Attributes
    ----------
    long_m, gap_m : tuple of float
        Ranges of the lengths of the pieces and of the gaps.
    deep_m : tuple of float
        Range of their depths.
    deep_share : float
        Share of the pieces that are as deep; the others are as thick as the walls.
    from_end : float
        How often the first piece stands at the border's end.
    """

    long_m: tuple[float, float]
    gap_m: tuple[float, float]
    deep_m: tuple[float, float]
    deep_share: float
    from_end: float = 0.0


PIECES = {
    "cabinets": Pieces(CABINET_M, CABINET_GAP_M, CABINET_DEEP_M, 0.7),
    "pieces": Pieces(SUITE_PIECE_M, SUITE_GAP_M, SUITE_DEEP_M, 0.3, 0.7),
    "piers": Pieces(PIER_M, PIER_GAP_M, PIER_DEEP_M, 0.35),
}
"""Openings that leave pieces of a border."""


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


@dataclass(frozen=True)
class Stretch:
    """A straight piece of border at any angle.

    Attributes
    ----------
    start, direction : tuple of float
        x, y of its beginning, in cells, and the unit vector along it.
    length : int
        In cells.
    """

    start: tuple[float, float]
    direction: tuple[float, float]
    length: int

    def point(self, along: float, aside: float = 0.0) -> tuple[float, float]:
        """x, y at a length along it and a distance to its left."""
        (x, y), (u, v) = self.start, self.direction
        return x + along * u - aside * v, y + along * v + aside * u


def straight_stretch(rng: Generator, runs: list[Run]) -> Stretch:
    """A straight piece of a border: one along an axis where there is a long one, else at a slant."""
    lengths = np.array([r.length for r in runs], float)
    if lengths.max() >= cells(DOOR_PLACE_MIN_M) and lengths.max() >= AXIS_SHARE_MIN * lengths.sum():
        run = runs[rng.choice(len(lengths), p=lengths**2 / (lengths**2).sum())]
        start = (run.at + 0.5, float(run.low)) if run.upright else (float(run.low), run.at + 0.5)
        return Stretch(start, (0.0, 1.0) if run.upright else (1.0, 0.0), run.length)
    points = np.vstack([_points(run) for run in runs])
    found = [_straight_around(points, int(seed)) for seed in rng.integers(0, len(points), SLANT_TRIES)]
    return max(found, key=lambda stretch: stretch.length)


def _points(run: Run) -> NDArray[np.float64]:
    along = np.arange(run.low, run.high, dtype=float)
    across = np.full(len(along), run.at + 0.5)
    return np.column_stack([across, along] if run.upright else [along, across])


def _straight_around(points: NDArray[np.float64], seed: int) -> Stretch:
    """The straight piece of a border through one of its points."""
    offset = points - points[seed]
    near = offset[(offset**2).sum(1) <= cells(SLANT_NEAR_M) ** 2]
    u, v = np.linalg.svd(near - near.mean(0), full_matrices=False)[2][0].tolist()
    beside = offset @ np.array([-v, u])
    along = np.sort((offset @ np.array([u, v]))[np.abs(beside) <= SLANT_TOLERANCE_CELLS])
    gaps = np.flatnonzero(np.diff(along) > 2 * SLANT_TOLERANCE_CELLS)
    pieces = np.split(along, gaps + 1)
    piece = max(pieces, key=len)
    x, y = points[seed] + piece[0] * np.array([u, v])
    return Stretch((float(x), float(y)), (u, v), int(piece[-1] - piece[0]))


def _clear(walls: Mask, stretch: Stretch, low: int, high: int, thickness: int) -> None:
    reach = thickness // 2 + 2.5
    ends = [(low, -reach), (high - 1, -reach), (high - 1, reach), (low, reach)]
    corners = np.round([stretch.point(*end) for end in ends]).astype(np.int32)
    cv2.fillPoly(walls, [corners], 0)


def _leaf(rng: Generator, walls: Mask, stretch: Stretch, low: int, high: int) -> None:
    """A door leaf that stands open at an angle."""
    width = high - low
    angle = np.deg2rad(rng.uniform(40, 115))
    hinge, way = (low, 1) if chance(rng, 0.5) else (high - 1, -1)
    side = rng.choice([-1, 1])
    tip = stretch.point(hinge + way * width * np.cos(angle), side * width * np.sin(angle))
    ends = [(round(x), round(y)) for x, y in (stretch.point(hinge), tip)]
    cv2.line(walls, ends[0], ends[1], 1, 1)


def _opening_kind(rng: Generator, plan: Plan, a: int, b: int) -> str:
    """Door, wide opening, one with a jamb at one side, one that leaves stubs, or no jamb at all."""
    if a in plan.corridors and b in plan.corridors and not (a in plan.public and b in plan.public):
        return str(rng.choice(["door", "double", "wide", "stub", "open"], p=[0.25, 0.3, 0.15, 0.2, 0.1]))
    for kinds, openings in (
        (plan.suite, SUITE_OPENINGS),
        (plan.galleries, GALLERY_OPENINGS),
        (plan.zones, ZONE_OPENINGS),
        (plan.flowing, FLOWING_OPENINGS),
    ):
        if a in kinds and b in kinds:
            return str(rng.choice(list(openings), p=list(openings.values())))
    ways = plan.corridors | plan.lobbies | plan.halls
    if (a in plan.labs and b in ways) or (b in plan.labs and a in ways):
        return str(rng.choice(["cabinets", "wide", "one side"], p=[0.6, 0.2, 0.2]))
    if (a in plan.lobbies and b in ways) or (b in plan.lobbies and a in ways):
        return str(rng.choice(["wide", "stub", "one side", "open"], p=[0.28, 0.26, 0.2, 0.26]))
    if a in plan.public and b in plan.public:
        return str(rng.choice(["door", "wide", "one side", "stub", "open"], p=[0.26, 0.26, 0.16, 0.16, 0.16]))
    if chance(rng, plan.open_fronts):
        return str(rng.choice(["wide", "stub", "open"], p=[0.55, 0.38, 0.07]))
    return "door"


def _opening(rng: Generator, kind: str, stretch: Stretch, thickness: int, usual_m: float) -> tuple[int, int]:
    """First cell of an opening along a piece of border, and the one after its last."""
    room_for = stretch.length - 2 * thickness
    if kind == "door" or room_for < cells(1.5):
        width = min(max(between(rng, usual_m * 0.9, usual_m * 1.15), cells(0.6)), room_for)
        if chance(rng, 0.06):
            width = min(2 * width, room_for)
        last = stretch.length - width - thickness
        stub = int(rng.integers(0, last + 1)) if chance(rng, 0.5) else int(rng.choice([thickness, last]))
        low = max(thickness // 2 + 1, stub)
    elif kind == "double":
        width = min(between(rng, *DOUBLE_DOOR_M), room_for)
        low = (stretch.length - width) // 2
    elif kind == "wide":
        width = min(max(round(room_for * rng.uniform(0.3, 0.85)), cells(1.0)), cells(WIDE_MAX_M))
        low = thickness + int(rng.integers(0, room_for - width + 1))
    elif kind in ("gap", "large gap", "counter"):
        share = rng.uniform(*(GAP_SHARE if kind == "gap" else LARGE_GAP_SHARE))
        stub = cells(STUB_MIN_M)
        width = min(max(round(room_for * share), cells(0.8)), room_for - 2 * stub)
        low = thickness + int(rng.integers(stub, room_for - width - stub + 1))
    elif kind in ("one side", "end gap"):
        width = round(room_for * rng.uniform(*(GAP_SHARE if kind == "end gap" else (0.45, 0.9))))
        low = thickness // 2 if chance(rng, 0.5) else stretch.length - width - thickness // 2
    elif kind == "stub":
        width = max(cells(0.8), room_for - 2 * cells(STUB_MIN_M) - between(rng, 0, 0.6))
        low = (stretch.length - width) // 2
    else:
        low, width = thickness // 2, stretch.length - thickness
    return low, min(low + width, stretch.length - thickness // 2)


def _width_beside(rooms: Labels, stretch: Stretch, side: int) -> int:
    """How far a room reaches along a piece of its border, half a meter from it, in cells."""
    reach = cells(LOOK_ALONG_M)
    along = np.arange(-reach, reach + 1) + stretch.length / 2
    x, y = stretch.point(along, side * cells(0.5))  # type: ignore[arg-type]
    x = np.clip(np.round(x).astype(int), 0, rooms.shape[1] - 1)
    y = np.clip(np.round(y).astype(int), 0, rooms.shape[0] - 1)
    same = rooms[y, x] == rooms[y[reach], x[reach]]
    before = np.flatnonzero(~same[:reach])
    after = np.flatnonzero(~same[reach:])
    first = before[-1] + 1 if len(before) else 0
    last = reach + after[0] if len(after) else len(same)
    return int(last - first)


def only_taste_parts(rooms: Labels, stretch: Stretch) -> bool:
    """Whether two rooms that meet without jambs are of the same width there."""
    widths = [_width_beside(rooms, stretch, side) for side in (-1, 1)]
    return max(widths) < stretch.length + cells(SHOULDER_MIN_M)


class _Groups:
    """Sets of rooms that are united one by one."""

    def __init__(self, rooms: Iterable[int]) -> None:
        self.parent = {n: n for n in rooms}

    def of(self, n: int) -> int:
        while self.parent[n] != n:
            n = self.parent[n]
        return n

    def unite(self, a: int, b: int) -> None:
        self.parent[self.of(a)] = self.of(b)


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
    neighbors: dict[int, list[int]] = {n: [] for n in numbers_in(rooms)}
    reached, taste = _Groups(neighbors), _Groups(neighbors)
    place_min = cells(DOOR_PLACE_MIN_M)
    pairs = [p for p, parts in runs.items() if p[0] > 0 and sum(r.length for r in parts) >= place_min]
    ways = plan.corridors | plan.halls | plan.public | plan.lobbies | plan.zones | plan.flowing
    order = sorted(pairs, key=lambda p: (not (p[0] in ways or p[1] in ways)) + rng.uniform(0, 0.9))
    usual_m = rng.uniform(0.75, 1.1)
    leaves = rng.choice([0.0, 0.15, 0.4])
    for a, b in order:
        both_corridors = a in plan.corridors and b in plan.corridors
        again = _again(plan, a, b, ways)
        joined = reached.of(a) == reached.of(b)
        if joined and not both_corridors and not chance(rng, again):
            if not (a in ways or b in ways) and chance(rng, plan.frayed):
                _fray(rng, walls, straight_stretch(rng, runs[a, b]), thickness)
            continue
        stretch = straight_stretch(rng, runs[a, b])
        if stretch.length - 2 * thickness < cells(0.6):
            continue
        kind = _opening_kind(rng, plan, a, b)
        low, high = _opening(rng, kind, stretch, thickness, usual_m)
        if kind == "open" and (both_corridors or only_taste_parts(rooms, stretch)):
            taste.unite(a, b)
        if not (a in ways or b in ways) and chance(rng, plan.frayed):
            _fray(rng, walls, stretch, thickness)
        if kind in PIECES:
            _pieces(rng, walls, stretch, thickness, PIECES[kind])
        else:
            _clear(walls, stretch, low, high, thickness)
        if kind == "counter":
            _counter(rng, walls, stretch, low, high)
        if kind == "gap" and chance(rng, CABINET_AT_STUB):
            _cabinet_at_stub(rng, walls, stretch, low, high)
        if kind == "double":
            middle = (low + high) // 2
            for half in ((low, middle), (middle, high)):
                if chance(rng, DOUBLE_LEAF_SHARE):
                    _leaf(rng, walls, stretch, *half)
        if kind == "door" and high - low < cells(1.3) and chance(rng, leaves):
            _leaf(rng, walls, stretch, low, high)
        reached.unite(a, b)
        neighbors[a].append(b)
        neighbors[b].append(a)
    for (low_room, _), parts in runs.items():
        if low_room == 0 and chance(rng, 0.04):
            stretch = straight_stretch(rng, parts)
            if stretch.length > cells(1.6):
                middle = stretch.length // 2
                _clear(walls, stretch, middle - cells(0.45), middle + cells(0.45), thickness)
    _gates(rng, walls, runs, plan.gates, thickness)
    mean, longest_m = (1.5, 0.8) if plan.kind in HOMES else (rng.choice([3, 14]), 1.5)
    _stubs(rng, walls, thickness, rng.poisson(mean), longest_m)
    if plan.glazed:
        glass = _fronts(rng, inner_side)
    else:
        glass = _glass(rng, walls, inner_side, HOME_WINDOWS if plan.kind in HOMES else WINDOWS)
    number = np.zeros(int(rooms.max()) + 1, np.int32)
    for room in neighbors:
        number[room] = taste.of(room)
    return WalledPlan(plan, walls, glass, neighbors, number[rooms])


def _again(plan: Plan, a: int, b: int, ways: set[int]) -> float:
    """Probability of an opening between rooms that are joined already."""
    if (a in plan.public and b in plan.public) or (a in plan.galleries and b in plan.galleries):
        return PUBLIC_AGAIN
    if a in plan.suite and b in plan.suite:
        return plan.joined
    if (a in plan.zones and b in plan.zones) or (a in plan.flowing and b in plan.flowing):
        return ZONES_AGAIN
    return 0.1 if (a in ways) != (b in ways) else 0.05


def _pieces(rng: Generator, walls: Mask, stretch: Stretch, thickness: int, pieces: Pieces) -> None:
    """Clear a border but for cabinets, pillars and pieces of wall with gaps between them."""
    first, last = thickness, stretch.length - thickness
    _clear(walls, stretch, first, last, thickness)
    at = first if chance(rng, pieces.from_end) else first + between(rng, *pieces.gap_m)
    hollow = chance(rng, 0.5)
    side = rng.choice([-1, 1])
    while at < last:
        end = min(at + between(rng, *pieces.long_m), last)
        deep = side * between(rng, *pieces.deep_m) if chance(rng, pieces.deep_share) else thickness - 1
        _box(walls, stretch, (at, 0), (end, deep), hollow=hollow)
        at = end + between(rng, *pieces.gap_m)


def _counter(rng: Generator, walls: Mask, stretch: Stretch, low: int, high: int) -> None:
    """A counter that goes on from a jamb into an opening, or stands in it."""
    reach = round((high - low) * rng.uniform(*COUNTER_SHARE))
    at = int(rng.choice([low, high - reach, low + (high - low - reach) // 2]))
    half = between(rng, *COUNTER_DEEP_M) / 2
    aside = rng.choice([-half, 0.0, half])
    _box(walls, stretch, (at, aside - half), (at + reach, aside + half), hollow=chance(rng, 0.3))


def _cabinet_at_stub(rng: Generator, walls: Mask, stretch: Stretch, low: int, high: int) -> None:
    """A cabinet at one side or both of what is left of a wall beside a gap."""
    start, end = (0, low) if chance(rng, 0.5) else (high, stretch.length)
    long = min(between(rng, *CABINET_M), end - start)
    at = start if chance(rng, 0.5) else end - long
    sides = [int(rng.choice([-1, 1]))] if chance(rng, 0.6) else [-1, 1]
    for side in sides:
        deep = side * between(rng, *CABINET_DEEP_M)
        _box(walls, stretch, (at, 0), (at + long, deep), hollow=chance(rng, 0.5))


def _box(
    walls: Mask, stretch: Stretch, one: tuple[float, float], other: tuple[float, float], *, hollow: bool
) -> None:
    """A rectangle between two corners, each given by its place along a border and aside of it."""
    (a, b), (c, d) = one, other
    corners = np.round([stretch.point(*p) for p in ((a, b), (c, b), (c, d), (a, d))]).astype(np.int32)
    if hollow:
        cv2.polylines(walls, [corners], True, 1, 1)
    else:
        cv2.fillPoly(walls, [corners], 1)


def _fray(rng: Generator, walls: Mask, stretch: Stretch, thickness: int) -> None:
    """Leave of a wall dots, pieces, or the cabinets before it."""
    first, last = thickness, stretch.length - thickness
    way = rng.choice(["dots", "pieces", "cabinets"])
    if way == "pieces":
        at = first
        while at < last:
            end = min(at + between(rng, *FRAYED_GAP_M), last)
            _clear(walls, stretch, at, end, thickness)
            at = end + between(rng, *FRAYED_PIECE_M)
        return
    _clear(walls, stretch, first, last, thickness)
    at = first
    while at < last:
        if way == "dots":
            x, y = stretch.point(at, rng.normal(0, 1.0))
            cv2.circle(walls, (round(x), round(y)), int(rng.integers(0, 2)), 1, -1)
            at += between(rng, *FRAYED_DOT_STEP_M)
            continue
        end = min(at + between(rng, *FRAYED_PIECE_M), last)
        low, high = -between(rng, 0.05, 0.5), between(rng, 0.05, 0.5)
        _box(walls, stretch, (at, low), (end, high), hollow=False)
        at = end + between(rng, 0.05, FRAYED_GAP_M[1])


def _gates(
    rng: Generator, walls: Mask, runs: dict[tuple[int, int], list[Run]], mean: float, thickness: int
) -> None:
    """Cut openings to the outside."""
    outer = [parts for (low_room, _), parts in runs.items() if low_room == 0]
    for _ in range(rng.poisson(mean) if outer else 0):
        stretch = straight_stretch(rng, outer[rng.integers(len(outer))])
        width = between(rng, *GATE_M)
        if stretch.length > width + 2 * thickness:
            low = int(rng.integers(thickness, stretch.length - width - thickness + 1))
            _clear(walls, stretch, low, low + width, thickness)


def _fronts(rng: Generator, outer_walls: Mask) -> Mask:
    """Outer walls of glass, at all sides of the building or at one or two."""
    glass = outer_walls.copy()
    rows, columns = np.nonzero(outer_walls)
    if len(rows) and chance(rng, 0.5):
        angle = rng.integers(4) * np.pi / 2
        y, x = np.mgrid[: glass.shape[0], : glass.shape[1]]
        ahead = np.cos(angle) * (x - columns.mean()) + np.sin(angle) * (y - rows.mean())
        glass[ahead < 0] = 0
    return glass


def _stubs(rng: Generator, walls: Mask, thickness: int, count: int, longest_m: float) -> None:
    """Pillars and short pieces of wall that stand into rooms."""
    rows, columns = np.nonzero(walls)
    for _ in range(count):
        at = int(rng.integers(len(rows)))
        along = [(1, 0), (-1, 0), (0, 1), (0, -1)][rng.integers(4)]
        reach = between(rng, 0.2, longest_m)
        end = (int(columns[at] + along[0] * reach), int(rows[at] + along[1] * reach))
        cv2.line(walls, (int(columns[at]), int(rows[at])), end, 1, max(1, thickness - 1))


def _glass(rng: Generator, walls: Mask, outer_walls: Mask, windows: float) -> Mask:
    """Stretches of wall that rays pass: windows mostly, panes of inner walls at times."""
    if chance(rng, 0.01):  # a front of glass
        return outer_walls.copy()
    glass = np.zeros_like(walls)
    for mask, mean, low_m, high_m in ((outer_walls, windows, 0.3, 2.0), (walls, 0.5, 0.3, 0.8)):
        rows, columns = np.nonzero(mask)
        if len(rows) == 0 or chance(rng, 0.5):
            continue
        for _ in range(rng.poisson(mean)):
            at = rng.integers(len(rows))
            half = between(rng, low_m / 2, high_m / 2)
            y, x = rows[at], columns[at]
            glass[max(0, y - half) : y + half, max(0, x - half) : x + half] = 1
    return (glass & walls).astype(np.uint8)
