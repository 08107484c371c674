"""Parameters of the paper's stage D, and of doorways."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from rose2_logs.config.fields import BY_FACES, ParameterBlock, number


@dataclass(frozen=True, repr=False)
class TopologyParameters(ParameterBlock):
    """Stage D: Voronoi graph, splitting of rooms, doorways (paper, III-D)."""

    block: ClassVar[str] = "topology"
    groupings: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        (
            "summit_reach_m",
            "passage_min_ratio",
            "split_min_clearance_m",
            "split_min_area_m2",
            "split_min_purity",
            "cut_tail_share",
            "max_rounds",
        ),
        BY_FACES,
    )

    clearance_blur_cells: float = number(
        1.0,
        "cells",
        "Blur of the clearance, so that steps of the grid do not become summits.",
        0.1,
        100,
    )
    summit_reach_m: float = number(
        0.15, "m", "A summit is the point of highest clearance within this distance: a wall's thickness.", 0.0
    )
    passage_min_ratio: float = number(
        0.2,
        "share",
        "A passage with at least this share of the clearance next to it joins; gaps in walls have less.",
        0,
        1,
    )
    split_min_clearance_m: float = number(
        0.5, "m", "Parts with less clearance on both sides of their center line are niches.", 0.0
    )
    split_min_area_m2: float = number(
        3.0, "m2", "Smaller parts are niches: the area of the smallest room.", 0.0
    )
    split_min_purity: float = number(0.98, "share", "A cut leaves this share of each part on its side.", 0, 1)
    cut_tail_share: float = number(
        0.02,
        "share",
        "A cut is midway between two parts, ignoring this share of each at its fringe.",
        0,
        0.5,
    )
    max_rounds: int = number(5, "1", "Rounds of splitting; the paper's implementation has five.", 0, 100)
    doorway_min_width_m: float = number(
        0.4,
        "m",
        "Narrower contacts of two rooms are noise, or the rest of a door between furniture: a robot vacuum, "
        "the narrowest of common robots, is 0.35 m wide.",
        0.0,
    )
    doorway_gap_cells: float = number(
        2.9,
        "cells",
        "Contacts of two rooms this close are one doorway: a cell may be missing between them.",
        1.0,
    )
