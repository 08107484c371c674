"""One ROS 1 bag: its channels, where their messages are, and the bytes of each.

The bag's own index is used. A bag without one (its recorder crashed), or with a damaged one, is scanned once,
chunk by chunk, as far as it is readable.
"""

from __future__ import annotations

import io
import logging
import struct
from collections import Counter, OrderedDict
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.reading import ReadingParameters
from rose2_logs.errors import LogError
from rose2_logs.io.checked_file import CheckedFile
from rose2_logs.io.log_file import Channel, LogFile, Place, StoredMessage, check_count
from rose2_logs.io.rosbag1.records import (
    BAG_HEADER,
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX_DTYPE,
    INDEX_ENTRY_BYTES,
    INDEX_HEAD_BYTES,
    MAGIC,
    MESSAGE,
    Head,
    IndexRows,
    chunk_data,
    chunk_info,
    connection_of,
    heads_in,
    number,
    read_head,
    time_ns,
)
from rose2_logs.io.source import DamagedMessageError
from rose2_logs.system.files import OnFailure
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

# What parsing damaged data raises; ValueError includes TooLargeError.
_DAMAGE = (ValueError, KeyError, EOFError, struct.error)
# Messages of a scanned chunk that are put into an array at once: as tuples they take ten times the memory.
_ENTRIES_AT_ONCE = 65_536
# Total size of the chunks that are cached while messages are read in time order. In a bag that was written
# topic by topic, reading alternates between chunks, and without a cache each would be decompressed for every
# message. Recorders write chunks of 0.8 MB.
_CHUNKS_KEPT_BYTES = 16 << 20


class BagFile(LogFile):
    """An open ROS 1 bag.

    Parameters
    ----------
    path : Path
    limits : ReadingParameters
        The largest sizes that are accepted.

    Raises
    ------
    LogError
        If the file cannot be opened, is not a bag of version 2.0, or has more map messages than the limit.
    """

    def __init__(self, path: Path, limits: ReadingParameters) -> None:
        self.path = path
        self.limits = limits
        # Maps are read once each, one after the other, so nothing is cached.
        self._latest = _Chunks(self._read_chunk, 0)
        try:
            self._stream = io.BufferedReader(CheckedFile(path))
            self._size = path.stat().st_size
        except OSError as error:
            raise LogError(f"{path}: cannot be opened: {error.strerror}", file=path) from error
        with OnFailure(self._stream.close):
            self._open()
        self.message_counts = Counter(dict(zip(*self._counted(), strict=True)))
        times = self._index["time"]
        self.start_ns = int(times.min()) if len(times) else None
        self.end_ns = int(times.max()) if len(times) else None

    def _open(self) -> None:
        if self._stream.read(len(MAGIC)) != MAGIC:
            raise LogError(f"{self.path}: is not a ROS 1 bag of version 2.0", file=self.path)
        self.channels: dict[int, Channel] = {}
        parts: list[NDArray[np.void]] = []
        try:
            head = read_head(self._stream, len(MAGIC))
            if head.op != BAG_HEADER:
                raise ValueError("its first record is not a bag's header")
            if head.fields.get("encryptor"):
                raise LogError(f"{self.path}: is encrypted; decrypt it first", file=self.path)
            index_begin = number(head.fields, "index_pos")
            self.indexed = index_begin > 0
            if self.indexed:
                self._read_index(index_begin, parts)
        except _DAMAGE:
            self.indexed = False
        if not self.indexed:
            self.channels, parts = {}, []
            self._scan(parts)
        self._index = np.concatenate([np.empty(0, INDEX_DTYPE), *parts])

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
        self._latest = _Chunks(self._read_chunk, 0)

    def places(self, channel_ids: Collection[int]) -> list[Place]:
        """Where the messages of some channels are stored, in log time order."""
        chosen = self._index[np.isin(self._index["connection"], list(channel_ids))]
        check_count(self.path, len(chosen), self.limits.map_max_messages)
        return sorted(Place(*each) for each in chosen.tolist())

    def payload(self, place: Place) -> memoryview:
        """Return the data of one message.

        Raises
        ------
        DamagedMessageError
            If it is not where the index says it is, or its chunk is damaged.
        """
        try:
            return self._payload(place, self._latest)
        except _DAMAGE as error:
            raise DamagedMessageError(f"damaged ({error})") from error

    def _read_chunk(self, begin: int) -> bytes:
        head = read_head(self._stream, begin)
        return bytes(chunk_data(self._stream, head, self.limits.chunk_max_bytes))

    def _payload(self, place: Place, chunks: _Chunks) -> memoryview:
        records = chunks.records(place.record)
        stream = BytesIO(records)
        head = read_head(stream, place.offset)
        while head.op == CONNECTION:  # may precede its first message
            head = read_head(stream, head.end)
        if (
            head.op != MESSAGE
            or number(head.fields, "conn") != place.channel_id
            or time_ns(head.fields, "time") != place.log_time_ns
        ):
            raise ValueError("the index points to another message")
        data = memoryview(records)[head.data_begin : head.end]
        if len(data) != head.data_length:
            raise EOFError("it ends in the middle of a message")
        return data

    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield every readable message of some channels, or of all, in log time order."""
        sequence: Counter[int] = Counter()
        chunks = _Chunks(self._read_chunk, _CHUNKS_KEPT_BYTES)
        index = self._index
        if channel_ids is not None:
            index = index[np.isin(index["connection"], list(channel_ids))]
        for entry in index[np.argsort(index["time"], kind="stable")]:
            place = Place(*entry.item())
            with suppress(*_DAMAGE):
                data = self._payload(place, chunks)
                channel, time = self.channels[place.channel_id], place.log_time_ns
                yield StoredMessage(channel, time, time, sequence[place.channel_id], data)
                sequence[place.channel_id] += 1

    def _counted(self) -> tuple[list[int], list[int]]:
        connections, counts = np.unique(self._index["connection"], return_counts=True)
        return connections.tolist(), counts.tolist()

    def _read_index(self, begin: int, parts: list[NDArray[np.void]]) -> None:
        """Read the index at the end of the bag, and the index after each chunk."""
        infos: dict[int, dict[int, int]] = {}
        while begin < self._size:
            try:
                head = read_head(self._stream, begin)
            except _DAMAGE:
                if not infos:
                    raise
                break  # whatever follows the index
            if head.op == CONNECTION:
                self._take_connection(head, self._data(head))
            elif head.op == CHUNK_INFO:
                place, counts = chunk_info(head, self._data(head))
                if place in infos:
                    raise ValueError("a chunk is described twice")
                infos[place] = counts
            else:
                raise ValueError("the index contains a record that does not belong there")
            begin = head.end
        self._check_index(infos)
        rows = IndexRows()
        for place, counts in infos.items():
            try:
                self._read_chunk_index(place, counts, rows)
            except _DAMAGE as error:
                self._recover_chunk(place, sum(counts.values()), error, parts)
        parts.append(rows.places())

    def _check_index(self, infos: dict[int, dict[int, int]]) -> None:
        """Compare the index with the counts in the bag's header."""
        fields = read_head(self._stream, len(MAGIC)).fields
        if len(infos) != number(fields, "chunk_count") or len(self.channels) != number(fields, "conn_count"):
            raise ValueError("the index is incomplete")

    def _read_chunk_index(self, place: int, counts: dict[int, int], rows: IndexRows) -> None:
        head = read_head(self._stream, place)
        if head.op != CHUNK:
            raise ValueError("the index does not point to a chunk")
        self._stream.seek(head.end)
        length = len(counts) * INDEX_HEAD_BYTES + sum(counts.values()) * INDEX_ENTRY_BYTES
        if head.end + length > self._size:
            raise EOFError("it ends in the middle of a chunk's index")
        rows.take(self._stream.read(length), counts, place)

    def _recover_chunk(self, place: int, count: int, why: Exception, parts: list[NDArray[np.void]]) -> None:
        """Scan a chunk whose index is damaged; if there is no chunk either, warn about what is lost."""
        with suppress(*_DAMAGE):
            head = read_head(self._stream, place)
            if head.op == CHUNK:
                self._scan_chunk(head, parts)
                return
        self.whole = False
        text = f"{self.path}: the chunk at byte {place} is damaged ({why}); its {count} messages are skipped"
        log_warning(logger, "damaged_chunk", text, file=self.path)

    def _scan(self, parts: list[NDArray[np.void]]) -> None:
        """Index the bag chunk by chunk, as far as it is readable."""
        begin = len(MAGIC)
        reason = ""
        while begin < self._size:
            try:
                head = read_head(self._stream, begin)
            except _DAMAGE as error:
                reason = str(error)
                break
            if head.op == CHUNK:
                self._scan_chunk(head, parts)
            elif head.op == CONNECTION and head.end <= self._size:
                with suppress(*_DAMAGE):
                    self._take_connection(head, self._data(head))
            begin = head.end
        if begin > self._size or begin == len(MAGIC):
            reason = reason or "incomplete record"
        if reason:
            self.whole = False
            text = f"{self.path}: truncated or damaged ({reason}) after {min(begin, self._size)} bytes; "
            log_warning(logger, "cut_off", text + "everything before is read", file=self.path)
        else:
            text = f"{self.path}: was not closed, or its index is damaged; the whole file was read instead"
            log_warning(logger, "damaged_index", text, file=self.path)

    def _scan_chunk(self, chunk: Head, parts: list[NDArray[np.void]]) -> None:
        found: list[tuple[int, int, int, int]] = []
        try:
            records = chunk_data(self._stream, chunk, self.limits.chunk_max_bytes)
            for head in heads_in(records):
                if head.op == CONNECTION:
                    self._take_connection(head, bytes(records[head.data_begin : head.end]))
                elif head.op == MESSAGE:
                    time, connection = time_ns(head.fields, "time"), number(head.fields, "conn")
                    if connection in self.channels:
                        found.append((time, chunk.begin, head.begin, connection))
                    if len(found) == _ENTRIES_AT_ONCE:
                        parts.append(np.array(found, INDEX_DTYPE))
                        found.clear()
        except _DAMAGE as error:
            self.whole = False
            text = f"{self.path}: the chunk at byte {chunk.begin} is damaged ({error}); "
            log_warning(logger, "damaged_chunk", text + "its readable part is used", file=self.path)
        if found:
            parts.append(np.array(found, INDEX_DTYPE))

    def _take_connection(self, head: Head, data: bytes) -> None:
        channel = connection_of(head, data)
        self.channels.setdefault(channel.id, channel)

    def _data(self, head: Head) -> bytes:
        if head.end > self._size:
            raise EOFError("it ends in the middle of a record")
        self._stream.seek(head.data_begin)
        return self._stream.read(head.data_length)


class _Chunks:
    """Cache of uncompressed chunks by file offset: always the latest one, others up to a total size."""

    def __init__(self, read: Callable[[int], bytes], kept_bytes: int) -> None:
        self._read = read
        self._most_bytes = kept_bytes
        self._kept: OrderedDict[int, bytes] = OrderedDict()
        self._bytes = 0

    def records(self, begin: int) -> bytes:
        if begin in self._kept:
            self._kept.move_to_end(begin)
            return self._kept[begin]
        if self._bytes > self._most_bytes:
            self._drop()
        records = self._read(begin)
        self._kept[begin] = records
        self._bytes += len(records)
        while self._bytes > self._most_bytes and len(self._kept) > 1:
            self._drop()
        return records

    def _drop(self) -> None:
        self._bytes -= len(self._kept.popitem(last=False)[1])
