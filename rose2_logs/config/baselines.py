"""Parameters of the methods that ROSE2 is compared with, as in the survey by Bormann et al. (ICRA 2016)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from rose2_logs.config.fields import ParameterBlock, number

METHODS = ("rose2", "morphological", "distance", "voronoi")
"""Names of the segmentation methods: the paper's, and those that it is compared with."""


@dataclass(frozen=True, repr=False)
class MorphologicalParameters(ParameterBlock):
    """Baseline: morphological segmentation (survey of Bormann et al., ICRA 2016)."""

    block: ClassVar[str] = "morphological"
    ascending: ClassVar[tuple[tuple[str, ...], ...]] = (("room_min_area_m2", "room_max_area_m2"),)

    room_min_area_m2: float = number(
        0.8, "m2", "A part left by erosion is a room above this area; the survey's value."
    )
    room_max_area_m2: float = number(47.0, "m2", "And below this area; the survey's value.")
    max_rounds: int = number(73, "rounds", "Rounds of erosion, one cell each; the survey's value.", 0, 10**5)


@dataclass(frozen=True, repr=False)
class DistanceParameters(ParameterBlock):
    """Baseline: distance transform segmentation (survey of Bormann et al., ICRA 2016)."""

    block: ClassVar[str] = "distance"
    ascending: ClassVar[tuple[tuple[str, ...], ...]] = (("room_min_area_m2", "room_max_area_m2"),)

    room_min_area_m2: float = number(0.35, "m2", "Minimum area of a room's seed; the survey's value.")
    room_max_area_m2: float = number(163.0, "m2", "Maximum area of a room's seed; the survey's value.")


@dataclass(frozen=True, repr=False)
class VoronoiBaselineParameters(ParameterBlock):
    """Baseline: Voronoi segmentation (survey of Bormann et al., ICRA 2016)."""

    block: ClassVar[str] = "voronoi"
    ascending: ClassVar[tuple[tuple[str, ...], ...]] = (("room_min_area_m2", "room_max_area_m2"),)

    room_min_area_m2: float = number(0.1, "m2", "Minimum area of a piece between cuts; the survey's value.")
    room_max_area_m2: float = number(1e6, "m2", "Maximum area of a piece; the survey's value: any.")
    clear_rounds: int = number(2, "rounds", "Minimum distance of the graph from obstacles, in cells.", 0, 100)
    prune_passes: int = number(
        100, "passes", "Loose ends of the graph shorter than this are removed.", 0, 10**5
    )
    neighborhood_cells2: float = number(
        280.0, "cells^2", "Cells of a neighborhood times the distance from obstacles; the survey's value.", 1
    )
    neighborhood_max_rounds: int = number(
        150, "rounds", "Most steps from a neighborhood's center; the survey's value.", 0, 10**5
    )
    critical_min_gap: float = number(
        0.5, "1", "Closer critical points, by their distance from obstacles, compete; the survey's value."
    )


@dataclass(frozen=True, repr=False)
class VoronoiMergeParameters(ParameterBlock):
    """Baseline: which pieces the Voronoi segmentation joins; the values are those of the survey's program.

    Borders and walls are shares of a perimeter.
    """

    block: ClassVar[str] = "voronoi_merge"

    dead_end_max_area_m2: float = number(12.5, "m2", "Area of a room with one neighbor; the survey's value.")
    dead_end_max_wall: float = number(0.75, "share", "Wall of a room with one neighbor.", 0, 1)
    small_max_area_m2: float = number(2.0, "m2", "Area of a small room.")
    small_min_border: float = number(0.2, "share", "Border of a small room with its target.", 0, 1)
    small_target_max_wall: float = number(0.8, "share", "Wall of a small room's target.", 0, 1)
    niche_min_cover: float = number(0.98, "share", "Wall and border of a niche: it has no other side.", 0, 1)
    niche_min_wall: float = number(0.5, "share", "Wall of a niche.", 0, 1)
    niche_min_border: float = number(0.15, "share", "Border of a niche with its target.", 0, 1)
    niche_target_min_cover: float = number(
        0.95, "share", "Wall and two longest borders of a niche's target with more than two neighbors.", 0, 1
    )
    open_min_border: float = number(0.2, "share", "Border of a room that is open to its target.", 0, 1)
    half_open_min_border: float = number(0.1, "share", "The same where walls fit a corridor's piece.", 0, 1)
    half_open_wall: float = number(
        0.95, "share", "Wall and twice the border of a corridor's piece, at least.", 0, 1
    )
    open_min_border_back: float = number(0.1, "share", "The same border in the target's perimeter.", 0, 1)
    wide_min_border: float = number(0.4, "share", "Border with which any room is joined.", 0, 1)
