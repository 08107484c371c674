"""Plans whose rooms are parted by little that is seen, and halls that what stands in them does not part."""

from __future__ import annotations

import cv2
import numpy as np

from fit_grouping.buildings.joined_rooms import openhome
from fit_grouping.buildings.plans import (
    Plan,
    Rectangle,
    bays,
    corner_rooms,
    corridor_segments,
    notches,
    row_of_rooms,
    unite_touching,
)
from fit_grouping.buildings.raster import Generator, Mask, between, cells, chance
from fit_grouping.buildings.workplaces import double_doors, empty_building, strip_beside, unbuilt

OFFICE_M = (2.6, 6.5)
"""Width of the offices of a floor, all much the same."""
WALL_PIECE_M, WALL_PIECE_SHARE_MAX = (0.8, 9.0), 0.55
"""Length of pieces of wall that stand free in a hall, and the share of its width that they cover at most."""
WALL_PIECE_M2 = (30.0, 200.0)
"""A hall has about one piece of wall to so much floor."""
PASSAGE_M = 1.5
"""What is left free around a piece of wall at least, but where it begins at that of the hall."""


def hallways(rng: Generator) -> Plan:
    """A home whose hallways open into its living rooms, and these into each other, mostly without jambs."""
    plan = openhome(rng)
    plan.kind = "hallways"
    plan.flowing, plan.zones = plan.zones | plan.public, set()
    return plan


def cellular(rng: Generator) -> Plan:
    """Offices of much the same width, whose walls to each other stand behind furniture and hardly show."""
    plan = empty_building(
        rng, "cellular", between(rng, 18, 54), between(rng, 11, 34 if chance(rng, 0.3) else 18)
    )
    area = plan.inner
    width, depth = between(rng, 1.5, 3.4), between(rng, 3.6, 7.5)
    segments = corridor_segments(rng, area, width, depth)
    unite_touching(plan, {plan.corridor(segment) for segment in segments})
    double_doors(rng, plan, segments)
    usual_m = rng.uniform(*OFFICE_M)
    for segment in segments:
        for side in (0, 1):
            own_m = usual_m if chance(rng, 0.6) else rng.uniform(*OFFICE_M)
            strip = strip_beside(segment, side, depth, area)
            row_of_rooms(rng, plan, strip, own_m, least_m=1.5, regular=chance(rng, 0.7))
    corner_rooms(rng, plan, 0.5, 1.0, 2.4)
    bays(rng, plan, 0.6)
    notches(rng, plan, 0.3)
    unbuilt(rng, plan, rng.choice([0.0, 0.06, 0.2]))
    plan.frayed = rng.choice([0.3, 0.6, 0.95])
    plan.open_fronts = rng.choice([0.02, 0.1])
    return plan


def partitions(rng: Generator) -> Plan:
    """Halls with pieces of wall, booths and screens, each of which stays one room; rooms at their sides."""
    plan = empty_building(rng, "partitions", between(rng, 8, 34), between(rng, 7, 24))
    x0, y0, x1, y1 = plan.inner
    for _ in range(rng.poisson(1.0)):
        deep = between(rng, 2, 6)
        strip = [(x0, y0, x0 + deep, y1), (x1 - deep, y0, x1, y1), (x0, y0, x1, y0 + deep)][rng.integers(3)]
        row_of_rooms(rng, plan, strip, rng.uniform(2.5, 8), regular=chance(rng, 0.4))
    if chance(rng, 0.3):
        middle = x0 + round((x1 - x0) * rng.uniform(0.35, 0.65))
        plan.hall((x0, y0, middle, y1))
    plan.hall(plan.inner)
    notches(rng, plan, 0.7)
    plan.things = np.zeros(plan.rooms.shape, np.uint8)
    for hall in sorted(plan.halls):
        rows, columns = np.nonzero(plan.rooms == hall)
        if len(rows):
            _stand_walls(rng, plan.things, (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1))
    inside = cv2.erode(np.isin(plan.rooms, list(plan.halls)).astype(np.uint8), np.ones((5, 5), np.uint8))
    plan.things &= inside.astype(np.uint8)
    plan.gates = 0.5
    return plan


def _stand_walls(rng: Generator, things: Mask, hall: Rectangle) -> None:
    """Put pieces of wall into a hall, straight, or round a corner; some begin at its wall."""
    x0, y0, x1, y1 = hall
    every_m2 = rng.uniform(*WALL_PIECE_M2)
    thick = max(1, between(rng, 0.05, 0.3))
    for _ in range(1 + rng.poisson((x1 - x0) * (y1 - y0) / cells(1.0) ** 2 / every_m2)):
        lies = chance(rng, 0.5)
        across = (x1 - x0) if lies else (y1 - y0)
        long = min(between(rng, *WALL_PIECE_M), round(WALL_PIECE_SHARE_MAX * across))
        left_over = across - long
        if left_over <= cells(PASSAGE_M):
            continue
        at = 0 if chance(rng, 0.25) else int(rng.integers(0, left_over + 1))
        aside = round(((y1 - y0) if lies else (x1 - x0)) * rng.uniform(0.15, 0.85))
        first = (x0 + at, y0 + aside) if lies else (x0 + aside, y0 + at)
        last = (first[0] + long, first[1]) if lies else (first[0], first[1] + long)
        corners = [first, last]
        if chance(rng, 0.3):
            reach = min(between(rng, 0.5, 3.0), long) * int(rng.choice([-1, 1]))
            corners.append((last[0], last[1] + reach) if lies else (last[0] + reach, last[1]))
        piece, near = np.zeros_like(things), np.zeros_like(things)
        line = [np.array(corners, np.int32)]
        cv2.polylines(piece, line, False, 1, thick)
        cv2.polylines(near, line, False, 1, 2 * cells(PASSAGE_M))
        if not (near & things).any():
            things |= piece
