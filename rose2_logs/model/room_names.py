"""What rooms are called."""

from __future__ import annotations


def room_name(number: int, given: str = "") -> str:
    """What a room is called in all outputs: the name that it was given, or its number.

    Examples
    --------
    >>> room_name(7), room_name(7, "Kitchen")
    ('Room 7', 'Kitchen')
    """
    return given or f"Room {number}"
