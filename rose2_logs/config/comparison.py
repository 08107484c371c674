"""Parameters of the comparison of two runs: how one layout lies over another, and what is a change."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from rose2_logs.config.fields import ParameterBlock, number


@dataclass(frozen=True, repr=False)
class ComparisonParameters(ParameterBlock):
    """Comparison of two runs in one building: placement, rooms, walls."""

    block: ClassVar[str] = "comparison"

    wall_reach_m: float = number(
        0.2,
        "m",
        "A wall of the other map this near is the same: a wall's thickness, and SLAM's drift.",
        0.001,
    )
    wall_reach_min_cells: float = number(2.0, "cells", "And this many cells of the coarser map at least.")
    contradiction: float = number(
        0.5,
        "share",
        "A wall on free space counts this much against a placement: maps of one building, drawn years apart, "
        "still share more walls than not.",
    )
    raster_m: float = number(
        0.2, "m", "Cells of the rasters whose shifts are searched; the fit bridges two of them.", 0.01
    )
    raster_max_cells: int = number(
        1024, "cells", "Most such cells along a side; they are larger in larger maps.", 16, 2**15
    )
    wall_blur_m: float = number(
        0.5, "m", "Nearness to a wall falls from 1 to 0 over this length: the fit's first gate.", 0.01
    )
    turns_max: int = number(
        6, "turns", "Turns tried, each both ways: two for walls at right angles, more for others.", 1, 1000
    )
    turn_min_gap_rad: float = number(
        math.radians(3.0), "rad", "Turns closer than this are one: the fit bridges them.", 1e-3
    )
    starts_per_turn: int = number(3, "starts", "Best positions of each turn.", 1, 1000)
    starts_fitted: int = number(10, "starts", "Best positions of all turns, which are fitted.", 1, 1000)
    start_min_gap_m: float = number(1.0, "m", "Starts of one turn are this far apart.")
    points_max: int = number(
        4000, "points", "Wall cells of each map, evenly taken, that agreement is counted over.", 10, 10**6
    )
    faces_min_share: float = number(
        0.05,
        "share",
        "With fewer occupied cells beside free ones, as in blurred drawings, all occupied cells are walls.",
    )
    same_place_m: float = number(
        1.0, "m", "Placements closer than this are one and not each other's alternative."
    )
    same_turn_rad: float = number(math.radians(3.0), "rad", "The same of their turns.")
    same_building_min_score: float = number(
        0.4,
        "score",
        "From this score on two maps show one building: pairs of the benchmark that do have 0.54 or more, "
        "others 0.34 or less.",
    )
    parts_min_agreement: float = number(
        0.85,
        "share",
        "So do parts of one that agree by this where both are explored: others do by 0.8 or less.",
    )
    parts_min_common_share: float = number(0.2, "share", "And have this share of the smaller one in common.")
    ambiguous_share: float = number(
        0.85, "share", "Another placement with this share of the score leaves it open how the two lie."
    )
    scaled_min_score: float = number(
        0.6,
        "score",
        "A placement at another scale needs this: two buildings of the benchmark reach 0.43, one at two "
        "scales 0.93.",
    )
    scale_min_change: float = number(0.03, "share", "Scales nearer to 1 are no other scale.")
    outside_share: float = number(
        0.01,
        "share",
        "A building's sides leave out this share of its walls at each end: what was seen through a window.",
        0,
        0.49,
    )
    same_room_min_iou: float = number(
        0.8, "share", "Rooms that overlap by this are the same: as in the tables of a run."
    )
    pair_min_iou: float = number(
        0.3, "share", "Rooms that overlap by less are no pair unless one is part of the other."
    )
    part_min_share: float = number(
        0.5, "share", "A room is part of another when most of it lies in it: never of two at once."
    )
    explored_min_share: float = number(
        0.5, "share", "A room is missing where the other run has explored most of its place."
    )
    sample_m: float = number(
        0.1, "m", "What is explored is looked up every so many meters: two cells of 5 cm.", 0.001
    )
    samples_max: int = number(
        250_000,
        "points",
        "Most points looked up for one room; coarser in halls of more than 50 m.",
        100,
        10**9,
    )
    wall_step_m: float = number(
        0.1, "m", "Walls are looked at every so many meters: two cells of 5 cm.", 0.001
    )
    change_min_length_m: float = number(
        0.5, "m", "Shorter stretches of wall are no change: the least jamb beside a door is as long."
    )
    gap_max_m: float = number(
        0.3, "m", "Stretches of one wall closer than this are one: furniture may hide it between them."
    )
    beyond_m: float = number(
        1.0, "m", "Walls are followed this far beyond their segments where cells are occupied."
    )
    moved_max_m: float = number(
        1.5, "m", "A new wall further from a missing one is another wall: less than the narrowest corridor."
    )
    moved_max_turn_rad: float = number(math.radians(10.0), "rad", "And at most so much turned against it.")
    moved_min_overlap: float = number(
        0.5, "share", "And beside at least this share of the shorter one: most of it."
    )
