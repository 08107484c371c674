"""What rooms are called: by numbers, or by names that a person gave to tracks, points or outlines."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

JOINED = " + "
"""Between the names of what became one room."""
INSIDE_SHARE = 0.5
"""A named outline is a room where they share this much of the smaller of both: most of it."""


NameOf = Callable[[int], str]
"""The name of a room by its track, or by its number in a single map."""


def room_name(number: int, given: str = "") -> str:
    """Name a room in any output: by the name that it was given, or by its number.

    Examples
    --------
    >>> room_name(7), room_name(7, "Kitchen")
    ('Room 7', 'Kitchen')
    """
    return given or f"Room {number}"


def short_name(number: int, name_of: NameOf = room_name) -> str:
    """Return what stands in a narrow place: the number of a room that nobody has named.

    Examples
    --------
    >>> short_name(7, room_name), short_name(7, {7: "Kitchen"}.__getitem__)
    ('7', 'Kitchen')
    """
    name = name_of(number)
    return str(number) if name == room_name(number) else name


class TrackNames:
    """The names of the tracks of a run as they are known so far.

    Examples
    --------
    >>> names = TrackNames()
    >>> names.add((7, 8), ("Kitchen", ""))
    >>> names(7), names(8)
    ('Kitchen', 'Room 8')
    """

    def __init__(self) -> None:
        self._given: dict[int, str] = {}

    def add(self, tracks: Sequence[int], names: Sequence[str]) -> None:
        """Take the names that rooms of a map were given, empty for none."""
        self._given.update({track: name for track, name in zip(tracks, names, strict=False) if name})

    def __call__(self, track: int) -> str:
        """Name of a track."""
        return room_name(track, self._given.get(track, ""))


@dataclass(frozen=True, eq=False)
class RoomNames:
    """Names for rooms.

    Attributes
    ----------
    by_track : mapping of int to str
        Names of tracks of a run.
    places : tuple of shapely geometry
        Points and outlines that are named, world meters.
    of_place : tuple of str
        Their names, empty for outlines that only help to lay a plan over a map.

    Examples
    --------
    >>> import shapely
    >>> names = RoomNames({3: "Kitchen"}, (shapely.Point(1, 1),), ("Hall",))
    >>> names.of((3, 4), (shapely.box(5, 0, 9, 4), shapely.box(0, 0, 4, 4)))
    ('Kitchen', 'Hall')
    """

    by_track: Mapping[int, str] = field(default_factory=dict)
    places: tuple[BaseGeometry, ...] = ()
    of_place: tuple[str, ...] = ()

    def of(self, tracks: Sequence[int], shapes: Sequence[BaseGeometry]) -> tuple[str, ...]:
        """Name rooms.

        The name of a track comes first. Otherwise a room is called by the points that it holds and the
        outlines that it shares most floor with, by all of them where it holds several.

        Parameters
        ----------
        tracks : sequence of R int
            Their tracks.
        shapes : sequence of R shapely geometry
            Their shapes, world meters. None, if the places are those of another building: then names of
            tracks alone count.

        Returns
        -------
        tuple of R str
            Names, empty for none.
        """
        found: list[list[str]] = [[] for _ in tracks]
        if self.places and shapes:
            rooms, places = np.array(shapes, object), np.array(self.places, object)
            pairs = shapely.STRtree(rooms).query(places, predicate="intersects")
            place, room = pairs[:, self._are_one(places[pairs[0]], rooms[pairs[1]])]
            for at, number in sorted(zip(place.tolist(), room.tolist(), strict=True)):
                if self.of_place[at] and self.of_place[at] not in found[number]:
                    found[number].append(self.of_place[at])
        return tuple(
            self.by_track.get(track, JOINED.join(names)) for track, names in zip(tracks, found, strict=True)
        )

    @staticmethod
    def _are_one(places: NDArray[np.object_], rooms: NDArray[np.object_]) -> NDArray[np.bool_]:
        """Which places (N,) are in, or are, the rooms (N,) next to them."""
        least = np.minimum(shapely.area(places), shapely.area(rooms))
        shared: NDArray[np.bool_] = shapely.area(shapely.intersection(places, rooms)) >= INSIDE_SHARE * least
        return shared

    def unused(self, names: Collection[str], tracks: Collection[int]) -> list[str]:
        """List what was given and names none of some rooms, whose names `of` gave."""
        used = {*names, *(part for name in names for part in name.split(JOINED))}
        given = [*(name for track, name in self.by_track.items() if track not in tracks), *self.of_place]
        return sorted({name for name in given if name and name not in used})
