"""All maps of a run by the layout of its last one: the second pass, once the run is over."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from rose2_logs.occupancy import OccupancySnapshot
from rose2_logs.parameters import Parameters
from rose2_logs.rooms import RoomMap
from rose2_logs.tracking.alignment import RigidMotion
from rose2_logs.tracking.frames import TrackedSnapshot, map_motion
from rose2_logs.tracking.smoothing import SmoothedRooms, Smoother, motions_to_last


@dataclass(frozen=True, eq=False)
class SmoothedSnapshot:
    """One map of a run with what it shows of the rooms of the last one.

    Attributes
    ----------
    snapshot : OccupancySnapshot
        The map.
    coverage : float
        As of `TrackedSnapshot`.
    rooms : SmoothedRooms
        How much it shows of the last map's rooms.
    last_rooms : RoomMap
        The rooms of the last map.
    track_ids : tuple of R int
        Their tracks.
    to_last : RigidMotion
        How the whole map moved from then to the end.
    """

    snapshot: OccupancySnapshot
    coverage: float
    rooms: SmoothedRooms
    last_rooms: RoomMap
    track_ids: tuple[int, ...]
    to_last: RigidMotion


class RunSmoother:
    """Keeps what the second pass needs along the run, some numbers a map, and makes that pass.

    Parameters
    ----------
    parameters : Parameters
        Of the run.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._last: TrackedSnapshot | None = None
        self._motions: dict[int, RigidMotion | None] = {}
        self._coverages: dict[int, float] = {}

    def add(self, frame: TrackedSnapshot) -> None:
        """Take the next map of the run."""
        self._last = frame
        self._motions[frame.snapshot.index] = map_motion(frame.events)
        self._coverages[frame.snapshot.index] = frame.coverage

    def smoothed(self, snapshots: Iterable[OccupancySnapshot]) -> Iterator[SmoothedSnapshot]:
        """Yield the maps with the rooms of the last one; one map at a time is held.

        Parameters
        ----------
        snapshots : iterable of OccupancySnapshot
            The maps of the run once more. Those that were not taken before are left out.
        """
        last = self._last
        if last is None:
            return
        rooms = last.analysis.rooms
        smoother = Smoother(last.snapshot, rooms, self._parameters.tracking, self._parameters.occupancy)
        to_last = dict(zip(self._motions, motions_to_last(list(self._motions.values())), strict=True))
        for snapshot in snapshots:
            if snapshot.index in to_last:
                motion = to_last[snapshot.index]
                found = smoother.rooms(snapshot, motion)
                coverage = self._coverages[snapshot.index]
                yield SmoothedSnapshot(snapshot, coverage, found, rooms, last.track_ids, motion)
