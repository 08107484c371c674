"""RunHistory: the facts of a whole run, collected step by step and complete after the last map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby
from statistics import median

from rose2_logs.config.parameters import Parameters
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.system.text import counted
from rose2_logs.tracking.back_projection import BackProjectedSnapshot, RunBackProjection
from rose2_logs.tracking.convergence import Convergence, RoomRows, map_by_map, measure_convergence
from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.track_history import SnapshotRef, TrackHistories
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot


@dataclass
class RunningMean:
    """Mean and maximum of values that come one by one; None counts as no value."""

    count: int = 0
    total: float = 0.0
    maximum: float | None = None

    def add(self, value: float | None) -> None:
        """Take a value."""
        if value is not None:
            self.count += 1
            self.total += value
            self.maximum = value if self.maximum is None else max(self.maximum, value)

    @property
    def mean(self) -> float | None:
        """Mean of the values so far, None without any."""
        return self.total / self.count if self.count else None


@dataclass
class RunTotals:
    """What is summed up over a run, map by map.

    Attributes
    ----------
    snapshots : int
        Maps that were analyzed.
    invalid : int
        Maps that could not be analyzed and were left out.
    unchanged : int
        Maps with the free and occupied cells of the one before, whose analysis was taken over.
    rooms_last : int
        Rooms of the last map.
    free_m2_last, outside_m2_last : float
        Free area of the last map, and how much of it was left out as outside the building.
    tracks : int
        Rooms that ever had a number.
    coverage_first, coverage_last : float
        Of the first and the last map.
    first_log_time_ns, last_log_time_ns : int or None
        Of the first and the last map.
    events : Counter
        Number of events by kind.
    changed_share, variation_bits : RunningMean
        How the layout changed from map to map.
    frontier_m : float
        Open frontier of the last map's rooms.
    stage_seconds, stage_seconds_max : dict
        Time per stage, summed and of the slowest map.
    """

    snapshots: int = 0
    invalid: int = 0
    unchanged: int = 0
    rooms_last: int = 0
    free_m2_last: float = 0.0
    outside_m2_last: float = 0.0
    tracks: int = 0
    coverage_first: float = 0.0
    coverage_last: float = 0.0
    first_log_time_ns: int | None = None
    last_log_time_ns: int | None = None
    events: Counter[str] = field(default_factory=Counter)
    changed_share: RunningMean = field(default_factory=RunningMean)
    variation_bits: RunningMean = field(default_factory=RunningMean)
    frontier_m: float = 0.0
    stage_seconds: dict[str, float] = field(default_factory=dict)
    stage_seconds_max: dict[str, float] = field(default_factory=dict)

    def add(self, step: TrackedSnapshot) -> None:
        """Take the next map."""
        if self.first_log_time_ns is None:
            self.first_log_time_ns = step.snapshot.log_time_ns
            self.coverage_first = step.coverage
        self.last_log_time_ns = step.snapshot.log_time_ns
        self.coverage_last = step.coverage
        self.snapshots += 1
        self.rooms_last = len(step.track_ids)
        self.free_m2_last = step.analysis.free_area_m2
        self.outside_m2_last = step.analysis.outside_m2
        self.events.update(event.kind for event in step.events)
        self.tracks = self.events["born"]
        if step.change is not None:
            self.changed_share.add(step.change.changed_share)
            self.variation_bits.add(step.change.variation_bits)
        if step.quality is not None:
            self.frontier_m = float(step.quality.frontier_m.sum())
        for stage, seconds in step.analysis.seconds.items():
            self.stage_seconds[stage] = self.stage_seconds.get(stage, 0.0) + seconds
            self.stage_seconds_max[stage] = max(self.stage_seconds_max.get(stage, 0.0), seconds)


@dataclass(frozen=True)
class RunSummary:
    """A run that is over.

    Attributes
    ----------
    totals : RunTotals
        Numbers of maps, rooms and events, times.
    histories : TrackHistories
        What is known of every room.
    convergence : Convergence
        Since when each room, and the layout, was as in the last map.
    parts : dict of int to RunSummary
        The same for each part of a run in which maps were begun anew, by number; empty for other runs. Of the
        whole run, what refers to the last map is that of the last part.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> class Conclusion(rl.Sink):
    ...     def write(self, step):
    ...         pass
    ...
    ...     def finish(self, summary):
    ...         print(summary.totals.rooms_last, "rooms, final from map", summary.layout_final.snapshot)
    >>> run = rl.analyze("sample_logs/office.mcap", sinks=[Conclusion()], max_snapshots=3)
    18 rooms, final from map 2
    """

    totals: RunTotals
    histories: TrackHistories
    convergence: Convergence
    parts: Mapping[int, RunSummary] = field(default_factory=dict)

    def __repr__(self) -> str:
        maps, rooms = counted(self.totals.snapshots, "map"), counted(self.totals.rooms_last, "room")
        tracks, events = counted(self.totals.tracks, "track"), counted(self.totals.events.total(), "event")
        return f"RunSummary({maps}, {rooms} at the end, {tracks}, {events})"

    @property
    def layout_final(self) -> SnapshotRef | None:
        """The map from which on the layout was that of the last one; None if the last one has no room."""
        return self.convergence.layout_final

    @property
    def known_final(self) -> SnapshotRef | None:
        """The map from which on what was known of the layout was that of the last one; None as above."""
        return self.convergence.known_final

    def is_last(self, since: SnapshotRef) -> bool:
        """Whether something held in the last map only, of several: so it may change again."""
        last = self.histories.last
        return self.totals.snapshots > 1 and last is not None and since.snapshot == last.snapshot

    def median_coverage(self, since: Mapping[int, SnapshotRef]) -> float | None:
        """Median coverage, over the last map's rooms, from which on something held; None if it never did."""
        tracks = self.histories.in_last_map
        return median_of(since[track].coverage for track in tracks if track in since)


@dataclass
class _Followed:
    """What is collected of a run, or of one of its parts."""

    histories: TrackHistories
    totals: RunTotals = field(default_factory=RunTotals)
    snapshot_refs: dict[int, SnapshotRef] = field(default_factory=dict)

    def add(self, step: TrackedSnapshot) -> None:
        """Take the next map."""
        self.totals.add(step)
        self.histories.add(step)
        self.snapshot_refs[step.snapshot.index] = self.histories.snapshot_ref(step)


class RunHistory:
    """Observes a run: totals, the histories of its rooms, and what the second pass needs.

    Memory: some facts and one shape for each room, some numbers for each map.

    Parameters
    ----------
    parameters : Parameters
        Of the run.
    back_project : bool
        Whether the last layout is to be projected back.

    Attributes
    ----------
    totals : RunTotals
    histories : TrackHistories
    """

    def __init__(self, parameters: Parameters, *, back_project: bool = False) -> None:
        self._run = _Followed(TrackHistories())
        self._parts: dict[int, _Followed] = {}
        self._tracking = parameters.tracking
        self._drifts: dict[int, RigidMotion] = {}
        self._back_projection = RunBackProjection(parameters) if back_project else None

    @property
    def totals(self) -> RunTotals:
        """What is summed up so far."""
        return self._run.totals

    @property
    def histories(self) -> TrackHistories:
        """What is known of every room so far."""
        return self._run.histories

    def add(self, step: TrackedSnapshot) -> None:
        """Take the next map."""
        self._run.add(step)
        if step.part is not None:
            if step.part not in self._parts:
                self._parts[step.part] = _Followed(TrackHistories(self.totals.first_log_time_ns))
            self._parts[step.part].add(step)
        x, y, yaw = (0.0, 0.0, 0.0) if step.change is None else step.change.drift.pose
        self._drifts[step.snapshot.index] = RigidMotion((0.0, 0.0), (x, y), yaw)
        if self._back_projection is not None:
            self._back_projection.add(step)

    @property
    def projects_back(self) -> bool:
        """Whether the last layout is to be projected back."""
        return self._back_projection is not None

    @property
    def snapshot_refs(self) -> Mapping[int, SnapshotRef]:
        """When each map was, by its index."""
        return self._run.snapshot_refs

    def back_projected(self, snapshots: Iterable[OccupancySnapshot]) -> Iterator[BackProjectedSnapshot]:
        """Yield what each map shows of the last map's rooms, if that was requested.

        Parameters
        ----------
        snapshots : iterable of OccupancySnapshot
            The maps of the run again.
        """
        if self._back_projection is not None:
            yield from self._back_projection.back_projected(snapshots)

    def summary(self, rooms: Iterable[RoomRows], threads: int = 1) -> RunSummary:
        """Compare all maps with the last one; after it.

        Parameters
        ----------
        rooms : iterable of RoomRows
            Every room of every map, in the order of the maps.
        threads : int
            How many compare maps at once.
        """
        followed = list(self._parts.values()) or [self._run]
        part_of = {index: place for place, each in enumerate(followed) for index in each.snapshot_refs}
        # Of a part without rooms there are no rows.
        found = [self._converged(each, (), 1) for each in followed]
        for place, rows in groupby(map_by_map(rooms), lambda rows: part_of[int(rows.snapshot[0])]):
            found[place] = self._converged(followed[place], rows, threads)
        parts = {
            number: RunSummary(each.totals, each.histories, convergence)
            for (number, each), convergence in zip(self._parts.items(), found, strict=False)
        }
        return RunSummary(self.totals, self.histories, Convergence.joined(found), parts)

    def _converged(self, followed: _Followed, rooms: Iterable[RoomRows], threads: int) -> Convergence:
        return measure_convergence(
            rooms,
            followed.histories,
            followed.snapshot_refs,
            self._drifts,
            self._tracking,
            threads=threads,
        )


def median_of(values: Iterable[float | None]) -> float | None:
    """Median of the values that are not None; None without any."""
    known = [value for value in values if value is not None]
    return median(known) if known else None
