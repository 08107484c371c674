"""What rooms are called."""

from __future__ import annotations

from collections.abc import Callable

NameOf = Callable[[int], str]
"""The name of a room by its track, or by its number in a single map."""


def room_name(number: int) -> str:
    """Name a room that nobody has named.

    Examples
    --------
    >>> room_name(7)
    'Room 7'
    """
    return f"Room {number}"


def short_name(number: int, name_of: NameOf) -> str:
    """Return what stands in a narrow place: the number of a room that nobody has named.

    Examples
    --------
    >>> short_name(7, room_name), short_name(7, {7: "Kitchen"}.__getitem__)
    ('7', 'Kitchen')
    """
    name = name_of(number)
    return str(number) if name == room_name(number) else name
