"""What is known of every room over the run: gathered map by map, some facts and one shape a room."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.tracked_snapshot import RoomEvent, TrackedSnapshot, map_motion


@dataclass(frozen=True)
class Moment:
    """One map of the run.

    Attributes
    ----------
    snapshot : int
        Its index.
    time_s : float
        Log time since the first map.
    coverage : float
        Its coverage.
    """

    snapshot: int
    time_s: float
    coverage: float


@dataclass
class RoomLife:
    """One track.

    Attributes
    ----------
    first, last : Moment
        The first and the last map that show it.
    maps : int
        Number of maps that show it.
    area_m2 : float
        Its area in the last of them, as far as it was seen.
    polygon : shapely Polygon or MultiPolygon
        Its shape there, with the predicted part.
    outline_wall_share, frontier_m : float or None
        Evidence there, None where it was not measured.
    splits, merges, losses : int
        How often it was split, took in others, and was lost.
    """

    first: Moment
    last: Moment
    maps: int = 0
    area_m2: float = 0.0
    polygon: BaseGeometry = field(default_factory=Polygon)
    outline_wall_share: float | None = None
    frontier_m: float | None = None
    splits: int = 0
    merges: int = 0
    losses: int = 0


class RoomLives:
    """Gathers the life of every room.

    Attributes
    ----------
    lives : dict
        By track, in the order of their numbers.
    last : Moment or None
        The last map.
    in_last_map : tuple of int
        The tracks that it shows, ascending.
    shifts : int
        How often the whole map shifted.
    largest_shift : (Moment, RigidMotion) or None
        The first of the greatest of these.
    """

    def __init__(self) -> None:
        self.lives: dict[int, RoomLife] = {}
        self.last: Moment | None = None
        self.in_last_map: tuple[int, ...] = ()
        self.shifts = 0
        self.largest_shift: tuple[Moment, RigidMotion] | None = None
        self._first_time_ns: int | None = None

    def moment(self, frame: TrackedSnapshot) -> Moment:
        """Return when a map was; the first one that is asked for begins the run."""
        if self._first_time_ns is None:
            self._first_time_ns = frame.snapshot.log_time_ns
        time_s = (frame.snapshot.log_time_ns - self._first_time_ns) / 1e9
        return Moment(frame.snapshot.index, time_s, frame.coverage)

    def add(self, frame: TrackedSnapshot) -> None:
        """Take the next map."""
        now = self.moment(frame)
        rooms = frame.analysis.rooms
        for number, track in enumerate(frame.track_ids):
            life = self.lives.setdefault(track, RoomLife(now, now))
            life.last = now
            life.maps += 1
            life.area_m2 = float(rooms.areas_m2[number])
            life.polygon = rooms.polygons[number]
            life.outline_wall_share, life.frontier_m = evidence_of(frame, number)
        for event in frame.events:
            self._count(event)
        if (motion := map_motion(frame.events)) is not None:
            self.shifts += 1
            before_m = -1.0 if self.largest_shift is None else math.hypot(*self.largest_shift[1].shift_xy_m)
            if math.hypot(*motion.shift_xy_m) > before_m:
                self.largest_shift = now, motion
        self.last, self.in_last_map = now, tuple(sorted(frame.track_ids))

    def _count(self, event: RoomEvent) -> None:
        if event.kind == "split":
            self.lives[event.track].splits += 1
        elif event.kind == "merged":
            self.lives[event.track].merges += 1
        elif event.kind == "lost":
            self.lives[event.track].losses += 1


def evidence_of(frame: TrackedSnapshot, number: int) -> tuple[float | None, float | None]:
    """Share of the outline that walls back, and open frontier in metres, of room `number` + 1."""
    if frame.evidence is None:
        return None, None
    share = float(frame.evidence.outline_wall_share[number])
    return (None if math.isnan(share) else share), float(frame.evidence.frontier_m[number])
