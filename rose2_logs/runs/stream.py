"""The maps of a log with their rooms and the rooms' identity: reader -> workers -> tracker, as one stream."""

from __future__ import annotations

import logging
import math
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import InvalidMapError
from rose2_logs.io.cell_values import oddity
from rose2_logs.io.log import LogReader
from rose2_logs.io.poses import RobotPath, map_frame
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.explored import coarser_for_its_size
from rose2_logs.model.far_cells import find_far_cells
from rose2_logs.model.occupancy import FloatArray, OccupancySnapshot, free_area_m2, is_same_to_analysis
from rose2_logs.model.room_names import RoomNames
from rose2_logs.runs.journal import Found, JournaledWorkers
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.system.warnings import log_warning, muted
from rose2_logs.system.workers import Workers, give_back_freed_memory
from rose2_logs.tracking.layout_change import LayoutFollower
from rose2_logs.tracking.tracked_snapshot import MAP_TRACK, RoomEvent, TrackedSnapshot, map_motion
from rose2_logs.tracking.tracker import RoomTracker

logger = logging.getLogger(__name__)

GIVE_BACK_EVERY = 20
"""Maps after which freed memory is given back: it costs a map's page faults, and keeps a long run small."""
SnapshotWorkers = Workers[OccupancySnapshot, Found]


def start_workers(options: RunOptions) -> SnapshotWorkers:
    """Return what analyzes snapshots: a context manager, to be entered as early as possible."""
    work = partial(
        _analyze_or_refuse,
        parameters=options.parameters,
        method=options.method,
        voronoi="voronoi" in options.shown_layers,
    )
    return Workers(work, options.workers)


class TrackedStream:
    """The maps of a log with their rooms and the rooms' identity, one after the other; to be read once.

    Parameters
    ----------
    snapshots : iterable of OccupancySnapshot
        The maps.
    final_free_m2 : float or None
        Known free area of the last map of the run in square meters, which coverage refers to; coverage is NaN
        where it is not known. Of a run in parts, that of the last map of each, by number.
    workers : Workers
        What analyzes the maps, started.
    parameters : Parameters
        Those that it was started with.
    source : str
        What warnings call the log.
    topic : str, optional
        The map topic.
    paths : mapping of str to RobotPath, optional
        Where the robot was, to be part of the steps, in each frame in which it is wanted; maps in other
        frames have no poses.
    part_at : callable, optional
        Returns the part of the run that the map of a log time is of, None if the run has no parts. Each part
        has its own coverage and tracks.
    names : RoomNames, optional
        What rooms are called; its points and outlines are those of the last part.

    Attributes
    ----------
    last_log_time_ns : int or None
        When the last map of the run was recorded, where that is known.
    invalid : int
        Maps so far that could not be analyzed and were left out.
    unchanged : int
        Maps so far with the free and occupied cells of the one before, whose analysis was taken over.
    """

    def __init__(
        self,
        snapshots: Iterable[OccupancySnapshot],
        final_free_m2: float | Mapping[int | None, float] | None,
        workers: SnapshotWorkers | JournaledWorkers,
        parameters: Parameters,
        *,
        source: str = "the maps",
        topic: str | None = None,
        paths: Mapping[str, RobotPath] | None = None,
        part_at: Callable[[int], int | None] = lambda _: None,
        names: RoomNames | None = None,
    ) -> None:
        self.invalid = 0
        self.unchanged = 0
        self.last_log_time_ns: int | None = None
        self._snapshots = snapshots
        self._final_free_m2: Mapping[int | None, float | None] = (
            final_free_m2 if isinstance(final_free_m2, Mapping) else {None: final_free_m2}
        )
        self._part_at = part_at
        self._part: int | None = None
        self._workers = workers
        self._occupancy = parameters.occupancy
        self._source, self._topic = source, topic
        self._paths = paths
        self._names = names
        self._tracker = RoomTracker(parameters.tracking, parameters.occupancy)
        self._layout = LayoutFollower()
        self._analyzed: Iterator[tuple[OccupancySnapshot, Found]] | None = None
        self._has_told_coarser = self._has_told_far = False

    @classmethod
    def of_log(
        cls,
        reader: LogReader,
        workers: SnapshotWorkers | JournaledWorkers,
        parameters: Parameters,
        *,
        with_path: bool = False,
        base_frame: str | None = None,
        names: RoomNames | None = None,
    ) -> TrackedStream:
        """Follow the rooms through an open log.

        Parameters
        ----------
        reader : LogReader
            The log.
        workers, parameters
            As for the class.
        with_path : bool
            Whether to read where the robot was.
        base_frame : str, optional
            Frame of the robot's base, where it is none of the usual ones.
        names : RoomNames, optional
            As for the class.

        Raises
        ------
        LogError
            If the log holds no map that can be read.
        """
        lasts = reader.lasts()
        for last in lasts.values():
            if (odd := oddity(last, parameters.occupancy)) is not None:
                text = f"{reader.info.path}: the last map on {reader.topic}: {odd[1]}"
                log_warning(logger, odd[0], text, file=reader.info.path, topic=reader.topic)
        *_, last = lasts.values()
        stream = cls(
            reader.snapshots(),
            {part: free_area_m2(each, parameters.occupancy) for part, each in lasts.items()},
            workers,
            parameters,
            source=str(reader.info.path),
            topic=reader.topic,
            paths=_paths_of(reader, lasts.values(), base_frame) if with_path else None,
            part_at=reader.part_at,
            names=names,
        )
        stream.last_log_time_ns = last.log_time_ns
        stream._has_told_far = True  # the reader leaves them out, and tells it
        return stream

    def begin(self) -> Iterator[tuple[OccupancySnapshot, Found]]:
        """Let worker processes begin with the first maps; otherwise they begin when one is asked for."""
        if self._analyzed is None:
            is_same = partial(is_same_to_analysis, parameters=self._occupancy)
            self._analyzed = self._workers.map(self._snapshots, is_same)
        return self._analyzed

    def __iter__(self) -> Iterator[TrackedSnapshot]:
        for number, (snapshot, found) in enumerate(self.begin(), start=1):
            if number % GIVE_BACK_EVERY == 0:
                give_back_freed_memory()
            if isinstance(found, InvalidMapError):
                self.invalid += 1
                text = f"{self._source}: snapshot {snapshot.index} is left out: {found}"
                log_warning(logger, "snapshot_left_out", text, file=self._source, topic=self._topic)
            else:
                yield self._step(snapshot, found)

    def _step(self, snapshot: OccupancySnapshot, analysis: SnapshotAnalysis) -> TrackedSnapshot:
        note = coarser_for_its_size(snapshot.geometry, analysis.resolution_m, self._occupancy)
        if note is not None and not self._has_told_coarser:
            text = f"{self._source}: snapshot {snapshot.index} and those of its size: {note}"
            log_warning(logger, "coarser", text, file=self._source, topic=self._topic)
            self._has_told_coarser = True
        if not self._has_told_far:
            far = find_far_cells(snapshot.cells, snapshot.geometry.resolution_m, self._occupancy)
            if far is not None:
                text = f"{self._source}: map {snapshot.index}: {far.note}; so are those of later maps"
                log_warning(logger, "far_cells", text, topic=self._topic)
                self._has_told_far = True
        if analysis.index != snapshot.index:
            analysis = analysis.again_for(snapshot)
            self.unchanged += 1
        begun = self._begun_part(snapshot)
        track_ids, events = self._tracker.update(snapshot, analysis)
        tracker, motion = self._tracker, map_motion(events)
        change = self._layout.update(analysis.rooms, tracker.shapes, track_ids, motion, tracker.common)
        coverage = self._coverage(analysis.free_area_m2)
        poses = self._poses(snapshot, is_begun_anew=bool(begun))
        names = self._named(track_ids, analysis)
        quality = analysis.quality
        return TrackedSnapshot(
            snapshot, analysis, coverage, track_ids, begun + events, quality, change, poses, self._part, names
        )

    def _poses(self, snapshot: OccupancySnapshot, *, is_begun_anew: bool) -> FloatArray | None:
        """Poses of the robot since the map before, in the frame of this one; None if they are not wanted."""
        if self._paths is None:
            return None
        found = {
            frame: path.until(snapshot.log_time_ns, is_begun_anew=is_begun_anew)
            for frame, path in self._paths.items()
        }
        return found.get(map_frame(snapshot.geometry.frame_id), np.zeros((0, 3)))

    def _named(self, track_ids: tuple[int, ...], analysis: SnapshotAnalysis) -> tuple[str, ...]:
        """Name the rooms of a map. What lies at a point of the last part may be anything in another one."""
        if self._names is None:
            return ()
        is_of_last = self._part == next(reversed(self._final_free_m2), None)
        return self._names.of(track_ids, analysis.polygons if is_of_last else ())

    def _begun_part(self, snapshot: OccupancySnapshot) -> tuple[RoomEvent, ...]:
        """Begin a part anew if the map is the first of one; an event unless the run begins with it."""
        before, self._part = self._part, self._part_at(snapshot.log_time_ns)
        if before in (None, self._part):
            return ()
        self._tracker.begin_part()
        self._layout = LayoutFollower()
        return (RoomEvent("part_begun", snapshot.index, MAP_TRACK),)

    def _coverage(self, free_m2: float) -> float:
        final_m2 = self._final_free_m2.get(self._part)
        if final_m2 is None:
            return math.nan
        return min(free_m2 / final_m2, 1.0) if final_m2 > 0 else 0.0


def _paths_of(
    reader: LogReader, lasts: Collection[OccupancySnapshot], base_frame: str | None
) -> dict[str, RobotPath]:
    """The robot's path in the frame of the last map of each part; that of the last one is the last."""
    frames = dict.fromkeys(map_frame(each.geometry.frame_id) for each in reversed(list(lasts)))
    *others, last = reversed(frames)
    with muted():  # what is odd about the path is told of the last frame
        paths = {frame: reader.robot_path(frame, base_frame) for frame in others}
    return paths | {last: reader.robot_path(last, base_frame)}


def _analyze_or_refuse(
    snapshot: OccupancySnapshot, parameters: Parameters, method: str, voronoi: bool
) -> Found:
    try:
        return analyze(snapshot, parameters, method, voronoi=voronoi)
    except InvalidMapError as error:
        return error
    except MemoryError:
        raise
    except Exception as error:  # a map that the method stumbles over does not cost the others of the run
        at = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(at.filename).name}:{at.lineno}"
        return InvalidMapError(f"{type(error).__name__}: {error} ({where}; an internal error of rose2-logs)")
