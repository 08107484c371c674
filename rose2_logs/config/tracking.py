"""Parameters of what comes after the rooms of a map: how sure they are, and their identity over a run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from rose2_logs.config.fields import ParameterBlock, number
from rose2_logs.errors import ParameterError

MOST_SEARCH_STEPS = 40
"""Steps of the search to each side: 6,561 positions for each rotation, which a gigabyte holds."""


@dataclass(frozen=True, repr=False)
class QualityParameters(ParameterBlock):
    """How certain the rooms of a map are: how much of their outlines is supported by walls."""

    block: ClassVar[str] = "quality"

    outline_step_m: float = number(
        0.1, "m", "Spacing of the points at which outlines are examined: two cells of 5 cm.", 0.001
    )
    wall_reach_m: float = number(
        0.2,
        "m",
        "Occupied cells within this distance support an outline, which runs along the center of walls.",
        0.0,
    )


@dataclass(frozen=True, repr=False)
class TrackingParameters(ParameterBlock):
    """Identity of rooms over the snapshots of a run."""

    block: ClassVar[str] = "tracking"
    ascending: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("fit_gate_4_m", "fit_gate_3_m", "fit_gate_2_m", "fit_gate_1_m"),
        ("fit_neighbors", "fit_min_points", "fit_points"),
    )

    match_min_iou: float = number(
        0.2, "share", "Minimum overlap for a room to continue a track; half seen rooms double in size.", 0, 1
    )
    part_min_share: float = number(
        0.5, "share", "A room is part of another room if most of it is inside: never of two at once.", 0, 1
    )
    match_power: int = number(
        2,
        "1",
        "Pairs are weighted by this power of their overlap, so that one good pair beats two poor ones.",
        1,
        10,
    )
    shapes_kept: int = number(
        3, "shapes", "Shapes that a track remembers: the whole room, part of it, and an earlier one.", 1, 1000
    )
    shape_same_iou: float = number(
        0.8, "share", "A shape that overlaps a remembered one by this much replaces it.", 0, 1
    )
    lost_kept: int = number(
        500,
        "tracks",
        "Lost rooms that are remembered, a few kilobytes each; those lost longest are dropped first.",
    )
    shift_min_m: float = number(
        0.1, "m", "The whole map has moved if its walls moved by this on average: two cells of 5 cm.", 0.0
    )
    shift_search_m: float = number(
        2.0, "m", "Largest shift of the whole map, as in a loop closure, that is searched.", 0.0, 50.0
    )
    shift_search_rad: float = number(
        math.radians(5.0), "rad", "Largest rotation of the whole map that is searched.", 0.0, math.pi
    )
    shift_min_share: float = number(
        0.5, "share", "A motion of the map is accepted if it makes most walls coincide.", 0, 1
    )
    back_projected_min_area_m2: float = number(
        1.5,
        "m2",
        "Smaller pieces of a room of the last map do not count as the room yet: half the smallest room.",
        0.0,
    )
    fit_points: int = number(
        2000,
        "points",
        "Wall cells, evenly sampled, that are aligned with the next map: enough for millimeters.",
        3,
        10**5,
    )
    fit_min_points: int = number(
        50, "points", "Fewer wall cells cannot determine the alignment: two meters of wall.", 3, 10**5
    )
    fit_neighbors: int = number(
        12, "points", "Neighboring wall cells that give the direction of a wall: half a meter of it.", 2, 1000
    )
    fit_gate_1_m: float = number(
        0.5,
        "m",
        "Distance of corresponding walls in the fit's first step, at most: a loop closure's jump.",
        0.001,
    )
    fit_gate_2_m: float = number(0.3, "m", "The same in its second step.", 0.001)
    fit_gate_3_m: float = number(0.2, "m", "The same in its third step.", 0.001)
    fit_gate_4_m: float = number(0.1, "m", "The same in its last step: drift.", 0.001)
    fit_gate_min_cells: float = number(
        2.0, "cells", "Minimum of all these distances: the two faces of a wall, plus noise."
    )
    fit_damping: float = number(
        1e-3,
        "share",
        "Share of the walls that must be perpendicular to a direction to determine the shift along it.",
        1e-9,
    )
    fit_max_rounds: int = number(
        8, "rounds", "Most iterations of each step of the fit; it converges earlier.", 1, 1000
    )
    fit_settled_m: float = number(1e-4, "m", "The fit has converged when no point moves further than this.")
    fit_sure_share: float = number(
        0.75, "share", "If this share of the walls coincides, no other position is searched."
    )
    fit_better_share: float = number(
        0.05, "share", "A map has moved if this share more of its walls coincide than without the motion."
    )
    search_points: int = number(500, "points", "Wall cells used in the search over many positions.", 3, 2000)
    search_raster_m: float = number(0.1, "m", "Cell size of the grid on which positions are searched.", 0.02)
    search_step_m: float = number(
        0.3, "m", "Step of the search: less than the largest distance in the fit's first step.", 0.01
    )
    search_candidates: int = number(
        5, "positions", "Number of best positions of the search that are refined by the fit.", 1, 100
    )
    settled_area_tolerance: float = number(
        0.1, "share", "The area of a room has settled when it is within this share of its last area."
    )
    last_shape_min_iou: float = number(
        0.8, "share", "A room's shape is right from this overlap with its last one on: decimeters off in 5 m."
    )
    final_room_min_iou: float = number(
        0.7,
        "share",
        "A room of the last map is there when a room overlaps it by this much: not if a neighbor half its "
        "size is joined to it (2/3), nor if a third of it is missing.",
        0,
        1,
    )
    final_min_share: float = number(
        0.8,
        "share",
        "The layout is final when this share of it, by area, is there: one room in five, as those at the "
        "frontier, may still change.",
        0,
        1,
    )
    lasting_min_maps: int = number(
        3,
        "maps",
        "Tracks that fewer maps show, and the last one does not, are brief: pieces of rooms at the frontier, "
        "which one map has and the next one may repeat.",
        1,
        10**6,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shift_search_m > MOST_SEARCH_STEPS * self.search_step_m:
            raise ParameterError(
                f"tracking.shift_search_m is {self.shift_search_m}; it must not be above {MOST_SEARCH_STEPS} "
                f"times tracking.search_step_m, which is {self.search_step_m}"
            )
