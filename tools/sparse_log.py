"""An MCAP of any size that takes little space: all but the maps in it are holes in the file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Schema,
    Statistics,
)

MAGIC = b"\x89MCAP0\r\n"
SENSOR_TOPICS = 20
"""Topics beside the map, each with a message in every chunk: about as many as a robot records."""
CHUNK_BYTES = 1 << 20
CHUNK_NS = 1_000_000_000
"""Time from chunk to chunk: 1 MB/s."""


def write_sparse_log(path: Path, size_bytes: int, schema_text: bytes, maps: Sequence[bytes]) -> None:
    """Write an indexed MCAP of sensor messages, whose bytes are holes, and of maps that can be read.

    Parameters
    ----------
    path : Path
        Where to; the file system must know holes.
    size_bytes : int
        About how large the file appears.
    schema_text : bytes
        Definition of nav_msgs/msg/OccupancyGrid.
    maps : sequence of bytes
        Maps as CDR, spread evenly over the log.
    """
    count = max(size_bytes // CHUNK_BYTES, len(maps))
    map_after = {(number + 1) * count // len(maps) - 1: data for number, data in enumerate(maps)}
    schemas = [Schema(id=1, name="nav_msgs/msg/OccupancyGrid", encoding="ros2msg", data=schema_text)]
    schemas.append(Schema(id=2, name="sensor_msgs/msg/PointCloud2", encoding="ros2msg", data=b""))
    channels = [
        Channel(id=k, topic=topic, message_encoding="cdr", schema_id=1 + (k > 1), metadata={})
        for k, topic in enumerate(["/map", *(f"/sensor_{k}" for k in range(SENSOR_TOPICS))], start=1)
    ]
    indexes: list[ChunkIndex] = []
    with path.open("wb") as stream:
        stream.write(MAGIC)
        _write(stream, Header("ros2", "sparse"), *schemas, *channels)
        for number in range(count):
            time = (number + 1) * CHUNK_NS
            sensors = [channel.id for channel in channels[1:]]
            indexes.append(_write_chunk(stream, b"", CHUNK_BYTES, time, sensors))
            if number in map_after:
                message = Message(
                    channel_id=1, log_time=time, data=map_after[number], publish_time=time, sequence=number
                )
                indexes.append(_write_chunk(stream, _bytes(message), 0, time, [1]))
        _write(stream, DataEnd(0))
        counts = Counter(channel for index in indexes for channel in index.message_index_offsets)
        statistics = Statistics(
            message_count=counts.total(),
            schema_count=len(schemas),
            channel_count=len(channels),
            attachment_count=0,
            metadata_count=0,
            chunk_count=len(indexes),
            message_start_time=CHUNK_NS,
            message_end_time=count * CHUNK_NS,
            channel_message_counts=dict(counts),
        )
        summary_start = stream.tell()
        _write(stream, *schemas, *channels, statistics, *indexes)
        _write(stream, Footer(summary_start=summary_start, summary_offset_start=0, summary_crc=0))
        stream.write(MAGIC)


def _write_chunk(stream: IO[bytes], records: bytes, hole: int, time: int, channels: list[int]) -> ChunkIndex:
    """Write a chunk of one message a channel, its records compressed or a hole of so many bytes instead."""
    packed = zstandard.compress(records) if records else b""
    chunk = Chunk(
        compression="zstd" if records else "",
        data=packed,
        message_start_time=time,
        message_end_time=time,
        uncompressed_crc=0,
        uncompressed_size=len(records) or hole,
    )
    start, written = stream.tell(), bytearray(_bytes(chunk))
    # The two lengths in the record count the hole: of the record after its opcode, of the data at its end.
    written[1:9] = (len(written) - 9 + hole).to_bytes(8, "little")
    place = len(written) - len(packed) - 8
    written[place : place + 8] = (len(packed) + hole).to_bytes(8, "little")
    stream.write(written)
    stream.seek(hole, 1)
    end, offsets = stream.tell(), {}
    for channel in channels:
        offsets[channel] = stream.tell()
        _write(stream, MessageIndex(channel_id=channel, records=[(time, 0)]))
    return ChunkIndex(
        chunk_start_offset=start,
        chunk_length=end - start,
        compression=chunk.compression,
        compressed_size=len(packed) + hole,
        uncompressed_size=chunk.uncompressed_size,
        message_start_time=time,
        message_end_time=time,
        message_index_length=stream.tell() - end,
        message_index_offsets=offsets,
    )


def _write(stream: IO[bytes], *records: Any) -> None:
    for record in records:
        stream.write(_bytes(record))


def _bytes(record: Any) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data
