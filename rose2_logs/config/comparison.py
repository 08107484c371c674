"""Parameters of the comparison of two runs: how layouts are aligned, and what counts as a change."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from rose2_logs.config.fields import ParameterBlock, number


@dataclass(frozen=True, repr=False)
class ComparisonParameters(ParameterBlock):
    """Comparison of two runs in one building: placement, rooms, walls."""

    block: ClassVar[str] = "comparison"
    ascending: ClassVar[tuple[tuple[str, ...], ...]] = (("pair_min_iou", "same_room_min_iou"),)

    wall_reach_m: float = number(
        0.2,
        "m",
        "A wall of the other map within this distance is the same one: a wall's thickness, plus drift.",
        0.001,
    )
    wall_reach_min_cells: float = number(
        2.0, "cells", "The same distance is at least this many cells of the coarser map."
    )
    contradiction: float = number(
        0.5,
        "share",
        "Weight of a wall on free space against a placement: maps of one building, even years apart, still "
        "share most walls.",
    )
    raster_m: float = number(
        0.2,
        "m",
        "Cell size of the grids on which shifts are searched; the fit corrects up to two cells.",
        0.01,
    )
    raster_max_cells: int = number(
        1024,
        "cells",
        "Most cells of these grids along a side; in larger maps the cells are larger.",
        16,
        2**13,
    )
    wall_blur_m: float = number(
        0.5,
        "m",
        "Closeness to a wall falls from 1 to 0 over this distance: as in the fit's first step.",
        0.01,
    )
    turns_max: int = number(
        6,
        "turns",
        "Rotations tried, each also turned by 180 degrees: two for right angles, more for others.",
        1,
        180,
    )
    turn_min_gap_rad: float = number(
        math.radians(3.0), "rad", "Rotations closer than this are one: the fit corrects the difference.", 1e-3
    )
    starts_per_turn: int = number(3, "starts", "Number of best positions of each rotation.", 1, 100)
    starts_fitted: int = number(
        10, "starts", "Number of best positions of all rotations that are refined by the fit.", 1, 100
    )
    start_min_gap_m: float = number(1.0, "m", "Minimum distance between the positions of one rotation.")
    points_max: int = number(
        4000, "points", "Wall cells of each map, evenly sampled, for which agreement is counted.", 10, 10**5
    )
    faces_min_share: float = number(
        0.05,
        "share",
        "If fewer occupied cells are next to free ones, as in blurred drawings, all of them are walls.",
    )
    same_place_m: float = number(1.0, "m", "Placements closer than this are the same one, not alternatives.")
    same_turn_rad: float = number(math.radians(3.0), "rad", "The same for their rotations.")
    same_building_min_score: float = number(
        0.4,
        "score",
        "From this score on, two maps show the same building: in the benchmark such pairs have 0.54 or more, "
        "others 0.34 or less.",
    )
    parts_min_agreement: float = number(
        0.85,
        "share",
        "So do maps that agree by this where both are explored; other pairs agree by 0.8 or less.",
    )
    parts_min_common_share: float = number(
        0.2, "share", "For this, they must have this share of the smaller one in common."
    )
    ambiguous_share: float = number(
        0.85, "share", "With another placement at this share of the score, the alignment is ambiguous."
    )
    scaled_min_score: float = number(
        0.6,
        "score",
        "Minimum score of a placement at another scale: different buildings reach 0.43, one building at two "
        "scales 0.93.",
    )
    scale_min_change: float = number(0.03, "share", "Scales closer to 1 do not count as another scale.")
    outside_share: float = number(
        0.01,
        "share",
        "Share of the walls at each side that is ignored for the building's extent: seen through windows.",
        0,
        0.49,
    )
    same_room_min_iou: float = number(
        0.8, "share", "Rooms that overlap by this much are the same, as in the tables of a run."
    )
    pair_min_iou: float = number(
        0.3, "share", "Rooms that overlap by less are not a pair, unless one is part of the other."
    )
    part_min_share: float = number(
        0.5, "share", "A room is part of another room if most of it is inside: never of two at once."
    )
    explored_min_share: float = number(
        0.5, "share", "A room is missing only if the other run has explored most of its area."
    )
    sample_m: float = number(
        0.1, "m", "Spacing of the points at which explored areas are sampled: two cells of 5 cm.", 0.001
    )
    samples_max: int = number(
        250_000,
        "points",
        "Most such points per room; the spacing is larger in halls of more than 50 m.",
        100,
        10**7,
    )
    wall_step_m: float = number(
        0.1, "m", "Spacing of the points at which walls are examined: two cells of 5 cm.", 0.001
    )
    change_min_length_m: float = number(
        0.5, "m", "Shorter stretches of wall are not a change: the length of the shortest jamb."
    )
    gap_max_m: float = number(
        0.3, "m", "Stretches of one wall closer than this are joined: furniture may hide what is between."
    )
    beyond_m: float = number(
        1.0, "m", "Walls are followed this far beyond their segments as long as cells are occupied."
    )
    moved_max_m: float = number(
        1.5, "m", "A new wall within this distance of a missing one is the same, moved: less than a corridor."
    )
    moved_max_turn_rad: float = number(math.radians(10.0), "rad", "Largest angle between the two.")
    moved_min_overlap: float = number(
        0.5, "share", "Minimum share of the shorter one that is next to the other: most of it."
    )
