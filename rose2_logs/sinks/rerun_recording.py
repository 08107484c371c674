"""The run as a Rerun recording: the map with its rooms along time and along coverage."""

from __future__ import annotations

import logging
import math
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rose2_logs.errors import OutputError
from rose2_logs.files import part_of, writing
from rose2_logs.occupancy import FloatArray
from rose2_logs.sinks.palette import track_colour
from rose2_logs.sinks.rerun_blueprint import COVERAGE_UNIT, corners_of, make_blueprint
from rose2_logs.sinks.rerun_columns import Entry, Label, Scalar, Strips
from rose2_logs.sinks.rerun_layers import CHUNK_BYTES, Layers
from rose2_logs.sinks.rerun_pictures import MapPictures
from rose2_logs.sinks.ros_messages import outer_rings
from rose2_logs.sinks.sink import RunInfo
from rose2_logs.tracking.frames import RoomEvent, TrackedSnapshot

logger = logging.getLogger(__name__)

LAYER_STEP_M = 0.01
"""Layers lie this far above each other, so that none flickers through another."""
OUTLINE_POINTS, WALL_POINTS, LINE_POINTS = 2.0, 1.5, 0.75
"""Widths of lines in points of the screen, which stay readable at any zoom."""
FLUSH_TIMEOUT_S = 60.0
VIEWER_PORT = 9876
"""Where Rerun's viewer listens unless told otherwise."""
VIEWER_START_S, VIEWER_SETTLE_S = 30.0, 1.0


class RerunRecording:
    """Sink that writes a ``.rrd`` with its layout, or shows the run in an open viewer, or both.

    Timelines are ``message_log_time`` and ``ros2_timestamp`` (as in Rerun's own MCAP importer), ``snapshot``,
    and ``coverage``, the greatest so far, in steps of 1e-4. Rooms stand under ``/world/rooms/TRACK``, their
    areas under ``/run/area/TRACK``; they are cleared when their track is lost. What has not changed since the
    snapshot before is not logged again.

    Parameters
    ----------
    path : path, optional
        Where to; written beside and renamed when whole. Without it nothing is stored.
    info : RunInfo
        The run.
    live : bool
        Also show the run in a Rerun viewer, which is started where none is open.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """

    def __init__(self, path: Path | None, info: RunInfo, *, live: bool = False) -> None:
        self._path = path
        self._part = part_of(path) if path else None
        self._info = info
        self._live = live
        self._viewer_answers = live
        self._shown: set[int] = set()
        self._low, self._high = np.full(2, np.inf), np.full(2, -np.inf)
        self._frames = 0
        self._begun: dict[int, int] = {}

    def __enter__(self) -> Self:
        # The same log gives the same recording id, so that a second run replaces the first in a viewer.
        fingerprint = str(self._info.provenance.get("sha256", self._info.log_path.name))
        self._recording = rr.RecordingStream(
            "rose2_logs",
            recording_id=f"{self._info.log_path.stem}-{fingerprint[:16]}",
            send_properties=True,
        )
        # A live viewer shows each snapshot at once.
        self._layers = Layers(self._recording, 0 if self._live else CHUNK_BYTES)
        sinks: list[rr.FileSink | rr.GrpcSink] = []
        if self._part is not None:
            with writing(self._part.parent):
                self._part.parent.mkdir(parents=True, exist_ok=True)
            sinks.append(rr.FileSink(str(self._part)))
        if self._live:
            _open_viewer()
            sinks.append(rr.GrpcSink(f"rerun+http://127.0.0.1:{VIEWER_PORT}/proxy"))
        self._recording.set_sinks(*sinks)
        self._recording.set_log_time_enabled(False)
        self._recording.set_log_tick_enabled(False)
        self._recording.log("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._recording.log("/run/coverage", rr.SeriesLines(names="coverage", widths=2), static=True)
        self._recording.log("/run/rooms", rr.SeriesLines(names="rooms", widths=2), static=True)
        self._style_lines("/world/doorways", 2 * OUTLINE_POINTS, (230, 90, 20))
        self._style_lines("/world/walls", WALL_POINTS, (40, 40, 40))
        self._style_lines("/world/lines", LINE_POINTS, (60, 110, 230))
        self._style_lines("/world/edges", LINE_POINTS)
        return self

    def write(self, frame: TrackedSnapshot) -> None:
        """Log one snapshot at all its times."""
        recording, snapshot = self._recording, frame.snapshot
        coverage = round(frame.coverage / COVERAGE_UNIT)
        self._layers.begin(snapshot.log_time_ns, snapshot.stamp_ns, snapshot.index, coverage)
        self._log_map(frame)
        self._log_rooms(frame)
        self._log_structure(frame)
        self._layers.add("/run/coverage", Scalar(frame.coverage))
        self._layers.add("/run/rooms", Scalar(len(frame.track_ids)))
        for event in frame.events:
            if event.kind != "continued":
                self._layers.add("/events", Entry(event_text(event), _event_level(event)))
        if self._frames == 0:
            # A live viewer shows the layout from the beginning; the file gets the final one.
            recording.send_blueprint(make_blueprint(self._low, self._high))
        self._frames += 1
        self._flush()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._layers.flush()
                self._recording.log(
                    "/summary", rr.TextDocument(self._summary(), media_type="text/markdown"), static=True
                )
                if self._frames:
                    self._recording.send_blueprint(make_blueprint(self._low, self._high))
            self._flush()
            self._recording.disconnect()
            if kind is None and self._path is not None and self._part is not None:
                with writing(self._path):
                    self._part.replace(self._path)
        finally:
            if self._part is not None:
                self._part.unlink(missing_ok=True)

    def _flush(self) -> None:
        """Write what was logged; a viewer that was closed along the way is not waited for again."""
        if self._live and not self._viewer_answers:
            return
        try:
            self._recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
        except RuntimeError as error:
            if not self._live:
                raise OutputError(f"{self._path}: cannot be written: {error}") from error
            self._viewer_answers = False
            logger.warning("the Rerun viewer does not answer any more; the run goes on without it")

    def _log_map(self, frame: TrackedSnapshot) -> None:
        pictures = MapPictures(frame)
        low, high = corners_of(pictures.corners_m)
        self._low, self._high = np.minimum(self._low, low), np.maximum(self._high, high)
        self._layers.show("/world/map", pictures.map(0.0))
        self._layers.show("/world/room_fills", pictures.rooms(LAYER_STEP_M))
        if frame.analysis.structure is not None:
            clean = pictures.clean_map(frame.analysis.structure.clean, 2 * LAYER_STEP_M)
            self._layers.show("/world/clean_map", clean)

    def _log_rooms(self, frame: TrackedSnapshot) -> None:
        rooms = frame.analysis.rooms
        for track in sorted(self._shown - set(frame.track_ids)):
            self._layers.clear(f"/world/rooms/{track}")
            self._layers.clear(f"/run/area/{track}")
        self._shown = set(frame.track_ids)
        points = _lifted(np.nan_to_num(rooms.label_points_m), 6).tolist()
        for number, track in enumerate(frame.track_ids):
            if track not in self._begun:
                self._begin_track(track, frame.snapshot.index)
            shape, area = rooms.polygons[number], float(rooms.areas_m2[number])
            self._layers.show(f"/world/rooms/{track}", _strips(outer_rings(shape), 3))
            x, y, z = points[number]
            self._layers.show(f"/world/rooms/{track}/label", Label((x, y, z), f"{track}: {area:.0f} m²"))
            self._layers.add(f"/run/area/{track}", Scalar(area))

    def _begin_track(self, track: int, index: int) -> None:
        """Log what stays the same for a track."""
        self._begun[track] = index
        colour = track_colour(track)
        dark = tuple(int(value * 0.6) for value in colour)
        self._style_lines(f"/world/rooms/{track}", OUTLINE_POINTS, dark)
        label = rr.Points3D.from_fields(
            colors=[(255, 255, 255)], radii=rr.components.Radius.ui_points(1.0), show_labels=True
        )
        self._recording.log(f"/world/rooms/{track}/label", label, static=True)
        name = rr.SeriesLines(colors=[colour], names=f"room {track}")
        self._recording.log(f"/run/area/{track}", name, static=True)

    def _style_lines(self, path: str, width: float, colour: tuple[int, ...] | None = None) -> None:
        """Log the width in points of the screen of all lines of a path, and their colour if it is one."""
        style = rr.LineStrips3D.from_fields(
            radii=rr.components.Radius.ui_points(width), colors=None if colour is None else [colour]
        )
        self._recording.log(path, style, static=True)

    def _log_structure(self, frame: TrackedSnapshot) -> None:
        analysis = frame.analysis
        doors = np.array([door.ends_m for door in analysis.rooms.doorways]).reshape(-1, 4)
        self._log_lines("/world/doorways", doors, 5)
        if analysis.walls is not None:
            self._log_lines("/world/walls", analysis.walls.segments_m, 4)
            self._log_lines("/world/lines", analysis.walls.lines_m, 4)
        if analysis.floor_plan is not None:
            weight = analysis.floor_plan.edge_weight[:, None]
            colours = (weight * (220, 30, 30) + (1 - weight) * (60, 190, 90)).astype(np.uint8)
            self._log_lines("/world/edges", analysis.floor_plan.edges_m, 4, colours)

    def _log_lines(
        self, path: str, ends_m: FloatArray, layer: int, colours: NDArray[np.uint8] | None = None
    ) -> None:
        points = _lifted(ends_m.reshape(-1, 2), layer)
        self._layers.show(path, Strips(points, np.full(len(ends_m), 2, np.int32), colours))

    def _summary(self) -> str:
        info = self._info
        rows = {
            "log": info.log_path.name,
            "topic": info.topic,
            "method": info.method,
            "maps": self._frames,
            "rooms at the end": len(self._shown),
            "rooms over the run": len(self._begun),
            **{f"version of {name}": version for name, version in info.versions.items()},
        }
        # Names come from a log: a bar would end a cell of the table.
        lines = [f"| {name} | {str(value).replace('|', '/')} |" for name, value in rows.items()]
        return "\n".join(["| run | |", "|---|---|", *lines])


def _open_viewer() -> None:
    """Start a viewer, for this machine only, unless one is open.

    Raises
    ------
    OutputError
        If there is none and none can be started.
    """
    if _listens(VIEWER_PORT):
        return
    command = [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--port", str(VIEWER_PORT)]
    viewer = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    end = time.monotonic() + VIEWER_START_S
    while time.monotonic() < end and viewer.poll() is None:
        if _listens(VIEWER_PORT):
            # A viewer without a screen listens for a moment before it ends.
            time.sleep(VIEWER_SETTLE_S)
            if viewer.poll() is None:
                return
        time.sleep(0.1)
    raise OutputError("no Rerun viewer is open and none can be started here; leave --live out")


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def event_text(event: RoomEvent) -> str:
    """Tell an event in a sentence."""
    if event.motion is not None:
        (x, y), turn_deg = event.motion.shift_xy_m, math.degrees(event.motion.turn_rad)
        return f"the map shifted by {x:+.2f}, {y:+.2f} m and turned by {turn_deg:+.1f}°"
    others = ", ".join(str(track) for track in event.others)
    if event.kind == "split":
        return f"room {event.track} split; new: {others}" if others else f"room {event.track} split"
    if event.kind == "merged":
        return f"room {event.track} took in {others}" if others else f"room {event.track} merged"
    return f"room {event.track} {event.kind}"


def _event_level(event: RoomEvent) -> str:
    level = (
        rr.TextLogLevel.WARN if event.kind in ("split", "merged", "lost", "shifted") else rr.TextLogLevel.INFO
    )
    return str(level)


def _lifted(points_m: FloatArray, layer: int) -> NDArray[np.float32]:
    """Points (K, 2) as (K, 3) at a layer's height."""
    return np.column_stack([points_m, np.full(len(points_m), layer * LAYER_STEP_M)]).astype(np.float32)


def _strips(rings: Sequence[FloatArray], layer: int) -> Strips:
    """Closed rings at a layer's height."""
    points = _lifted(np.concatenate([np.zeros((0, 2)), *rings]), layer)
    return Strips(points, np.array([len(ring) for ring in rings], np.int32))
