"""Random buildings with true rooms: `simulate_building`."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.affinity import affine_transform
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from simulation.building import Building, FloatArray, Room, boundary_segments
from simulation.furnishing import door_leaves, furnish, surroundings, wall_bumps
from simulation.layout import STYLES, FloorPlanDraft, draw_floor_plan

OUTER_WALL_M = 0.35
ROBOT_START_CLEARANCE_M = 0.6


def turned(draft: FloorPlanDraft, angle_rad: float) -> None:
    """Turn a whole floor plan about the origin, in place."""
    c, s = float(np.cos(angle_rad)), float(np.sin(angle_rad))
    frame = [c, -s, s, c, 0.0, 0.0]
    draft.rooms = [Room(r.number, r.name, affine_transform(r.polygon, frame)) for r in draft.rooms]
    draft.doorways = [affine_transform(door, frame) for door in draft.doorways]
    draft.hinges = [np.stack([[c * x - s * y, s * x + c * y] for x, y in hinge]) for hinge in draft.hinges]


def windows(
    rng: np.random.Generator, draft: FloorPlanDraft, chance: float
) -> tuple[list[Polygon], FloatArray, FloatArray]:
    """Cut windows down to the lidar's height into outer walls.

    Returns
    -------
    slots : list of shapely Polygon
        Openings through the outer wall.
    panes : (N, 4) float
        The glass in them.
    transmission : (N,) float
        Probability that a ray passes each pane.
    """
    inside = shapely.union_all([room.polygon for room in draft.rooms]).buffer(OUTER_WALL_M + 0.3)
    slots: list[Polygon] = []
    panes: list[FloatArray] = []
    passing: list[float] = []
    for room in draft.rooms:
        if rng.random() > chance:
            continue
        others = shapely.union_all([r.polygon for r in draft.rooms if r is not room]).buffer(
            OUTER_WALL_M + 0.1
        )
        clear = float(rng.uniform(0.02, 0.3))
        for edge in boundary_segments(shapely.geometry.polygon.orient(room.polygon)):
            length = float(np.hypot(*(edge[2:] - edge[:2])))
            if length < 1.4:
                continue
            along = (edge[2:] - edge[:2]) / length
            outward = np.array([along[1], -along[0]])
            at = float(rng.uniform(0.3, 1.0))
            while at < length - 1.0:
                width = min(float(rng.uniform(0.6, 1.8)), length - at - 0.2)
                a = edge[:2] + along * at
                b = a + along * width
                slot = Polygon(
                    [a - outward * 0.02, b - outward * 0.02, b + outward * OUTER_WALL_M * 1.6,
                     a + outward * OUTER_WALL_M * 1.6]
                )  # fmt: skip
                beyond = LineString([a, b]).parallel_offset(OUTER_WALL_M + 0.6, "right")
                if not slot.intersects(others) and not beyond.intersects(inside.buffer(-0.25)):
                    slots.append(slot)
                    panes.append(np.concatenate([a + outward * 0.12, b + outward * 0.12]))
                    passing.append(clear)
                at += width + float(rng.uniform(0.4, 2.5))
    return slots, np.array(panes).reshape(-1, 4), np.array(passing)


def simulate_building(seed: int, style: str | None = None, *, turn_rad: float | None = None) -> Building:
    """Make a random building; the same arguments give the same building.

    Parameters
    ----------
    seed : int
        Any number from 0.
    style : str, optional
        One of `STYLES`: ``straight`` (rooms along a corridor), ``bent`` (a wing turned by 20 to 60 degrees),
        ``ring`` (a corridor loop with a cut corner), ``hall`` (one large hall with a slanted wall), ``flat``
        (a hallway with rooms around), ``campus`` (a corridor with a branch). Random by default.
    turn_rad : float, optional
        How the building lies in the world. By default square to the map three times out of four, else any
        angle.

    Returns
    -------
    Building

    Raises
    ------
    ValueError
        If `style` is not one of `STYLES`.
    """
    if style is not None and style not in STYLES:
        raise ValueError(f"no building style {style!r}; choose one of {', '.join(STYLES)}")
    rng = np.random.default_rng([seed, 0])
    style = style or STYLES[int(rng.integers(len(STYLES)))]
    draft = draw_floor_plan(rng, style)
    lean = float(rng.normal(0, np.deg2rad(0.7))) if rng.random() < 0.75 else float(rng.uniform(0, np.pi))
    turned(draft, lean if turn_rad is None else turn_rad)
    furniture: list[BaseGeometry] = []
    clutter = float(rng.uniform(0.1, 1.0))
    for room in draft.rooms:
        furniture += furnish(rng, room, draft, clutter)
        furniture += wall_bumps(rng, room, draft)
    furniture += door_leaves(rng, draft.hinges)
    slots, panes, passing = windows(rng, draft, chance=float(rng.uniform(0.02, 0.3)))
    floor = shapely.union_all([room.polygon for room in draft.rooms])
    footprint = floor.buffer(OUTER_WALL_M, join_style="mitre", mitre_limit=2)
    walls = footprint.difference(shapely.union_all([floor, *draft.doorways, *slots]))
    inside = floor.union(shapely.union_all(draft.doorways))
    things = shapely.union_all(furniture).intersection(inside)
    outside = shapely.union_all(surroundings(rng, footprint))
    opaque = np.concatenate([boundary_segments(shape) for shape in (walls, things, outside)])
    start = draft.rooms[0].polygon.representative_point()
    room = (
        draft.rooms[0]
        .polygon.buffer(-ROBOT_START_CLEARANCE_M)
        .difference(things.buffer(ROBOT_START_CLEARANCE_M))
    )
    corners = shapely.get_coordinates(room)
    if len(corners):  # one end of the corridor: the run then shows how the corridor grows
        start = Point(corners[int(rng.integers(len(corners)))])
    return Building(
        name=f"{style} {seed}",
        rooms=tuple(draft.rooms),
        doorways=tuple(draft.doorways),
        furniture=things,
        segments=np.concatenate([opaque, panes]),
        transmission=np.concatenate([np.zeros(len(opaque)), passing]),
        start_xy_m=(float(start.x), float(start.y)),
    )
