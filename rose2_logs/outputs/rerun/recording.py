"""The run as a Rerun recording: the map with its rooms along time and along coverage."""

from __future__ import annotations

import logging
import subprocess
from collections.abc import Collection
from pathlib import Path

import rerun as rr

from rose2_logs.config.run_options import RECORDING_LAYERS
from rose2_logs.drawing.event_text import event_text
from rose2_logs.drawing.extent import Extent
from rose2_logs.drawing.palette import track_color
from rose2_logs.errors import OutputError
from rose2_logs.model.room_names import NameOf, room_name
from rose2_logs.outputs.rerun import viewer as rerun_viewer
from rose2_logs.outputs.rerun.back_projected import BackProjectedWorld
from rose2_logs.outputs.rerun.blueprint import make_blueprint, view_side_m
from rose2_logs.outputs.rerun.columns import Entry, Scalar
from rose2_logs.outputs.rerun.disk import abandon, require_resources, require_space
from rose2_logs.outputs.rerun.lanes import SHIFTS, TrackLanes
from rose2_logs.outputs.rerun.layers import CHUNK_BYTES, Layers, whole_percent
from rose2_logs.outputs.rerun.legend import CURVES, log_legend
from rose2_logs.outputs.rerun.summary import summary_text
from rose2_logs.outputs.rerun.world import World
from rose2_logs.runs.history import RunSummary
from rose2_logs.runs.sink import RunInfo, Sink
from rose2_logs.system.files import part_of, reason_of, writing
from rose2_logs.system.text import percent
from rose2_logs.tracking.back_projection import BackProjectedSnapshot
from rose2_logs.tracking.tracked_snapshot import RoomEvent, TrackedSnapshot, map_motion

logger = logging.getLogger(__name__)

FLUSH_TIMEOUT_S = 60.0
ABANDON_TIMEOUT_S = 10.0
"""Longest wait for what is to be removed anyway."""
COUNTS = {
    "/run/rooms": ("rooms", (190, 130, 250)),
    "/run/variation_bits": ("variation of information, bits", (250, 100, 100)),
}
"""Further curves of the whole run: what they are called and their colors."""


class RerunRecording(Sink):
    """Sink that writes a ``.rrd`` with its layout, or shows the run in an open viewer, or both.

    Timelines are ``message_log_time`` and ``ros2_timestamp`` (as in Rerun's own MCAP importer), ``snapshot``,
    and ``coverage_percent``, the greatest so far, rounded down; a part of the run that begins anew goes on
    where the one before ends, so that its 50 % stand at 150 %. Rooms stand under ``/world/rooms/TRACK``,
    their areas under ``/run/area/TRACK``; they are cleared when their track is lost. What has not changed
    since the snapshot before is not logged again. The lanes of the tracks and the convergence, which only
    the last map tells, follow at the end; before them the back-projected rooms, in a second pass, if there
    is one.

    Parameters
    ----------
    path : path, optional
        Where to; written beside and renamed when whole. Without it nothing is stored.
    live : bool
        Also show the run in a Rerun viewer, which is started where none is open.
    layers : collection of str
        Which of `RECORDING_LAYERS` to write.
    name_of : callable
        Name of a room by its track.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """

    def __init__(
        self,
        path: Path | None,
        *,
        live: bool = False,
        layers: Collection[str] = RECORDING_LAYERS,
        name_of: NameOf = room_name,
    ) -> None:
        self._path = path
        self._part = part_of(path) if path else None
        self._live = live
        self._wanted = layers
        self._name_of = name_of
        self._recording: rr.RecordingStream | None = None
        self._legend_of: list[str] | None = None
        self._viewer: subprocess.Popen[bytes] | None = None
        self._viewer_answers = live
        self._is_lost = False
        self._shown: set[int] = set()
        self._known: set[int] = set()
        self._back_projected: BackProjectedWorld | None = None
        self._extent = Extent()
        self._maps, self._first_percent, self._most_rooms = 0, 0, 0
        self._parts: list[int | None] = []

    def begin(self, info: RunInfo) -> None:
        """Open the file, or a viewer, and log what stays the same."""
        self._info = info
        if self._path is not None:
            require_resources(self._path, ", or recording=False")
        # The same log gives the same recording id, so that a second run replaces the first in a viewer.
        fingerprint = str(info.provenance.get("sha256", info.log_path.name))
        self._recording = self._stream = rr.RecordingStream(
            "rose2_logs",
            recording_id=f"{info.log_path.stem}-{fingerprint[:16]}",
            send_properties=True,
        )
        self._layers = self._new_layers()
        sinks: list[rr.FileSink | rr.GrpcSink] = []
        if self._part is not None:
            with writing(self._part.parent):
                self._part.parent.mkdir(parents=True, exist_ok=True)
            sinks.append(rr.FileSink(str(self._part)))
        if self._live:
            address, self._viewer = rerun_viewer.open_viewer(rerun_viewer.VIEWER_PORT)
            sinks.append(rr.GrpcSink(address))
        self._stream.set_sinks(*sinks)
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        self._world = World(self._layers, self._stream, self._wanted, self._name_of)
        self._lanes = TrackLanes(self._stream, self._name_of)
        for path, (name, color) in (CURVES | COUNTS).items():
            style = (
                rr.SeriesPoints(names=name, colors=[color], markers="cross", marker_sizes=8)
                if path == SHIFTS
                else rr.SeriesLines(names=name, colors=[color], widths=2)
            )
            self._stream.log(path, style, static=True)

    def write(self, step: TrackedSnapshot) -> None:
        """Log one snapshot at all its times."""
        snapshot = step.snapshot
        if step.part not in self._parts:
            self._parts.append(step.part)
        coverage_percent = self._percent(step.coverage, step.part)
        self._layers.begin(snapshot.log_time_ns, snapshot.stamp_ns, snapshot.index, coverage_percent)
        self._extent.add(step)
        self._most_rooms = max(self._most_rooms, len(step.track_ids))
        is_first = self._maps == 0
        if is_first:
            # For viewers that are live, or still load the file; the final layout comes at the end.
            self._first_percent = coverage_percent
            self._send_blueprint()
        self._world.log(step, view_side_m(self._extent.low_m, self._extent.high_m))
        self._lanes.add(self._layers.now, step.track_ids)
        self._log_curves(step)
        for event in step.events:
            if event.kind != "continued":
                text = f"{percent(step.coverage, ' %')}: {event_text(event, self._name_of)}"
                self._layers.add("/events", Entry(text, _event_level(event)))
        if is_first:
            self._log_legend()
        self._maps += 1
        self._flush()

    def write_back_projected(self, found: BackProjectedSnapshot) -> None:
        """Log what one map shows of the last map's rooms, after all maps, in their order again."""
        if self._back_projected is None:
            self._layers.flush()
            self._back_projected = BackProjectedWorld(self._new_layers(), self._stream, self._name_of)
        view_m = view_side_m(self._extent.low_m, self._extent.high_m)
        self._back_projected.log(found, self._percent(found.coverage, found.part), view_m)
        self._flush()

    def finish(self, summary: RunSummary) -> None:
        """Log what the run came to, and give the file its name."""
        self._layers.flush()
        if self._back_projected is not None:
            self._back_projected.flush()
        self._lanes.log(summary.convergence)
        text = rr.TextDocument(summary_text(self._info, summary, self._name_of), media_type="text/markdown")
        self._stream.log("/summary", text, static=True)
        if self._maps:
            self._log_legend()
            self._send_blueprint()
        self._flush()
        self._stream.disconnect()
        if self._path is not None and self._part is not None:
            with writing(self._path):
                self._part.replace(self._path)

    def abandon(self) -> None:
        """Remove the file that was begun, and end the viewer that was started for it."""
        # First, so that what was not sent yet is not waited for.
        if self._viewer is not None:
            rerun_viewer.end(self._viewer)
        if self._recording is not None and not self._is_lost:
            try:
                if self._part is not None:
                    # What waits is not waited for longer: the disk may be full, which only others have told.
                    self._recording.flush(timeout_sec=ABANDON_TIMEOUT_S)
                self._recording.disconnect()
            except RuntimeError:
                abandon(self._recording)
        if self._part is not None:
            self._part.unlink(missing_ok=True)

    def _percent(self, coverage: float, part: int | None) -> int:
        """Place on the coverage timeline."""
        return 100 * self._parts.index(part) + whole_percent(coverage)

    def _new_layers(self) -> Layers:
        # A live viewer shows each snapshot at once.
        return Layers(self._stream, 0 if self._live else CHUNK_BYTES)

    def _log_legend(self) -> None:
        shown = [layer for layer in self._wanted if layer != "path" or self._world.has_path]
        if shown != self._legend_of:
            log_legend(self._stream, shown)
            self._legend_of = shown

    def _send_blueprint(self) -> None:
        blueprint = make_blueprint(
            self._extent.low_m,
            self._extent.high_m,
            self._wanted,
            back_projected=self._back_projected is not None,
            first_percent=self._first_percent - 100 * (len(self._parts) - 1),
            most_rooms=self._most_rooms,
            in_parts=self._parts != [None],
        )
        self._stream.send_blueprint(blueprint)

    def _flush(self) -> None:
        """Write what was logged; a viewer that was closed along the way is not waited for again."""
        if self._live and not self._viewer_answers:
            return
        if self._part is not None and self._path is not None:
            require_space(self._part, self._path)
        try:
            self._stream.flush(timeout_sec=FLUSH_TIMEOUT_S)
        except RuntimeError as error:
            if not self._live:
                self._is_lost = True
                abandon(self._stream)
                raise OutputError(f"{self._path}: cannot be written: {reason_of(error)}") from error
            self._viewer_answers = False
            logger.warning("the Rerun viewer does not answer any more; the run goes on without it")

    def _log_curves(self, step: TrackedSnapshot) -> None:
        self._layers.add("/run/coverage", Scalar(100 * step.coverage))
        self._layers.add("/run/rooms", Scalar(len(step.track_ids)))
        if map_motion(step.events) is not None:
            self._layers.add(SHIFTS, Scalar(100 * step.coverage))
        if step.change is not None and step.change.variation_bits is not None:
            self._layers.add("/run/variation_bits", Scalar(step.change.variation_bits))
        for track in sorted(self._shown - set(step.track_ids)):
            self._layers.clear(f"/run/area/{track}")
        self._shown = set(step.track_ids)
        for track, area in zip(step.track_ids, step.analysis.rooms.areas_m2.tolist(), strict=True):
            if track not in self._known:
                self._known.add(track)
                name = rr.SeriesLines(colors=[track_color(track)], names=self._name_of(track))
                self._stream.log(f"/run/area/{track}", name, static=True)
            self._layers.add(f"/run/area/{track}", Scalar(area))


def _event_level(event: RoomEvent) -> str:
    # Rooms split and merge in any run; a map that begins anew or shifts is what SLAM may have got wrong.
    is_warning = event.kind in ("part_begun", "shifted")
    return str(rr.TextLogLevel.WARN if is_warning else rr.TextLogLevel.INFO)
