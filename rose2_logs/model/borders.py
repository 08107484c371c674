"""Borders between rooms."""

from __future__ import annotations

from dataclasses import dataclass

BORDER_KINDS = ("wall", "door", "opening")


@dataclass(frozen=True)
class Border:
    """What lies between two rooms.

    Attributes
    ----------
    rooms : (int, int)
        The two room numbers, the smaller one first.
    kind : str
        ``wall``: nothing is known to be open between them; ``door``; ``opening``: wider than a door.
    width_m : float
        Distance between the ends of what is open, 0 for a wall.
    strength : float
        Probability that the two are different rooms, by the fitted strength; 1 for a wall.

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
