"""What a recording calls the rooms: one function of their tracks names them everywhere."""

from __future__ import annotations

from collections.abc import Callable

from rose2_logs.model.room_names import room_name

NameOf = Callable[[int], str]
"""The name of a room by its track."""


def short_name(track: int, name_of: NameOf) -> str:
    """Return what stands in a narrow place: the number of a room that nobody has named.

    Examples
    --------
    >>> short_name(7, room_name), short_name(7, {7: "Kitchen"}.__getitem__)
    ('7', 'Kitchen')
    """
    name = name_of(track)
    return str(track) if name == room_name(track) else name
