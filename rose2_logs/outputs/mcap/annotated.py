"""The input log with the results added as topics: an MCAP that Foxglove, RViz and rosbag2 open."""

from __future__ import annotations

import json
import logging
import re
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from mcap.exceptions import McapError
from mcap.records import Attachment, Metadata

from rose2_logs.drawing.extent import Extent
from rose2_logs.drawing.robot_trail import RobotTrail
from rose2_logs.errors import OutputError
from rose2_logs.io import open_source
from rose2_logs.io.grids import GRID_TYPE
from rose2_logs.io.mcap.index import DAMAGE
from rose2_logs.io.source import MessageSource
from rose2_logs.outputs.mcap.bag_metadata import version_record, write_bag_metadata
from rose2_logs.outputs.mcap.check import RecordTallies, Tallies, checked_copy
from rose2_logs.outputs.mcap.input import (
    LATCHED_QOS,
    NAMED_LATCHED_QOS,
    RECORD_NAME,
    CopiedChannel,
    CopiedChunk,
    CopiedLog,
    CopiedMessage,
    copied_log,
)
from rose2_logs.outputs.mcap.ros_messages import ROOMS_TYPE, MarkerSizes, MessageMaker, definition
from rose2_logs.outputs.mcap.viewer_layouts import MapScene, bag_metadata_path, view_height_m, write_layouts
from rose2_logs.outputs.mcap.writer import McapWriter
from rose2_logs.runs.history import RunSummary
from rose2_logs.runs.sink import RunInfo, Sink
from rose2_logs.system.files import part_of, reason_of
from rose2_logs.system.warnings import log_warning
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

logger = logging.getLogger(__name__)

PREFIX = "/rose2/"
ADDED = {
    "/rose2/segmented_map": GRID_TYPE,
    "/rose2/clean_map": GRID_TYPE,
    "/rose2/markers": "visualization_msgs/msg/MarkerArray",
    "/rose2/rooms": ROOMS_TYPE,
}
"""The added topics, with their types."""
ATTACHMENT = "rose2_parameters.json"
METADATA = "rose2_logs"
NAMED_QOS = re.compile(r"reliability:\s*[a-z]")
"""Quality of service with names instead of numbers, as rosbag2 writes it since version 9."""


class AnnotatedMcap(Sink):
    """Sink that copies the input log and adds the topics of `ADDED` with the source map's stamp and frame.

    Messages, schemas, channels, attachments and metadata of an MCAP are kept byte for byte; chunks between
    those with a map are copied without decompressing them. A bag becomes an MCAP of the ros2 profile, with
    every message as CDR. The input is read while the run proceeds, so that messages are in log time order and
    the log is never in memory as a whole. Saved maps are not messages yet, so each map is written to the map
    topic.

    Parameters
    ----------
    path : path
        Output file; written under a hidden name and renamed when complete.
    source : MessageSource, optional
        The log, if it is already open; it is left open.
    is_bag : bool
        Whether to describe the file in a ``metadata.yaml``, which makes its folder a ROS 2 bag.

    At the end the file is read back, and its content is compared with what was read and added.

    Attributes
    ----------
    facts : dict
        ``annotated_log``: for each channel, number and hash of its messages in the input and in the output;
        set at the end.

    Raises
    ------
    OutputError
        If the file cannot be written or differs from what was written, if the input already has ``/rose2/``
        topics, or if a ROS 2 bag is wanted and the input has messages that it cannot contain.
    LogError
        If the input cannot be copied.
    """

    def __init__(self, path: Path, source: MessageSource | None = None, *, is_bag: bool = False) -> None:
        self._path = path
        self._part = part_of(path)
        self._source = source
        self._opened_source: MessageSource | None = None
        self._is_bag = is_bag
        self._extent = Extent()
        self._trail = RobotTrail()
        self._frame_id = ""
        self._z_m = 0.0
        self._file: IO[bytes] | None = None
        self.facts: dict[str, Any] = {}

    def begin(self, info: RunInfo) -> None:
        """Open the log and the file, and take over what the log says of itself."""
        self._info = info
        if self._source is None:
            self._opened_source = self._source = open_source(info.log_path)
        self._log: CopiedLog = copied_log(self._source.recorded)
        with self._writing():
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._part.open("wb")
            self._write_head(self._file)

    def _write_head(self, file: IO[bytes]) -> None:
        log, info = self._log, self._info
        library = f"rose2_logs {info.versions.get('rose2-logs', '')}".strip()
        library = f"{log.library}; {library}" if log.library else library
        self._writer = McapWriter(file, log.profile, library)
        self._channels: dict[int, int] = {}
        self._schemas: dict[int | tuple[str, str, bytes], int] = {}
        self._input, self._own, self._records = Tallies(), Tallies(), RecordTallies()
        self._items = self._input.watched(log.messages())
        self._waiting: CopiedMessage | CopiedChunk | None = None
        # Messages of a chunk that had to be unpacked; they are next.
        self._opened: deque[CopiedMessage] = deque()
        self._maker = MessageMaker(info.parameters.occupancy)
        self._sequence = 0
        map_metadata: dict[str, str] = {}
        for channel in log.channels():
            self._register(channel)
            if channel.topic == info.topic:
                map_metadata = channel.metadata
        for attachment in log.attachments():
            self._add_record(attachment)
        names = set()
        for record in log.metadata():
            names.add(record.name)
            self._add_record(record)
        self._map_qos = map_metadata.get("offered_qos_profiles", "")
        self._qos = self._added_qos(has_version=RECORD_NAME in names)
        self._added = {topic: self._add_channel(topic, kind) for topic, kind in ADDED.items()}
        self._own_map = self._map_channel()
        made_by = {name: str(value) for name, value in (info.versions | info.provenance).items()}
        self._add_record(Metadata(METADATA, made_by))

    def _added_qos(self, *, has_version: bool) -> str:
        """Quality of service of the added topics: that of the map, else of maps in the log's notation."""
        texts = [channel.metadata.get("offered_qos_profiles", "") for channel in self._log.channels()]
        is_named = any(NAMED_QOS.search(text) for text in texts)
        if self._log.profile == "ros2" and not has_version and not is_named:
            self._add_record(Metadata(RECORD_NAME, version_record()))
        if self._map_qos.strip() not in ("", "[]"):
            return self._map_qos
        return NAMED_LATCHED_QOS if is_named else LATCHED_QOS

    def _map_channel(self) -> int | None:
        """Add a channel for maps that the log does not contain: saved ones, and those built from scans."""
        assert self._source is not None
        is_built = self._source.recorded is not self._source
        is_empty = not self._log.channels() and self._log.profile == "ros2" and not self._has_messages()
        if not is_built and not is_empty:
            return None
        self._map_qos = self._qos
        return self._add_channel(self._info.topic, GRID_TYPE)

    def _has_messages(self) -> bool:
        self._waiting = next(self._items, None)
        return self._waiting is not None

    def write(self, step: TrackedSnapshot) -> None:
        """Copy the input up to the map's log time, then add the results of the map."""
        source = self._source
        assert source is not None  # it was opened by `begin`
        time_ns = source.recorded_ns(step.snapshot.log_time_ns)
        self._extent.add(step)
        self._trail.follow(step)
        sizes = MarkerSizes.of_view(view_height_m(self._extent.low_m, self._extent.high_m, aspect=1.0))
        self._frame_id, self._z_m = step.analysis.geometry.frame_id, step.snapshot.z_m
        with self._writing():
            self._copy_until(time_ns)
            messages = {
                "/rose2/segmented_map": self._maker.segmented_map(step),
                "/rose2/clean_map": self._maker.clean_map(step),
                "/rose2/markers": self._maker.markers(step, self._trail.pieces_m, sizes),
                "/rose2/rooms": self._maker.rooms(step),
            }
            if self._own_map is not None:
                self._add(self._own_map, time_ns, self._maker.source_map(step))
            for topic, data in messages.items():
                if data is not None:
                    self._add(self._added[topic], time_ns, data)
            self._sequence += 1

    def finish(self, summary: RunSummary) -> None:
        """Copy the rest of the log, compare the file with the log, and give it its name."""
        with self._writing():
            self._copy_until(None)
            text = json.dumps(self._info.parameters.resolved(), indent=2)
            self._add_record(Attachment(0, 0, ATTACHMENT, "application/json", text.encode()))
            self._writer.finish()
            if self._file is not None:
                self._file.close()
            self.facts["annotated_log"] = self._checked()
            self._part.replace(self._path)
            self._describe()
        self.abandon()

    def _describe(self) -> None:
        """Write the layouts for viewers and, if wanted, the bag's description."""
        extent = self._extent
        scene = MapScene(
            self._frame_id,
            self._info.topic,
            extent.low_m,
            extent.high_m,
            self._map_qos,
            self._qos,
            self._z_m,
        )
        write_layouts(self._path, scene)
        if self._is_bag:
            write_bag_metadata(self._path, bag_metadata_path(self._path))

    def _checked(self) -> dict[str, Any]:
        # Channels without messages were copied too.
        read = {number: self._input[key] for key, number in self._channels.items()}
        return checked_copy(
            self._part, str(self._path), read, self._own, self._input.closed_chunks, self._records
        )

    def _copy_until(self, time_ns: int | None) -> None:
        """Copy what was logged up to a time; a chunk that extends beyond it is unpacked."""
        while True:
            if self._waiting is None:
                self._waiting = self._opened.popleft() if self._opened else next(self._items, None)
            item = self._waiting
            if item is None or (time_ns is not None and item.log_time > time_ns):
                return
            self._waiting = None
            if isinstance(item, CopiedMessage):
                self._add_message(item)
            elif time_ns is None or item.end_time <= time_ns:
                self._copy_chunk(item)
            else:
                try:
                    self._opened.extend(item.messages())
                except DAMAGE:
                    # It cannot be unpacked, so it is copied as a whole.
                    self._copy_chunk(item)

    def _copy_chunk(self, chunk: CopiedChunk) -> None:
        """Copy a chunk as it is, or message by message if the index that follows it is damaged."""
        try:
            self._writer.copy_chunk(chunk.stream, chunk.index)
            return
        except ValueError:
            pass
        try:
            messages = chunk.messages()
        except DAMAGE as error:
            begin = chunk.index.chunk_start_offset
            text = f"{self._info.log_path}: the chunk at byte {begin} is damaged ({error}); it is not copied"
            log_warning(logger, "not_copied", text, file=self._info.log_path)
            self._input.leave_out(chunk)
            return
        for message in messages:
            self._add_message(message)

    def _add_message(self, message: CopiedMessage) -> None:
        self._writer.add_message(
            self._register(message.channel),
            message.log_time,
            message.data,
            message.publish_time,
            message.sequence,
        )

    def _register(self, channel: CopiedChannel) -> int:
        if channel.key not in self._channels:
            if channel.topic.startswith(PREFIX):
                raise OutputError(
                    f"{self._info.log_path}: already has {channel.topic}; analyze the log it was made from"
                )
            if self._is_bag and channel.message_encoding != "cdr":
                raise OutputError(
                    f"{self._info.log_path}: {channel.topic} has {channel.message_encoding or 'unknown'} "
                    "messages, which a ROS 2 bag cannot contain; leave out bag=True"
                )
            schema = (channel.schema_name, channel.schema_encoding, channel.schema_data)
            # Copied chunks refer to channels and schemas by their ids, so these must not change.
            self._channels[channel.key] = self._writer.register_channel(
                channel.topic,
                channel.message_encoding,
                self._schema(*schema, channel.schema_id) if any(schema) else 0,
                channel.metadata,
                channel.key,
            )
        return self._channels[channel.key]

    def _schema(self, name: str, encoding: str, data: bytes, copied_id: int | None = None) -> int:
        content = (name, encoding, data)
        key = content if copied_id is None else copied_id
        if key not in self._schemas:
            number = self._writer.register_schema(name, encoding, data, copied_id)
            self._schemas[key] = self._schemas[content] = number
        return self._schemas[key]

    def _add_channel(self, topic: str, kind: str) -> int:
        schema = self._schema(kind, "ros2msg", definition(kind))
        return self._writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": self._qos})

    def _add(self, channel: int, time_ns: int, data: bytearray) -> None:
        self._own[channel].add(time_ns, time_ns, self._sequence, data)
        self._writer.add_message(channel, time_ns, data, time_ns, self._sequence)

    def _add_record(self, record: Attachment | Metadata) -> None:
        """Write an attachment or a metadata record."""
        self._records.add(record)
        if isinstance(record, Attachment):
            self._writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        else:
            self._writer.add_metadata(record.name, record.metadata)

    def abandon(self) -> None:
        """Close both files, and remove the output if it has not been renamed yet."""
        if self._opened_source is not None:
            self._opened_source.close()
        if self._file is not None:
            # Closing flushes the buffer; on a full disk that fails again and would hide the first error.
            with suppress(OSError):
                self._file.close()
        self._part.unlink(missing_ok=True)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except (OSError, McapError) as error:
            raise OutputError(f"{self._path}: cannot be written: {reason_of(error)}") from error
