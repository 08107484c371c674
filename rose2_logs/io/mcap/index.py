"""One MCAP file: its channels, where their messages are, and the bytes of each.

The index comes from the file's summary. A file without one, or a truncated one, is scanned once, record by
record, as far as it is readable.
"""

from __future__ import annotations

import logging
import struct
from collections import Counter, OrderedDict
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, ChunkIndex, Header, Metadata, Schema
from mcap.records import Channel as McapChannel

from rose2_logs.config.reading import NO_TYPE, ReadingParameters
from rose2_logs.config.times import LATEST_NS
from rose2_logs.errors import LogError
from rose2_logs.io.checked_file import CheckedFile
from rose2_logs.io.decompression import REMEDY
from rose2_logs.io.log_file import (
    Channel,
    LogFile,
    Place,
    StoredMessage,
    check_count,
    warn_of_times,
)
from rose2_logs.io.mcap.records import (
    INDEX,
    INDEX_ENTRY,
    MAGIC,
    MESSAGE,
    RECORD,
    Record,
    channel_of,
    chunk_records,
    parsed,
    read_exactly,
    read_summary,
    records_in,
)
from rose2_logs.io.source import DamagedMessageError
from rose2_logs.system.files import OnFailure
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

# Reading alternates between chunks that overlap in time; two are cached so that each is decompressed once.
_CHUNKS_KEPT = 2
_KEPT_BYTES = 1 << 24
"""Large chunks, each with a single large map, are not kept together."""
NAMED_RECORDS = {Opcode.ATTACHMENT: Attachment, Opcode.METADATA: Metadata}
"""Records with a name, which lie outside chunks; all others are of channels and messages."""
# What parsing damaged data raises; ValueError includes TooLargeError.
DAMAGE = (McapError, ValueError, KeyError, EOFError, struct.error)


class McapFile(LogFile):
    """An open MCAP file.

    Parameters
    ----------
    path : Path
    limits : ReadingParameters
        The largest sizes that are accepted.

    Raises
    ------
    LogError
        If the file cannot be opened, is not an MCAP file, or has more map messages than the limit.
    """

    def __init__(self, path: Path, limits: ReadingParameters) -> None:
        self.path = path
        self.limits = limits
        self.channels = {}
        self._schemas: dict[int, Schema] = {}
        self.message_counts = Counter()
        self.start_ns = self.end_ns = None
        self._chunks: OrderedDict[int, memoryview] = OrderedDict()
        self._scanned: list[Place] = []
        self._named_at: dict[int, list[int]] = {opcode: [] for opcode in NAMED_RECORDS}
        try:
            self._stream = CheckedFile(path)
        except OSError as error:
            raise LogError(f"{path}: cannot be opened: {error.strerror}", file=path) from error
        with OnFailure(self._stream.close):
            if self._stream.read(len(MAGIC)) != MAGIC:
                raise LogError(f"{path}: is not an MCAP file; it does not start like one", file=path)
            index_damage = ""
            try:
                self.summary = read_summary(self._stream, limits.chunk_max_bytes)
            except DAMAGE as error:
                self.summary, index_damage = None, str(error)
            self.indexed = self.summary is not None
            if self.summary is None:
                self._scan()
                if self.whole and index_damage:
                    text = f"{path}: its index is damaged ({index_damage}); the whole file was read instead"
                    log_warning(logger, "damaged_index", text, file=path)
            else:
                self._take_summary()

    def _typed(self, channel: Channel) -> Channel:
        """Give a channel without schema the type that was named."""
        named = self.limits.type_without_schema
        if channel.schema_name or named == NO_TYPE:
            return channel
        return replace(channel, schema_name=named)

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
        self._chunks.clear()

    @property
    def stream(self) -> IO[bytes]:
        """The open file, to copy chunks from."""
        return self._stream

    def places(self, channel_ids: Collection[int]) -> list[Place]:
        """Where the messages of some channels are stored, in log time order."""
        if self.summary is None:
            return sorted(place for place in self._scanned if place.channel_id in channel_ids)
        found: list[Place] = []
        for chunk in self.summary.chunks:
            if wanted := set(channel_ids) & set(chunk.message_index_offsets):
                found += self._places_in(chunk, wanted)
                check_count(self.path, len(found), self.limits.map_max_messages)
        places = sorted(place for place in found if place.log_time_ns <= LATEST_NS)
        warn_of_times(self.path, len(found) - len(places))
        return places

    def _places_in(self, chunk: ChunkIndex, channel_ids: set[int]) -> list[Place]:
        """Places of the messages in a chunk, from its index, or from the chunk if the index is damaged."""
        begin = chunk.chunk_start_offset
        try:
            return [
                Place(time, begin, offset, channel)
                for channel in channel_ids
                for time, offset in self._message_index(chunk, channel)
            ]
        except DAMAGE:
            pass
        found = []
        try:
            for record in records_in(self._chunk(begin)):
                if record.opcode == Opcode.MESSAGE:
                    channel, _, time, _ = MESSAGE.unpack_from(record.content)
                    if channel in channel_ids:
                        found.append(Place(time, begin, record.offset, channel))
        except DAMAGE as error:
            self._warn_damaged(begin, error)
        return found

    def _warn_damaged(self, begin: int, error: Exception) -> None:
        text = f"{self.path}: the chunk at byte {begin} is damaged ({error}); its messages are skipped"
        log_warning(logger, "damaged_chunk", text, file=self.path)

    def _message_index(self, chunk: ChunkIndex, channel_id: int) -> list[tuple[int, int]]:
        """Log time and offset of each message of a channel in a chunk, from the index after the chunk.

        Only the needed bytes are read: a large log has thousands of these indexes.
        """
        self._stream.seek(chunk.message_index_offsets[channel_id])
        opcode, _, channel, length = INDEX.unpack(self._stream.read(INDEX.size))
        if opcode != Opcode.MESSAGE_INDEX or channel != channel_id:
            raise ValueError("the summary does not point to a message index")
        if length > chunk.message_index_length:
            raise ValueError("the message index is longer than the summary says")
        entries = list(INDEX_ENTRY.iter_unpack(self._stream.read(length)))
        most = min(chunk.uncompressed_size, self.limits.chunk_max_bytes)
        if any(offset >= most for _, offset in entries):
            raise ValueError("the message index points beyond the chunk")
        return entries

    def payload(self, place: Place) -> memoryview:
        """Return the data of one message.

        Raises
        ------
        DamagedMessageError
            If it is not where the index says it is, or its chunk is damaged.
        """
        try:
            if place.offset < 0:
                record = memoryview(self._record(place.record))
            else:
                chunk = self._chunk(place.record)
                opcode, length = RECORD.unpack_from(chunk, place.offset)
                begin = place.offset + RECORD.size
                record = chunk[begin : begin + length]
                if opcode != Opcode.MESSAGE or len(record) != length:
                    raise ValueError("the index does not point to a message")
            channel_id, _, log_time_ns, _ = MESSAGE.unpack_from(record)
            if (channel_id, log_time_ns) != (place.channel_id, place.log_time_ns):
                raise ValueError("the index points to another message")
        except DAMAGE as error:
            raise DamagedMessageError(f"damaged ({error})") from error
        return record[MESSAGE.size :]

    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield every readable message: of some channels chunk by chunk, or all of them in file order."""
        if channel_ids is None:
            yield from self._all_messages()
        elif self.summary is None:
            yield from (each for each in self._all_messages() if each.channel.id in channel_ids)
        else:
            for chunk in sorted(self.summary.chunks, key=lambda each: each.message_start_time):
                if set(channel_ids) & set(chunk.message_index_offsets):
                    with suppress(*DAMAGE):
                        found = self.messages_in(chunk)
                        yield from (each for each in found if each.channel.id in channel_ids)

    def _all_messages(self) -> Iterator[StoredMessage]:
        for record in self._records():
            if record.opcode == Opcode.CHUNK:
                try:
                    held = records_in(chunk_records(record.content, self.limits.chunk_max_bytes))
                except DAMAGE as error:
                    if self.indexed:  # otherwise scanning the file has warned about it
                        self._warn_damaged(record.offset, error)
                    continue
            else:
                held = iter([record])
            with suppress(*DAMAGE):
                for each in held:
                    if each.opcode == Opcode.MESSAGE:
                        yield self._stored(each)

    def _stored(self, record: Record) -> StoredMessage:
        channel_id, sequence, log_time_ns, publish_time_ns = MESSAGE.unpack_from(record.content)
        data = record.content[MESSAGE.size :]
        return StoredMessage(self.channels[channel_id], log_time_ns, publish_time_ns, sequence, data)

    def header(self) -> Header:
        """Return the file's profile and the library that wrote it; empty if they are damaged."""
        try:
            header: Header = parsed(Header, memoryview(self._record(len(MAGIC))))
        except DAMAGE:
            return Header(profile="", library="")
        return header

    def attachments(self) -> Iterator[Attachment]:
        """Yield the readable attachments, one in memory at a time."""
        return self._named(Opcode.ATTACHMENT)

    def metadata(self) -> Iterator[Metadata]:
        """Yield the readable metadata records."""
        return self._named(Opcode.METADATA)

    def _named(self, opcode: Opcode) -> Iterator[Any]:
        kind = NAMED_RECORDS[opcode]
        for offset in self._offsets_of(opcode):
            try:
                yield parsed(kind, memoryview(self._record(offset, opcode)))
            except DAMAGE as error:
                text = (
                    f"{self.path}: the {kind.__name__.lower()} at byte {offset} is damaged ({error}); skipped"
                )
                log_warning(logger, "damaged_record", text, file=self.path)

    def _offsets_of(self, opcode: Opcode) -> list[int]:
        """File offsets of the records with a name: those that the summary lists, unless there are more."""
        if self.summary is None:
            return self._named_at[opcode]
        statistics = self.summary.statistics
        listed, count = {
            Opcode.ATTACHMENT: (self.summary.attachments, statistics.attachment_count),
            Opcode.METADATA: (self.summary.metadata, statistics.metadata_count),
        }[opcode]
        if len(listed) >= count:
            return listed
        return [begin for begin, found, _ in self._heads() if found == opcode]

    def messages_in(self, chunk: ChunkIndex) -> list[StoredMessage]:
        """Messages of one chunk in log time order; raises the errors of `DAMAGE` if it cannot be read."""
        content = memoryview(self._record(chunk.chunk_start_offset))
        records = records_in(chunk_records(content, self.limits.chunk_max_bytes))
        found = [self._stored(record) for record in records if record.opcode == Opcode.MESSAGE]
        return sorted(found, key=lambda message: message.log_time_ns)

    def _take_summary(self) -> None:
        assert self.summary is not None
        self.channels = {number: self._typed(each) for number, each in self.summary.channels.items()}
        statistics = self.summary.statistics
        if statistics.message_count:
            self.message_counts.update(statistics.channel_message_counts)
            self.start_ns = min(statistics.message_start_time, LATEST_NS)
            self.end_ns = min(statistics.message_end_time, LATEST_NS)

    def _records(self, is_scan: bool = False) -> Iterator[Record]:
        """Yield the records of the data section, one in memory at a time, as far as the file is readable.

        For a scan, a truncated file gives a warning, and only the head of messages outside chunks is read.
        Attachments and metadata records are left empty.
        """
        for begin, opcode, length in self._heads(is_scan):
            if opcode in NAMED_RECORDS:
                yield Record(begin, opcode, memoryview(b""))
            elif opcode in (Opcode.MESSAGE, Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL):
                needed = min(length, MESSAGE.size) if is_scan and opcode == Opcode.MESSAGE else length
                # Too large: left empty, which every reader treats as damage.
                content = self._stream.read(needed if needed <= self.limits.chunk_max_bytes else 0)
                yield Record(begin, opcode, memoryview(content))

    def _heads(self, is_scan: bool = False) -> Iterator[tuple[int, int, int]]:
        """Yield offset, kind and length of the records of the data section; each is to be read right away.

        What is left of a truncated file is yielded only of a chunk.
        """
        size = self._stream.seek(0, 2)
        begin = len(MAGIC)
        while True:
            self._stream.seek(begin)
            head = self._stream.read(RECORD.size)
            opcode, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, size)
            end = begin + RECORD.size + length
            if end > size or opcode == 0:
                if is_scan:
                    self.whole = False
                    text = f"{self.path}: truncated or damaged after {begin} bytes; everything before is read"
                    log_warning(logger, "cut_off", text, file=self.path)
                if opcode == Opcode.CHUNK and length <= self.limits.chunk_max_bytes:
                    yield begin, opcode, length
                return
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                return
            yield begin, opcode, length
            begin = end

    def _scan(self) -> None:
        """Index the file record by record, as far as it is readable."""
        size = self._stream.seek(0, 2)
        for record in self._records(is_scan=True):
            try:
                if record.opcode in NAMED_RECORDS:
                    self._named_at[record.opcode].append(record.offset)
                    continue
                if record.opcode != Opcode.CHUNK:
                    self._take(record, record.offset, -1)
                    continue
                for inner in records_in(chunk_records(record.content, self.limits.chunk_max_bytes)):
                    self._take(inner, record.offset, inner.offset)
            except DAMAGE as error:
                if record.offset + RECORD.size + len(record.content) == size and not self.whole:
                    continue  # the incomplete end of a truncated file
                self.whole = False
                text = (
                    f"{self.path}: the record at byte {record.offset} is damaged ({error}); its readable "
                    "part is used"
                )
                log_warning(logger, "damaged_chunk", text, file=self.path)

    def _take(self, record: Record, place: int, offset: int) -> None:
        if record.opcode == Opcode.MESSAGE:
            self._add(record.content, place, offset)
        elif record.opcode == Opcode.SCHEMA:
            schema = parsed(Schema, record.content)
            self._schemas[schema.id] = schema
        elif record.opcode == Opcode.CHANNEL:
            channel = parsed(McapChannel, record.content)
            found = channel_of(channel, self._schemas.get(channel.schema_id))
            self.channels[channel.id] = self._typed(found)

    def _add(self, head: memoryview, record: int, offset: int) -> None:
        channel_id, _, log_time_ns, _ = MESSAGE.unpack_from(head)
        if channel_id not in self.channels or log_time_ns > LATEST_NS:
            raise ValueError("a message has no channel or an impossible time")
        self.message_counts[channel_id] += 1
        self.start_ns = log_time_ns if self.start_ns is None else min(self.start_ns, log_time_ns)
        self.end_ns = log_time_ns if self.end_ns is None else max(self.end_ns, log_time_ns)
        if self.channels[channel_id].is_wanted:
            self._scanned.append(Place(log_time_ns, record, offset, channel_id))
            check_count(self.path, len(self._scanned), self.limits.map_max_messages)

    def _chunk(self, begin: int) -> memoryview:
        """Uncompressed records of the chunk at a file offset, after verifying its checksum."""
        if begin in self._chunks:
            self._chunks.move_to_end(begin)
            return self._chunks[begin]
        while sum(map(len, self._chunks.values())) > _KEPT_BYTES:
            self._chunks.popitem(last=False)
        self._chunks[begin] = records = chunk_records(self._record(begin), self.limits.chunk_max_bytes)
        if len(self._chunks) > _CHUNKS_KEPT:
            self._chunks.popitem(last=False)
        return records

    def _record(self, begin: int, wanted: Opcode | None = None) -> bytes:
        """Content of the record at a file offset, of a kind if one is wanted."""
        self._stream.seek(begin)
        opcode, length = RECORD.unpack(read_exactly(self._stream, RECORD.size))
        if wanted is not None and opcode != wanted:
            raise ValueError("the index points to another record")
        if length > self.limits.chunk_max_bytes:
            raise ValueError(f"it claims {length} bytes; {REMEDY}")
        return self._stream.read(length) if opcode == Opcode.CHUNK else read_exactly(self._stream, length)
