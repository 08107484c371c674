"""Parameters of the paper's stage C, and of the shapes of rooms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from rose2_logs.config.fields import BY_FACES, ParameterBlock, choice, number


@dataclass(frozen=True, repr=False)
class FloorPlanParameters(ParameterBlock):
    """Stage C: edge weights, faces, rooms (paper, III-C)."""

    block: ClassVar[str] = "floor_plan"
    groupings: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **dict.fromkeys(
            (
                "blind_look_m",
                "known_power",
                "join_min_open_m",
                "leak_max_width_m",
                "room_min_area_m2",
                "room_min_clearance_m",
            ),
            BY_FACES,
        ),
        **dict.fromkeys(
            (
                "join_min_openness",
                "join_min_passage",
                "passage_wide",
                "passage_look_widths",
                "passage_look_max_m",
                "passage_look_points",
                "passage_look_samples",
                "doorway_max_width_m",
                "jamb_length_m",
                "jamb_min_fill",
            ),
            ("walls",),
        ),
        "dbscan_max_weight": ("dbscan",),
    }

    wall_tolerance_m: float = number(
        0.15, "m", "A wall counts for an edge within this distance: half a wall's thickness, plus drift.", 0.0
    )
    blind_look_m: float = number(
        0.4,
        "m",
        "A wall without free space within this distance behind it hides what is there; more than its "
        "thickness; 0 turns this off.",
        0.0,
    )
    frame_margin_m: float = number(
        1.0, "m", "The frame around the map is this far away, so that the outer walls are inside.", 0.01
    )
    face_min_seen: float = number(
        0.1, "share", "A face seen less than this is outside: it was seen by rays through windows.", 0, 1
    )
    shape_min_seen: float = number(
        0.1,
        "share",
        "Nothing is predicted in a face seen less than this: rays say little of a room.",
        0,
        1,
    )
    shape_reach_m: float = number(
        3.0, "m", "A room is predicted this far beyond what was seen of it: the other half of a room.", 0.0
    )
    shape_share_of_face: float = number(
        0.1,
        "share",
        "A room with this share of what was seen of a face may be predicted there; less is due to "
        "borders that were straightened.",
        0,
        1,
    )
    shape_gap_m: float = number(
        0.2,
        "m",
        "Gaps in walls up to this width let no room through: drift and far rays leave them.",
        0.0,
    )
    shape_min_open: float = number(
        0.3,
        "share",
        "Unseen space is a room's if this share of its known border is open to it: behind walls it is less.",
        0,
        1,
    )
    shape_wall_m: float = number(
        0.15,
        "m",
        "A shape reaches this far into the wall around it: half a wall's thickness, plus drift.",
        0.0,
    )
    shape_fill_max_m2: float = number(
        1.0, "m2", "Smaller unseen places within a room are furniture and its shadows.", 0.0
    )
    shape_simplify_m: float = number(
        0.1, "m", "Steps of the cells of a shape's outline up to this size are straightened.", 0.0
    )
    grouping: str = choice(
        "fitted",
        ("fitted", "walls", "dbscan"),
        "How the floor is joined to rooms: by the fitted strength of borders, by the walls on whole borders, "
        "or pair by pair with DBSCAN as in the paper.",
    )
    known_power: float = number(
        2.0,
        "1",
        "Of a half seen face, three quarters of what is behind its walls is unknown: 1 - 0.5^2.",
        0.1,
        10,
    )
    dbscan_max_weight: float = number(
        0.24, "share", "DBSCAN joins faces with edges up to this weight: exp(-w / 0.125) = 0.15.", 0.001, 1
    )
    join_min_openness: float = number(
        0.7, "share", "Faces are joined if at least this share of their known border is open.", 0, 1
    )
    join_min_open_m: float = number(
        0.15, "m", "Minimum open border for faces to be joined: three cells of 5 cm."
    )
    join_min_passage: float = number(
        0.7,
        "1",
        "Faces are joined if the passage between them is this wide relative to the narrower face.",
        0,
    )
    passage_wide: float = number(
        2.0,
        "1",
        "Passages wider than this, relative to the room, are not preferred over those of this width.",
        0.1,
    )
    passage_look_widths: float = number(
        2.0, "1", "Distance from a passage at which its width is compared with the room's, in widths.", 0.0
    )
    passage_look_max_m: float = number(3.0, "m", "Upper limit of this distance: half a large room.", 0.0)
    passage_look_points: int = number(
        3, "points", "Points of a passage from which the width of the room is measured: its quarters.", 1, 100
    )
    passage_look_samples: int = number(
        25, "samples", "Samples per measurement: at 3 m one every 12 cm.", 2, 10_000
    )
    doorway_max_width_m: float = number(
        2.0, "m", "A gap in a wall up to this width is a doorway: a double door.", 0.0
    )
    jamb_length_m: float = number(0.5, "m", "Wall next to a gap that makes it a doorway: a jamb.", 0.01)
    jamb_min_fill: float = number(0.6, "share", "Minimum share of a jamb that is covered by walls.", 0, 1)
    leak_max_width_m: float = number(
        0.5,
        "m",
        "Narrower free space outside rooms was seen by single rays; wider free space is part of a room.",
        0.0,
    )
    border_strip_m: float = number(
        0.25, "m", "Narrower strips of a room on the other side of a wall go to the room there.", 0.0
    )
    room_min_area_m2: float = number(3.0, "m2", "Smaller pieces of free space are not rooms.", 0.0)
    room_min_clearance_m: float = number(0.6, "m", "Half the width of the narrowest room.", 0.0)
