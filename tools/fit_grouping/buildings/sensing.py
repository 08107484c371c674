"""How a map comes about: rays from views along a path, noise of pose and range, drawings, damage."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from fit_grouping.buildings.bending import moved
from fit_grouping.buildings.raster import CELL_M, Generator, Labels, Mask, between, cells, chance
from fit_grouping.buildings.walls import HOMES, WalledPlan

FREE, UNKNOWN, OCCUPIED = 254, 205, 0
"""Gray values of the ROS map convention."""
RAYS_PER_VIEW = 720
"""Rays of a view: a lidar's usual half degree, so that far things show as fans."""
LOST_FROM = 0.15
"""Rays that meet nothing are known to at least this share of the sensor's reach."""
REACHES_M = (4.0, 6.0, 8.0, 12.0, 18.0)
USUAL_REACHES, HOME_REACHES = (0.15, 0.25, 0.25, 0.2, 0.15), (0.06, 0.24, 0.35, 0.25, 0.1)
"""How far sensors see, and how often, in homes and elsewhere."""
VIEWS_MAX = 110
THOROUGH_HOMES, THOROUGH = 0.75, 0.45
"""Share of the maps for which robots looked into every corner."""
HOME_DAMAGE = 0.5
"""Faint walls and gaps in homes, relative to elsewhere."""
PROGRESS, PROGRESS_VIEWS_MIN = (0.25, 0.9), 6
"""The share of the views that an exploration in progress has, and how many at least."""
FRONT_TRANSMISSION = (0.02, 0.25)
"""Share of the rays that pass whole fronts: single ones, as through blinds and between posts."""
YARD_VIEWS = (3, 12)
"""Views from the ground outside."""
DRAWN_SHARE = {
    "villa": 0.05,
    "offices": 0.05,
    "faculty": 0.05,
    "depot": 0.15,
    "arena": 0.03,
    "suites": 0.05,
    "loop": 0.07,
    "openhome": 0.06,
    "wings": 0.08,
    "gallery": 0.08,
    "warehouse": 0.3,
    "hallways": 0.05,
    "cellular": 0.03,
    "partitions": 0.15,
}
"""Share of drawings among the maps of a kind; 0.12 elsewhere."""
ROOM_SEEN_MIN_M2 = 0.5
"""Rooms of which less was seen are none in the truth."""


@dataclass(frozen=True)
class Survey:
    """How a kind of building is mapped, from its corridors where it has some.

    Attributes
    ----------
    from_doors : tuple of float
        Shares of the rooms that are seen through their doors only, one of them by chance.
    in_progress : float
        How often the exploration is still in progress.
    thorough : float
        Share of the maps for which robots looked into every corner.
    reaches : tuple of float
        How often sensors have each reach of `REACHES_M`.
    beams_apart : tuple of int
        Every which ray of a view the lidar has, one of them by chance.
    """

    from_doors: tuple[float, ...] = (0.0, 0.2, 0.5, 0.85)
    in_progress: float = 0.45
    thorough: float = THOROUGH
    reaches: tuple[float, ...] = USUAL_REACHES
    beams_apart: tuple[int, ...] = (1, 1, 2, 3, 4)


SURVEYS = {
    "offices": Survey(),
    "faculty": Survey(),
    "suites": Survey((0.0, 0.0, 0.1, 0.3, 0.6), 0.3, 0.6),
    "loop": Survey((0.0, 0.0, 0.2, 0.5), 0.3, 0.6),
    "wings": Survey((0.0, 0.0, 0.0, 0.2), 0.12, 0.7, (0.0, 0.15, 0.3, 0.35, 0.2), (1, 1, 2)),
    "cellular": Survey((0.0, 0.1, 0.3, 0.6), 0.35, 0.55),
    "gallery": Survey((0.0, 0.0, 0.1), 0.1, 0.75, (0.05, 0.2, 0.3, 0.3, 0.15), (1, 1, 2)),
}
"""Kinds of plans that are mapped so; few beams leave fans of single rays in far rooms."""


@dataclass(frozen=True, eq=False)
class SimulatedMap:
    """A map with its true rooms, row 0 at the bottom.

    Attributes
    ----------
    kind : str
        Maker of the plan, furnishing and sensing, joined by slashes.
    gray : (H, W) uint8
    truths : tuple of (H, W) int32
        The rooms; a second image where openings without jambs part nothing.
    """

    kind: str
    gray: NDArray[np.uint8]
    truths: tuple[Labels, ...] = field(default_factory=tuple)


@cache
def _rays(reach: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    angle = np.linspace(0, 2 * np.pi, RAYS_PER_VIEW, endpoint=False, dtype=np.float32)
    step = np.arange(1, reach, dtype=np.float32)
    return np.sin(angle)[:, None] * step, np.cos(angle)[:, None] * step


class Sensor:
    """Gathers evidence of views, like the log odds of a SLAM map."""

    def __init__(self, rng: Generator, solid: Mask, glass: Mask, reach: int, every: int = 1) -> None:
        self.rng, self.reach = rng, reach
        self.pad = reach + 4
        self.solid = np.pad(solid, self.pad)
        self.unglazed = np.pad(solid & (1 - glass), self.pad)
        self.transmission = rng.uniform(0.05, 0.8)
        """Share of the rays that pass glass."""
        self.stride = self.solid.shape[1]
        self.every = every
        self.evidence = np.zeros(self.solid.shape, np.float32)
        self.ragged = chance(rng, 0.6)
        """Whether rays that meet nothing are lost at any length."""
        self.range_noise = rng.choice([0.0, 0.3, 0.6, 1.0])
        self.pose_noise = rng.choice([0.0, 0.3, 0.6, 1.1], p=[0.25, 0.35, 0.25, 0.15])
        self.hit_weight = np.float32(rng.choice([2.0, 3.0, 6.0]))

    def look(self, row: int, column: int) -> None:
        """Add one view."""
        rng, reach = self.rng, self.reach
        along_y, along_x = (along[:: self.every] for along in _rays(reach))
        rays = len(along_y)
        y = (along_y + np.float32(row + self.pad + 0.5)).astype(np.int32)
        x = (along_x + np.float32(column + self.pad + 0.5)).astype(np.int32)
        index = y * self.stride + x
        passes = rng.random(rays) < self.transmission
        solid = np.empty(index.shape, np.uint8)
        solid[passes] = self.unglazed.ravel()[index[passes]]
        solid[~passes] = self.solid.ravel()[index[~passes]]
        first = np.where(solid.any(1), solid.argmax(1), reach)
        hit = np.flatnonzero(first < reach - 1)
        noise = rng.normal(0, self.range_noise, len(first)) if self.range_noise else np.zeros(len(first))
        seen_to = np.maximum(first + np.round(noise), 0).astype(int)
        ends = np.clip(seen_to[hit] + 1, 1, reach - 1) - 1
        known_to = np.minimum(seen_to, first)
        if self.ragged:
            lost = first >= reach - 1
            known_to[lost] = known_to[lost] * rng.uniform(LOST_FROM, 1.0, np.count_nonzero(lost))
        free = index[np.arange(reach - 1) < known_to[:, None]]
        down, right = np.round(rng.normal(0, self.pose_noise, 2)).astype(int) if self.pose_noise else (0, 0)
        move = int(np.clip(down, -3, 3)) * self.stride + int(np.clip(right, -3, 3))
        flat = self.evidence.ravel()
        flat[free + move] -= 1
        flat[index[hit, ends] + move] += self.hit_weight

    def map(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Free and occupied cells."""
        inner = self.evidence[self.pad : -self.pad, self.pad : -self.pad]
        return inner < 0, inner > 0


def make_map(rng: Generator, walled: WalledPlan, furniture: Mask, furnishing: str) -> SimulatedMap | None:
    """Map a furnished building in a random way; None where nothing was seen."""
    rooms = walled.plan.rooms
    solid = (walled.walls | furniture | _outdoors(rng, rooms)).astype(np.uint8)
    drawn_share = 0.75 if furnishing == "survey" else DRAWN_SHARE.get(walled.plan.kind, 0.12)
    if chance(rng, drawn_share):
        kind, gray = "drawing", _drawing(rng, walled, furniture)
    else:
        kind, seen = _sensed(rng, walled, solid)
        if seen is None:
            return None
        gray = seen
    if walled.plan.strip is not None:
        gray[(walled.plan.strip > 0) & (gray == UNKNOWN) & (solid == 0)] = FREE
    gray = _damaged(rng, gray, HOME_DAMAGE if walled.plan.kind in HOMES else 1.0)
    rooms, other, gray = _warped(rng, rooms, walled.other, gray)
    window = _known_window(gray, rooms)
    gray, rooms, other = gray[window], rooms[window], other[window]
    truths = [_truth(gray, rooms)]
    if (other != rooms).any():
        truths.append(_truth(gray, other))
    if not truths[0].any():
        return None
    return SimulatedMap(f"{walled.plan.kind}/{furnishing}/{kind}", np.ascontiguousarray(gray), tuple(truths))


def _drawing(rng: Generator, walled: WalledPlan, furniture: Mask) -> NDArray[np.uint8]:
    """A floor plan or a simulator's map: all known, the outside white or unknown."""
    rooms = walled.plan.rooms
    gray = np.where((walled.walls | furniture) > 0, OCCUPIED, FREE).astype(np.uint8)
    outside = (rooms == 0) & (gray == FREE)
    if chance(rng, 0.7):
        gray[outside] = UNKNOWN
    return gray


def _outdoors(rng: Generator, rooms: Labels) -> Mask:
    """Things outside the building that end the rays through its windows."""
    solid = np.zeros(rooms.shape, np.uint8)
    for _ in range(rng.poisson(rng.choice([5, 30, 100]))):
        spot = int(rng.integers(rooms.shape[1])), int(rng.integers(rooms.shape[0]))
        cv2.circle(solid, spot, between(rng, 0.05, 0.4), 1, -1)
    solid[rooms > 0] = 0
    return solid


def _sensed(rng: Generator, walled: WalledPlan, solid: Mask) -> tuple[str, NDArray[np.uint8] | None]:
    """Drive through rooms that can be reached, all or the first of them, and look around."""
    rooms, neighbors = walled.plan.rooms, walled.neighbors
    survey = SURVEYS.get(walled.plan.kind)
    at_home = walled.plan.kind in HOMES
    reaches = survey.reaches if survey else HOME_REACHES if at_home else USUAL_REACHES
    reach_m = float(rng.choice(REACHES_M, p=reaches))
    numbers = list(neighbors)
    if survey and walled.plan.corridors:
        ways = [n for n in numbers if n in walled.plan.corridors] or numbers
        start = ways[rng.integers(len(ways))]
    else:
        start = numbers[rng.integers(len(numbers))]
    share = 1.0 if chance(rng, 0.75 if at_home else 0.62) else rng.uniform(0.15, 0.9)
    order, queue, met = [], [start], {start}
    while queue:
        room = queue.pop(int(rng.integers(len(queue))))
        order.append(room)
        for beside in neighbors[room]:
            if beside not in met:
                met.add(beside)
                queue.append(beside)
    if len(order) < len(numbers) and share == 1.0 and chance(rng, 0.8):
        order += [n for n in numbers if n not in met]
    order = order[: max(1, round(share * len(order)))]
    kind = "whole" if share == 1.0 else "part"
    away = cv2.erode((solid == 0).astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    rows, columns = np.nonzero(away & (rooms > 0))
    place = np.argsort(rooms[rows, columns].astype(np.uint16), kind="stable")
    rows, columns = rows[place], columns[place]
    bounds = np.searchsorted(rooms[rows, columns], [*order, *[n + 1 for n in order]])
    # Share of the rooms that are seen through their doors only.
    usual = [0.7, 0.24, 0.06, 0.0] if at_home else None
    skip = rng.choice(survey.from_doors) if survey else rng.choice([0.0, 0.06, 0.3, 0.6], p=usual)
    views = []
    per_view_m2 = rng.uniform(6, 16)
    thorough = chance(rng, survey.thorough if survey else THOROUGH_HOMES if at_home else THOROUGH)
    apart = 0.25 if thorough else 0.6
    for low, high, room in zip(bounds[: len(order)], bounds[len(order) :], order, strict=True):
        inside = room in walled.plan.corridors or room in walled.plan.halls or len(order) == 1
        if high <= low or (not inside and chance(rng, skip)):
            continue
        spread_m2 = max(per_view_m2, apart * reach_m**2) / rng.uniform(1, 2)
        count = int(np.ceil((high - low) * CELL_M**2 / spread_m2))
        length = max(int(np.ptp(rows[low:high])), int(np.ptp(columns[low:high])))
        count = max(count, 4 if thorough else 2, round(length / cells(0.7 * reach_m)))
        at = low + _spread(rng, rows[low:high], columns[low:high], count)
        views += list(zip(rows[at].tolist(), columns[at].tolist(), strict=True))
    if not views:
        return kind, None
    if len(views) > VIEWS_MAX:
        views = [views[i] for i in rng.choice(len(views), VIEWS_MAX, replace=False)]
    if survey and chance(rng, survey.in_progress):
        count = max(PROGRESS_VIEWS_MIN, round(len(views) * rng.uniform(*PROGRESS)))
        kind, views = "progress", _nearest(rng, views, count)
    if walled.plan.yard is not None:
        at_yard = np.argwhere((walled.plan.yard > 0) & away)
        if len(at_yard):
            chosen = rng.integers(0, len(at_yard), rng.integers(*YARD_VIEWS))
            views += [(int(row), int(column)) for row, column in at_yard[chosen]]
    every = int(rng.choice(survey.beams_apart)) if survey else 1
    sensor = Sensor(rng, solid, walled.glass, cells(reach_m), every)
    if walled.plan.glazed:
        sensor.transmission = rng.uniform(*FRONT_TRANSMISSION)
    for row, column in views:
        sensor.look(row, column)
    free, occupied = sensor.map()
    if chance(rng, 0.7):  # rays leave gaps far out that a real map's many scans fill
        free = cv2.morphologyEx(free.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0
    if chance(rng, 0.6):
        size = int(rng.choice([2, 3, 4], p=[0.45, 0.45, 0.1]))
        occupied = cv2.dilate(occupied.astype(np.uint8), np.ones((size, size), np.uint8)) > 0
    gray = np.full(rooms.shape, UNKNOWN, np.uint8)
    gray[free] = FREE
    gray[occupied] = OCCUPIED
    return kind, gray


def _nearest(rng: Generator, views: list[tuple[int, int]], count: int) -> list[tuple[int, int]]:
    """The views around one of them: as far as an exploration has come."""
    places = np.array(views)
    away = np.hypot(*(places - places[rng.integers(len(places))]).T)
    return [views[i] for i in np.argsort(away, kind="stable")[:count]]


def _spread(
    rng: Generator, rows: NDArray[np.intp], columns: NDArray[np.intp], count: int
) -> NDArray[np.intp]:
    """Random cells of a room, one in each of equal parts along its longer side."""
    longer = rows if np.ptp(rows) > np.ptp(columns) else columns
    order = np.argsort(longer.astype(np.uint16), kind="stable")  # 16 bits are sorted fastest
    place = (np.arange(count) + rng.random(count)) / count * len(order)
    return order[place.astype(np.intp)]


def _damaged(rng: Generator, gray: NDArray[np.uint8], usual: float) -> NDArray[np.uint8]:
    """Gaps in walls, spots, unknown holes, and a second, slightly turned copy of a part of the walls."""
    gray = gray.copy()
    occupied = gray == OCCUPIED
    if chance(rng, 0.35 * usual):  # faint walls
        lost = rng.uniform(0, 0.3)
        gray[occupied & (rng.random(gray.shape) < lost)] = rng.choice([UNKNOWN, FREE])
    if chance(rng, 0.3 * usual):  # gaps as a robot vacuum leaves them
        rows, columns = np.nonzero(occupied)
        for _ in range(rng.poisson(len(rows) * CELL_M / 25)):
            at = rng.integers(len(rows))
            half = between(rng, 0.05, 0.25)
            part = gray[
                max(0, rows[at] - half) : rows[at] + half, max(0, columns[at] - half) : columns[at] + half
            ]
            part[part == OCCUPIED] = rng.choice([UNKNOWN, FREE])
    if chance(rng, 0.3):
        spots = rng.random(gray.shape) < rng.uniform(0, 0.002)
        gray[spots & (gray == FREE)] = OCCUPIED
    if chance(rng, 0.25):
        spots = (rng.random(gray.shape) < rng.uniform(0, 0.02)) & (gray == FREE)
        gray[spots] = UNKNOWN
    if chance(rng, 0.2):
        _doubled(rng, gray)
    return gray


def _doubled(rng: Generator, gray: NDArray[np.uint8]) -> None:
    """Draw a part of the walls again, shifted and turned a little, as after a poor closing of a loop."""
    height, width = gray.shape
    low, high = np.sort(rng.integers(0, width, 2))
    center = float(low + high) / 2, height / 2
    turn = cv2.getRotationMatrix2D(center, rng.normal(0, 0.6), 1.0)
    turn[:, 2] = turn[:, 2] + rng.uniform(-3, 3, 2)
    walls = (gray == OCCUPIED).astype(np.uint8)
    again = cv2.warpAffine(walls, turn, (width, height), flags=cv2.INTER_NEAREST) > 0
    again[:, :low] = again[:, high:] = False
    gray[again] = OCCUPIED


def _warped(
    rng: Generator, rooms: Labels, other: Labels, gray: NDArray[np.uint8]
) -> tuple[Labels, Labels, NDArray[np.uint8]]:
    """Turn the map a little, or let it wave as drift does."""
    height, width = gray.shape
    kind = rng.choice(["none", "turn", "wave"], p=[0.45, 0.3, 0.25])
    if kind == "none":
        return rooms, other, gray
    y, x = np.mgrid[:height, :width].astype(np.float32)
    if kind == "turn":
        angle = rng.normal(0, 0.02)
        y, x = y + np.float32(angle) * (x - width / 2), x - np.float32(angle) * (y - height / 2)
    else:
        length, size = rng.uniform(8, 30) / CELL_M, rng.uniform(0.03, 0.3) / CELL_M
        phase = rng.uniform(0, 6, 2)
        y, x = (
            y + np.float32(size) * np.sin(x / np.float32(length / 6) + np.float32(phase[0])),
            x + np.float32(size) * np.sin(y / np.float32(length / 6) + np.float32(phase[1])),
        )
    from_x, from_y = x.astype(np.float32), y.astype(np.float32)
    labels = [moved(image, from_x, from_y).astype(np.int32) for image in (rooms, other)]
    return labels[0], labels[1], moved(gray, from_x, from_y, UNKNOWN).astype(np.uint8)


def _known_window(gray: NDArray[np.uint8], rooms: Labels) -> tuple[slice, slice]:
    known = (gray != UNKNOWN) | (rooms > 0) & (gray == FREE)
    rows, columns = np.flatnonzero(known.any(1)), np.flatnonzero(known.any(0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def _truth(gray: NDArray[np.uint8], rooms: Labels) -> Labels:
    """Rooms of the free cells, without those of which next to nothing was seen."""
    truth = np.where(gray == FREE, rooms, 0)
    size = np.bincount(truth.ravel())
    kept = size * CELL_M**2 >= ROOM_SEEN_MIN_M2
    kept[0] = False
    number = np.where(kept, np.cumsum(kept), 0).astype(np.int32)
    return number[truth]
