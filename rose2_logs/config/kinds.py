"""Parameters of the guess what kind of room a room is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from rose2_logs.config.fields import ParameterBlock, number

KINDS = ("corridor", "hall", "closet", "room")
"""Kinds that are guessed; the first whose thresholds hold."""


@dataclass(frozen=True, repr=False)
class KindParameters(ParameterBlock):
    """Guess of the kind of a room from its shape alone; no other result depends on it."""

    block: ClassVar[str] = "kinds"

    corridor_min_elongation: float = number(
        3.5,
        "1",
        "Least length over width of a corridor; rooms seldom reach 3. The width is of the largest circle "
        "in it, the length its area over this width, so that corridors with bends and rings count too.",
        1.0,
        1000.0,
    )
    corridor_min_width_m: float = number(
        0.8,
        "m",
        "Least width of a corridor: what is narrower is a niche, or what was seen through a gap.",
        0.0,
        50.0,
    )
    corridor_max_width_m: float = number(
        4.5,
        "m",
        "Greatest width of a corridor, at its widest place: about that of two wide ones that meet.",
        0.1,
        50.0,
    )
    hall_min_m2: float = number(
        80.0, "m2", "Least area of a hall: more than a classroom or a living room.", 0.1, 1e6
    )
    closet_max_m2: float = number(
        3.0, "m2", "Greatest area of a closet: less than the smallest bedroom or bathroom.", 0.0, 1e6
    )
    island_max_m2: float = number(
        20.0,
        "m2",
        "Smaller holes in a room are furniture; larger ones are parts of the building that it goes around.",
        0.0,
        1e6,
    )
    detail_m: float = number(
        0.5,
        "m",
        "Notches and juts of an outline up to twice as wide do not count: furniture, doors.",
        0.0,
        10.0,
    )
