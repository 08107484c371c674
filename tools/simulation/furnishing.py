"""What stands in the rooms and around the building, as its cross-section at the lidar's height."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.affinity import affine_transform, rotate
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

from simulation.building import FloatArray, Room, boundary_segments
from simulation.layout import FloorPlanDraft

DOOR_CLEARANCE_M = 0.75
"""Kept free of furniture around each doorway, so that the robot can enter."""
LEG_M = 0.05


def square(x: float, y: float, side: float) -> Polygon:
    """An upright square around a point."""
    return box(x - side / 2, y - side / 2, x + side / 2, y + side / 2)


def legs(width: float, depth: float) -> list[Polygon]:
    """The four legs of a table that stands with its corner at the origin."""
    return [square(x, y, LEG_M) for x in (0.05, width - 0.05) for y in (0.05, depth - 0.05)]


def chair(rng: np.random.Generator, x: float, y: float) -> list[Polygon]:
    """Four thin legs, or the five feet and the column of an office chair."""
    turn = float(rng.uniform(0, 2 * np.pi))
    count, radius = (4, 0.24) if rng.random() < 0.5 else (5, 0.28)
    angles = turn + np.arange(count) * 2 * np.pi / count
    feet = [square(x + radius * float(np.cos(a)), y + radius * float(np.sin(a)), 0.04) for a in angles]
    return feet if count == 4 else [*feet, square(x, y, 0.06)]


def wall_piece(rng: np.random.Generator, kind: str) -> tuple[float, list[Polygon]]:
    """Width along the wall, and the shapes, of one piece of furniture that stands at a wall (y = 0)."""
    pick = float(rng.random())
    if kind == "store" or pick < 0.38:
        width, depth = float(rng.uniform(0.6, 2.0)), float(rng.uniform(0.3, 0.6))
        gap = float(rng.uniform(0.0, 0.06))
        return width, [box(0, gap, width, gap + depth)]
    if pick < 0.8:
        width, depth = float(rng.uniform(1.2, 1.8)), float(rng.uniform(0.6, 0.9))
        shapes = legs(width, depth)
        if rng.random() < 0.6:  # a drawer unit under the table
            x = 0.05 if rng.random() < 0.5 else width - 0.5
            shapes.append(box(x, 0.1, x + 0.42, 0.6))
        if rng.random() < 0.85:
            shapes += chair(rng, width / 2 + float(rng.normal(0, 0.2)), depth + float(rng.uniform(-0.1, 0.5)))
        return width, shapes
    side = float(rng.uniform(0.25, 0.55))
    return side, [box(0, 0.03, side, 0.03 + side)]


def furnish(
    rng: np.random.Generator, room: Room, draft: FloorPlanDraft, clutter: float
) -> list[BaseGeometry]:
    """Furniture of one room: pieces along its walls, tables and chairs in the middle.

    Parameters
    ----------
    rng : numpy Generator
        Source of every choice.
    room : Room
        Where to put it.
    draft : FloorPlanDraft
        Its doorways stay free.
    clutter : float
        Share of the walls that is furnished in the building, 0..1; rooms differ.
    """
    kind = room.name.split()[0]
    density = 0.06 if kind == "corridor" else float(np.clip(clutter + rng.normal(0, 0.2), 0.0, 1.0))
    keep_free = shapely.union_all(draft.doorways).buffer(DOOR_CLEARANCE_M, quad_segs=2)
    inside = room.polygon.buffer(0.02)
    placed: list[BaseGeometry] = []
    outline = shapely.geometry.polygon.orient(room.polygon)
    for edge in boundary_segments(outline):
        length = float(np.hypot(*(edge[2:] - edge[:2])))
        direction = (edge[2:] - edge[:2]) / max(length, 1e-9)
        at = float(rng.uniform(0, 0.4))
        while at < length - 0.5:
            width, shapes = wall_piece(rng, kind)
            if at + width > length or rng.random() > density:
                at += float(rng.uniform(0.3, 1.2))
                continue
            origin = edge[:2] + direction * at
            frame = [direction[0], -direction[1], direction[1], direction[0], origin[0], origin[1]]
            piece = shapely.union_all([affine_transform(shape, frame) for shape in shapes])
            if rng.random() < 0.3:  # pushed aside
                piece = rotate(piece, float(rng.normal(0, 8)), "center")
            taken = shapely.union_all(placed) if placed else Polygon()
            hull = piece.convex_hull
            narrow = kind == "corridor" and hull.area / width > 0.5
            if not narrow and not hull.intersects(keep_free) and not hull.buffer(0.05).intersects(taken):
                placed.append(piece.intersection(inside))
            at += width + float(rng.exponential(0.25))
    if kind != "corridor":
        placed += middle_furniture(rng, room, keep_free, placed, density)
    return [piece for piece in placed if not piece.is_empty]


def middle_furniture(
    rng: np.random.Generator,
    room: Room,
    keep_free: BaseGeometry,
    placed: list[BaseGeometry],
    density: float,
) -> list[BaseGeometry]:
    """Tables with chairs, or pillars, away from the walls."""
    found: list[BaseGeometry] = []
    taken = shapely.union_all([*placed, keep_free])
    for _ in range(int(room.polygon.area / 5)):
        if rng.random() > density:
            continue
        x0, y0, x1, y1 = room.polygon.bounds
        x, y = float(rng.uniform(x0, x1)), float(rng.uniform(y0, y1))
        pick = float(rng.random())
        if pick < 0.15:
            piece: BaseGeometry = square(x, y, float(rng.uniform(0.2, 0.5)))
        elif pick < 0.45:
            piece = shapely.union_all(chair(rng, x, y))
        elif pick < 0.6:  # a desk with a solid side and back
            piece = shapely.union_all([box(x, y, x + 1.4, y + 0.04), box(x, y, x + 0.45, y + 0.7)])
        else:
            width, depth = float(rng.uniform(1.2, 2.4)), float(rng.uniform(0.7, 1.2))
            shapes = [shapely.affinity.translate(leg, x, y) for leg in legs(width, depth)]
            for k in range(int(rng.integers(1, 6))):
                side = -0.25 if k % 2 else depth + 0.25
                shapes += chair(rng, x + float(rng.uniform(0.2, width - 0.2)), y + side)
            piece = shapely.union_all(shapes)
        piece = rotate(piece, float(rng.choice([0, 90]) + rng.normal(0, 6)), "center")
        hull = piece.convex_hull
        if room.polygon.buffer(-0.5).contains(hull) and not hull.buffer(0.4).intersects(taken):
            found.append(piece)
            taken = taken.union(piece)
    return found


def wall_bumps(rng: np.random.Generator, room: Room, draft: FloorPlanDraft) -> list[BaseGeometry]:
    """Pilasters, pipes, and radiators: what keeps real walls from being straight."""
    keep_free = shapely.union_all(draft.doorways).buffer(0.2, quad_segs=2)
    every = float(rng.choice([1.5, 3.0, 6.0, 12.0]))
    bumps: list[BaseGeometry] = []
    for edge in boundary_segments(shapely.geometry.polygon.orient(room.polygon)):
        length = float(np.hypot(*(edge[2:] - edge[:2])))
        direction = (edge[2:] - edge[:2]) / max(length, 1e-9)
        at = float(rng.exponential(every))
        while at < length - 0.4:
            width, depth = float(rng.uniform(0.06, 0.4)), float(rng.uniform(0.05, 0.22))
            origin = edge[:2] + direction * at
            frame = [direction[0], -direction[1], direction[1], direction[0], origin[0], origin[1]]
            bump = affine_transform(box(0, 0, width, depth), frame)
            if not bump.intersects(keep_free):
                bumps.append(bump)
            at += width + float(rng.exponential(every))
    return bumps


def door_leaves(rng: np.random.Generator, hinges: list[FloatArray]) -> list[Polygon]:
    """Leaves of the open doors, swung into the room, 4 cm thick."""
    leaves = []
    for start, along in hinges:
        width = float(np.hypot(*along))
        u = along / width
        normal = np.array([-u[1], u[0]])
        swing = np.deg2rad(float(rng.uniform(75, 115))) * float(rng.choice([-1.0, 1.0]))
        if rng.random() < 0.35:
            continue  # a doorway whose leaf was taken away
        leaf = np.cos(swing) * u + np.sin(swing) * normal
        side = np.array([-leaf[1], leaf[0]]) * 0.02
        tip = start + leaf * (width - 0.05)
        leaves.append(Polygon([start - side, tip - side, tip + side, start + side]))
    return leaves


def surroundings(rng: np.random.Generator, footprint: BaseGeometry) -> list[Polygon]:
    """Trees, cars, and a neighbor's walls: what rays meet that leave through a window."""
    x0, y0, x1, y1 = footprint.buffer(8.0).bounds
    near = footprint.buffer(2.0)
    found = []
    for _ in range(40):
        x, y = float(rng.uniform(x0, x1)), float(rng.uniform(y0, y1))
        size = float(rng.choice([0.3, 0.5, 1.8, 4.0], p=[0.45, 0.25, 0.2, 0.1]))
        turn = float(rng.uniform(0, np.pi))
        frame = [np.cos(turn), -np.sin(turn), np.sin(turn), np.cos(turn), x, y]
        shape = affine_transform(box(0, 0, size, 0.5 * size), frame)
        if not shape.intersects(near):
            found.append(shape)
    return found
