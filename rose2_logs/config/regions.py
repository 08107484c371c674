"""Parameters of rooms by fitted borders."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import ClassVar

from rose2_logs.config.fields import ParameterBlock, number

DETAIL_MOST = 20.0
"""Greatest and, negative, least detail, log odds: surer than any answer."""


@dataclass(frozen=True, repr=False)
class RegionParameters(ParameterBlock):
    """Stage C with fitted borders: atoms of the floor, and how far they are joined."""

    block: ClassVar[str] = "regions"
    ascending: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("surroundings_rest_min_edge", "surroundings_min_edge"),
    )

    clean_min_score: float = number(
        0.35,
        "score",
        "Clean map that the atoms' faces come from: a wall that goes on for a third of a room's side.",
        0,
        1,
    )
    speck_max_m: float = number(0.25, "m", "Shorter occupied pieces bound no basin: legs, noise.", 0.0)
    summit_reach_m: float = number(
        0.5, "m", "Summits of the clearance are this far apart at least: half of the narrowest room.", 0.0
    )
    clearance_blur_m: float = number(0.05, "m", "Blur of the clearance: a cell of 5 cm.", 0.001)
    atom_min_m2: float = number(
        0.15,
        "m2",
        "Smaller pieces go to the neighbor that they touch most: less than the floor of any closet.",
        0.0,
    )
    answer_views: int = number(
        1,
        "1",
        "Views that the network sees: the map as it is, and turned by half. The mean of both gained nothing "
        "on maps left out, for twice the time of the network.",
        1,
        2,
    )
    answer_weight: float = number(
        1.0,
        "1",
        "Weight of the network's log odds beside the trees' 1: in a logistic regression of joins of maps "
        "left out both count alike, 0.85 and 0.84.",
        0.0,
    )
    answer_least: float = number(
        0.001,
        "probability",
        "Added to a mean answer and to its opposite, so that no answer is surer than 1 in 1000: it is told "
        "in such steps.",
        1e-6,
        1.0,
    )
    join_margin: float = number(
        0.5,
        "log odds",
        "A wrong join costs more than a wrong border: the regression of `answer_weight` gives 0.6, and 0.5 "
        "to 0.75 are equally good on maps left out.",
        -20,
        20,
    )
    detail: float = number(
        0.0,
        "log odds",
        "Regions are joined if that is likelier right than wrong; more detail asks for surer joins and gives "
        "more and smaller rooms, less gives fewer.",
        -DETAIL_MOST,
        DETAIL_MOST,
    )
    room_min_log_odds: float = number(
        0.0, "log odds", "Regions are rooms rather than outside from even odds on.", -20, 20
    )
    small_room_max_m2: float = number(
        5.0,
        "m2",
        "Regions below are looked at once more: rooms of their own, or part of a neighbor? Closets and "
        "toilets are smaller.",
        0.0,
    )
    small_room_min_log_odds: float = number(
        -0.5,
        "log odds",
        "Small regions are rooms of their own from these odds on; 0.35 to 0.4 was best on maps left out.",
        -20,
        20,
    )
    room_min_width_m: float = number(
        0.6,
        "m",
        "What is nowhere this wide is no room: narrower than a door leaf, as rays through windows are, and "
        "white beside outer walls. On maps left out 0.55 to 0.65 are equally good.",
        0.0,
    )
    outside_max_share: float = number(
        0.4,
        "share",
        "Where more than this share of a map would be outside, nothing is, but for `walled_min_share`: it is "
        "18 % at most on 98 maps with true rooms. With 0 nothing ever is.",
        0,
        1,
    )
    walled_min_share: float = number(
        0.7,
        "share",
        "But where this much of the outline of what would be left is wall, and not unknown, the rest is "
        "outside, however large: rays through windows may take more than the rooms. Of 49 drawn buildings "
        "with windows 0.6 to 0.75 are equally good.",
        0,
        1,
    )
    walled_min_rooms: int = number(
        2,
        "rooms",
        "If so many rooms would be left: the one room that a robot has looked into is walled, too, and what "
        "it has seen of the others is not. With 1, 2, 3 the rooms of 49 drawn buildings with windows agree "
        "by 93, 92, 91 %, and those of 43 first scans by 78, 80, 80 %.",
        1,
        10**6,
    )
    walled_min_left: float = number(
        0.15,
        "share",
        "If at least this share of a map would be left: of a first scan, less may be walled by chance.",
        0,
        1,
    )
    surroundings_min_edge: float = number(
        0.25,
        "share",
        "A region on this share of the map's edge is white around a drawn building, if such regions hold "
        "twice as much together; rooms are behind walls.",
        0,
        1,
    )
    surroundings_rest_min_edge: float = number(
        0.05,
        "share",
        "Beside such regions, others on this share of the edge are cut off from them: rooms hold less.",
        0,
        1,
    )
    building_min_share: float = number(
        0.03,
        "share",
        "A building takes at least this share of its drawing; where less would be left, nothing lies around.",
        0,
        1,
    )
    room_min_area_m2: float = number(1.0, "m2", "Smaller regions are not rooms: a toilet has 1 m2.", 0.0)
    loose_reach_m: float = number(
        0.5, "m", "Free cells too few for an atom belong to the room this near.", 0.0
    )
    piece_gap_m: float = number(
        0.3, "m", "Pieces of a room hang together across gaps of this much noise; others are rooms.", 0.0
    )
    object_max_m2: float = number(
        3.0,
        "m2",
        "Pieces below that a wall closes in the midst of their room lie within an object, such as a stack of "
        "pallets, and are no rooms. Stalls are as small, but beside other rooms or the unknown.",
        0.0,
    )
    object_wall_m: float = number(
        0.3, "m", "What lies around such a piece is looked at across a wall of this thickness.", 0.0
    )
    object_min_surrounded: float = number(
        0.9, "share", "A piece with this much of its own room around it lies in its midst.", 0, 1
    )
    door_max_width_m: float = number(1.4, "m", "Wider openings between rooms are not doors.", 0.0)


RegionParameters.groupings = dict.fromkeys((each.name for each in fields(RegionParameters)), ("fitted",))
