"""Furniture: what stands along walls, in rows, around tables and in the middle of halls."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects

from fit_grouping.buildings.raster import CELL_M, Generator, Labels, Mask, between, cells, chance
from fit_grouping.buildings.walls import WalledPlan
from fit_grouping.buildings.workrooms import furnish_niches, furnish_workroom

STYLES = ("none", "survey", "home", "office", "dense", "work", "niches")
"""Ways to furnish: not at all, dots and boxes as drawn by hand, as in homes, as in offices, cluttered, with
rows of desks, screens and cabinets, and with cabinets at steps along all walls."""
HALLS = {
    "rows": 0.2,
    "pillars": 0.1,
    "tables": 0.15,
    "boxes": 0.1,
    "mixed": 0.15,
    "stands": 0.14,
    "pallets": 0.1,
    "empty": 0.06,
}
"""What halls are full of, and how often."""
OTHER_HALLS = {
    "depot": {"pallets": 0.35, "rows": 0.25, "pillars": 0.1, "boxes": 0.1, "mixed": 0.1, "islands": 0.1},
    "shop": {"islands": 0.5, "rows": 0.3, "mixed": 0.1, "stands": 0.1},
    "wings": {"benches": 0.35, "study": 0.25, "rows": 0.15, "tables": 0.1, "pillars": 0.05, "empty": 0.1},
    "gallery": {"stands": 0.45, "empty": 0.15, "pillars": 0.1, "islands": 0.15, "mixed": 0.1, "study": 0.05},
    "partitions": {"empty": 0.35, "stands": 0.2, "tables": 0.15, "pillars": 0.1, "mixed": 0.1, "boxes": 0.1},
    "warehouse": {"crates": 0.35, "racks": 0.3, "pallets": 0.15, "mixed": 0.1, "boxes": 0.1},
    "faculty": {"rows": 0.35, "pillars": 0.2, "tables": 0.2, "mixed": 0.15, "empty": 0.1},
}
"""The same for kinds of plans that differ."""
KEEP_CLEAR_M = 0.55
"""Furniture stays this far from openings, most of the time."""
FRONTS = {"home": 0.35, "office": 1.3, "dense": 1.4}
"""Fronts of furniture along the walls of a room of each style, on average."""
ISLAND_FROM_WALL_M = 0.6
FRONTS_MIN_M2 = 5.0
FRAME_GAIN = 1.15
"""A room has a frame of its own where that is filled better by this factor than the box of its cells."""


@dataclass(frozen=True, eq=False)
class RoomFrame:
    """The rectangle of a room that stands at a slant.

    Attributes
    ----------
    shape : tuple of int
        Rows and columns of the rectangle, in cells.
    to_plan : (2, 3) float64
        Leads its cells to those of the room's box.
    """

    shape: tuple[int, int]
    to_plan: NDArray[np.float64]

    def back(self, drawn: Mask, shape: tuple[int, ...]) -> Mask:
        """What is drawn in the frame, in the room's box."""
        size = (shape[1], shape[0])
        return cv2.warpAffine(drawn, self.to_plan, size, flags=cv2.INTER_NEAREST).astype(np.uint8)


def room_frame(inside: NDArray[np.bool_]) -> RoomFrame | None:
    """The slanting rectangle of a room; None where it lies along the axes."""
    if not inside.any():
        return None
    rows = np.flatnonzero(inside.any(1))  # its hull is that of the ends of its rows
    first, last = inside[rows].argmax(1), inside.shape[1] - 1 - inside[rows, ::-1].argmax(1)
    points = np.column_stack([np.tile(rows, 2), np.append(first, last)])[:, ::-1].astype(np.int32)
    (x, y), (width, height), angle = cv2.minAreaRect(points)
    if width * height * FRAME_GAIN > inside.size:
        return None
    shape = (max(1, round(height)), max(1, round(width)))
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    turn = np.array([[c, -s], [s, c]])
    shift = np.array([x, y]) - turn @ np.array([width, height]) / 2
    return RoomFrame(shape, np.column_stack([turn, shift]))


class Furnisher:
    """Places furniture in one building."""

    def __init__(self, rng: Generator, walled: WalledPlan, style: str) -> None:
        self.rng, self.walled, self.style = rng, walled, style
        self.rooms = walled.plan.rooms
        self.solid = np.zeros(self.rooms.shape, np.uint8)
        gaps = np.zeros_like(self.solid)
        border = np.zeros(self.rooms.shape, bool)
        border[:, :-1] |= self.rooms[:, :-1] != self.rooms[:, 1:]
        border[:-1] |= self.rooms[:-1] != self.rooms[1:]
        gaps[border & (walled.walls == 0)] = 1
        size = 2 * cells(KEEP_CLEAR_M) + 1
        self.clear = cv2.dilate(gaps, np.ones((size, size), np.uint8)) > 0

    def furnish(self) -> Mask:
        """Furnish every room; 1 where something stands."""
        if self.style == "none":
            return self.solid
        way = self.walled.plan.corridors
        for number, box in _boxes(self.rooms):
            x0, y0, x1, y1 = box
            inside = self.rooms[y0:y1, x0:x1] == number
            target = self.solid[y0:y1, x0:x1]
            frame = room_frame(inside)
            if frame is None:
                drawn = np.zeros_like(target)
                self._fill(drawn, number, np.count_nonzero(inside) * CELL_M**2, corridor=number in way)
            else:
                in_frame = np.zeros(frame.shape, np.uint8)
                self._fill(in_frame, number, np.count_nonzero(inside) * CELL_M**2, corridor=number in way)
                drawn = frame.back(in_frame, target.shape)
            keep = ~self.clear[y0:y1, x0:x1] if chance(self.rng, 0.85) else True
            target[(drawn > 0) & inside & keep] = 1
        return self.solid

    def _fill(self, drawn: Mask, number: int, area_m2: float, *, corridor: bool) -> None:
        """Furnish one room."""
        if corridor:
            self._corridor(drawn, area_m2)
        elif number in self.walled.plan.halls or area_m2 > 70:
            self._hall(drawn, area_m2)
        elif self.style == "survey":
            self._survey_room(drawn)
        elif self.style == "work":
            furnish_workroom(self.rng, drawn)
        elif self.style == "niches":
            furnish_niches(self.rng, drawn)
        else:
            self._room(drawn, area_m2)

    def _corridor(self, drawn: Mask, area_m2: float) -> None:
        rng = self.rng
        if self.style == "survey":
            for _ in range(rng.poisson(min(area_m2, 150) / 40)):
                cv2.circle(drawn, self._spot(drawn), cells(rng.uniform(0.25, 0.6)), 1, -1)
            return
        for _ in range(rng.poisson(min(area_m2, 100) / 50)):
            self._box(drawn, 0.3, 1.2, at_wall=True)
        if chance(rng, 0.15):
            self._noise(drawn, min(area_m2, 100) / 20)

    def _hall(self, drawn: Mask, area_m2: float) -> None:
        rng = self.rng
        shares = OTHER_HALLS.get(self.walled.plan.kind, HALLS)
        kind = rng.choice(list(shares), p=list(shares.values()))
        if kind == "islands":
            self._islands(drawn, area_m2)
        if kind == "stands":
            self._stands(drawn, area_m2)
        if kind == "pallets":
            self._pallets(drawn)
        if kind == "benches":
            self._benches(drawn)
        if kind == "study":
            self._study(drawn)
        if kind == "crates":
            self._crates(drawn)
        if kind == "racks":
            self._racks(drawn)
        if kind in ("rows", "mixed"):
            self._rows(drawn, rng.uniform(0.3, 1.0), rng.uniform(1.2, 3.0))
        if kind in ("tables", "mixed"):
            self._grid(drawn, rng.uniform(2.0, 4.0), rng.uniform(2.0, 4.0), lambda p: self._table(drawn, p))
        if kind == "pillars" or chance(rng, 0.2):
            half = between(rng, 0.1, 0.35)
            step = rng.uniform(3.5, 8)
            self._grid(
                drawn,
                step,
                step,
                lambda p: cv2.rectangle(drawn, (p[0] - half, p[1] - half), (p[0] + half, p[1] + half), 1, -1),
            )
        if chance(rng, 0.15):  # stands, pods and cages that can be looked into
            self._grid(
                drawn, rng.uniform(2.2, 5), rng.uniform(2.2, 5), lambda p: self._frame(drawn, p), share=0.7
            )
        if kind in ("boxes", "mixed"):
            for _ in range(rng.poisson(min(area_m2, 400) / 15)):
                self._box(drawn, 0.5, 3.0, at_wall=chance(rng, 0.4))
        if chance(rng, 0.4):
            self._along_walls(drawn, area_m2 / 20)
        self._noise(drawn, min(area_m2, 300) / 30 * rng.random())

    def _stands(self, drawn: Mask, area_m2: float) -> None:
        """Dozens of stands and screens at all angles, as in a museum: blocks, bars and angles."""
        rng = self.rng
        per_stand_m2 = rng.uniform(7, 18)
        slants = not chance(rng, 0.25)
        thick = int(rng.integers(1, 4))
        for _ in range(rng.poisson(min(area_m2, 900) / per_stand_m2)):
            angle = rng.uniform(0, 180) if slants else 90.0 * rng.integers(2)
            long, deep = rng.uniform(1.0, 4.5) / CELL_M, rng.uniform(0.2, 1.6) / CELL_M
            corners = cv2.boxPoints((self._spot(drawn), (long, deep), angle)).astype(np.int32)
            if chance(rng, 0.5):
                cv2.fillPoly(drawn, [corners], 1)
            else:  # a frame with one side or two left open
                cv2.polylines(drawn, [corners[: rng.integers(2, 5)]], chance(rng, 0.3), 1, thick)

    def _islands(self, drawn: Mask, area_m2: float) -> None:
        """Shelves, racks and counters of a shop, along the axes, and tables of dots between them."""
        rng = self.rng
        per_island_m2 = rng.uniform(7, 20)
        wide_m = rng.uniform(0.6, 1.1)
        for _ in range(rng.poisson(min(area_m2, 700) / per_island_m2)):
            long, deep = rng.uniform(0.7, 4.5) / CELL_M, wide_m * rng.uniform(0.8, 1.2) / CELL_M
            box = (self._spot(drawn), (long, deep), 90.0 * rng.integers(2))
            cv2.polylines(drawn, [cv2.boxPoints(box).astype(np.int32)], True, 1, int(rng.integers(1, 3)))
        self._noise(drawn, min(area_m2, 300) / 15 * rng.random())

    def _pallets(self, drawn: Mask) -> None:
        """Pallets and racks in a grid over a part of the hall: outlines with feet, posts beyond."""
        rng = self.rng
        height, width = drawn.shape
        low_x, low_y = int(width * rng.uniform(0, 0.5)), int(height * rng.uniform(0, 0.5))
        part = drawn[low_y : low_y + round(height * rng.uniform(0.4, 0.9)), low_x:]
        half = between(rng, 0.4, 0.7), between(rng, 0.4, 0.8)
        legs_only = chance(rng, 0.4)

        def put(spot: tuple[int, int]) -> None:
            low, high = (spot[0] - half[0], spot[1] - half[1]), (spot[0] + half[0], spot[1] + half[1])
            if legs_only:
                self._legs(part, spot, 2 * half[0] * CELL_M, 2 * half[1] * CELL_M)
            else:
                cv2.rectangle(part, low, high, 1, int(rng.integers(1, 3)))

        self._grid(part, rng.uniform(1.6, 3.2), rng.uniform(1.6, 3.2), put, share=rng.uniform(0.5, 1.0))
        step = rng.uniform(3, 8)
        self._grid(drawn, step, step, lambda p: cv2.circle(drawn, p, int(rng.integers(1, 4)), 1, -1))

    def _benches(self, drawn: Mask) -> None:
        """Rows of benches of a lecture hall in one block to three, straight or in arcs, with frayed ends."""
        rng = self.rng
        image = np.rot90(drawn, int(rng.integers(4)))
        drawn_rows = np.zeros(image.shape, np.uint8)
        height, width = image.shape
        deep, step = between(rng, 0.35, 1.0), between(rng, 1.0, 2.2)
        rim, front = between(rng, 0.6, 2.0), between(rng, 1.5, 4.0)
        blocks, way = int(rng.integers(1, 4)), between(rng, 0.8, 1.8)
        bow = rng.uniform(0.02, 0.12) if chance(rng, 0.3) else 0.0
        hollow, seen = chance(rng, 0.4), rng.uniform(0.8, 1.0)
        stops = np.linspace(rim, width - rim + way, blocks + 1).astype(int).tolist()
        for y in range(front, height - rim - deep, max(step, deep + cells(0.5))):
            for low, high in pairwise(stops):
                end = high - way
                if end - low < cells(0.8) or not chance(rng, seen):
                    continue
                x = np.linspace(low, end, 9)
                sag = bow * (x - width / 2) ** 2 / max(width, 1)
                front_line = np.column_stack([x, y + sag])
                outline = np.vstack([front_line, front_line[::-1] + np.array([0.0, deep])]).astype(np.int32)
                if hollow:
                    cv2.polylines(drawn_rows, [outline], True, 1, 1)
                else:
                    cv2.fillPoly(drawn_rows, [outline], 1)
        image[drawn_rows > 0] = 1
        if chance(rng, 0.6):  # a lectern
            left = int(width * rng.uniform(0.2, 0.7))
            image[front // 3 : front // 3 + cells(0.6), left : left + between(rng, 0.8, 3.0)] = 1

    def _study(self, drawn: Mask) -> None:
        """Blocks of tables in a grid, each with chairs around it that fray its outline."""
        rng = self.rng
        long, deep = rng.uniform(1.2, 3.6), rng.uniform(0.8, 2.4)
        half = cells(long / 2), cells(deep / 2)

        def put(spot: tuple[int, int]) -> None:
            low, high = (spot[0] - half[0], spot[1] - half[1]), (spot[0] + half[0], spot[1] + half[1])
            cv2.rectangle(drawn, low, high, 1, int(rng.choice([-1, 1])))
            for _ in range(rng.poisson(3 * (long + deep))):
                x, y = int(rng.integers(low[0] - 6, high[0] + 7)), int(rng.integers(low[1] - 6, high[1] + 7))
                cv2.circle(drawn, (x, y), int(rng.integers(0, 3)), 1, -1)

        share = rng.uniform(0.6, 1.0)
        self._grid(drawn, long + rng.uniform(1.2, 3.0), deep + rng.uniform(1.2, 3.0), put, share=share)

    def _crates(self, drawn: Mask) -> None:
        """Blocks of crates, cages and pallets that can be looked into: outlines with gaps, bars within."""
        rng = self.rng
        height, width = drawn.shape
        for _ in range(rng.integers(1, 4)):
            wide, deep = between(rng, 0.9, 3.6), between(rng, 0.9, 3.2)
            step = wide + between(rng, 0.0, 2.5), deep + between(rng, 0.0, 2.5)
            columns, rows = int(rng.integers(1, 9)), int(rng.integers(1, 5))
            low_x, low_y = int(rng.integers(width)), int(rng.integers(height))
            gaps, bars, thick = rng.choice([0.0, 0.1, 0.35]), chance(rng, 0.5), int(rng.integers(1, 3))
            for y in range(low_y, min(height - deep, low_y + rows * step[1]), step[1]):
                for x in range(low_x, min(width - wide, low_x + columns * step[0]), step[0]):
                    if chance(rng, 0.9):
                        self._crate(drawn, (x, y, x + wide, y + deep), gaps, bars, thick)
        for _ in range(rng.poisson(1.5)):  # one by itself, at a slant
            size = (rng.uniform(1.0, 3.0) / CELL_M, rng.uniform(1.0, 2.5) / CELL_M)
            corners = cv2.boxPoints((self._spot(drawn), size, rng.uniform(0, 90))).astype(np.int32)
            cv2.polylines(drawn, [corners], chance(rng, 0.7), 1, int(rng.integers(1, 4)))
        if chance(rng, 0.7):  # posts
            step_x, step_y = rng.uniform(2, 9), rng.uniform(2, 9)
            radius = int(rng.integers(0, 4))
            self._grid(drawn, step_x, step_y, lambda p: cv2.circle(drawn, p, radius, 1, -1), share=0.9)

    def _crate(
        self, drawn: Mask, box: tuple[int, int, int, int], gaps: float, bars: bool, thick: int
    ) -> None:
        """One outline, of which a share is not seen, with bars across it."""
        x0, y0, x1, y1 = box
        own = np.zeros((y1 - y0, x1 - x0), np.uint8)
        own[:thick] = own[-thick:] = 1
        own[:, :thick] = own[:, -thick:] = 1
        if bars:
            own[(y1 - y0) // 2] = 1
            own[:, (x1 - x0) // 2 :: max(1, (x1 - x0) // 2)] = 1
        own &= self.rng.random(own.shape) >= gaps
        if chance(self.rng, 0.3):  # one side open
            np.rot90(own, int(self.rng.integers(4)))[: thick + 1, thick:-thick] = 0
        drawn[y0:y1, x0:x1] |= own

    def _racks(self, drawn: Mask) -> None:
        """Long racks with aisles between: whole, as outlines, or as the posts that are seen of them."""
        rng = self.rng
        image = drawn if chance(rng, 0.5) else drawn.T
        height, width = image.shape
        rim, deep, aisle = between(rng, 1.5, 4.0), between(rng, 0.5, 2.4), between(rng, 1.6, 4.5)
        low, high = int(height * rng.uniform(0.05, 0.35)), int(height * rng.uniform(0.6, 0.95))
        bay = between(rng, 1.0, 3.0)
        way = rng.choice(["whole", "outline", "posts"])
        cross = int(rng.integers(low, high)) if chance(rng, 0.5) else -1
        for x in range(rim, width - rim - deep, deep + aisle):
            for y in range(low, high - bay, bay):
                if (cross >= 0 and abs(y + bay // 2 - cross) < cells(1.5)) or chance(rng, 0.06):
                    continue
                part = image[y : y + bay, x : x + deep]
                if way == "whole":
                    part[:] = 1
                elif way == "outline":
                    part[:, 0] = part[:, -1] = 1
                    part[0] = part[0] | (rng.random(part.shape[1]) < rng.choice([0.0, 0.8]))
                for row, column in ((0, 0), (0, -2), (-2, 0), (-2, -2)):
                    part[row : row + 2 or None, column : column + 2 or None] = 1

    def _front(self, drawn: Mask) -> None:
        """Desks, shelves or wardrobes side by side along most of a wall: the floor ends before it."""
        rng = self.rng
        image = np.rot90(drawn, int(rng.integers(4)))
        width = image.shape[1]
        at, end = int(width * rng.uniform(0, 0.4)), int(width * rng.uniform(0.6, 1.0))
        usual = rng.uniform(0.3, 0.9)
        while at < end:
            piece = between(rng, 0.4, 1.8)
            deep = max(1, cells(usual * rng.uniform(0.75, 1.15)))
            if chance(rng, 0.88):
                image[:deep, at : min(at + piece, end)] = 1
            at += piece

    def _survey_room(self, drawn: Mask) -> None:
        """Chairs as dots on a grid, boxes in corners."""
        rng = self.rng
        step_x, step_y = rng.uniform(0.8, 1.5), rng.uniform(0.8, 1.5)
        radius = int(rng.integers(2, 4))
        self._grid(
            drawn,
            step_x,
            step_y,
            lambda p: cv2.circle(drawn, p, radius, 1, -1),
            share=rng.uniform(0.4, 1.0),
            rim=0.8,
        )
        height, width = drawn.shape
        for _ in range(rng.poisson(1.0)):
            a, b = between(rng, 0.4, 1.0), between(rng, 0.8, 2.6)
            if chance(rng, 0.5):
                a, b = b, a
            x = 0 if chance(rng, 0.5) else width - a
            y = 0 if chance(rng, 0.5) else height - b
            drawn[max(0, y) : y + b, max(0, x) : x + a] = 1

    def _room(self, drawn: Mask, area_m2: float) -> None:
        rng = self.rng
        density = {"home": 1.2, "office": 1.2, "dense": 2.2}[self.style] * rng.uniform(0.3, 1.5)
        if chance(rng, 0.12):
            return
        self._along_walls(drawn, density * min(area_m2, 60) / (6 if self.style == "home" else 4))
        for _ in range(rng.poisson(FRONTS[self.style] if area_m2 > FRONTS_MIN_M2 else 0)):
            self._front(drawn)
        for _ in range(rng.poisson(density * min(area_m2, 60) / 9)):
            kind = rng.choice(
                ["table", "box", "legs", "chair", "screen", "disc"], p=[0.3, 0.2, 0.15, 0.2, 0.07, 0.08]
            )
            spot = self._spot(drawn)
            if kind == "table":
                self._table(drawn, spot)
            elif kind == "box":
                self._box(drawn, 0.4, 2.2, at_wall=False)
            elif kind == "legs":
                self._legs(drawn, spot, rng.uniform(0.4, 1.8), rng.uniform(0.4, 1.0))
            elif kind == "chair":
                self._chair(drawn, spot)
            elif kind == "screen":
                self._line(drawn, spot, rng.uniform(0.6, 2.5))
            else:
                cv2.circle(drawn, spot, between(rng, 0.1, 0.6), 1, -1)
        if self.style == "home" and area_m2 > 8 and chance(rng, 0.5):  # a bed or a sofa
            self._box(drawn, 1.4, 2.2, at_wall=True)
        if self.style in ("home", "dense") and area_m2 > 14:
            self._living_room(drawn)
        if self.style == "office" and area_m2 > 9 and chance(rng, 0.4):
            self._rows(drawn, rng.uniform(0.6, 0.9), rng.uniform(1.3, 2.2))
        if self.style == "dense":
            self._noise(drawn, area_m2 / 6)

    def _living_room(self, drawn: Mask) -> None:
        """Sofas and islands in the middle, counters that stand out from a wall like a wall."""
        rng = self.rng
        height, width = drawn.shape
        for _ in range(rng.poisson(1.4)):
            self._island(drawn)
        if chance(rng, 0.45):
            self._dining_table(drawn)
        for _ in range(rng.poisson(0.6)):
            reach, deep = between(rng, 1.2, 3.0), between(rng, 0.5, 0.8)
            side = rng.integers(4)
            if side < 2:
                y = int(rng.integers(max(1, height - deep)))
                x = 0 if side == 0 else max(0, width - reach)
                drawn[y : y + deep, x : x + reach] = 1
            else:
                x = int(rng.integers(max(1, width - deep)))
                y = 0 if side == 2 else max(0, height - reach)
                drawn[y : y + reach, x : x + deep] = 1

    def _island(self, drawn: Mask) -> None:
        """A sofa, counter or bed that can be walked around, at a slant at times."""
        rng = self.rng
        height, width = drawn.shape
        rim = cells(ISLAND_FROM_WALL_M)
        long, deep = between(rng, 1.0, 3.0), between(rng, 0.5, 1.2)
        if chance(rng, 0.5):
            long, deep = deep, long
        if width < long + 2 * rim or height < deep + 2 * rim:
            return
        x = float(rng.integers(rim + long // 2, width - rim - long // 2 + 1))
        y = float(rng.integers(rim + deep // 2, height - rim - deep // 2 + 1))
        angle = rng.uniform(-40, 40) if chance(rng, 0.25) else 0.0
        corners = cv2.boxPoints(((x, y), (long, deep), angle)).astype(np.int32)
        cv2.fillPoly(drawn, [corners], 1)

    def _dining_table(self, drawn: Mask) -> None:
        """Rows of chairs, four dots each, at both sides of a table of which the legs or all can be seen."""
        rng = self.rng
        step, chairs = cells(rng.uniform(0.5, 0.75)), int(rng.integers(2, 6))
        half = cells(rng.uniform(0.4, 0.75))
        image = drawn if chance(rng, 0.5) else drawn.T
        x, y = self._spot(image)
        for number in range(chairs):
            for side in (-1, 1):
                seat = (x + number * step, y + side * (half + cells(0.15)))
                for corner in cv2.boxPoints((seat, (cells(0.35), cells(0.35)), rng.normal(0, 15))):
                    column, row = int(corner[0]), int(corner[1])
                    if 0 <= row < image.shape[0] and 0 <= column < image.shape[1]:
                        image[row, column] = 1
        if chance(rng, 0.3):
            image[max(0, y - half // 2) : max(0, y + half // 2), x : x + (chairs - 1) * step] = 1

    def _spot(self, drawn: Mask) -> tuple[int, int]:
        return int(self.rng.integers(drawn.shape[1])), int(self.rng.integers(drawn.shape[0]))

    def _along_walls(self, drawn: Mask, mean: float) -> None:
        for _ in range(self.rng.poisson(mean)):
            self._box(drawn, 0.35, 2.0, at_wall=True)

    def _box(self, drawn: Mask, low_m: float, high_m: float, *, at_wall: bool) -> None:
        rng = self.rng
        height, width = drawn.shape
        if at_wall:
            deep, long = between(rng, 0.3, 0.8), between(rng, low_m, high_m)
            if low_m > 1:
                deep = between(rng, 0.9, 1.9)
            side = rng.integers(4)
            if side < 2:
                x = int(rng.integers(-cells(0.3), max(1, width - long)))
                y = 0 if side == 0 else height - deep
                drawn[max(0, y) : y + deep, max(0, x) : max(0, x + long)] = 1
            else:
                y = int(rng.integers(-cells(0.3), max(1, height - long)))
                x = 0 if side == 2 else width - deep
                drawn[max(0, y) : max(0, y + long), max(0, x) : x + deep] = 1
            return
        angle = 0.0 if chance(rng, 0.6) else rng.uniform(0, 90)
        size = (
            rng.uniform(low_m, high_m) / CELL_M,
            rng.uniform(low_m, max(low_m + 0.1, high_m / 2)) / CELL_M,
        )
        corners = cv2.boxPoints(((float(rng.integers(width)), float(rng.integers(height))), size, angle))
        cv2.fillPoly(drawn, [corners.astype(np.int32)], 1)

    def _table(self, drawn: Mask, spot: tuple[int, int]) -> None:
        rng = self.rng
        long, wide = rng.uniform(0.8, 2.0), rng.uniform(0.6, 1.0)
        if chance(rng, 0.5):
            long, wide = wide, long
        if chance(rng, 0.4):
            a, b = cells(long / 2), cells(wide / 2)
            cv2.rectangle(drawn, (spot[0] - a, spot[1] - b), (spot[0] + a, spot[1] + b), 1, -1)
        else:
            self._legs(drawn, spot, long, wide)
        for _ in range(rng.poisson(1.5)):
            offset = (
                rng.choice([-1, 1]) * cells(long / 2 + 0.3),
                rng.choice([-1, 1]) * cells(wide / 2 + 0.3),
            )
            self._chair(drawn, (spot[0] + int(offset[0]), spot[1] + int(offset[1])))

    def _legs(self, drawn: Mask, spot: tuple[int, int], long_m: float, wide_m: float) -> None:
        radius = int(self.rng.integers(0, 2))
        angle = 0.0 if chance(self.rng, 0.7) else self.rng.uniform(0, 90)
        for corner in cv2.boxPoints((spot, (long_m / CELL_M, wide_m / CELL_M), angle)):
            cv2.circle(drawn, (int(corner[0]), int(corner[1])), radius, 1, -1)

    def _chair(self, drawn: Mask, spot: tuple[int, int]) -> None:
        if chance(self.rng, 0.35):  # five legs as a star
            angle = self.rng.uniform(0, 2)
            for k in range(5):
                tip = angle + 2 * np.pi * k / 5
                reach = cells(0.3)
                cv2.line(
                    drawn,
                    spot,
                    (int(spot[0] + reach * np.cos(tip)), int(spot[1] + reach * np.sin(tip))),
                    1,
                    1,
                )
        else:
            self._legs(drawn, spot, 0.45, 0.45)

    def _line(self, drawn: Mask, spot: tuple[int, int], length_m: float) -> None:
        angle = self.rng.choice([0.0, np.pi / 2, self.rng.uniform(0, np.pi)])
        reach = length_m / CELL_M
        cv2.line(
            drawn, spot, (int(spot[0] + reach * np.cos(angle)), int(spot[1] + reach * np.sin(angle))), 1, 1
        )

    def _noise(self, drawn: Mask, mean: float) -> None:
        for _ in range(self.rng.poisson(mean)):
            spot = self._spot(drawn)
            for _ in range(self.rng.integers(1, 7)):
                near = (spot[0] + int(self.rng.normal(0, 8)), spot[1] + int(self.rng.normal(0, 8)))
                cv2.circle(drawn, near, int(self.rng.integers(0, 3)), 1, -1)

    def _frame(self, drawn: Mask, spot: tuple[int, int]) -> None:
        half = between(self.rng, 0.4, 0.9), between(self.rng, 0.4, 0.9)
        low, high = (spot[0] - half[0], spot[1] - half[1]), (spot[0] + half[0], spot[1] + half[1])
        cv2.rectangle(drawn, low, high, 1, int(self.rng.integers(1, 3)))

    def _rows(self, drawn: Mask, deep_m: float, way_m: float) -> None:
        """Shelves or desks in rows, with ways between them."""
        rng = self.rng
        image = drawn if chance(rng, 0.5) else drawn.T
        height, width = image.shape
        rim = between(rng, 0.8, 2.0)
        deep, way = cells(deep_m), cells(way_m)
        piece = between(rng, 1.2, 6.0)
        x = rim
        while x + deep < width - rim:
            y = rim
            while y + piece < height - rim // 2:
                if chance(rng, 0.85):
                    image[y : y + piece, x : x + deep] = 1
                y += piece + between(rng, 0.0, 2.0)
            x += deep + way

    def _grid(
        self,
        drawn: Mask,
        step_x_m: float,
        step_y_m: float,
        put: Callable[[tuple[int, int]], object],
        *,
        share: float = 0.8,
        rim: float = 1.2,
    ) -> None:
        height, width = drawn.shape
        for y in range(cells(rim), height - cells(rim) + 1, cells(step_y_m)):
            for x in range(cells(rim), width - cells(rim) + 1, cells(step_x_m)):
                if chance(self.rng, share):
                    put((x, y))


def _boxes(rooms: Labels) -> Iterator[tuple[int, tuple[int, int, int, int]]]:
    """Each room's number with the x0, y0, x1, y1 of its box, without the walls' thickness."""
    for number, part in enumerate(find_objects(rooms), 1):
        if part is not None:
            rows, columns = part
            yield number, (columns.start + 1, rows.start + 1, columns.stop - 1, rows.stop - 1)
