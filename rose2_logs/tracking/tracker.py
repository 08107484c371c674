"""RoomTracker: the one place that remembers, so that a room keeps its number over the run."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.occupancy import BoolArray, FloatArray, OccupancySnapshot
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.matching import RegionShape, assign, cut_out_rooms
from rose2_logs.tracking.memory import TrackMemory
from rose2_logs.tracking.overlap import share_of
from rose2_logs.tracking.registration import MapAligner
from rose2_logs.tracking.tracked_snapshot import EVENT_ORDER, MAP_TRACK, EventKind, RoomEvent


@dataclass(frozen=True, eq=False)
class _Overlaps:
    """What tracks (rows) and the rooms of a map (columns) have in common.

    Attributes
    ----------
    tracks : (A,) int
        The tracks.
    iou : list of A (S, R) float
        Intersection over union with each shape in the track's memory.
    newest : (A, R) float
        The same with the newest shape.
    is_part : (A, R) bool
        One of the newest shape and the room holds most of the other.
    """

    tracks: NDArray[np.int64]
    iou: list[FloatArray]
    newest: FloatArray
    is_part: BoolArray

    @property
    def best(self) -> FloatArray:
        """Intersection over union (A, R) with the shape that is most alike."""
        return np.array([row.max(axis=0) for row in self.iou]).reshape(self.newest.shape)


@dataclass
class _Tracks:
    """Every track that can be continued, and whether the map before had a room of it."""

    memory: dict[int, TrackMemory] = field(default_factory=dict)
    present: tuple[int, ...] = ()
    lost: dict[int, None] = field(default_factory=dict)
    """In the order in which they were lost."""
    count: int = 0


class RoomTracker:
    """Gives the rooms of successive maps the numbers of the tracks that they continue.

    Rooms are compared in world coordinates, whatever the maps' canvas; where the whole map moved, as
    in a loop closure, what is remembered moves along. A track remembers a few shapes of its room. A room can
    continue a track, also a lost one, if it overlaps one of them by `match_min_iou`, or if it or the newest
    one holds `part_min_share` of the other, as when a room seen through its door is entered. Among all these
    pairs those with the greatest sum of squared overlap are taken; what is left gets a new number. Numbers
    are 1, 2, ... in the order of appearance and belong to one room forever.

    Memory: `shapes_kept` packed shapes for each track of the last map and for at most `lost_kept` lost ones,
    and the points of the last map's walls.

    Parameters
    ----------
    parameters : TrackingParameters
        Thresholds.
    occupancy : OccupancyParameters, optional
        Which cells are walls.

    Attributes
    ----------
    shapes : tuple of RegionShape or None
        The rooms of the last map, cut out; None for one without cells.
    common : dict of RegionShape to (R,) float
        Area in square meters that shapes from before have in common with each of these rooms, where they may
        have any.
    """

    def __init__(self, parameters: TrackingParameters, occupancy: OccupancyParameters | None = None) -> None:
        self._parameters = parameters
        self._occupancy = occupancy
        self._aligner = MapAligner(parameters, occupancy)
        self._tracks = _Tracks()
        self.shapes: tuple[RegionShape | None, ...] = ()
        self.common: dict[RegionShape, FloatArray] = {}

    def begin_part(self) -> None:
        """Forget all rooms, as the next map does not grow from the ones before; numbers go on."""
        self._aligner = MapAligner(self._parameters, self._occupancy)
        self._tracks = _Tracks(count=self._tracks.count)

    def update(
        self, snapshot: OccupancySnapshot, analysis: SnapshotAnalysis | RoomMap
    ) -> tuple[tuple[int, ...], tuple[RoomEvent, ...]]:
        """Number the rooms of the next map of the run.

        Parameters
        ----------
        snapshot : OccupancySnapshot
            The map; its index goes into the events, its walls show whether it moved.
        analysis : SnapshotAnalysis or RoomMap
            Its rooms, or the analysis that holds them.

        Returns
        -------
        track_ids : tuple of R int
            The track of room i + 1.
        events : tuple of RoomEvent
            Each room gives one of continued, returned, born; each track of the map before that has no room
            any more gives one lost. The split or merge that explains them comes in addition, and a shift of
            the whole map.
        """
        rooms = analysis if isinstance(analysis, RoomMap) else analysis.rooms
        events = self._move(snapshot)
        self.shapes = shapes = cut_out_rooms(rooms)
        overlaps = self._overlaps(rooms, shapes)
        ids = self._assign(overlaps)
        events += self._name(snapshot.index, overlaps, ids)
        events += self._explain(snapshot.index, overlaps, ids)
        events += self._remember(snapshot.index, overlaps, shapes, ids)
        events.sort(key=lambda event: (EVENT_ORDER.index(event.kind), event.track))
        return tuple(ids.tolist()), tuple(events)

    def _move(self, snapshot: OccupancySnapshot) -> list[RoomEvent]:
        motion = self._aligner.update(snapshot)
        if motion is None:
            return []
        for memory in self._tracks.memory.values():
            memory.move(motion)
        return [RoomEvent("shifted", snapshot.index, MAP_TRACK, motion=motion)]

    def _overlaps(self, rooms: RoomMap, shapes: tuple[RegionShape | None, ...]) -> _Overlaps:
        areas = np.array([0.0 if shape is None else shape.area_m2 for shape in shapes])
        boxes = np.array([np.full(4, np.nan) if shape is None else shape.box_m for shape in shapes])
        boxes = boxes.reshape(-1, 4)
        memories = self._tracks.memory.values()
        known = [shape for memory in memories for shape in memory.shapes]
        ends = np.cumsum([0, *(len(memory.shapes) for memory in memories)]).tolist()
        their_boxes = np.array([shape.box_m for shape in known]).reshape(-1, 1, 4)
        meet = (boxes[:, :2] < their_boxes[..., 2:]) & (boxes[:, 2:] > their_boxes[..., :2])
        common = np.zeros((len(known), len(areas)))
        self.common = {}
        for row in np.unique(np.nonzero(meet.all(axis=2))[0]).tolist():
            shared = known[row].common_area_m2(rooms.labels, rooms.geometry, len(areas))
            common[row] = self.common[known[row]] = shared
        sizes = np.array([shape.area_m2 for shape in known]).reshape(-1, 1)
        smaller = np.minimum(sizes, areas)
        # Between grids of different resolution or yaw, sampling may count a little more than there is.
        common = np.minimum(common, smaller)
        iou = share_of(common, sizes + areas - common)
        is_part = (common > 0) & (common >= self._parameters.part_min_share * smaller)
        newest = np.array(ends[1:], np.int64) - 1
        tracks = np.array(list(self._tracks.memory), np.int64)
        of_track = [iou[begin:end] for begin, end in pairwise(ends)]
        return _Overlaps(tracks, of_track, iou[newest], is_part[newest])

    def _assign(self, overlaps: _Overlaps) -> NDArray[np.int64]:
        """Track of each room, 0 for a new one."""
        ids = np.zeros(overlaps.newest.shape[1], np.int64)
        best = overlaps.best
        same = (best > 0) & ((best >= self._parameters.match_min_iou) | overlaps.is_part)
        for row, column in assign(best**self._parameters.match_power, same):
            ids[column] = overlaps.tracks[row]
        return ids

    def _name(self, index: int, overlaps: _Overlaps, ids: NDArray[np.int64]) -> list[RoomEvent]:
        """Give new rooms their numbers, and say what every room is."""
        events = []
        row_of = {track: row for row, track in enumerate(overlaps.tracks.tolist())}
        for column, track in enumerate(ids.tolist()):
            if track == 0:
                self._tracks.count += 1
                ids[column] = self._tracks.count
                events.append(RoomEvent("born", index, self._tracks.count))
            else:
                kind: EventKind = "returned" if track in self._tracks.lost else "continued"
                overlap = float(overlaps.newest[row_of[track], column])
                events.append(RoomEvent(kind, index, track, overlap=overlap))
        return events

    def _explain(self, index: int, overlaps: _Overlaps, ids: NDArray[np.int64]) -> list[RoomEvent]:
        """Say which tracks were split, and which ended in a merge.

        A room of now that no track of the map before continues in, but that was part of one, is a part split
        off; a track that ended as a part of a room of now was merged into it.
        """
        present = np.isin(overlaps.tracks, self._tracks.present)
        goes_on, is_old = np.isin(overlaps.tracks, ids), np.isin(ids, self._tracks.present)
        row_of = {track: row for row, track in enumerate(overlaps.tracks.tolist())}
        events = []
        for column in np.flatnonzero(is_old).tolist():
            track = int(ids[column])
            row = row_of[track]
            overlap = float(overlaps.newest[row, column])
            parts = tuple(sorted(ids[overlaps.is_part[row] & ~is_old].tolist()))
            if parts:
                events.append(RoomEvent("split", index, track, parts, overlap))
            ended = overlaps.tracks[overlaps.is_part[:, column] & present & ~goes_on]
            if len(ended):
                events.append(RoomEvent("merged", index, track, tuple(sorted(ended.tolist())), overlap))
        return events

    def _remember(
        self, index: int, overlaps: _Overlaps, shapes: tuple[RegionShape | None, ...], ids: NDArray[np.int64]
    ) -> list[RoomEvent]:
        """Keep the rooms' shapes, and those of lost tracks as far as there is space."""
        tracks, parameters = self._tracks, self._parameters
        row_of = {track: row for row, track in enumerate(overlaps.tracks.tolist())}
        for column, (track, shape) in enumerate(zip(ids.tolist(), shapes, strict=True)):
            tracks.lost.pop(track, None)
            if shape is None:
                continue
            if track in tracks.memory:
                iou = overlaps.iou[row_of[track]][:, column]
                tracks.memory[track].take(shape, iou, parameters.shape_same_iou, parameters.shapes_kept)
            else:
                tracks.memory[track] = TrackMemory(shape)
        now = set(ids.tolist())
        gone = sorted(track for track in tracks.present if track not in now)
        tracks.lost.update(dict.fromkeys(track for track in gone if track in tracks.memory))
        for track in list(tracks.lost)[: max(0, len(tracks.lost) - parameters.lost_kept)]:
            del tracks.lost[track], tracks.memory[track]
        tracks.present = tuple(sorted(now))
        return [RoomEvent("lost", index, track) for track in gone]
