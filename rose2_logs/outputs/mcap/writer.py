"""Writing an MCAP file from messages and from chunks of another file, which are copied compressed.

The writer of the mcap package accepts only messages, so a copy would decompress and compress everything.
"""

from __future__ import annotations

import dataclasses
import struct
import zlib
from collections import Counter
from itertools import count
from typing import IO, Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from rose2_logs.io.mcap.records import INDEX, INDEX_ENTRY, MAGIC, RECORD

CHUNK_BYTES = 1 << 20
"""Size of uncompressed messages from which a chunk is written, as in the writer of the mcap package."""
COPIED_AT_ONCE = 16 << 20
"""Bytes of a chunk that are in memory at a time while it is copied."""

# Record head and start of a message, packed in one call: channel, sequence, log time, publish time.
_MESSAGE = struct.Struct("<BQHIQQ")


class McapWriter:
    """Writes one indexed MCAP file; `finish` completes it, and the caller closes the stream.

    Parameters
    ----------
    stream : binary file
        Positioned at its start.
    profile, library : str
        For the header.
    """

    def __init__(self, stream: IO[bytes], profile: str, library: str) -> None:
        self._stream = stream
        self._offset = 0
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: Counter[int] = Counter()
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        # The current chunk: its records, and the log time and offset of each message by channel.
        self._records = bytearray()
        self._entries: dict[int, list[tuple[int, int]]] = {}
        self._compressor = zstandard.ZstdCompressor()
        self._write(MAGIC)
        self._write_record(Header(profile, library))

    def register_schema(self, name: str, encoding: str, data: bytes, wanted_id: int | None = None) -> int:
        """Add a schema and return its id: the wanted one, which must not be 0, if it is free."""
        number = _free_id(wanted_id, self._schemas)
        self._schemas[number] = Schema(id=number, name=name, encoding=encoding, data=data)
        self._write_record(self._schemas[number])
        return number

    def register_channel(
        self,
        topic: str,
        message_encoding: str,
        schema_id: int,
        metadata: dict[str, str],
        wanted_id: int | None = None,
    ) -> int:
        """Add a channel and return its id: the wanted one if it is free; schema 0 means no schema."""
        number = _free_id(wanted_id, self._channels)
        self._channels[number] = Channel(
            id=number, topic=topic, message_encoding=message_encoding, schema_id=schema_id, metadata=metadata
        )
        self._write_record(self._channels[number])
        return number

    def add_message(
        self,
        channel_id: int,
        log_time: int,
        data: bytes | bytearray | memoryview,
        publish_time: int,
        sequence: int,
    ) -> None:
        """Add one message to the current chunk; log time and publish time in nanoseconds."""
        self._entries.setdefault(channel_id, []).append((log_time, len(self._records)))
        length = _MESSAGE.size - RECORD.size + len(data)
        self._records += _MESSAGE.pack(Opcode.MESSAGE, length, channel_id, sequence, log_time, publish_time)
        self._records += data
        if len(self._records) >= CHUNK_BYTES:
            self.flush()

    def copy_chunk(self, source: IO[bytes], index: ChunkIndex) -> None:
        """Copy a chunk and the message index that follows it, unchanged.

        Parameters
        ----------
        source : binary file
            File that contains the chunk.
        index : ChunkIndex
            Where it is, from the source's summary. Its channels must be registered under the same ids.

        Raises
        ------
        OSError
            If the file ends before the chunk does, or cannot be read or written.
        ValueError
            If the message index is damaged; then nothing is written.
        """
        source.seek(index.chunk_start_offset + index.chunk_length)
        counts = _indexed_messages(_read(source, index.message_index_length))
        self.flush()
        moved = self._offset - index.chunk_start_offset
        source.seek(index.chunk_start_offset)
        for left in range(index.chunk_length + index.message_index_length, 0, -COPIED_AT_ONCE):
            self._write(_read(source, min(left, COPIED_AT_ONCE)))
        offsets = {channel: offset + moved for channel, offset in index.message_index_offsets.items()}
        self._chunks.append(
            dataclasses.replace(
                index, chunk_start_offset=index.chunk_start_offset + moved, message_index_offsets=offsets
            )
        )
        self._counts.update(counts)

    def add_attachment(
        self, create_time: int, log_time: int, name: str, media_type: str, data: bytes
    ) -> None:
        """Add an attachment."""
        record = Attachment(
            create_time=create_time, log_time=log_time, name=name, media_type=media_type, data=data
        )
        offset, length = self._write_record(record)
        self._attachments.append(
            AttachmentIndex(
                offset=offset,
                length=length,
                create_time=create_time,
                log_time=log_time,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Add a metadata record."""
        offset, length = self._write_record(Metadata(name=name, metadata=values))
        self._metadata.append(MetadataIndex(offset=offset, length=length, name=name))

    def flush(self) -> None:
        """Write the current chunk, if it has messages."""
        if not self._entries:
            return
        times = [time for entries in self._entries.values() for time, _ in entries]
        packed = self._compressor.compress(self._records)
        chunk = Chunk(
            compression="zstd",
            data=packed,
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(self._records),
            uncompressed_size=len(self._records),
        )
        start, length = self._write_record(chunk)
        index_start, offsets = self._offset, {}
        for channel, entries in self._entries.items():
            offsets[channel], _ = self._write_record(MessageIndex(channel_id=channel, records=entries))
            self._counts[channel] += len(entries)
        self._chunks.append(
            ChunkIndex(
                chunk_start_offset=start,
                chunk_length=length,
                compression=chunk.compression,
                compressed_size=len(packed),
                uncompressed_size=chunk.uncompressed_size,
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                message_index_length=self._offset - index_start,
                message_index_offsets=offsets,
            )
        )
        self._records, self._entries = bytearray(), {}

    def finish(self) -> None:
        """Write the last chunk, the summary and the end of the file."""
        self.flush()
        self._write_record(DataEnd(0))
        summary, summary_start = RecordBuilder(), self._offset
        groups: list[tuple[Opcode, list[Any]]] = [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels.values())),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ]
        places = []
        for opcode, records in groups:
            start = summary.count
            for record in records:
                record.write(summary)
            if records:
                places.append(
                    SummaryOffset(
                        group_opcode=opcode,
                        group_start=summary_start + start,
                        group_length=summary.count - start,
                    )
                )
        offsets_start = summary_start + summary.count
        for place in places:
            place.write(summary)
        written: bytes = summary.end()  # type: ignore[no-untyped-call]
        # The checksum of the summary covers the footer up to the checksum itself.
        footer = RecordBuilder()
        Footer(summary_start=summary_start, summary_offset_start=offsets_start, summary_crc=0).write(footer)
        checked: bytes = footer.end()[:-4]  # type: ignore[no-untyped-call]
        self._write(written)
        self._write(checked + struct.pack("<I", zlib.crc32(checked, zlib.crc32(written))))
        self._write(MAGIC)

    def _statistics(self) -> Statistics:
        filled = [chunk for chunk in self._chunks if chunk.message_index_offsets]
        return Statistics(
            message_count=self._counts.total(),
            schema_count=len(self._schemas),
            channel_count=len(self._channels),
            attachment_count=len(self._attachments),
            metadata_count=len(self._metadata),
            chunk_count=len(self._chunks),
            message_start_time=min((chunk.message_start_time for chunk in filled), default=0),
            message_end_time=max((chunk.message_end_time for chunk in filled), default=0),
            channel_message_counts=dict(self._counts),
        )

    def _write_record(self, record: Any) -> tuple[int, int]:
        """Write a record and return its offset and length."""
        builder = RecordBuilder()
        record.write(builder)
        offset, data = self._offset, builder.end()  # type: ignore[no-untyped-call]
        self._write(data)
        return offset, len(data)

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._offset += len(data)


def _free_id(wanted: int | None, taken: dict[int, Any]) -> int:
    if wanted is not None and wanted not in taken:
        return wanted
    return next(each for each in count(1) if each not in taken)


def _read(source: IO[bytes], length: int) -> bytes:
    data = source.read(length)
    if len(data) != length:
        raise OSError("the log ends in the middle of a chunk")
    return data


def _indexed_messages(message_index: bytes) -> Counter[int]:
    """Number of messages by channel in consecutive message index records; ValueError if they are damaged."""
    counts: Counter[int] = Counter()
    place = 0
    while place < len(message_index):
        if place + INDEX.size > len(message_index):
            raise ValueError("a message index is damaged")
        opcode, length, channel, entries = INDEX.unpack_from(message_index, place)
        if opcode != Opcode.MESSAGE_INDEX or length != INDEX.size - RECORD.size + entries:
            raise ValueError("a message index is damaged")
        counts[channel] += entries // INDEX_ENTRY.size
        place += RECORD.size + length
    return counts
