"""ROS 1 bags and ROS 2 bags in SQLite as a source of map messages, through rosbags.

Its readers are used, not the AnyReader above them: maps are decoded by this package, so that a bag whose
message definitions are missing, from another release or beyond rosbags' parser can be read all the same.
"""

from __future__ import annotations

import heapq
import struct
import sys
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import NoReturn

import apsw
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Connection, ConnectionExtRosbag2

from rose2_logs.errors import LogError
from rose2_logs.readers.messages import Decoder, Grid, Patch, decoder, is_map_type, ros_type
from rose2_logs.readers.selection import Times
from rose2_logs.readers.source import (
    DamagedMessageError,
    LoggedBytes,
    LoggedMap,
    LogInfo,
    MessageSource,
    TopicInfo,
)

if sys.version_info >= (3, 14):
    from compression.zstd import ZstdError
else:
    from backports.zstd import ZstdError

Reader = rosbag1.Reader | rosbag2.Reader

# What rosbags and the libraries under it raise on bytes that are not what they should be.
_DAMAGE = (
    rosbag1.ReaderError,
    rosbag2.ReaderError,
    apsw.Error,
    ZstdError,
    struct.error,
    OSError,
    EOFError,
    ValueError,
    RuntimeError,
    LookupError,
    TypeError,
    AssertionError,
)


class BagSource(MessageSource):
    """One or more bags, read as one log.

    Parameters
    ----------
    path : Path
        Name of the log.
    bags : sequence of Path
        ``.bag`` files, or ROS 2 bag directories and ``.db3`` files.
    format_name : str
        What the log is in words.
    size_bytes : int
        Size of the log on disk.

    Raises
    ------
    LogError
        If a bag cannot be opened.
    """

    def __init__(self, path: Path, bags: Sequence[Path], format_name: str, size_bytes: int) -> None:
        self._readers: list[Reader] = []
        self._times: dict[tuple[int, str], Times] = {}
        for bag in bags:
            try:
                reader = rosbag1.Reader(bag) if bag.suffix == ".bag" else rosbag2.Reader(bag)
                reader.open()
            except _DAMAGE as error:
                self.close()
                raise LogError(f"{bag}: {_open_failure(error)}") from error
            self._readers.append(reader)
        filled = [reader for reader in self._readers if reader.message_count]
        self.info = LogInfo(
            path,
            format_name,
            size_bytes,
            min((reader.start_time for reader in filled), default=None),
            # rosbags gives the first nanosecond after the last message.
            max((reader.end_time - 1 for reader in filled), default=None),
            self._topics(),
            True,
        )

    def close(self) -> None:
        """Release the files; may be called twice."""
        while self._readers:
            self._readers.pop().close()

    def log_times(self, topic: str) -> Times:
        """Log times of all messages of `topic`, nanoseconds, sorted."""
        times = [self._reader_times(number, topic) for number in range(len(self._readers))]
        return np.sort(np.concatenate(times))

    def read(self, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Yield, in the order of log time, the messages of `topics` logged at `times` (sorted, distinct)."""
        streams = [self._read_one(number, topics, times) for number in range(len(self._readers))]
        return heapq.merge(*streams, key=lambda message: message.log_time_ns)

    def stream(self, topics: Sequence[str]) -> Iterator[LoggedBytes]:
        """Yield all messages of `topics` in the order of log time, none of them held."""
        streams = [_stream_one(reader, topics) for reader in self._readers]
        return heapq.merge(*streams, key=lambda message: message.log_time_ns)

    def _read_one(self, number: int, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Read from one bag, each run of successive messages by one query."""
        own = np.unique(np.concatenate([self._reader_times(number, topic) for topic in topics]))
        chosen = np.flatnonzero(np.isin(own, times))
        for run in np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1):
            yield from self._read_run(self._readers[number], topics, deque(own[run].tolist()))

    def _read_run(self, reader: Reader, topics: Sequence[str], times: deque[int]) -> Iterator[LoggedMap]:
        """Read messages that follow one another; one that is damaged is yielded as such and passed over."""
        connections = [each for each in reader.connections if each.topic in topics and _decoder(each)]
        while times:
            try:
                for connection, time, data in reader.messages(connections, times[0], times[-1] + 1):
                    while times and times[0] <= time:
                        times.popleft()
                    yield LoggedMap(time, connection.topic, partial(_decode, connection, data))
                return
            except _DAMAGE as error:
                if times:
                    yield LoggedMap(times.popleft(), topics[0], partial(_raise_damaged, error))

    def _reader_times(self, number: int, topic: str) -> Times:
        if (number, topic) not in self._times:
            reader = self._readers[number]
            if isinstance(reader, rosbag1.Reader):
                found = [
                    entry.time
                    for each in reader.connections
                    if each.topic == topic and _decoder(each)
                    for entry in reader.indexes[each.id]
                ]
            else:
                found = _times_in_databases(reader, topic)
            self._times[number, topic] = np.sort(np.array(found, np.int64))
        return self._times[number, topic]

    def _topics(self) -> tuple[TopicInfo, ...]:
        topics: Counter[tuple[str, str, str]] = Counter()
        for reader in self._readers:
            for each in reader.connections:
                topics[each.topic, _message_type(each), _encoding(each)] += each.msgcount
        return tuple(
            TopicInfo(name, message_type, count, is_map_type(message_type, encoding), encoding)
            for (name, message_type, encoding), count in sorted(topics.items())
        )


def _stream_one(reader: Reader, topics: Sequence[str]) -> Iterator[LoggedBytes]:
    """Messages of one bag, up to where it is damaged."""
    connections = [each for each in reader.connections if each.topic in topics]
    with suppress(*_DAMAGE):
        for connection, time, data in reader.messages(connections) if connections else ():
            yield LoggedBytes(time, connection.topic, _encoding(connection), partial(bytes, data))


def _times_in_databases(reader: rosbag2.Reader, topic: str) -> list[int]:
    """Log times of one topic; rosbags gives times with messages only, so this asks its databases."""
    storages = getattr(reader.storage, "storages", None) or [reader.storage]
    times: list[int] = []
    for storage in storages:
        for each in storage.connections:
            if each.topic == topic and _decoder(each):
                rows = storage.dbconn.execute("SELECT timestamp FROM messages WHERE topic_id = ?", (each.id,))
                times += [time for (time,) in rows]
    return times


def _encoding(connection: Connection) -> str:
    extension = connection.ext
    return extension.serialization_format if isinstance(extension, ConnectionExtRosbag2) else "ros1"


def _message_type(connection: Connection) -> str:
    """Return the type as its generation of ROS spells it; rosbags gives both the spelling of ROS 2."""
    return ros_type(connection.msgtype) if _encoding(connection) == "ros1" else connection.msgtype


def _decoder(connection: Connection) -> Decoder | None:
    return decoder(connection.msgtype, _encoding(connection))


def _decode(connection: Connection, data: bytes) -> Grid | Patch | None:
    decode = _decoder(connection)
    assert decode is not None, "only map messages and patches are read"
    return decode(memoryview(data))


def _raise_damaged(error: Exception) -> NoReturn:
    raise DamagedMessageError(f"damaged ({error})") from error


def _open_failure(error: Exception) -> str:
    """Say in one line what is wrong with a bag and what to do."""
    if "not indexed" in str(error):
        return "the recording was not closed and has no index; run `rosbag reindex` on it"
    return f"cannot be read as a bag: {str(error) or type(error).__name__}"
