"""What tracking adds to an analysis, and what the sinks receive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rose2_logs.occupancy import OccupancySnapshot
from rose2_logs.pipeline import SnapshotAnalysis

EventKind = Literal["born", "continued", "split", "merged", "lost", "returned"]


@dataclass(frozen=True)
class RoomEvent:
    """Something that happened to the identity of rooms at one snapshot.

    Attributes
    ----------
    kind : str
        born: a track begins; continued: a room takes its track on; split: a track's room is now several
        rooms; merged: several tracks' rooms are now one; lost: a track has no room any more;
        returned: a lost track has a room again.
    snapshot : int
        Index of the snapshot.
    track : int
        The track that the event is about: of a split the one that was split, of a merge the one that stays.
    others : tuple of int
        The further tracks: the parts that a split gave birth to, the tracks that a merge ended.
    overlap : float
        Intersection over union of the room with its track's last shape; 0 where there is none.
    """

    kind: EventKind
    snapshot: int
    track: int
    others: tuple[int, ...] = ()
    overlap: float = 0.0


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
        Known free area over that of the last map of the run, in [0, 1].
    track_ids : tuple of R int
        The track (1, 2, ... never used again) of room i + 1.
    events : tuple of RoomEvent
        What happened to the tracks at this snapshot.
    """

    snapshot: OccupancySnapshot
    analysis: SnapshotAnalysis
    coverage: float
    track_ids: tuple[int, ...]
    events: tuple[RoomEvent, ...]
