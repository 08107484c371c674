"""Parsing of the records of an MCAP file; memory is never allocated just because a header claims a size.

Format: https://mcap.dev/spec
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import IO, Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex, Schema, Statistics
from mcap.records import Channel as McapChannel

from rose2_logs.io.decompression import decompress
from rose2_logs.io.log_file import Channel

MAGIC = b"\x89MCAP0\r\n"
RECORD = struct.Struct("<BQ")  # opcode, length of what follows
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time; then the data
INDEX = struct.Struct("<BQHI")  # start of a message index: record head, channel, length of its entries
INDEX_ENTRY = struct.Struct("<QQ")  # log time, offset in the uncompressed chunk
_CHUNK = struct.Struct("<QQQII")  # first and last log time, size, checksum, length of the compression's name
_LENGTH = struct.Struct("<Q")
_FOOTER = struct.Struct("<BQQQI")  # record head; starts of summary and offsets, checksum of the summary


class Record(NamedTuple):
    """A record: its offset, its kind, its content."""

    offset: int
    opcode: int
    content: memoryview


@dataclass(frozen=True)
class Summary:
    """What the end of a file says about the rest of it; attachments and metadata by their file offsets."""

    channels: dict[int, Channel]
    chunks: list[ChunkIndex]
    statistics: Statistics
    attachments: list[int]
    metadata: list[int]


def read_exactly(stream: IO[bytes], length: int) -> bytes:
    """Read `length` bytes.

    Raises
    ------
    EOFError
        If the file is shorter.
    """
    left = stream.seek(0, 1)
    if left + length > stream.seek(0, 2):
        raise EOFError("the file ends in the middle of a record")
    stream.seek(left)
    data = stream.read(length)
    if len(data) != length:
        raise EOFError("the file ends in the middle of a record")
    return data


def records_in(data: memoryview) -> Iterator[Record]:
    """Yield consecutive records.

    Raises
    ------
    ValueError, struct.error
        If the last one is incomplete.
    """
    place = 0
    while place < len(data):
        opcode, length = RECORD.unpack_from(data, place)
        begin = place + RECORD.size
        if length > len(data) - begin or opcode == 0:
            raise ValueError("a record is incomplete")
        yield Record(place, opcode, data[begin : begin + length])
        place = begin + length


def parsed(kind: Any, content: memoryview) -> Any:
    """Parse the content of a record as one of the mcap package's classes."""
    return kind.read(ReadDataStream(BytesIO(content)))


def channel_of(channel: McapChannel, schema: Schema | None) -> Channel:
    """Describe a channel with its schema."""
    name, encoding, data = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
    return Channel(
        channel.id,
        channel.topic,
        channel.message_encoding,
        channel.schema_id,
        name,
        encoding,
        data,
        channel.metadata,
    )


def chunk_records(content: bytes | memoryview, most_bytes: int) -> memoryview:
    """Uncompressed records of a chunk, from its record's content, after verifying the checksum.

    Of a truncated chunk, as much as can be decompressed; the last record may then be incomplete.

    Raises
    ------
    ValueError, struct.error
        If it is damaged or too large.
    """
    view = memoryview(content)
    _, _, size, checksum, name_length = _CHUNK.unpack_from(view)
    place = _CHUNK.size + name_length
    compression = bytes(view[_CHUNK.size : place]).decode()
    (length,) = _LENGTH.unpack_from(view, place)
    data = view[place + _LENGTH.size :][:length]
    is_cut = len(data) < length
    plain = decompress(
        compression, data, None if is_cut and not compression else size, most_bytes, is_cut=is_cut
    )
    records = memoryview(plain)
    if checksum and not is_cut and zlib.crc32(records) != checksum:
        raise ValueError("its checksum is wrong")
    return records


def read_summary(stream: IO[bytes], most_bytes: int) -> Summary | None:
    """Return the summary of a file, or None if there is none by which every message can be found.

    Raises
    ------
    ValueError, struct.error, EOFError ...
        If it is damaged or truncated.
    """
    size = stream.seek(0, 2)
    tail = _FOOTER.size + len(MAGIC)
    stream.seek(max(size - tail, 0))
    end = read_exactly(stream, min(tail, size))
    opcode, _, start, _, checksum = _FOOTER.unpack_from(end)
    if opcode != Opcode.FOOTER or end[_FOOTER.size :] != MAGIC:
        raise ValueError("the file does not end like an MCAP file")
    if start == 0:
        return None
    length = size - tail - start
    if not 0 <= length <= most_bytes:
        raise ValueError("the end of the file does not point to it")
    stream.seek(start)
    data = read_exactly(stream, length)
    # The checksum covers the footer up to the checksum itself.
    if checksum and zlib.crc32(end[: _FOOTER.size - 4], zlib.crc32(data)) != checksum:
        raise ValueError("its checksum is wrong")
    return _usable(memoryview(data), start)


def _usable(data: memoryview, start: int) -> Summary | None:
    schemas: dict[int, Schema] = {}
    channels: dict[int, McapChannel] = {}
    chunks: list[ChunkIndex] = []
    attachments: list[int] = []
    metadata: list[int] = []
    statistics: Statistics | None = None
    for record in records_in(data):
        match record.opcode:
            case Opcode.SCHEMA:
                schema = parsed(Schema, record.content)
                schemas[schema.id] = schema
            case Opcode.CHANNEL:
                channel = parsed(McapChannel, record.content)
                channels[channel.id] = channel
            case Opcode.CHUNK_INDEX:
                chunks.append(parsed(ChunkIndex, record.content))
            case Opcode.STATISTICS:
                statistics = parsed(Statistics, record.content)
            case Opcode.ATTACHMENT_INDEX:
                attachments.append(parsed(AttachmentIndex, record.content).offset)
            case Opcode.METADATA_INDEX:
                metadata.append(parsed(MetadataIndex, record.content).offset)
    if statistics is None or len(channels) < statistics.channel_count:
        return None
    if any(channel.schema_id and channel.schema_id not in schemas for channel in channels.values()):
        return None
    if len(chunks) < statistics.chunk_count or any(not each.message_index_offsets for each in chunks):
        return None
    if not _lie_side_by_side(chunks, start):
        raise ValueError("its chunks overlap")
    # Messages outside chunks have no index.
    if not chunks and statistics.message_count:
        return None
    described = {key: channel_of(each, schemas.get(each.schema_id)) for key, each in channels.items()}
    return Summary(described, chunks, statistics, attachments, metadata)


def _lie_side_by_side(chunks: list[ChunkIndex], end: int) -> bool:
    """Whether the chunks, each followed by its message index, do not overlap."""
    place = len(MAGIC)
    for chunk in sorted(chunks, key=lambda each: each.chunk_start_offset):
        index_begin = chunk.chunk_start_offset + chunk.chunk_length
        offsets = chunk.message_index_offsets.values()
        if chunk.chunk_start_offset < place:
            return False
        place = index_begin + chunk.message_index_length
        if place > end or min(offsets) < index_begin or max(offsets) >= place:
            return False
    return True
