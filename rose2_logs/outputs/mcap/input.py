"""Any log as a stream of MCAP messages, for the annotated MCAP to copy."""

from __future__ import annotations

import heapq
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import IO, Any

from mcap.records import Attachment, ChunkIndex, Metadata

from rose2_logs.io.file_log import FileLog
from rose2_logs.io.log_file import Channel, LogFile, StoredMessage
from rose2_logs.io.mcap.index import McapFile
from rose2_logs.io.mcap.records import INDEX, INDEX_ENTRY, Summary
from rose2_logs.io.source import MessageSource
from rose2_logs.outputs.mcap.ros_messages import ros2_typestore
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

RECORD_NAME = "rosbag2"
"""Name of the record of an MCAP in which rosbag2 looks for the version of its metadata."""

LATCHED_QOS = (
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
    "  deadline:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  avoid_ros_namespace_conventions: false"
)
"""Keep last, depth 1, reliable, transient local: how ROS 2 publishes maps, in rosbag2's numbers."""
NAMED_LATCHED_QOS = (
    LATCHED_QOS.replace("history: 1", "history: keep_last")
    .replace("reliability: 1", "reliability: reliable")
    .replace("durability: 1", "durability: transient_local")
    .replace("liveliness: 1", "liveliness: automatic")
)
"""The same in the names that rosbag2 writes since version 9."""


@dataclass(frozen=True)
class CopiedChannel:
    """A channel with its schema, as written to the output.

    `key` and `schema_id` are the ids of channel and schema in the input.
    """

    key: int
    topic: str
    message_encoding: str
    schema_id: int
    schema_name: str
    schema_encoding: str
    schema_data: bytes
    metadata: dict[str, str] = field(hash=False)


@dataclass(frozen=True)
class CopiedMessage:
    """A message as written to the output."""

    channel: CopiedChannel
    log_time: int
    publish_time: int
    sequence: int
    data: bytes | memoryview


@dataclass(frozen=True)
class CopiedChunk:
    """A compressed chunk of messages that can be copied to the output as it is.

    Attributes
    ----------
    log_time, end_time : int
        Log times of its first and its last message.
    stream : binary file
        The file that contains it.
    index : ChunkIndex
        Where it is in the file.
    messages : callable
        Returns its messages in log time order; raises the errors of `DAMAGE` if they cannot be read.
    """

    log_time: int
    end_time: int
    stream: IO[bytes]
    index: ChunkIndex
    messages: Callable[[], list[CopiedMessage]] = field(repr=False)


class CopiedLog(ABC):
    """The input of an annotated MCAP.

    Attributes
    ----------
    profile, library : str
        For the header of the output.
    """

    profile = "ros2"
    library = ""

    @abstractmethod
    def channels(self) -> list[CopiedChannel]:
        """Return the channels that are known before reading, including those without messages."""

    @abstractmethod
    def messages(self) -> Iterator[CopiedMessage | CopiedChunk]:
        """Yield every message in log time order, or in file order if there is no index.

        Chunks that can be copied unchanged are yielded as chunks, in file order.
        """

    def attachments(self) -> Iterator[Attachment]:
        """Yield the attachments."""
        return iter(())

    def metadata(self) -> Iterator[Metadata]:
        """Yield the metadata records."""
        return iter(())


def copied_log(source: MessageSource) -> CopiedLog:
    """Return an open log for copying; saved maps have no messages, and the sink writes them itself."""
    if not isinstance(source, FileLog):
        return _NoLog()
    first = source.files[0]
    return _McapLog(first) if len(source.files) == 1 and isinstance(first, McapFile) else _Files(source.files)


class _NoLog(CopiedLog):
    """Saved maps: there are no original messages."""

    def channels(self) -> list[CopiedChannel]:
        return []

    def messages(self) -> Iterator[CopiedMessage | CopiedChunk]:
        return iter(())


def _copied(channel: Channel, key: int) -> CopiedChannel:
    return CopiedChannel(
        key,
        channel.topic,
        channel.message_encoding,
        channel.schema_id,
        channel.schema_name,
        channel.schema_encoding,
        channel.schema_data,
        channel.metadata,
    )


class _McapLog(CopiedLog):
    """An MCAP file: chunk by chunk, or message by message if its index does not cover every message."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        header = file.header()
        self.profile, self.library = header.profile, header.library
        self._channels: dict[int, CopiedChannel] = {}

    def channels(self) -> list[CopiedChannel]:
        return [self._channel(channel) for channel in self._file.channels.values()]

    def messages(self) -> Iterator[CopiedMessage | CopiedChunk]:
        summary = self._file.summary
        if summary is None or not _is_all_in_indexed_chunks(summary):
            for message in self._file.messages():
                yield self._message(message)
            return
        for index in sorted(summary.chunks, key=lambda index: index.chunk_start_offset):
            yield CopiedChunk(
                index.message_start_time,
                index.message_end_time,
                self._file.stream,
                index,
                partial(self._messages_in, index),
            )

    def _messages_in(self, index: ChunkIndex) -> list[CopiedMessage]:
        return [self._message(message) for message in self._file.messages_in(index)]

    def attachments(self) -> Iterator[Attachment]:
        return self._file.attachments()

    def metadata(self) -> Iterator[Metadata]:
        return self._file.metadata()

    def _message(self, message: StoredMessage) -> CopiedMessage:
        return CopiedMessage(self._channel(message.channel), *message[1:])

    def _channel(self, channel: Channel) -> CopiedChannel:
        if channel.id not in self._channels:
            self._channels[channel.id] = _copied(channel, channel.id)
        return self._channels[channel.id]


def _is_all_in_indexed_chunks(summary: Summary) -> bool:
    """Whether every message is in a chunk that is followed by its message index.

    Index entries have a fixed size, so the length of an index gives the number of messages.
    """
    indexed = 0
    for chunk in summary.chunks:
        offsets = chunk.message_index_offsets
        if offsets and min(offsets.values()) != chunk.chunk_start_offset + chunk.chunk_length:
            return False
        indexed += (chunk.message_index_length - INDEX.size * len(offsets)) // INDEX_ENTRY.size
    return (
        summary.statistics.message_count == indexed
        and summary.statistics.chunk_count == len(summary.chunks)
        and summary.statistics.channel_count == len(summary.channels)
    )


class _Files(CopiedLog):
    """Bags, databases, or several MCAP files; ROS 1 messages become CDR."""

    def __init__(self, files: Sequence[LogFile]) -> None:
        self._files = files
        channels = [
            (number, channel) for number, file in enumerate(files) for channel in file.channels.values()
        ]
        names = {_ros2_name(channel.schema_name) for _, channel in channels}
        defined = _definitions([channel for _, channel in channels])
        is_ros1 = any(channel.message_encoding == "ros1" for _, channel in channels)
        self._target = ros2_typestore(defined, names, is_ros1=is_ros1)
        self._schema_ids: dict[tuple[str, bytes], int] = {}
        self._channels: dict[tuple[int, int], CopiedChannel] = {}
        self._converters: dict[int, Callable[[Any], bytes | memoryview]] = {}
        for key, (number, channel) in enumerate(channels, start=1):
            copied = self._as_channel(key, channel)
            self._channels[number, channel.id] = copied
            if channel.message_encoding == "ros1" and copied.message_encoding == "cdr":
                # Converted with the Header of ROS 2, which drops the sequence number of ROS 1.
                self._converters[key] = partial(self._target.ros1_to_cdr, typename=copied.schema_name)

    def channels(self) -> list[CopiedChannel]:
        return list(self._channels.values())

    def messages(self) -> Iterator[CopiedMessage | CopiedChunk]:
        streams = [self._messages_of(number) for number in range(len(self._files))]
        yield from heapq.merge(*streams, key=lambda message: message.log_time)

    def attachments(self) -> Iterator[Attachment]:
        return chain.from_iterable(file.attachments() for file in self._files if isinstance(file, McapFile))

    def metadata(self) -> Iterator[Metadata]:
        """Yield the records of all files, but for those in which rosbag2 describes each of the files."""
        records = chain.from_iterable(file.metadata() for file in self._files if isinstance(file, McapFile))
        return (record for record in records if record.name != RECORD_NAME)

    def _messages_of(self, number: int) -> Iterator[CopiedMessage]:
        file = self._files[number]
        for message in file.messages():
            channel = self._channels[number, message.channel.id]
            data = message.data
            try:
                if message.channel.message_encoding == "cdr":
                    data = file.decompressed(data)
                if channel.key in self._converters:
                    data = self._converters[channel.key](bytes(data))
            except Exception as error:  # whatever a deserializer raises on damaged data
                text = f"{file.path}: a message on {channel.topic} cannot be copied ({error}); skipped"
                log_warning(logger, "not_copied", text, file=file.path, topic=channel.topic)
                continue
            yield CopiedMessage(channel, message.log_time_ns, message.publish_time_ns, message.sequence, data)

    def _as_channel(self, key: int, channel: Channel) -> CopiedChannel:
        name = _ros2_name(channel.schema_name)
        metadata = dict(channel.metadata)
        definition = channel.schema_data
        encoding, language = channel.message_encoding, channel.schema_encoding
        if encoding == "ros1":
            metadata = {"offered_qos_profiles": LATCHED_QOS if metadata.get("latching") == "1" else "[]"}
            converted = self._definition(name)
            if converted is not None:
                encoding, language, definition = "cdr", "ros2msg", converted
        elif encoding == "cdr":
            metadata["offered_qos_profiles"] = qos_of_version_8(metadata.get("offered_qos_profiles", "[]"))
            if not definition and (known := self._definition(name)) is not None:
                language, definition = "ros2msg", known
        schema_id = self._schema_ids.setdefault((name, definition), len(self._schema_ids) + 1)
        return CopiedChannel(
            key, channel.topic, encoding, schema_id, name, language or "ros2msg", definition, metadata
        )

    def _definition(self, name: str) -> bytes | None:
        """Definition of a type in ROS 2 syntax, or None if it is unknown."""
        try:
            text, _ = self._target.generate_msgdef(name, ros_version=2)
        except Exception:  # the type, or one that it uses, has no definition
            return None
        return text.encode()


def _ros2_name(name: str) -> str:
    package, _, rest = name.partition("/")
    return f"{package}/msg/{rest.removeprefix('msg/')}" if rest else name


def _definitions(channels: Sequence[Channel]) -> dict[str, Any]:
    """Message types defined in a log."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    types: dict[str, Any] = {}
    for channel in channels:
        name = _ros2_name(channel.schema_name)
        text = channel.schema_data.decode(errors="replace")
        try:
            if channel.schema_encoding in ("ros1msg", "ros2msg") and text:
                types.update(get_types_from_msg(text, name))
            elif channel.schema_encoding == "ros2idl":
                types.update(get_types_from_idl(text))
        except Exception as error:  # whatever a parser raises on an invalid definition
            why = " ".join(str(error).split())
            text = f"the definition of {channel.schema_name} on {channel.topic} cannot be read ({why})"
            log_warning(logger, "definition", f"{text}; the standard one is used", topic=channel.topic)
    return types


def qos_of_version_8(text: str) -> str:
    """Quality of service as rosbag2 wrote it up to version 8, with numbers; empty if it cannot be read.

    Where there is none, the text stays as it is.
    """
    from rosbags.rosbag2.metadata import dump_qos_v8, parse_qos

    try:
        return str(dump_qos_v8(parse_qos(text))) or text
    except Exception:  # whatever the parser raises; an unreadable profile is left empty
        return "[]"
