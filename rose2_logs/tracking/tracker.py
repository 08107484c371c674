"""RoomTracker: the one place that remembers, so that a room keeps its number over the run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import BoolArray, FloatArray, GridGeometry, OccupancySnapshot
from rose2_logs.parameters import TrackingParameters
from rose2_logs.pipeline import SnapshotAnalysis
from rose2_logs.rooms import RoomMap
from rose2_logs.tracking.frames import EventKind, RoomEvent
from rose2_logs.tracking.matching import RegionShape, assign, resample_labels
from rose2_logs.tracking.overlap import Overlap, overlap_of

EVENT_ORDER: tuple[EventKind, ...] = ("continued", "returned", "born", "split", "merged", "lost")
"""Order of one snapshot's events: what the rooms are, then what became of the tracks before."""


@dataclass(frozen=True, eq=False)
class _LastMap:
    """The labels of the map before, the track and the area in square metres of each."""

    geometry: GridGeometry
    labels: NDArray[np.int32]
    tracks: tuple[int, ...]
    areas_m2: FloatArray


class RoomTracker:
    """Gives the rooms of successive maps the numbers of the tracks that they continue.

    Rooms are compared where they lie in the world, whatever the maps' canvas. A room can continue a track of
    the map before if their intersection over union is at least `match_min_iou`, or if the larger one holds
    `part_min_share` of the smaller, as when a room seen through its door is entered; among these pairs
    those with the greatest sum of intersection over union are taken. What is left is compared with the
    last shapes of lost tracks, and then gets a new number. Numbers are 1, 2, ... in the order of appearance
    and belong to one room for ever.

    Memory: the labels of one map, and the packed shapes of at most `lost_kept` lost tracks.

    Parameters
    ----------
    parameters : TrackingParameters
        Thresholds.
    """

    def __init__(self, parameters: TrackingParameters) -> None:
        self._parameters = parameters
        self._last: _LastMap | None = None
        self._lost: dict[int, RegionShape] = {}
        self._next_track = 1

    def update(
        self, snapshot: OccupancySnapshot, analysis: SnapshotAnalysis
    ) -> tuple[tuple[int, ...], tuple[RoomEvent, ...]]:
        """Number the rooms of the next map of the run.

        Parameters
        ----------
        snapshot : OccupancySnapshot
            The map; its index goes into the events.
        analysis : SnapshotAnalysis
            Its rooms.

        Returns
        -------
        track_ids : tuple of R int
            The track of room i + 1.
        events : tuple of RoomEvent
            Each room gives one of continued, returned, born; each track of the map before that has no room
            any more gives one lost. The split or merge that explains them comes in addition.
        """
        now = _last_map(analysis.rooms)
        overlap = self._overlap_with_last(now)
        tracks = np.zeros(len(now.areas_m2), np.int64)
        events = self._continue(snapshot.index, overlap, tracks)
        events += self._return(snapshot.index, now, tracks)
        events += self._begin(snapshot.index, tracks)
        events += self._explain(snapshot.index, overlap, tracks, events)
        events += self._end(snapshot.index, tracks)
        events.sort(key=lambda event: (EVENT_ORDER.index(event.kind), event.track))
        track_ids = tuple(tracks.tolist())
        self._last = _LastMap(now.geometry, now.labels, track_ids, now.areas_m2)
        return track_ids, tuple(events)

    def _overlap_with_last(self, now: _LastMap) -> Overlap:
        """Areas in square metres that the last map's rooms (rows) share with those of now (columns)."""
        last_areas = np.zeros(0) if self._last is None else self._last.areas_m2
        common = np.zeros((len(last_areas), len(now.areas_m2)))
        if self._last is not None:
            there = resample_labels(self._last.labels, self._last.geometry, now.geometry)
            found = overlap_of(there, now.labels)
            where = np.ix_(found.first_ids - 1, found.second_ids - 1)
            common[where] = found.common * now.geometry.cell_area_m2
            # Between grids of different resolution or yaw, sampling may count a little more than there is.
            common = np.minimum(common, np.minimum(last_areas[:, None], now.areas_m2))
        ids = [np.arange(1, size + 1) for size in common.shape]
        return Overlap(ids[0], ids[1], last_areas, now.areas_m2, common)

    def _is_part(self, overlap: Overlap) -> BoolArray:
        """Pairs (A, B) where the larger room holds most of the smaller."""
        return (overlap.common > 0) & (overlap.share_of_smaller >= self._parameters.part_min_share)

    def _continue(self, index: int, overlap: Overlap, tracks: NDArray[np.int64]) -> list[RoomEvent]:
        iou = overlap.iou
        similar = (overlap.common > 0) & (iou >= self._parameters.match_min_iou)
        events = []
        for row, column in assign(iou, similar | self._is_part(overlap)):
            tracks[column] = self._last_tracks[row]
            events.append(RoomEvent("continued", index, int(tracks[column]), (), float(iou[row, column])))
        return events

    def _return(self, index: int, now: _LastMap, tracks: NDArray[np.int64]) -> list[RoomEvent]:
        """Give rooms without a track that of a lost room that lay at the same place."""
        new = np.flatnonzero((tracks == 0) & (now.areas_m2 > 0))
        if len(new) == 0 or not self._lost:
            return []
        lost = list(self._lost)
        boxes = _world_boxes(now)[new]
        iou = np.zeros((len(lost), len(new)))
        for row, track in enumerate(lost):
            shape = self._lost[track]
            if np.any(np.all((boxes[:, :2] < shape.box_m[2:]) & (boxes[:, 2:] > shape.box_m[:2]), axis=1)):
                common = shape.common_area_m2(now.labels, now.geometry, len(tracks))[new]
                common = np.minimum(common, np.minimum(shape.area_m2, now.areas_m2[new]))
                iou[row] = common / (shape.area_m2 + now.areas_m2[new] - common)
        events = []
        for row, column in assign(iou, (iou > 0) & (iou >= self._parameters.match_min_iou)):
            tracks[new[column]] = lost[row]
            del self._lost[lost[row]]
            events.append(RoomEvent("returned", index, lost[row], (), float(iou[row, column])))
        return events

    def _begin(self, index: int, tracks: NDArray[np.int64]) -> list[RoomEvent]:
        new = np.flatnonzero(tracks == 0)
        tracks[new] = np.arange(self._next_track, self._next_track + len(new))
        self._next_track += len(new)
        return [RoomEvent("born", index, track) for track in tracks[new].tolist()]

    def _explain(
        self, index: int, overlap: Overlap, tracks: NDArray[np.int64], so_far: list[RoomEvent]
    ) -> list[RoomEvent]:
        """Say which tracks were split, and which ended in a merge.

        A room of now that no track of the map before continues in, but that was part of one, is a part
        split off; a track that ended as a part of a room of now was merged into it.
        """
        before, part, iou = np.array(self._last_tracks, np.int64), self._is_part(overlap), overlap.iou
        continued = [event.track for event in so_far if event.kind == "continued"]
        goes_on, is_old = np.isin(before, continued), np.isin(tracks, continued)
        column_of = {track: column for column, track in enumerate(tracks.tolist())}
        row_of = {track: row for row, track in enumerate(before.tolist())}
        events = []
        for track in continued:
            row, column = row_of[track], column_of[track]
            parts = tuple(sorted(tracks[part[row] & ~is_old].tolist()))
            if parts:
                events.append(RoomEvent("split", index, track, parts, float(iou[row, column])))
            ended = tuple(sorted(before[part[:, column] & ~goes_on].tolist()))
            if ended:
                events.append(RoomEvent("merged", index, track, ended, float(iou[row, column])))
        return events

    def _end(self, index: int, tracks: NDArray[np.int64]) -> list[RoomEvent]:
        """Keep the last shape of each track that has no room any more, as far as there is space."""
        events = []
        for number, track in enumerate(self._last_tracks):
            if self._last is not None and track not in tracks:
                events.append(RoomEvent("lost", index, track))
                if self._last.areas_m2[number] > 0:
                    mask = self._last.labels == number + 1
                    self._lost[track] = RegionShape.cut_out(mask, self._last.geometry)
        for track in list(self._lost)[: max(0, len(self._lost) - self._parameters.lost_kept)]:
            del self._lost[track]
        return events

    @property
    def _last_tracks(self) -> tuple[int, ...]:
        return () if self._last is None else self._last.tracks


def _last_map(rooms: RoomMap) -> _LastMap:
    count = len(rooms)
    cells = np.bincount(rooms.labels.ravel(), minlength=count + 1)[1 : count + 1].astype(np.float64)
    return _LastMap(rooms.geometry, rooms.labels, (), cells * rooms.geometry.cell_area_m2)


def _world_boxes(map_: _LastMap) -> FloatArray:
    """Boxes (R, 4) x0, y0, x1, y1 around each room's cells, world metres; NaN for a room without cells."""
    from scipy.ndimage import find_objects

    boxes = np.full((len(map_.areas_m2), 4), np.nan)
    for number, place in enumerate(find_objects(map_.labels, max_label=len(boxes))):
        if place is not None:
            rows, columns = place
            x, y = [columns.start, columns.stop], [rows.start, rows.stop]
            corners = np.array([(a, b) for a in x for b in y]) * map_.geometry.resolution_m
            world = map_.geometry.grid_to_world(corners)
            boxes[number] = np.concatenate([world.min(0), world.max(0)])
    return boxes
