"""Which plans are made, and how often."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from fit_grouping.buildings.faint_borders import cellular, hallways, partitions
from fit_grouping.buildings.joined_rooms import loop, openhome, suites
from fit_grouping.buildings.large_floors import gallery, warehouse, wings
from fit_grouping.buildings.plans import Plan, campus, chamfers, cubicles, hall, home, office, passage
from fit_grouping.buildings.raster import Generator
from fit_grouping.buildings.villas import villa
from fit_grouping.buildings.workplaces import arena, depot, faculty, offices, shop

MAKERS: tuple[tuple[Callable[[Generator], Plan], float], ...] = (
    (villa, 0.19),
    (home, 0.11),
    (office, 0.08),
    (cubicles, 0.03),
    (campus, 0.04),
    (passage, 0.03),
    (hall, 0.04),
    (offices, 0.24),
    (faculty, 0.13),
    (depot, 0.04),
    (arena, 0.04),
    (shop, 0.03),
    (suites, 0.13),
    (loop, 0.07),
    (openhome, 0.14),
    (wings, 0.08),
    (gallery, 0.06),
    (warehouse, 0.05),
    (hallways, 0.12),
    (cellular, 0.12),
    (partitions, 0.06),
)
"""Makers of plans and their shares, relative to each other."""
KINDS = tuple(maker.__name__ for maker, _ in MAKERS)
"""Names of the kinds of plans."""
TIDY_CORNERS = {
    "villa": (0.0, 0.0),
    "passage": (0.0, 0.0),
    "hall": (0.5, 0.0),
    "depot": (0.2, 0.0),
    "shop": (0.5, 0.0),
    "arena": (0.1, 0.1),
    "loop": (0.1, 0.1),
    "openhome": (0.25, 0.35),
    "wings": (0.1, 0.1),
    "gallery": (0.4, 0.1),
    "warehouse": (0.2, 0.0),
    "hallways": (0.2, 0.2),
    "cellular": (0.2, 0.1),
    "partitions": (0.4, 0.0),
}
"""How many corners are cut off a building of a kind and how many of its rooms are cut in two, on average."""
USUAL_CORNERS = (0.35, 0.15)


def make_plan(rng: Generator, kinds: Collection[str] = KINDS) -> Plan:
    """Lay out a building of a random kind of the given ones."""
    makers, shares = zip(*[made for made in MAKERS if made[0].__name__ in kinds], strict=True)
    plan: Plan = makers[rng.choice(len(makers), p=np.array(shares) / sum(shares))](rng)
    chamfers(rng, plan, *TIDY_CORNERS.get(plan.kind, USUAL_CORNERS))
    plan.tidy()
    return plan
