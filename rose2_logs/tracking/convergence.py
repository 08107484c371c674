"""What can be said of a run once its last map is known: since when each room, and the layout, was right."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.model.per_shape import PerShape
from rose2_logs.system.workers import threaded_map
from rose2_logs.tracking.overlap import share_of
from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.track_history import SnapshotRef, TrackHistories


@dataclass(frozen=True, eq=False)
class RoomRows:
    """Rooms of some maps, in the order of the maps.

    Attributes
    ----------
    snapshot, track : (N,) int
        Map and track of each.
    area_m2 : (N,) float
        Its area as far as it was seen.
    polygons : (N,) shapely geometries
        Its shape with the predicted part, where its map lay.
    """

    snapshot: NDArray[np.integer]
    track: NDArray[np.integer]
    area_m2: FloatArray
    polygons: NDArray[np.object_]

    def part(self, begin: int, end: int) -> RoomRows:
        """Some rows, from `begin` on and before `end`."""
        return RoomRows(*(column[begin:end] for column in self._columns))

    @classmethod
    def joined(cls, parts: Sequence[RoomRows]) -> RoomRows:
        """Rows one after the other."""
        return cls(
            *(np.concatenate(of_column) for of_column in zip(*(p._columns for p in parts), strict=True))
        )

    @property
    def _columns(self) -> tuple[NDArray[Any], ...]:
        return self.snapshot, self.track, self.area_m2, self.polygons


@dataclass
class Convergence:
    """Since when what was right.

    Attributes
    ----------
    area_settled : dict
        By track, the map from which on its area stayed within `settled_area_tolerance` of its last.
    shape_right : dict
        By track, the first map whose shape overlapped its last by `last_shape_min_iou`.
    shape_right_seen : dict
        By track, the area seen of it at that time over its last.
    final_iou : dict
        By snapshot, the mean overlap of the last layout's rooms with the map's rooms that are most like them,
        by area; None where the last map has no room.
    final_share : dict
        By snapshot, the share of the last layout's area in rooms that the map had: some room of the map
        overlaps them by `final_room_min_iou`. None where the last map has no room.
    known_final_share : dict
        The same of the floor that is in a room both in the map and in the last one, with both divisions
        compared on this floor alone: what was not seen yet does not count. None without such floor.
    layout_final, known_final : SnapshotRef or None
        The map from which on `final_share`, and `known_final_share`, stayed at `final_min_share` or above;
        None where the last map has no room.
    brief : tuple of int
        The tracks that fewer than `lasting_min_maps` maps show, and the last map does not.
    """

    area_settled: dict[int, SnapshotRef] = field(default_factory=dict)
    shape_right: dict[int, SnapshotRef] = field(default_factory=dict)
    shape_right_seen: dict[int, float] = field(default_factory=dict)
    final_iou: dict[int, float | None] = field(default_factory=dict)
    final_share: dict[int, float | None] = field(default_factory=dict)
    known_final_share: dict[int, float | None] = field(default_factory=dict)
    layout_final: SnapshotRef | None = None
    known_final: SnapshotRef | None = None
    brief: tuple[int, ...] = ()

    @classmethod
    def joined(cls, parts: Sequence[Convergence]) -> Convergence:
        """Take the parts of a run together; the layout is that of the last one."""
        joined = cls(layout_final=parts[-1].layout_final, known_final=parts[-1].known_final)
        for part in parts:
            joined.area_settled |= part.area_settled
            joined.shape_right |= part.shape_right
            joined.shape_right_seen |= part.shape_right_seen
            joined.final_iou |= part.final_iou
            joined.final_share |= part.final_share
            joined.known_final_share |= part.known_final_share
            joined.brief += part.brief
        return joined


def measure_convergence(
    rows: Iterable[RoomRows],
    histories: TrackHistories,
    snapshot_refs: Mapping[int, SnapshotRef],
    drifts: Mapping[int, RigidMotion],
    parameters: TrackingParameters | None = None,
    *,
    threads: int = 1,
) -> Convergence:
    """Compare the rooms of every map with what they were in the end.

    Parameters
    ----------
    rows : iterable of RoomRows
        Every room of every map, in the order of the maps.
    histories : TrackHistories
        What is known of the rooms in the end.
    snapshot_refs : mapping of int to SnapshotRef
        Every map, by snapshot, in their order.
    drifts : mapping of int to RigidMotion
        How each moved since the first one.
    parameters : TrackingParameters, optional
        From when on an area has settled, a shape is that of the last map, and the layout is final.
    threads : int
        How many compare maps at once.
    """
    parameters = parameters or TrackingParameters()
    layout = _LastLayout(histories, drifts, parameters.final_room_min_iou)
    measured = Convergence()
    likeness = dict.fromkeys(snapshot_refs, layout.likeness_of_nothing)
    for of_map, placed in threaded_map(layout.placed, map_by_map(rows), threads):
        iou = _iou_with_last(of_map, placed, histories, drifts)
        _follow_tracks(measured, of_map, iou, histories, snapshot_refs, parameters)
        likeness[int(of_map.snapshot[0])] = layout.likeness(placed)
    measured.final_iou = {snapshot: like.iou for snapshot, like in likeness.items()}
    measured.final_share = {snapshot: like.share for snapshot, like in likeness.items()}
    measured.known_final_share = {snapshot: like.known_share for snapshot, like in likeness.items()}
    least = parameters.final_min_share
    measured.layout_final = _since(measured.final_share, snapshot_refs, least)
    measured.known_final = _since(measured.known_final_share, snapshot_refs, least)
    in_last = set(histories.in_last_map)
    measured.brief = tuple(
        track
        for track, history in sorted(histories.tracks.items())
        if history.maps < parameters.lasting_min_maps and track not in in_last
    )
    return measured


def map_by_map(rows: Iterable[RoomRows]) -> Iterator[RoomRows]:
    """Rooms of one map at a time, however they came together."""
    held: list[RoomRows] = []
    for batch in rows:
        ends = [*(np.flatnonzero(np.diff(batch.snapshot)) + 1).tolist(), len(batch.snapshot)]
        for begin, end in pairwise([0, *ends]):
            if begin == end:
                continue
            part = batch.part(begin, end)
            if held and held[0].snapshot[0] != part.snapshot[0]:
                yield RoomRows.joined(held)
                held = []
            held.append(part)
    if held:
        yield RoomRows.joined(held)


def _follow_tracks(
    measured: Convergence,
    rows: RoomRows,
    iou_with_last: FloatArray,
    histories: TrackHistories,
    snapshot_refs: Mapping[int, SnapshotRef],
    parameters: TrackingParameters,
) -> None:
    """Note for each room of the next map whether its area and its shape are those of its track in the end."""
    for snapshot, track, area, iou in zip(
        rows.snapshot.tolist(),
        rows.track.tolist(),
        rows.area_m2.tolist(),
        iou_with_last.tolist(),
        strict=True,
    ):
        last = histories.tracks[track].area_m2
        if abs(area - last) > parameters.settled_area_tolerance * last:
            measured.area_settled.pop(track, None)
        else:
            measured.area_settled.setdefault(track, snapshot_refs[snapshot])
        if iou >= parameters.last_shape_min_iou and track not in measured.shape_right:
            measured.shape_right[track] = snapshot_refs[snapshot]
            measured.shape_right_seen[track] = min(area / last, 1.0) if last > 0 else 0.0


def _since(
    shares: Mapping[int, float | None], snapshot_refs: Mapping[int, SnapshotRef], least: float
) -> SnapshotRef | None:
    """The first of the maps at the end of the run whose shares are all at least so much."""
    since = None
    for snapshot, share in reversed(list(shares.items())):
        if share is None or share < least:
            break
        since = snapshot_refs[snapshot]
    return since


@dataclass(frozen=True, eq=False)
class _Placed:
    """The rooms of one map where they lie in the last one.

    Attributes
    ----------
    areas, last_areas : (R,) and (F,) float
        Of their shapes, and of those of the last map's rooms.
    common : (R, F) float
        What each has in common with each room of the last map.
    """

    areas: FloatArray
    last_areas: FloatArray
    common: FloatArray

    @property
    def iou(self) -> FloatArray:
        """Intersection over union (R, F) of each pair."""
        return share_of(self.common, self.areas[:, None] + self.last_areas - self.common)


@dataclass(frozen=True)
class _Likeness:
    """How far a map's layout is that of the last map: see `Convergence`."""

    iou: float | None
    share: float | None
    known_share: float | None


class _LastLayout:
    """The rooms of the last map, which those of each map are compared with, whatever their tracks.

    Parameters
    ----------
    histories : TrackHistories
        With the shapes of the last map's rooms.
    drifts : mapping of int to RigidMotion
        How each map moved since the first one.
    room_min_iou : float
        Rooms that overlap by this much are the same.
    """

    def __init__(
        self, histories: TrackHistories, drifts: Mapping[int, RigidMotion], room_min_iou: float
    ) -> None:
        rooms = [histories.tracks[track].polygon for track in histories.in_last_map]
        self._rooms = _valid(np.array(rooms, object))
        self._areas = shapely.area(self._rooms)
        self._tree = shapely.STRtree(self._rooms)
        self._drifts = drifts
        self._last = None if histories.last is None else histories.last.snapshot
        self._room_min_iou = room_min_iou
        self._common_of_rooms = PerShape(self._common)

    @property
    def likeness_of_nothing(self) -> _Likeness:
        """How a map without rooms compares."""
        none = 0.0 if self._areas.sum() > 0 else None
        return _Likeness(none, none, None)

    def placed(self, rows: RoomRows) -> _Placed:
        """Lay the rooms of one map over those of the last one."""
        assert self._last is not None  # at the latest, it is this map
        drift = self._drifts[int(rows.snapshot[0])], self._drifts[self._last]
        rooms = _placed(rows.polygons, [drift] * len(rows.polygons))
        return _Placed(shapely.area(rooms), self._areas, np.stack(self._common_of_rooms(rooms)))

    def _common(self, rooms: NDArray[np.object_]) -> list[FloatArray]:
        """What each of some shapes has in common with each room of the last map (F,)."""
        shapely.prepare(rooms)
        room, last = self._tree.query(rooms, predicate="intersects")
        # Many are neighbors, which is found much faster than what shapes have in common.
        shares_area = ~shapely.touches(rooms[room], self._rooms[last])
        room, last = room[shares_area], last[shares_area]
        common = np.zeros((len(rooms), len(self._rooms)))
        common[room, last] = shapely.area(shapely.intersection(rooms[room], self._rooms[last]))
        return list(common)

    def likeness(self, placed: _Placed) -> _Likeness:
        """Compare the rooms of one map."""
        total = float(self._areas.sum())
        if total == 0:
            return self.likeness_of_nothing
        common = placed.common
        iou = placed.iou.max(axis=0)
        known = common.sum(axis=0)
        known_iou = share_of(common, common.sum(axis=1)[:, None] + known - common).max(axis=0)
        known_total = float(known.sum())
        return _Likeness(
            float(iou @ self._areas) / total,
            float(self._areas[iou >= self._room_min_iou].sum()) / total,
            float(known[known_iou >= self._room_min_iou].sum()) / known_total if known_total > 0 else None,
        )


def _iou_with_last(
    rows: RoomRows, placed: _Placed, histories: TrackHistories, drifts: Mapping[int, RigidMotion]
) -> FloatArray:
    """Intersection over union (N,) of each room with its track's last shape, both where the last one lay."""
    column = {track: number for number, track in enumerate(histories.in_last_map)}
    at = np.array([column.get(track, -1) for track in rows.track.tolist()], np.intp)
    here, gone = np.flatnonzero(at >= 0), np.flatnonzero(at < 0)
    iou = np.zeros(len(at))
    iou[here] = placed.iou[here, at[here]]
    ends = [histories.tracks[track] for track in rows.track[gone].tolist()]
    pairs = [
        (drifts[snapshot], drifts[end.last.snapshot])
        for snapshot, end in zip(rows.snapshot[gone].tolist(), ends, strict=True)
    ]
    then, last = _placed(rows.polygons[gone], pairs), _valid(np.array([end.polygon for end in ends], object))
    common = shapely.area(shapely.intersection(then, last))
    iou[gone] = share_of(common, shapely.area(then) + shapely.area(last) - common)
    return iou


def _placed(
    polygons: NDArray[np.object_], drifts: Sequence[tuple[RigidMotion, RigidMotion]]
) -> NDArray[np.object_]:
    """Shapes where a map of another drift has them; those of equal drift stay as they are."""
    moved = polygons.copy()
    places: dict[tuple[RigidMotion, RigidMotion], list[int]] = {}
    for place, pair in enumerate(drifts):
        if pair[0] != pair[1]:
            places.setdefault(pair, []).append(place)
    for pair, chosen in places.items():
        moved[chosen] = shapely.transform(moved[chosen], pair[0].inverse().then(pair[1]).points)
    return _valid(moved)


def _valid(polygons: NDArray[np.object_]) -> NDArray[np.object_]:
    """The same shapes, repaired where rounding made them cross themselves."""
    wrong = ~shapely.is_valid(polygons)
    if wrong.any():
        polygons = polygons.copy()
        polygons[wrong] = shapely.make_valid(polygons[wrong])
    return polygons
