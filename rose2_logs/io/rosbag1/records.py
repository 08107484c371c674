"""Parsing of the records of a ROS 1 bag; memory is never allocated just because a header claims a size.

Format: https://wiki.ros.org/Bags/Format/2.0
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import IO

import numpy as np
from numpy.typing import NDArray

from rose2_logs.io.decompression import decompress
from rose2_logs.io.log_file import Channel

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
"""Kinds of records: the values of their field ``op``."""
INDEX_HEAD_BYTES = 55
"""Size of an index record without its entries: its fields and the two lengths around them."""
LARGEST_HEADER_BYTES = 1 << 20
"""Headers have a few short fields, of which the topic's name is the longest; a larger one is damage."""
KEPT_FIELDS: tuple[str, ...] = ("callerid", "latching", "md5sum")
"""Fields of a connection that are kept besides its topic, type and definition."""

_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<II")  # seconds, nanoseconds
_LONG = struct.Struct("<Q")
_INDEX_ENTRY = np.dtype([("s", "<u4"), ("ns", "<u4"), ("offset", "<u4")])
INDEX_ENTRY_BYTES = _INDEX_ENTRY.itemsize
"""Size of the entry of one message in an index record."""
INDEX_DTYPE = np.dtype([("time", "<i8"), ("chunk", "<i8"), ("offset", "<u4"), ("connection", "<u4")])
"""Where a message is: log time in nanoseconds, file offset of its chunk, offset in the chunk, connection."""

Fields = dict[str, bytes]


@dataclass(frozen=True)
class Head:
    """Header of a record: its fields, and where its data are in the file or chunk."""

    begin: int
    fields: Fields
    data_begin: int
    data_length: int

    @property
    def op(self) -> int:
        """Kind of the record."""
        return self.fields["op"][0]

    @property
    def end(self) -> int:
        """Offset of the next record."""
        return self.data_begin + self.data_length


def number(fields: Fields, name: str) -> int:
    """Unsigned number of 4 or 8 bytes in a field; raises KeyError or struct.error if there is none."""
    value = fields[name]
    found: int = (_LONG if len(value) == _LONG.size else _LENGTH).unpack(value)[0]
    return found


def time_ns(fields: Fields, name: str) -> int:
    """Time in a field, as nanoseconds."""
    seconds, nanoseconds = _TIME.unpack(fields[name])
    return int(seconds) * 10**9 + int(nanoseconds)


def read_head(stream: IO[bytes], begin: int) -> Head:
    """Read the header of the record at an offset.

    Raises
    ------
    ValueError, EOFError, struct.error
        If there is no valid record.
    """
    stream.seek(begin)
    (length,) = _LENGTH.unpack(_exactly(stream, _LENGTH.size))
    if length > LARGEST_HEADER_BYTES:
        raise ValueError(f"a record header claims {length} bytes")
    fields = parse_fields(_exactly(stream, length))
    if len(fields.get("op", b"")) != 1:
        raise ValueError("a record has no kind")
    (data_length,) = _LENGTH.unpack(_exactly(stream, _LENGTH.size))
    return Head(begin, fields, begin + 2 * _LENGTH.size + length, data_length)


def parse_fields(data: bytes) -> Fields:
    """Parse a header: fields ``name=value``, each preceded by its length."""
    fields, place = {}, 0
    while place < len(data):
        (length,) = _LENGTH.unpack_from(data, place)
        place += _LENGTH.size
        field = data[place : place + length]
        name, sign, value = field.partition(b"=")
        if len(field) != length or not sign:
            raise ValueError("a record header is damaged")
        fields[name.decode()] = value
        place += length
    return fields


def _exactly(stream: IO[bytes], length: int) -> bytes:
    data = stream.read(length)
    if len(data) != length:
        raise EOFError("it ends in the middle of a record")
    return data


def heads_in(records: bytes | memoryview) -> Iterator[Head]:
    """Yield the headers of the records in an uncompressed chunk.

    Raises
    ------
    ValueError, EOFError, struct.error
        At the first record that is damaged or incomplete.
    """
    stream, place = BytesIO(records), 0
    while place < len(records):
        head = read_head(stream, place)
        if head.end > len(records):
            raise EOFError("it ends in the middle of a record")
        yield head
        place = head.end


def chunk_data(stream: IO[bytes], head: Head, most_bytes: int) -> bytes | memoryview:
    """Uncompressed records of the chunk with this header.

    Of a truncated chunk, as much as can be decompressed; the last record may then be incomplete.

    Raises
    ------
    ValueError, EOFError
        If it is damaged or too large.
    """
    compression = head.fields["compression"].decode()
    size = number(head.fields, "size")
    if head.data_length > most_bytes:
        size = head.data_length  # so that `decompress` refuses it
    stream.seek(head.data_begin)
    is_plain = compression == "none"
    data = stream.read(min(head.data_length, most_bytes))
    claimed = None if is_plain and size <= most_bytes else size
    return decompress(compression, data, claimed, most_bytes, is_cut=len(data) < head.data_length)


def connection_of(head: Head, data: bytes) -> Channel:
    """Describe a connection: its number, topic, type and definition."""
    about = parse_fields(data)
    metadata = {name: about[name].decode() for name in KEPT_FIELDS if name in about}
    topic = head.fields["topic"].decode()
    return Channel(
        number(head.fields, "conn"),
        # As ROS resolves names: without double or trailing slashes.
        ("/" if topic.startswith("/") else "") + "/".join(part for part in topic.split("/") if part),
        "ros1",
        number(head.fields, "conn") + 1,
        about["type"].decode(),
        "ros1msg",
        about.get("message_definition", b""),
        metadata,
    )


class IndexRows:
    """Collects the index records of chunks; a long bag has hundreds of thousands of them."""

    def __init__(self) -> None:
        self._entries: list[bytes] = []
        self._rows: list[tuple[int, int, int]] = []

    def take(self, data: bytes, counts: dict[int, int], chunk: int) -> None:
        """Add the index records that follow a chunk: all of them, or none if one is damaged.

        Parameters
        ----------
        data : bytes
            Starts with the records.
        counts : dict
            Expected number of messages by connection.
        chunk : int
            File offset of the chunk.

        Raises
        ------
        ValueError, KeyError, struct.error
            If a record is damaged or missing, or its number of messages is not the expected one.
        """
        entries, rows, place = [], [], 0
        for _ in counts:
            (length,) = _LENGTH.unpack_from(data, place)
            place += _LENGTH.size
            fields = parse_fields(data[place : place + length])
            (size,) = _LENGTH.unpack_from(data, place + length)
            place += length + _LENGTH.size
            connection, count = number(fields, "conn"), number(fields, "count")
            found = data[place : place + size]
            if fields["op"] != bytes([INDEX]) or number(fields, "ver") != 1:
                raise ValueError("a chunk is not followed by its index")
            if len(found) != size or size != count * _INDEX_ENTRY.itemsize or counts.get(connection) != count:
                raise ValueError("a chunk's index does not have the length that it claims")
            entries.append(found)
            rows.append((chunk, connection, count))
            place += size
        self._entries += entries
        self._rows += rows

    def places(self) -> NDArray[np.void]:
        """Return the places (N,) of `INDEX_DTYPE` of all messages."""
        entries = np.frombuffer(b"".join(self._entries), _INDEX_ENTRY)
        rows = np.array(self._rows, np.int64).reshape(-1, 3)
        places = np.empty(len(entries), INDEX_DTYPE)
        places["time"] = entries["s"].astype(np.int64) * 10**9 + entries["ns"]
        places["offset"] = entries["offset"]
        places["chunk"], places["connection"] = np.repeat(rows[:, :2], rows[:, 2], axis=0).T
        return places


def chunk_info(head: Head, data: bytes) -> tuple[int, dict[int, int]]:
    """File offset of a chunk and its number of messages by connection."""
    if number(head.fields, "ver") != 1:
        raise ValueError("a chunk's description has an unknown version")
    counts = np.frombuffer(data, "<u4").reshape(-1, 2)
    if len(counts) != number(head.fields, "count"):
        raise ValueError("a chunk's description does not have the length that it claims")
    return number(head.fields, "chunk_pos"), dict(counts.tolist())
