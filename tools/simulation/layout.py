"""Random floor plans: rooms in rows along a corridor of any shape, and the doors between them."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely
from shapely.affinity import affine_transform
from shapely.geometry import LineString, Polygon, box
from shapely.geometry.base import BaseGeometry

from simulation.building import FloatArray, Room, boundary_segments

STYLES = ("straight", "bent", "ring", "hall", "flat", "campus")
MIN_ROOM_AREA_M2 = 4.0
MIN_ROOM_WIDTH_M = 1.3
"""What is left of a room after a neighbor took its part must still be a room."""
DOOR_POST_M = 0.15
"""Wall that stays on each side of a door."""


@dataclass
class FloorPlanDraft:
    """Rooms and openings as they are laid out.

    Attributes
    ----------
    wall_m : float
        Thickness of the walls between rooms.
    rooms : list of Room
        Corridors first.
    doorways : list of shapely Polygon
        Openings that were cut.
    hinges : list of (2, 2) float
        For each doorway that has a leaf: its hinge point and the direction of its sill, as two rows.
    """

    wall_m: float
    rooms: list[Room] = field(default_factory=list)
    doorways: list[Polygon] = field(default_factory=list)
    hinges: list[FloatArray] = field(default_factory=list)

    def add(self, kind: str, polygon: BaseGeometry) -> bool:
        """Add a room, less what the rooms before it occupy; False where too little is left of it."""
        taken = shapely.union_all([room.polygon for room in self.rooms])
        rest = polygon.difference(taken.buffer(self.wall_m, join_style="mitre"))
        parts = [part for part in shapely.get_parts(rest) if isinstance(part, Polygon)]
        if not parts:
            return False
        largest = max(parts, key=lambda part: part.area)
        core = largest.buffer(-MIN_ROOM_WIDTH_M / 2, join_style="mitre")
        if core.is_empty or largest.area < MIN_ROOM_AREA_M2:
            return False
        opened = core.buffer(MIN_ROOM_WIDTH_M / 2, join_style="mitre").intersection(largest)
        part = max(shapely.get_parts(opened), key=lambda p: p.area)
        number = len(self.rooms) + 1
        self.rooms.append(Room(number, f"{kind} {number}", shapely.normalize(part.simplify(0.01))))
        return True


def corridor_polygons(rng: np.random.Generator, style: str) -> list[Polygon]:
    """The corridors of a building, as polygons that touch or overlap only where they are one room."""
    width = float(rng.uniform(1.8, 3.0))

    def along(points: FloatArray) -> Polygon:
        return LineString(points).buffer(width / 2, cap_style="flat", join_style="mitre", mitre_limit=5)

    if style == "straight":
        return [along(np.array([[0, 0], [rng.uniform(22, 40), 0]]))]
    if style == "bent":
        first, second = rng.uniform(14, 22, 2)
        angle = np.deg2rad(float(rng.choice([30.0, 30.0, 45.0, 60.0, 20.0])))
        bend = np.array([first, 0.0])
        return [along(np.array([[0, 0], bend, bend + second * np.array([np.cos(angle), np.sin(angle)])]))]
    if style == "ring":
        length, depth = rng.uniform(20, 28), rng.uniform(14, 20)
        outer = box(-width / 2, -width / 2, length + width / 2, depth + width / 2)
        corner = rng.uniform(3, 6)
        cut = Polygon([(length - corner, depth + width), (length + width, depth - corner), (99, 99)])
        inner = box(width / 2, width / 2, length - width / 2, depth - width / 2)
        inner_cut = affine_transform(cut, [1, 0, 0, 1, -width * 0.9, -width * 0.9])
        return [shapely.difference(outer.difference(cut), inner.difference(inner_cut))]
    if style == "hall":
        length, narrow, wide = rng.uniform(18, 28), rng.uniform(4, 6), rng.uniform(7, 11)
        return [Polygon([(0, 0), (length, 0), (length, wide), (0, narrow)])]
    if style == "campus":
        length, arm = rng.uniform(24, 36), rng.uniform(10, 16)
        at = rng.uniform(0.3, 0.7) * length
        stem = np.array([[0, 0], [length, 0]])
        branch = np.array([[at, 0], [at + rng.uniform(-2, 2), arm]])
        return [shapely.union(along(stem), along(branch))]
    # A flat: one small hallway, the rooms around it do the rest.
    return [box(0, 0, float(rng.uniform(5, 10)), float(rng.uniform(1.4, 2.2)))]


def room_rows(
    rng: np.random.Generator, corridor: Polygon, wall_m: float, style: str
) -> list[tuple[str, Polygon]]:
    """Rectangles side by side along every wall of a corridor, the long walls first."""
    small = style == "flat"
    edges = boundary_segments(shapely.geometry.polygon.orient(corridor))
    lengths = np.hypot(edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1])
    rows: list[tuple[str, Polygon]] = []
    for edge, length in sorted(zip(edges, lengths, strict=True), key=lambda pair: -pair[1]):
        if length < 1.6 or (length < 4.0 and rng.random() < 0.4):
            continue
        direction = (edge[2:] - edge[:2]) / length
        # The corridor lies on the left of its edges: the rooms are on the right.
        frame = [direction[0], direction[1], direction[1], -direction[0], edge[0], edge[1]]
        depth = float(rng.uniform(3.0, 4.8) if small else rng.uniform(4.0, 7.0))
        at = float(rng.uniform(-1.5, 0.5)) if small or length < 4 else 0.0
        end = length if length >= 4 else length + 3.0
        while at < end - 1.6:
            width = float(rng.choice([2.6, 3.4, 4.2, 5.0, 6.4, 8.5], p=[0.12, 0.2, 0.25, 0.2, 0.15, 0.08]))
            width *= float(rng.uniform(0.92, 1.08))
            if end - at - width < 2.4:
                width = end - at
            deep = depth * float(rng.choice([1.0, 1.0, 1.0, 0.55]))
            local = box(at, wall_m, at + width - wall_m, wall_m + deep)
            kind = "store" if width * deep < 12 else ("lab" if width * deep > 36 else "office")
            if rng.random() > 0.04:  # a gap now and then: a shaft, a courtyard
                rows.append((kind, affine_transform(local, frame)))
            if deep < depth * 0.9 and depth - deep > 2.0 and rng.random() < 0.7:
                back = box(at, 2 * wall_m + deep, at + width - wall_m, wall_m + depth)
                rows.append(("store", affine_transform(back, frame)))
            at += width
    return rows


def split_corridor(rng: np.random.Generator, corridor: Polygon, wall_m: float) -> list[Polygon]:
    """Cut a long corridor by a fire door's wall at a random place, if that leaves two parts."""
    x0, y0, x1, y1 = corridor.bounds
    x = float(rng.uniform(x0 + 0.35 * (x1 - x0), x0 + 0.65 * (x1 - x0)))
    wall = box(x, y0 - 1, x + wall_m, y1 + 1)
    parts = [part for part in shapely.get_parts(corridor.difference(wall)) if part.area > 6.0]
    return parts if len(parts) == 2 else [corridor]


def facing_walls(a: Polygon, b: Polygon, wall_m: float) -> list[FloatArray]:
    """Straight stretches (2, 2) of b's outline that lie one wall away from a, the longest first."""
    near = LineString(shapely.get_coordinates(b.exterior)).intersection(
        a.buffer(wall_m + 0.02, join_style="mitre")
    )
    edges = [
        np.array([c[i], c[i + 1]])
        for part in shapely.get_parts(near)
        for c in [shapely.get_coordinates(part)]
        for i in range(len(c) - 1)
    ]
    return sorted(edges, key=lambda edge: -float(np.linalg.norm(edge[1] - edge[0])))


def cut_door(
    rng: np.random.Generator, draft: FloorPlanDraft, host: Room, room: Room, *, width_m: float, leaf: bool
) -> bool:
    """Cut an opening between two rooms; False where they share no wall that is long enough."""
    for edge in facing_walls(host.polygon, room.polygon, draft.wall_m):
        length = float(np.linalg.norm(edge[1] - edge[0]))
        if length < width_m + 2 * DOOR_POST_M:
            return False
        along = (edge[1] - edge[0]) / length
        normal = np.array([-along[1], along[0]])
        middle = edge.mean(axis=0)
        if not host.polygon.buffer(0.05).contains(shapely.Point(middle + normal * (draft.wall_m + 0.05))):
            normal = -normal
        room_to_spare = length - width_m - 2 * DOOR_POST_M
        start = edge[0] + along * (DOOR_POST_M + room_to_spare * float(rng.beta(0.6, 0.6)))
        low, high = start - normal * 0.02, start + normal * (draft.wall_m + 0.04)
        door = Polygon([low, low + along * width_m, high + along * width_m, high])
        sill = LineString([high - normal * 0.01, high + along * width_m - normal * 0.01])
        if host.polygon.buffer(0.03).intersection(sill).length < 0.9 * width_m:
            continue  # the walls are not parallel here
        draft.doorways.append(door)
        if leaf:
            draft.hinges.append(np.array([start - normal * 0.02, along * width_m]))
        return True
    return False


def connect(rng: np.random.Generator, draft: FloorPlanDraft, corridors: int) -> None:
    """Give every room a door, towards the corridor where it can; rooms that cannot have one are dropped."""
    reached = draft.rooms[:1]
    waiting = draft.rooms[1:]
    while waiting:
        progress = False
        for room in list(waiting):
            hosts = sorted(reached, key=lambda host: host.number > corridors)
            is_corridor = room.number <= corridors
            kind = rng.random()
            wide = (
                float(rng.uniform(1.5, 2.6)) if kind < 0.12 or is_corridor else float(rng.uniform(0.85, 1.05))
            )
            if any(cut_door(rng, draft, host, room, width_m=wide, leaf=wide < 1.2) for host in hosts) or any(
                cut_door(rng, draft, host, room, width_m=0.85, leaf=True) for host in hosts
            ):
                reached.append(room)
                waiting.remove(room)
                progress = True
        if not progress:
            break
    draft.rooms = [room for room in draft.rooms if room in reached]
    offices = [room for room in draft.rooms if room.number > corridors]
    for a, b in pairwise(offices):
        if rng.random() < 0.12:
            cut_door(rng, draft, a, b, width_m=0.9, leaf=True)


def draw_floor_plan(rng: np.random.Generator, style: str) -> FloorPlanDraft:
    """Lay out a random building of one of `STYLES`."""
    draft = FloorPlanDraft(wall_m=float(rng.choice([0.12, 0.16, 0.24])))
    corridors: list[Polygon] = []
    rows: list[tuple[str, Polygon]] = []
    for corridor in corridor_polygons(rng, style):
        rows += room_rows(rng, corridor, draft.wall_m, style)
        if style in ("straight", "campus") and rng.random() < 0.6:
            corridors += split_corridor(rng, corridor, draft.wall_m)
        else:
            corridors.append(corridor)
    for corridor in sorted(corridors, key=lambda part: -part.area):
        # Added as they are: `add` would take the ring's courtyard for an overlap.
        number = len(draft.rooms) + 1
        draft.rooms.append(Room(number, f"{'hall' if style == 'hall' else 'corridor'} {number}", corridor))
    for kind, polygon in rows:
        draft.add(kind, polygon)
    connect(rng, draft, len(corridors))
    draft.rooms = [
        Room(i + 1, f"{room.name.split()[0]} {i + 1}", room.polygon) for i, room in enumerate(draft.rooms)
    ]
    return draft
