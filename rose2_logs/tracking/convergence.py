"""What can be said of a run once its last map is known: since when each room, and the layout, was right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.model.occupancy import FloatArray
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
        By snapshot, the mean overlap of the last layout's rooms with their shape then, by area; None where
        the last map has no room.
    final_share : dict
        By snapshot, the share of the last layout's area that was in rooms in their final shape.
    layout_final : SnapshotRef or None
        The map from which on this share stayed above `final_min_share`; None where the last map has no room.
    """

    area_settled: dict[int, SnapshotRef] = field(default_factory=dict)
    shape_right: dict[int, SnapshotRef] = field(default_factory=dict)
    shape_right_seen: dict[int, float] = field(default_factory=dict)
    final_iou: dict[int, float | None] = field(default_factory=dict)
    final_share: dict[int, float | None] = field(default_factory=dict)
    layout_final: SnapshotRef | None = None


def measure_convergence(
    rows: Iterable[RoomRows],
    histories: TrackHistories,
    snapshot_refs: Mapping[int, SnapshotRef],
    drifts: Mapping[int, RigidMotion],
    parameters: TrackingParameters | None = None,
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
    """
    parameters = parameters or TrackingParameters()
    measured = Convergence()
    weight = {track: histories.tracks[track].polygon.area for track in histories.in_last_map}
    total = sum(weight.values())
    final_iou, final_share = dict.fromkeys(snapshot_refs, 0.0), dict.fromkeys(snapshot_refs, 0.0)
    for batch in rows:
        for snapshot, track, area, iou in zip(
            batch.snapshot.tolist(),
            batch.track.tolist(),
            batch.area_m2.tolist(),
            _iou_with_last(batch, histories, drifts).tolist(),
            strict=True,
        ):
            last = histories.tracks[track].area_m2
            if abs(area - last) > parameters.settled_area_tolerance * last:
                measured.area_settled.pop(track, None)
            else:
                measured.area_settled.setdefault(track, snapshot_refs[snapshot])
            if iou >= parameters.last_shape_min_iou and track not in measured.shape_right:
                measured.shape_right[track] = snapshot_refs[snapshot]
                measured.shape_right_seen[track] = area / last if last > 0 else 0.0
            if track in weight:
                final_iou[snapshot] += iou * weight[track]
                final_share[snapshot] += (iou >= parameters.last_shape_min_iou) * weight[track]
    for snapshot, snapshot_ref in snapshot_refs.items():
        share = final_share[snapshot] / total if total > 0 else None
        measured.final_iou[snapshot] = final_iou[snapshot] / total if total > 0 else None
        measured.final_share[snapshot] = share
        if share is None or share < parameters.final_min_share:
            measured.layout_final = None
        elif measured.layout_final is None:
            measured.layout_final = snapshot_ref
    return measured


def _iou_with_last(
    rows: RoomRows, histories: TrackHistories, drifts: Mapping[int, RigidMotion]
) -> FloatArray:
    """Intersection over union (N,) of each room with its track's last shape, both where the last one lay."""
    ends = [histories.tracks[track] for track in rows.track.tolist()]
    then = _placed(
        rows.polygons,
        [
            (drifts[snapshot], drifts[end.last.snapshot])
            for snapshot, end in zip(rows.snapshot.tolist(), ends, strict=True)
        ],
    )
    last = _valid(np.array([end.polygon for end in ends], object))
    common = shapely.area(shapely.intersection(then, last))
    union = shapely.area(then) + shapely.area(last) - common
    return share_of(common, union)


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
