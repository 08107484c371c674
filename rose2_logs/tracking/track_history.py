"""What is known of every room over the run: collected map by map, some facts and one shape per room."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.tracked_snapshot import RoomEvent, TrackedSnapshot, map_motion


@dataclass(frozen=True)
class SnapshotRef:
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
class TrackHistory:
    """One track.

    Attributes
    ----------
    first, last : SnapshotRef
        The first and the last map that show it.
    maps : int
        Number of maps that show it.
    area_m2 : float
        Its area in the last of them, as far as it was seen.
    polygon : shapely Polygon or MultiPolygon
        Its shape there, with the predicted part.
    name : str
        Name that it was given last, empty for none.
    wall_support, frontier_m : float or None
        Evidence there, None where it was not measured.
    splits, merges, losses : int
        How often it was split, had another room merged into it, and was lost.
    """

    first: SnapshotRef
    last: SnapshotRef
    maps: int = 0
    area_m2: float = 0.0
    polygon: BaseGeometry = field(default_factory=Polygon)
    name: str = ""
    wall_support: float | None = None
    frontier_m: float | None = None
    splits: int = 0
    merges: int = 0
    losses: int = 0


class TrackHistories:
    """Gathers the history of every room.

    Parameters
    ----------
    first_time_ns : int, optional
        When the run began; by default with the first map given.

    Attributes
    ----------
    tracks : dict
        By track, in the order of their numbers.
    last : SnapshotRef or None
        The last map.
    in_last_map : tuple of int
        The tracks that it shows, ascending.
    shifts : int
        How often the whole map shifted.
    largest_shift : (SnapshotRef, RigidMotion) or None
        The first of the greatest of these.
    """

    def __init__(self, first_time_ns: int | None = None) -> None:
        self.tracks: dict[int, TrackHistory] = {}
        self.last: SnapshotRef | None = None
        self.in_last_map: tuple[int, ...] = ()
        self.shifts = 0
        self.largest_shift: tuple[SnapshotRef, RigidMotion] | None = None
        self._first_time_ns = first_time_ns

    def snapshot_ref(self, step: TrackedSnapshot) -> SnapshotRef:
        """Return when a map was recorded; the first map given begins the run."""
        if self._first_time_ns is None:
            self._first_time_ns = step.snapshot.log_time_ns
        time_s = (step.snapshot.log_time_ns - self._first_time_ns) / 1e9
        return SnapshotRef(step.snapshot.index, time_s, step.coverage)

    def add(self, step: TrackedSnapshot) -> None:
        """Take the next map."""
        now = self.snapshot_ref(step)
        rooms = step.analysis.rooms
        for number, track in enumerate(step.track_ids):
            history = self.tracks.setdefault(track, TrackHistory(now, now))
            history.last = now
            history.maps += 1
            history.area_m2 = float(rooms.areas_m2[number])
            history.polygon = rooms.polygons[number]
            history.name = step.given_name(number) or history.name
            history.wall_support, history.frontier_m = quality_of(step, number)
        for event in step.events:
            self._count(event)
        if (motion := map_motion(step.events)) is not None:
            self.shifts += 1
            before_m = -1.0 if self.largest_shift is None else math.hypot(*self.largest_shift[1].shift_xy_m)
            if math.hypot(*motion.shift_xy_m) > before_m:
                self.largest_shift = now, motion
        self.last, self.in_last_map = now, tuple(sorted(step.track_ids))

    def _count(self, event: RoomEvent) -> None:
        if event.kind == "split":
            self.tracks[event.track].splits += 1
        elif event.kind == "merged":
            self.tracks[event.track].merges += 1
        elif event.kind == "lost":
            self.tracks[event.track].losses += 1


def quality_of(step: TrackedSnapshot, number: int) -> tuple[float | None, float | None]:
    """Share of the outline supported by walls, and open frontier in meters, of room `number` + 1."""
    if step.quality is None:
        return None, None
    share = float(step.quality.wall_support[number])
    return (None if math.isnan(share) else share), float(step.quality.frontier_m[number])
