"""What tracking adds to an analysis, and what the sinks receive."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.occupancy import FloatArray, OccupancySnapshot
from rose2_logs.model.room_quality import RoomQuality
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.layout_change import LayoutChange
from rose2_logs.tracking.registration import RigidMotion

EventKind = Literal["part_begun", "shifted", "continued", "returned", "born", "split", "merged", "lost"]
EVENT_ORDER: tuple[EventKind, ...] = get_args(EventKind)
"""Order of one snapshot's events: the map, the present rooms, then what happened to the earlier tracks."""
MAP_TRACK = 0
"""Stands for the track in an event of the whole map."""


@dataclass(frozen=True)
class RoomEvent:
    """Something that happened to the identity of rooms, or to the whole map, at one snapshot.

    Attributes
    ----------
    kind : str
        born: a track begins; continued: a room takes its track on; split: a track's room is now several
        rooms; merged: several tracks' rooms are now one; lost: a track has no room any more;
        returned: a lost track has a room again; shifted: the whole map moved within its frame;
        part_begun: the map was begun anew, and with it a part of the run.
    snapshot : int
        Index of the snapshot.
    track : int
        The track that the event is about: of a split the one that was split, of a merge the one that stays,
        of the whole map `MAP_TRACK`.
    others : tuple of int
        The further tracks: the parts that a split gave birth to, the tracks that a merge ended.
    overlap : float
        Intersection over union of the room with its track's last shape; 0 where there is none.
    motion : RigidMotion, optional
        Of a shift: how the map moved since the snapshot before.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> step = next(rl.track("sample_logs/office.mcap"))
    >>> step.events[0]
    RoomEvent(kind='born', snapshot=0, track=1, others=(), overlap=0.0, motion=None)
    """

    kind: EventKind
    snapshot: int
    track: int
    others: tuple[int, ...] = ()
    overlap: float = 0.0
    motion: RigidMotion | None = None


def map_motion(events: Iterable[RoomEvent]) -> RigidMotion | None:
    """Motion of the whole map among one snapshot's events, if it moved."""
    return next((event.motion for event in events if event.kind == "shifted"), None)


@dataclass(frozen=True, eq=False)
class TrackedSnapshot:
    """One snapshot with all that was found: what a sink receives.

    Attributes
    ----------
    snapshot : OccupancySnapshot
        The map.
    analysis : SnapshotAnalysis
        Its structure and rooms.
    coverage : float
        Known free area over that of the last map of the run, or of its part, in [0, 1].
    track_ids : tuple of R int
        The track (1, 2, ... never used again) of room i + 1.
    events : tuple of RoomEvent
        What happened to the tracks at this snapshot.
    quality : RoomQuality, optional
        How sure the rooms are.
    change : LayoutChange, optional
        How the layout changed since the map before.
    path : (K, 3) float, optional
        Poses of the robot since the map before: x, y in world meters, yaw in radians. Of a map that begins
        another part those that may be of the part before are left out; there are none in a frame in which no
        part ends.
    part : int, optional
        Number of the part, from 1, in a log in which maps were begun anew or are of several publishers.
    names : tuple of R str
        Names that were given to the rooms, empty for none; an empty tuple where no names were given.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> next(rl.track("sample_logs/office.mcap"))
    TrackedSnapshot(index=0, coverage=0.26, tracks=[1, 2, 3, 4, 5, 6], 512 x 320 cells of 0.05 m)
    """

    snapshot: OccupancySnapshot
    analysis: SnapshotAnalysis
    coverage: float
    track_ids: tuple[int, ...]
    events: tuple[RoomEvent, ...]
    quality: RoomQuality | None = None
    change: LayoutChange | None = None
    path: FloatArray | None = None
    part: int | None = None
    names: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return (
            f"TrackedSnapshot(index={self.snapshot.index}, coverage={self.coverage:.2f}, "
            f"tracks={list(self.track_ids)}, {self.snapshot.geometry.size_text})"
        )

    def given_name(self, number: int) -> str:
        """Name that was given to room `number` + 1, empty for none."""
        return self.names[number] if self.names else ""

    @property
    def rooms(self) -> RoomMap:
        """The rooms of the map; room i + 1 has the track ``track_ids[i]``."""
        return self.analysis.rooms

    @property
    def labels(self) -> NDArray[np.int32]:
        """Rooms (H, W) of the cells: 0 = no room, 1..R."""
        return self.analysis.rooms.labels
