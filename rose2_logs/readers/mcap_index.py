"""One MCAP file: its channels, where the messages of a channel lie, and the bytes of each.

The index comes from the file's summary; a file that has none, or was cut off, is scanned once, record by
record, over everything that is whole.
"""

from __future__ import annotations

import logging
import struct
from collections import Counter, OrderedDict
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from functools import partial
from io import BufferedReader, BytesIO
from pathlib import Path
from typing import NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from mcap.summary import Summary

from rose2_logs.errors import LogError
from rose2_logs.readers.source import DamagedMessageError

logger = logging.getLogger(__name__)

_RECORD = struct.Struct("<BQ")  # opcode, length of what follows
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time; then the data
_INDEX = struct.Struct("<BQHI")  # head of a message index: and channel, length of its entries
_INDEX_ENTRY = struct.Struct("<QQ")  # log time, offset in the uncompressed chunk
_MAGIC = b"\x89MCAP0\r\n"
# Chunks that overlap in time are read in turns; two are kept so that each is decompressed once.
_CHUNKS_KEPT = 2
# A later log time is damage: it lies beyond the year 2262.
_LATEST_NS = 2**63 - 1
# What the mcap package and its decompressors raise on bytes that are not what they should be.
_DAMAGE = (
    McapError,
    zstandard.ZstdError,
    ValueError,
    RuntimeError,
    KeyError,
    EOFError,
    MemoryError,
    struct.error,
)


class Place(NamedTuple):
    """Where a message lies; the order of the fields is the order of reading.

    `record` is the file offset of its chunk's record, or of its own record outside chunks; `offset` that of
    the message record in the uncompressed chunk, or -1 outside chunks.
    """

    log_time_ns: int
    record: int
    offset: int
    channel_id: int


class McapFile:
    """An open MCAP file.

    Parameters
    ----------
    path : Path
    is_wanted : callable
        From a channel and its schema (None if it has none) to whether its messages will be read; a scan
        keeps the places of those only.

    Attributes
    ----------
    path : Path
    channels : dict of int to Channel
        By id.
    schemas : dict of int to Schema
        By id.
    message_counts : dict of int to int
        Messages per channel id.
    start_ns, end_ns : int or None
        Log times of the first and the last message.
    indexed : bool
        Whether the summary served as index; otherwise the file was scanned.

    Raises
    ------
    LogError
        If the file cannot be opened or is no MCAP file.
    """

    def __init__(self, path: Path, is_wanted: Callable[[Channel, Schema | None], bool]) -> None:
        self.path = path
        self._is_wanted = is_wanted
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.message_counts: Counter[int] = Counter()
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self._chunks: OrderedDict[int, memoryview] = OrderedDict()
        self._scanned: list[Place] = []
        try:
            self._stream = path.open("rb", buffering=0)
        except OSError as error:
            raise LogError(f"{path}: cannot be opened: {error.strerror}") from error
        try:
            if self._stream.read(len(_MAGIC)) != _MAGIC:
                raise LogError(f"{path}: is not an MCAP file, it does not begin as one")
            self._summary = self._usable_summary()
            self.indexed = self._summary is not None
            if self._summary is None:
                self._scan()
            else:
                self._take_summary(self._summary)
        except BaseException:
            self._stream.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
        self._chunks.clear()

    def places(self, channel_ids: Collection[int]) -> list[Place]:
        """Where the messages of some channels lie, in the order of log time."""
        if self._summary is None:
            return sorted(place for place in self._scanned if place.channel_id in channel_ids)
        places: list[Place] = []
        for chunk in self._summary.chunk_indexes:
            for channel_id in set(channel_ids) & set(chunk.message_index_offsets):
                try:
                    entries = self._message_index(chunk.message_index_offsets[channel_id], channel_id)
                except _DAMAGE as error:
                    raise LogError(
                        f"{self.path}: its index is damaged ({error}); repair it with `mcap recover`"
                    ) from error
                places += [
                    Place(time, chunk.chunk_start_offset, offset, channel_id)
                    for time, offset in entries
                    if time <= _LATEST_NS
                ]
        return sorted(places)

    def messages(self, channel_ids: Collection[int]) -> Iterator[tuple[int, int, Callable[[], memoryview]]]:
        """Yield log time, channel and what gives the bytes of the messages of some channels.

        Chunk by chunk, so that neither messages nor their places are held; damaged chunks are passed over.
        """
        if self._summary is None:
            yield from self._messages_in_file_order(channel_ids)
            return
        for chunk in sorted(self._summary.chunk_indexes, key=lambda each: each.message_start_time):
            places = []
            for channel_id in set(channel_ids) & set(chunk.message_index_offsets):
                with suppress(*_DAMAGE):
                    places += [
                        Place(time, chunk.chunk_start_offset, offset, channel_id)
                        for time, offset in self._message_index(
                            chunk.message_index_offsets[channel_id], channel_id
                        )
                    ]
            for place in sorted(places):
                yield place.log_time_ns, place.channel_id, partial(self.payload, place)

    def _messages_in_file_order(
        self, channel_ids: Collection[int]
    ) -> Iterator[tuple[int, int, Callable[[], memoryview]]]:
        """As far as a file without index is whole; it is opened once more."""
        with suppress(*_DAMAGE, OSError), self.path.open("rb") as stream:
            for record in StreamReader(stream, record_size_limit=None).records:
                if isinstance(record, Message) and record.channel_id in channel_ids:
                    yield record.log_time, record.channel_id, partial(_view, record.data)

    def _message_index(self, begin: int, channel_id: int) -> list[tuple[int, int]]:
        """Log time and offset of each message of a channel, from the message index at a file offset.

        Read exactly: in a large log there are thousands.
        """
        self._stream.seek(begin)
        opcode, _, channel, length = _INDEX.unpack(self._read(_INDEX.size))
        if opcode != Opcode.MESSAGE_INDEX or channel != channel_id:
            raise McapError("no message index where the summary says")
        return list(_INDEX_ENTRY.iter_unpack(self._read(length)))

    def payload(self, place: Place) -> memoryview:
        """Return the data of one message.

        Raises
        ------
        DamagedMessageError
            If it is not where the index says, or a checksum or a compressed chunk is wrong.
        """
        try:
            if place.offset < 0:
                self._stream.seek(place.record)
                record = memoryview(self._read(_RECORD.unpack(self._read(_RECORD.size))[1]))
            else:
                chunk = self._chunk(place.record)
                opcode, length = _RECORD.unpack_from(chunk, place.offset)
                begin = place.offset + _RECORD.size
                record = chunk[begin : begin + length]
                if opcode != Opcode.MESSAGE or len(record) != length:
                    raise ValueError("there is no message where the index says")
            if _MESSAGE.unpack_from(record)[0] != place.channel_id:
                raise ValueError("there is a message of another channel where the index says")
        except _DAMAGE as error:
            raise DamagedMessageError(f"damaged ({error})") from error
        return record[_MESSAGE.size :]

    def _usable_summary(self) -> Summary | None:
        """Return the summary if every message of the file can be found by it."""
        # A summary is many small records; all else is read in the pieces that are needed.
        buffered = BufferedReader(self._stream)
        try:
            buffered.seek(0)
            summary = make_reader(buffered).get_summary()
        except (*_DAMAGE, OSError, StopIteration):
            return None
        finally:
            buffered.detach()
        if summary is None or summary.statistics is None:
            return None
        if len(summary.channels) < summary.statistics.channel_count or any(
            channel.schema_id and channel.schema_id not in summary.schemas
            for channel in summary.channels.values()
        ):
            return None
        if len(summary.chunk_indexes) < summary.statistics.chunk_count:
            return None
        indexed = all(chunk.message_index_offsets for chunk in summary.chunk_indexes)
        # Messages outside chunks have no index.
        return (
            summary if indexed and (summary.chunk_indexes or not summary.statistics.message_count) else None
        )

    def _take_summary(self, summary: Summary) -> None:
        self.channels, self.schemas = summary.channels, summary.schemas
        if summary.statistics is not None and summary.statistics.message_count:
            self.message_counts.update(summary.statistics.channel_message_counts)
            self.start_ns = summary.statistics.message_start_time
            self.end_ns = summary.statistics.message_end_time

    def _scan(self) -> None:
        """Index the file record by record, as far as it is whole."""
        size = self._stream.seek(0, 2)
        begin = len(_MAGIC)
        damaged = 0
        while True:
            self._stream.seek(begin)
            head = self._stream.read(_RECORD.size)
            opcode, length = _RECORD.unpack(head) if len(head) == _RECORD.size else (0, size)
            if begin + _RECORD.size + length > size:
                logger.warning(
                    "%s: cut off or damaged after %d bytes; what is whole before is read", self.path, begin
                )
                break
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                break
            try:
                if opcode == Opcode.MESSAGE:
                    self._add(self._read(_MESSAGE.size), begin, -1)
                elif opcode == Opcode.CHUNK:
                    for offset, inner, data in self._records_in_chunk(begin):
                        self._take(inner, data, begin, offset)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._take(opcode, self._read(length), begin, -1)
            except _DAMAGE:
                damaged += 1
            begin += _RECORD.size + length
        if damaged:
            logger.warning("%s: %d damaged chunks or records are left out", self.path, damaged)

    def _take(self, opcode: int, data: bytes | memoryview, record: int, offset: int) -> None:
        if opcode == Opcode.MESSAGE:
            self._add(data, record, offset)
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(data)))
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(data)))
            self.channels[channel.id] = channel

    def _add(self, head: bytes | memoryview, record: int, offset: int) -> None:
        channel_id, _, log_time_ns, _ = _MESSAGE.unpack_from(head)
        if channel_id not in self.channels or log_time_ns > _LATEST_NS:
            raise ValueError("a message without a channel or of an impossible time")
        self.message_counts[channel_id] += 1
        self.start_ns = log_time_ns if self.start_ns is None else min(self.start_ns, log_time_ns)
        self.end_ns = log_time_ns if self.end_ns is None else max(self.end_ns, log_time_ns)
        channel = self.channels[channel_id]
        if self._is_wanted(channel, self.schemas.get(channel.schema_id)):
            self._scanned.append(Place(log_time_ns, record, offset, channel_id))

    def _records_in_chunk(self, begin: int) -> Iterator[tuple[int, int, memoryview]]:
        """Yield the offset, opcode and content of each record in the chunk at a file offset."""
        chunk = self._chunk(begin)
        offset = 0
        while offset < len(chunk):
            opcode, length = _RECORD.unpack_from(chunk, offset)
            yield offset, opcode, chunk[offset + _RECORD.size :][:length]
            offset += _RECORD.size + length

    def _chunk(self, begin: int) -> memoryview:
        """Uncompressed records of the chunk at a file offset, its checksum verified."""
        if begin in self._chunks:
            self._chunks.move_to_end(begin)
            return self._chunks[begin]
        self._stream.seek(begin + _RECORD.size)
        chunk = Chunk.read(ReadDataStream(self._stream))
        stream, length = get_chunk_data_stream(chunk, validate_crc=True)
        self._chunks[begin] = records = memoryview(stream.read(length))
        if len(self._chunks) > _CHUNKS_KEPT:
            self._chunks.popitem(last=False)
        return records

    def _read(self, length: int) -> bytes:
        data = self._stream.read(length)
        if len(data) != length:
            raise EOFError("the file ends within the record")
        return data


def _view(data: bytes) -> memoryview:
    return memoryview(data)
