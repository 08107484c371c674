"""The rooms of a run's last map upon all its maps, as layers of a recording."""

from __future__ import annotations

import numpy as np
import rerun as rr

from rose2_logs.drawing.palette import track_color
from rose2_logs.model.room_names import NameOf, room_name, short_name
from rose2_logs.model.rooms import RoomMap
from rose2_logs.outputs.rerun.columns import Label, Scalar, Strips
from rose2_logs.outputs.rerun.layers import Layers
from rose2_logs.outputs.rerun.pictures import MapPictures
from rose2_logs.outputs.rerun.world import (
    FILLS,
    HEIGHTS,
    LAYER_STEP_M,
    OUTLINE_POINTS,
    OUTLINE_SHADE,
    label_style,
    lifted,
    line_style,
    room_label,
)
from rose2_logs.system.text import percent
from rose2_logs.tracking.back_projection import BackProjectedSnapshot

BACK_PROJECTED, SEEN_SHARE = "/world/back_projected", "/run/seen_share"
OUTLINES, NAMES = f"{BACK_PROJECTED}/outlines", f"{BACK_PROJECTED}/names"
LAYER = HEIGHTS.index(FILLS) + 0.5
"""They stand in place of the map's own rooms, right above them."""
OUTLINE_LAYER, NAME_LAYER = LAYER + 1, len(HEIGHTS)


class BackProjectedWorld:
    """Logs the back-projected rooms of one map after the other, in a second pass along the run.

    Parameters
    ----------
    layers : Layers
        A separate stream, because this pass begins at the first map again.
    recording : RecordingStream
        For what stays the same over the run.
    name_of : callable
        Name of a room by its track.
    """

    def __init__(self, layers: Layers, recording: rr.RecordingStream, name_of: NameOf = room_name) -> None:
        self._layers = layers
        self._name_of = name_of
        self._recording = recording
        self._known: set[int] = set()
        self._named: set[int] = set()
        recording.log(OUTLINES, line_style(OUTLINE_POINTS, None), static=True)

    def log(self, found: BackProjectedSnapshot, coverage_percent: int, view_side_m: float) -> None:
        """Log one map, in the order of the run, at its percent of coverage, for a view of that size."""
        snapshot = found.snapshot
        self._layers.begin(snapshot.log_time_ns, snapshot.stamp_ns, snapshot.index, coverage_percent)
        pictures = MapPictures(snapshot)
        self._layers.show(
            BACK_PROJECTED, pictures.rooms(found.rooms.labels, found.track_ids, LAYER * LAYER_STEP_M)
        )
        self._layers.show(OUTLINES, _outlines(found))
        seen = RoomMap.from_labels(found.rooms.labels, snapshot.geometry)
        points = lifted(seen.label_points_m, NAME_LAYER).tolist()
        shown = set()
        for room, (track, area, last) in enumerate(
            zip(
                found.track_ids,
                found.rooms.areas_m2.tolist(),
                found.last_rooms.areas_m2.tolist(),
                strict=True,
            )
        ):
            if track not in self._known:
                self._known.add(track)
                self._begin_track(track)
            share = area / last if last > 0 else 0.0
            self._layers.add(f"{SEEN_SHARE}/{track}", Scalar(100 * share))
            if area > 0:
                shown.add(track)
                name = short_name(track, self._name_of)
                label = room_label(name, last, view_side_m, text=percent(min(share, 1.0)))
                self._layers.show(f"{NAMES}/{track}", Label(tuple(points[room]), label))
        for track in sorted(self._named - shown):
            self._layers.clear(f"{NAMES}/{track}")
        self._named = shown

    def flush(self) -> None:
        """Write all that waits."""
        self._layers.flush()

    def _begin_track(self, track: int) -> None:
        """Log what stays the same for a room."""
        self._recording.log(f"{NAMES}/{track}", label_style(), static=True)
        curve = rr.SeriesLines(colors=[track_color(track)], names=self._name_of(track))
        self._recording.log(f"{SEEN_SHARE}/{track}", curve, static=True)


def _outlines(found: BackProjectedSnapshot) -> Strips:
    """Outlines of the last map's rooms where they lay in this one."""
    then = found.to_last.inverse()
    rings = found.last_rooms.outer_rings_m
    count = [len(of_room) for of_room in rings]
    lengths = [len(ring) for of_room in rings for ring in of_room]
    points = then.points(np.concatenate([np.zeros((0, 2)), *(ring for of_room in rings for ring in of_room)]))
    colors = np.array([track_color(track) for track in found.track_ids], float).reshape(-1, 3)
    of_rings = np.repeat((OUTLINE_SHADE * colors).astype(np.uint8), count, axis=0)
    return Strips(lifted(points, OUTLINE_LAYER), np.array(lengths, np.int32), of_rings)
