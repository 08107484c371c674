"""A log as a stream of MCAP messages: what an annotated MCAP copies from its input."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Attachment, Chunk, ChunkIndex, Message, Metadata
from mcap.stream_reader import breakup_chunk
from mcap.summary import Summary

from rose2_logs.errors import LogError
from rose2_logs.sinks.ros_messages import ros2_typestore

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

LATCHED_QOS = (
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
    "  deadline:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  avoid_ros_namespace_conventions: false"
)
"""Keep last, depth 1, reliable, transient local: how ROS 2 publishes maps; rosbag2's spelling."""
RECORD_HEAD_BYTES = 9
"""Of an MCAP record: opcode and length."""
INDEX_RECORD_BYTES, INDEX_ENTRY_BYTES = 15, 16
"""Of an MCAP's message index: record head, channel, length of the entries; log time and offset."""
DAMAGE = (McapError, zstandard.ZstdError, ValueError, RuntimeError, KeyError, EOFError, struct.error)
"""What the mcap package and its decompressors raise on bytes that are not what they should be."""


@dataclass(frozen=True)
class CopiedChannel:
    """A channel with its schema, as it is to stand in the output; channels are equal by `key`.

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
    """A message as it is to stand in the output."""

    channel: CopiedChannel
    log_time: int
    publish_time: int
    sequence: int
    data: bytes | memoryview


@dataclass(frozen=True)
class CopiedChunk:
    """A chunk of messages that can stand in the output as it is, compressed.

    Attributes
    ----------
    log_time, end_time : int
        Log times of its first and its last message.
    stream : binary file
        Holds it.
    index : ChunkIndex
        Where it lies.
    messages : callable
        Gives its messages by log time; raises what `DAMAGE` lists where they cannot be read.
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
        Of the output's header.
    """

    profile = "ros2"
    library = ""

    @abstractmethod
    def channels(self) -> list[CopiedChannel]:
        """List the channels that are known before reading, those without a message among them."""

    @abstractmethod
    def messages(self) -> Iterator[CopiedMessage | CopiedChunk]:
        """Yield every message by log time, or in the order of the file where it has no index.

        Messages in chunks that can go over as they are come as those chunks, in the order of the file.
        """

    def attachments(self) -> Iterator[Attachment]:
        """Yield the attachments."""
        return iter(())

    def metadata(self) -> Iterator[Metadata]:
        """Yield the metadata records."""
        return iter(())

    def close(self) -> None:
        """Release the files."""
        return


def open_copied_log(path: Path) -> CopiedLog:
    """Open the input for copying; saved maps have nothing to copy and are written by the sink itself.

    Raises
    ------
    LogError
        If the log cannot be opened.
    """
    if path.is_file() and path.suffix == ".mcap":
        return _McapLog(path)
    if path.suffix in (".bag", ".db3") or (path.is_dir() and (path / "metadata.yaml").exists()):
        inside = sorted(path.glob("*.mcap")) if path.is_dir() else []
        # rosbags cannot read an MCAP with channels of other encodings; a single file is copied as it is.
        return _McapLog(inside[0]) if len(inside) == 1 else _BagLog(path)
    return _NoLog()


class _NoLog(CopiedLog):
    """Saved maps: no messages of their own."""

    def channels(self) -> list[CopiedChannel]:
        return []

    def messages(self) -> Iterator[CopiedMessage | CopiedChunk]:
        return iter(())


class _McapLog(CopiedLog):
    """An MCAP file: chunk by chunk, or message by message where its index does not tell of every message."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = path.open("rb")
        try:
            reader = make_reader(self._file, validate_crcs=False)
            header = reader.get_header()
            self.profile, self.library = header.profile, header.library
            self._summary = reader.get_summary()
        except (McapError, ValueError):
            # Cut off: what is whole at the beginning is copied.
            self._summary = None
            self._file.seek(0)
            header = NonSeekingReader(self._file).get_header()
            self.profile, self.library = header.profile, header.library
        self._channels: dict[int, CopiedChannel] = {}

    def channels(self) -> list[CopiedChannel]:
        if self._summary is None:
            return []
        schemas = self._summary.schemas
        return [self._channel(item, schemas.get(item.schema_id)) for item in self._summary.channels.values()]

    def messages(self) -> Iterator[CopiedMessage | CopiedChunk]:
        if self._summary is not None and _is_all_in_indexed_chunks(self._summary):
            for index in sorted(self._summary.chunk_indexes, key=lambda index: index.chunk_start_offset):
                yield CopiedChunk(
                    index.message_start_time,
                    index.message_end_time,
                    self._file,
                    index,
                    partial(self._messages_in, index),
                )
            return
        self._file.seek(0)
        reader = make_reader(self._file) if self._summary else NonSeekingReader(self._file)
        try:
            for schema, channel, message in reader.iter_messages(log_time_order=self._summary is not None):
                yield CopiedMessage(
                    self._channel(channel, schema),
                    message.log_time,
                    message.publish_time,
                    message.sequence,
                    message.data,
                )
        except DAMAGE as error:
            if self._summary is not None:
                raise LogError(f"{self._path}: cannot be copied: {error}") from error

    def _messages_in(self, index: ChunkIndex) -> list[CopiedMessage]:
        self._file.seek(index.chunk_start_offset + RECORD_HEAD_BYTES)
        records = breakup_chunk(Chunk.read(ReadDataStream(self._file)), validate_crc=True)
        found = [record for record in records if isinstance(record, Message)]
        return [
            CopiedMessage(
                self._channels[message.channel_id],
                message.log_time,
                message.publish_time,
                message.sequence,
                message.data,
            )
            for message in sorted(found, key=lambda message: message.log_time)
        ]

    def attachments(self) -> Iterator[Attachment]:
        if self._summary is not None:
            self._file.seek(0)
            yield from make_reader(self._file).iter_attachments()

    def metadata(self) -> Iterator[Metadata]:
        if self._summary is not None:
            self._file.seek(0)
            yield from make_reader(self._file).iter_metadata()

    def close(self) -> None:
        self._file.close()

    def _channel(self, channel: Any, schema: Any) -> CopiedChannel:
        if channel.id not in self._channels:
            name, encoding, data = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
            self._channels[channel.id] = CopiedChannel(
                channel.id,
                channel.topic,
                channel.message_encoding,
                channel.schema_id,
                name,
                encoding,
                data,
                channel.metadata,
            )
        return self._channels[channel.id]


def _is_all_in_indexed_chunks(summary: Summary) -> bool:
    """Whether every message lies in a chunk that is followed by its message index.

    An index record is 15 bytes and 16 for each message, so that its length tells how many there are.
    """
    indexed = 0
    for chunk in summary.chunk_indexes:
        offsets = chunk.message_index_offsets
        if offsets and min(offsets.values()) != chunk.chunk_start_offset + chunk.chunk_length:
            return False
        indexed += (chunk.message_index_length - INDEX_RECORD_BYTES * len(offsets)) // INDEX_ENTRY_BYTES
    return (
        summary.statistics is not None
        and summary.statistics.message_count == indexed
        and summary.statistics.chunk_count == len(summary.chunk_indexes)
        and summary.statistics.channel_count == len(summary.channels)
    )


class _BagLog(CopiedLog):
    """A ROS 1 or ROS 2 bag, its messages as CDR."""

    def __init__(self, path: Path) -> None:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore

        self._stack = ExitStack()
        default = get_typestore(Stores.ROS2_HUMBLE)
        try:
            self._reader: AnyReader = self._stack.enter_context(AnyReader([path], default_typestore=default))
        except (AnyReaderError, KeyError, UnicodeDecodeError, OSError) as error:
            raise LogError(f"{path}: cannot be copied: {error}") from error
        self._target = ros2_typestore(self._reader.typestore.fielddefs)
        types = sorted({item.msgtype for item in self._reader.connections})
        self._schema_ids = {name: number for number, name in enumerate(types, start=1)}
        self._channels = {
            self._connection_key(item): self._as_channel(number, item)
            for number, item in enumerate(self._reader.connections, start=1)
        }

    def channels(self) -> list[CopiedChannel]:
        return list(self._channels.values())

    def messages(self) -> Iterator[CopiedMessage | CopiedChunk]:
        sequence: dict[int, int] = {}
        for connection, time_ns, data in self._reader.messages():
            channel = self._channels[self._connection_key(connection)]
            number = sequence[channel.key] = sequence.get(channel.key, -1) + 1
            yield CopiedMessage(channel, time_ns, time_ns, number, self._converter(connection)(data))

    def close(self) -> None:
        self._stack.close()

    @staticmethod
    def _connection_key(connection: Connection) -> tuple[int, int]:
        return connection.id, id(connection.owner)

    def _as_channel(self, number: int, connection: Connection) -> CopiedChannel:
        from rosbags.interfaces import ConnectionExtRosbag2
        from rosbags.rosbag2.metadata import dump_qos_v8

        qos = "[]"
        if isinstance(connection.ext, ConnectionExtRosbag2):
            qos = dump_qos_v8(connection.ext.offered_qos_profiles)
        elif connection.ext.latching:
            qos = LATCHED_QOS
        text, _ = self._target.generate_msgdef(connection.msgtype, ros_version=2)
        return CopiedChannel(
            number,
            connection.topic,
            "cdr",
            self._schema_ids[connection.msgtype],
            connection.msgtype,
            "ros2msg",
            text.encode(),
            {"offered_qos_profiles": qos},
        )

    def _converter(self, connection: Connection) -> Callable[[bytes], bytes | memoryview]:
        if self._reader.is2:
            return bytes
        # Through the definitions with ROS 2's Header: the sequence number that ROS 1's has is left out.
        return partial(self._target.ros1_to_cdr, typename=connection.msgtype)
