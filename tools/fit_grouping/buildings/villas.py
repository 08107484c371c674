"""Houses of organic outline: rooms attached to rooms, wings that turn, rounded and octagonal rooms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fit_grouping.buildings.plans import MARGIN_M, Plan, alcoves, corner_rooms
from fit_grouping.buildings.raster import Generator, Labels, Mask, between, cells, chance

GROUND_M = 44.0
"""Side of the ground that a house may grow on."""
CONTACT_MIN_M = 0.9
"""A room touches the room that it is attached to along at least this."""
FREE_SHARE_MIN = 0.55
"""Share of a new room that must still be free ground."""
GAP_MAX_M = 0.5
"""Narrower gaps between rooms go to the nearest one."""
TRIES_PER_ROOM = 6

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Use:
    """What a room is used for, and so how large it is and where it lies.

    Attributes
    ----------
    across_m, along_m : tuple of float
        Ranges of its two sides.
    share : float
        How often it is built, relative to the others.
    beside : tuple of str
        Uses of the rooms that it is attached to.
    public : bool
        Whether it opens widely to other rooms of this kind.
    """

    across_m: tuple[float, float]
    along_m: tuple[float, float]
    share: float
    beside: tuple[str, ...]
    public: bool = False


USES = {
    "hallway": Use((1.1, 2.2), (2.5, 8.0), 2.2, ("hallway", "living", "dining", "kitchen"), public=True),
    "living": Use((4.0, 7.5), (4.0, 9.0), 1.6, ("hallway", "dining", "kitchen"), public=True),
    "kitchen": Use((2.6, 4.5), (3.0, 6.0), 1.3, ("living", "dining", "hallway"), public=True),
    "dining": Use((2.8, 4.8), (3.0, 5.5), 1.4, ("living", "kitchen", "hallway"), public=True),
    "bedroom": Use((2.7, 4.8), (3.0, 6.0), 3.2, ("hallway", "hallway", "living", "kitchen")),
    "bath": Use((1.5, 2.8), (1.8, 3.4), 1.8, ("hallway", "bedroom", "kitchen")),
    "closet": Use((0.9, 1.7), (1.0, 2.4), 1.8, ("hallway", "bedroom", "kitchen", "bath")),
    "passage": Use((1.0, 1.6), (1.2, 3.5), 0.8, ("living", "bedroom", "hallway")),
}

BARE = frozenset({"hallway", "passage", "closet"})
"""Rooms that are always rectangles."""


@dataclass(frozen=True)
class Block:
    """The rectangle that a room was drawn in.

    Attributes
    ----------
    use : str
    number : int
        The room in the plan.
    center : tuple of float
        x, y in cells.
    sides : tuple of float
        Lengths along its first and second direction, in cells.
    angle : float
        Of its first direction, in radians.
    """

    use: str
    number: int
    center: tuple[float, float]
    sides: tuple[float, float]
    angle: float

    def axes(self) -> NDArray[np.float64]:
        """Both directions as rows."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, s], [-s, c]])


@dataclass(frozen=True, eq=False)
class Candidate:
    """A room that could be built: its block, its free cells in a window of the plan, and what it touches.

    Attributes
    ----------
    block : Block
    window : tuple of slice
    free : (h, w) uint8
    contact : float
        Share of its rim that touches the house.
    """

    block: Block
    window: tuple[slice, slice]
    free: Mask
    contact: float


def villa(rng: Generator) -> Plan:
    """A house that grows room by room; living rooms meet through wide openings."""
    ground = cells(GROUND_M)
    plan = Plan("villa", np.zeros((ground, ground), np.int32))
    first = str(rng.choice(["hallway", "living", "dining"], p=[0.45, 0.4, 0.15]))
    center = ground / 2, ground / 2
    angle = float(rng.choice([0.0, rng.normal(0, 0.05), rng.uniform(-0.8, 0.8)], p=[0.4, 0.45, 0.15]))
    block = Block(first, 1, center, _sides(rng, first), angle)
    start = _candidate(plan, block, _outline(rng, block), None)
    blocks: list[Block] = []
    turning = rng.choice([0.0, 0.06, 0.25], p=[0.35, 0.45, 0.2])
    crowding = int(rng.choice([1, 3, 6], p=[0.25, 0.4, 0.35]))
    wanted = int(rng.integers(4, 23))
    tries = TRIES_PER_ROOM * wanted
    while start is not None and tries > 0 and len(blocks) < wanted:
        plan.rooms[start.window][start.free > 0] = start.block.number
        blocks.append(start.block)
        start = None
        while start is None and tries > 0:
            tries -= 1
            start = _attached(rng, plan, blocks, turning, crowding)
    plan.public = {b.number for b in blocks if USES[b.use].public}
    plan.corridors = {b.number for b in blocks if b.use == "hallway" and max(b.sides) > 3 * min(b.sides)}
    plan.rooms = _without_gaps(_cropped(plan.rooms))
    alcoves(rng, plan, rng.choice([0.0, 0.2, 0.6]))
    corner_rooms(rng, plan, 0.6, 0.9, 1.8)
    return plan


def _sides(rng: Generator, use: str) -> tuple[float, float]:
    across = float(between(rng, *USES[use].across_m))
    along = float(between(rng, *USES[use].along_m))
    return (across, along) if chance(rng, 0.5) else (along, across)


def _attached(
    rng: Generator, plan: Plan, blocks: list[Block], turning: float, crowding: int
) -> Candidate | None:
    """A new room of the house: of several places the one that touches it most; None without any."""
    names = list(USES)
    shares = np.array([USES[name].share for name in names])
    use = str(rng.choice(names, p=shares / shares.sum()))
    fitting = [b for b in blocks if b.use in USES[use].beside] or blocks
    found = []
    for _ in range(crowding):
        parent = fitting[int(rng.integers(len(fitting)))]
        block = _beside(rng, parent, use, len(blocks) + 1, turning)
        candidate = _candidate(plan, block, _outline(rng, block), parent.number)
        if candidate is not None:
            found.append(candidate)
    return max(found, key=lambda c: c.contact, default=None)


def _beside(rng: Generator, parent: Block, use: str, number: int, turning: float) -> Block:
    """Place for a room at a side of another, at the same angle or turned against it."""
    sides = _sides(rng, use)
    turned = chance(rng, turning)
    turn = rng.choice([np.pi / 4, -np.pi / 4, rng.uniform(-0.7, 0.7)]) if turned else 0.0
    angle = parent.angle + turn
    side, sign = int(rng.integers(2)), int(rng.choice([-1, 1]))
    normal, tangent = sign * parent.axes()[side], parent.axes()[1 - side]
    deep, broad = sides[side], sides[1 - side]
    reach = (parent.sides[1 - side] + broad) / 2 - cells(CONTACT_MIN_M)
    along = rng.uniform(-reach, reach)
    if chance(rng, 0.4):  # flush with a corner
        along = rng.choice([-1, 1]) * abs(parent.sides[1 - side] - broad) / 2
    into = 0.3 * deep if turned else (rng.uniform(0, 0.35) * deep if chance(rng, 0.25) else 0.0)
    center = np.array(parent.center) + normal * (parent.sides[side] / 2 + deep / 2 - into) + tangent * along
    return Block(use, number, (float(center[0]), float(center[1])), sides, float(angle))


def _candidate(plan: Plan, block: Block, outline: Points, beside: int | None) -> Candidate | None:
    """A room of an outline on free ground; None where it does not fit or does not touch its parent."""
    corners = np.round(outline).astype(np.int32)
    low, high = corners.min(0) - 2, corners.max(0) + 3
    if low.min() < cells(1.0) or high.max() > len(plan.rooms) - cells(1.0):
        return None
    window = np.s_[low[1] : high[1], low[0] : high[0]]
    drawn = np.zeros(tuple((high - low)[::-1]), np.uint8)
    cv2.fillPoly(drawn, [corners - low], 1)
    there = plan.rooms[window]
    free = drawn & (there == 0)
    if beside is None:
        return Candidate(block, window, free, 0.0)
    if np.count_nonzero(free) < FREE_SHARE_MIN * np.count_nonzero(drawn):
        return None
    free = _largest_piece(free)
    rim = there[(cv2.dilate(free, np.ones((3, 3), np.uint8)) > 0) & (free == 0)]
    if np.count_nonzero(rim == beside) < cells(CONTACT_MIN_M):
        return None
    return Candidate(block, window, free, float(np.mean(rim > 0)))


def _largest_piece(mask: Mask) -> Mask:
    count, pieces, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
    if count <= 2:
        return mask
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    piece: Mask = (pieces == largest).astype(np.uint8)
    return piece


def _outline(rng: Generator, block: Block) -> Points:
    """Corners of a room in the plan's cells: a rectangle, or a shape that is drawn within one."""
    half = np.array(block.sides) / 2
    shape: Callable[[Generator, Points], Points] = _rectangle
    if block.use not in BARE:
        shapes = (_rectangle, _ell, _chamfered, _round, _bay)
        shape = shapes[rng.choice(len(shapes), p=[0.52, 0.14, 0.13, 0.04, 0.17])]
    outline: Points = np.array(block.center) + shape(rng, half) @ block.axes()
    return outline


def _rectangle(_: Generator, half: Points) -> Points:
    return np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * half


def _ell(rng: Generator, half: Points) -> Points:
    """A rectangle without one of its corners."""
    x, y = rng.uniform(-0.3, 0.6, 2)
    mirror = rng.choice([-1, 1], 2)
    corners: Points = np.array([[-1, -1], [1, -1], [1, y], [x, y], [x, 1], [-1, 1]]) * half * mirror
    return corners


def _chamfered(rng: Generator, half: Points) -> Points:
    """A rectangle with one to four corners cut off: all four make an octagon."""
    cut = min(half) * rng.uniform(0.3, 0.65)
    corners = rng.random(4) < (1.0 if chance(rng, 0.35) else 0.4)
    points = []
    signs = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    for number, (corner, sign) in enumerate(zip(corners, signs, strict=True)):
        at = half * sign
        first, second = [at[0], at[1] - sign[1] * cut], [at[0] - sign[0] * cut, at[1]]
        points += ([first, second] if number % 2 == 0 else [second, first]) if corner else [at.tolist()]
    return np.array(points)


def _round(rng: Generator, half: Points) -> Points:
    """A circle or a long ellipse."""
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    radii = np.full(2, half.mean()) if chance(rng, 0.7) else half
    circle: Points = np.column_stack([np.cos(angle), np.sin(angle)]) * radii
    return circle


def _bay(rng: Generator, half: Points) -> Points:
    """A rectangle with a bay at one side: round, slanted or straight."""
    wide, deep = half[0] * rng.uniform(0.35, 0.8), cells(rng.uniform(0.5, 1.4))
    kind = rng.choice(["round", "slanted", "straight"])
    angle = np.linspace(np.pi, 0, 9)
    steps = {
        "round": np.column_stack([wide * np.cos(angle), deep * np.sin(angle)]),
        "slanted": np.array([[-wide, 0], [-wide / 2, deep], [wide / 2, deep], [wide, 0]]),
        "straight": np.array([[-wide, 0], [-wide, deep], [wide, deep], [wide, 0]]),
    }[kind]
    low, high = half * [-1, -1], half * [1, 1]
    bay = np.array([0.0, high[1]]) + steps
    points: Points = np.vstack([[low], [[high[0], low[1]]], [high], bay[::-1], [[low[0], high[1]]]])
    points *= rng.choice([-1, 1], 2)
    return points


def _without_gaps(rooms: Labels) -> Labels:
    """Narrow gaps between rooms go to the nearest room."""
    size = cells(GAP_MAX_M) | 1
    built = (rooms > 0).astype(np.uint8)
    closed = cv2.morphologyEx(built, cv2.MORPH_CLOSE, np.ones((size, size), np.uint8))
    _, nearest = cv2.distanceTransformWithLabels(1 - built, cv2.DIST_L1, 3, labelType=cv2.DIST_LABEL_PIXEL)
    room_of = np.zeros(int(nearest.max()) + 1, np.int32)
    room_of[nearest[built > 0]] = rooms[built > 0]
    return np.where(closed > 0, room_of[nearest], 0).astype(np.int32)


def _cropped(rooms: Labels) -> Labels:
    """The house with a margin around."""
    rows, columns = np.flatnonzero(rooms.any(1)), np.flatnonzero(rooms.any(0))
    house = rooms[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return np.pad(house, cells(MARGIN_M))
