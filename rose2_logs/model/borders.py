"""Borders between rooms."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from rose2_logs.model.rooms import Doorway

UNSURE_BORDER_BELOW = 0.8
"""Borders of less strength are marked as unsure. A matter of display: no stored result depends on it."""


@dataclass(frozen=True)
class Border:
    """What lies between two rooms.

    Attributes
    ----------
    rooms : (int, int)
        The two room numbers, the smaller one first.
    kind : str
        ``wall``: no doorway is known between them; ``door``; ``opening``: a doorway wider than a door.
    width_m : float
        Clear width of the widest doorway between them, 0 for a wall.
    strength : float
        Probability that the two are different rooms, by the fitted strength; 1 where all between
        them is wall.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> rl.Border((1, 2), "door", 0.9, 0.97)
    Border(rooms=(1, 2), kind='door', width_m=0.9, strength=0.97)
    """

    rooms: tuple[int, int]
    kind: str
    width_m: float
    strength: float

    @property
    def is_unsure(self) -> bool:
        """Whether the two rooms may well be read as one."""
        return self.strength < UNSURE_BORDER_BELOW


def unsure_of(doorways: Iterable[Doorway], borders: Iterable[Border]) -> tuple[Doorway, ...]:
    """Return the doorways through borders that are unsure."""
    unsure = {border.rooms for border in borders if border.is_unsure}
    return tuple(door for door in doorways if door.rooms in unsure)
