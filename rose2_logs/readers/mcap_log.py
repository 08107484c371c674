"""MCAP files, alone or as the storage of a ROS 2 bag, as a source of map messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import zstandard
from mcap.records import Channel, Schema

from rose2_logs.readers.mcap_index import McapFile, Place
from rose2_logs.readers.messages import Decoder, Grid, Patch, decoder, is_map_type, is_patch_type
from rose2_logs.readers.selection import Times
from rose2_logs.readers.source import (
    DamagedMessageError,
    LoggedBytes,
    LoggedMap,
    LogInfo,
    MessageSource,
    TopicInfo,
)


class McapSource(MessageSource):
    """One or more MCAP files, read as one log.

    Parameters
    ----------
    path : Path
        Name of the log.
    files : sequence of Path
        Its files.
    format_name : str
        What the log is in words.
    size_bytes : int, optional
        Size of the log on disk; by default that of the files.
    messages_are_zstd : bool
        Whether each message is compressed for itself (ROS 2 bags in message mode).
    on_close : callable, optional
        Called once after the files are closed.

    Raises
    ------
    LogError
        If a file cannot be opened or is no MCAP file.
    """

    def __init__(
        self,
        path: Path,
        files: Sequence[Path],
        *,
        format_name: str = "MCAP",
        size_bytes: int | None = None,
        messages_are_zstd: bool = False,
        on_close: Callable[[], None] = lambda: None,
    ) -> None:
        self._files: list[McapFile] = []
        self._on_close = on_close
        self._messages_are_zstd = messages_are_zstd
        self._decoders: dict[tuple[int, int], Decoder] = {}
        # Sorted places with the number of their file, by topic; filled when a topic is first asked for.
        self._places: dict[str, list[tuple[Place, int]]] = {}
        try:
            for file in files:
                self._files.append(McapFile(file, _is_wanted))
        except BaseException:
            self.close()
            raise
        starts = [file.start_ns for file in self._files if file.start_ns is not None]
        ends = [file.end_ns for file in self._files if file.end_ns is not None]
        self.info = LogInfo(
            path,
            format_name,
            sum(file.stat().st_size for file in files) if size_bytes is None else size_bytes,
            min(starts, default=None),
            max(ends, default=None),
            self._topics(),
            all(file.indexed for file in self._files),
        )

    def close(self) -> None:
        """Release the files; may be called twice."""
        for file in self._files:
            file.close()
        self._on_close()
        self._on_close = lambda: None

    def log_times(self, topic: str) -> Times:
        """Log times of all map messages and patches of `topic`, nanoseconds, sorted."""
        return np.array([place.log_time_ns for place, _ in self._topic_places(topic)], np.int64)

    def read(self, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Yield, in the order of log time, the messages of `topics` logged at `times` (sorted, distinct)."""
        places = [(*found, topic) for topic in topics for found in self._topic_places(topic)]
        logged = np.array([place.log_time_ns for place, _, _ in places], np.int64)
        chosen = [places[k] for k in np.flatnonzero(np.isin(logged, times))]
        for place, number, topic in sorted(
            chosen, key=lambda found: (found[0].log_time_ns, found[1], found[0])
        ):
            yield LoggedMap(place.log_time_ns, topic, partial(self._decode, number, place))

    def stream(self, topics: Sequence[str]) -> Iterator[LoggedBytes]:
        """Yield all messages of `topics` about in the order of log time, none of them held."""
        for file in sorted(self._files, key=lambda each: each.start_ns or 0):
            channels = {each.id: each for each in file.channels.values() if each.topic in topics}
            for time_ns, channel_id, data in file.messages(channels):
                channel = channels[channel_id]
                read = partial(self._decompressed, data)
                yield LoggedBytes(time_ns, channel.topic, channel.message_encoding, read)

    def _decompressed(self, data: Callable[[], memoryview]) -> memoryview:
        if not self._messages_are_zstd:
            return data()
        try:
            return memoryview(zstandard.ZstdDecompressor().decompressobj().decompress(data()))
        except zstandard.ZstdError as error:
            raise DamagedMessageError(f"damaged ({error})") from error

    def _topic_places(self, topic: str) -> list[tuple[Place, int]]:
        if topic not in self._places:
            found = []
            for number, file in enumerate(self._files):
                channels = [
                    channel.id
                    for channel in file.channels.values()
                    if channel.topic == topic and _is_wanted(channel, file.schemas.get(channel.schema_id))
                ]
                found += [(place, number) for place in file.places(channels)]
            self._places[topic] = sorted(found, key=lambda each: (each[0].log_time_ns, each[1], each[0]))
        return self._places[topic]

    def _decode(self, number: int, place: Place) -> Grid | Patch | None:
        file = self._files[number]
        data = self._decompressed(partial(file.payload, place))
        key = (number, place.channel_id)
        if key not in self._decoders:
            channel = file.channels[place.channel_id]
            schema = file.schemas[channel.schema_id]
            found = decoder(schema.name, channel.message_encoding, schema.data)
            assert found is not None, "only wanted channels have places"
            self._decoders[key] = found
        return self._decoders[key](data)

    def _topics(self) -> tuple[TopicInfo, ...]:
        topics: dict[tuple[str, str, str], tuple[int, bool]] = {}
        for file in self._files:
            for channel in file.channels.values():
                schema = file.schemas.get(channel.schema_id)
                key = (channel.topic, schema.name if schema else "", channel.message_encoding)
                count, is_map = topics.get(key, (0, False))
                topics[key] = (
                    count + file.message_counts[channel.id],
                    is_map or (schema is not None and is_map_type(schema.name, channel.message_encoding)),
                )
        return tuple(
            TopicInfo(name, message_type, count, is_map, encoding)
            for (name, message_type, encoding), (count, is_map) in sorted(topics.items())
        )


def _is_wanted(channel: Channel, schema: Schema | None) -> bool:
    """Whether a channel holds map messages or patches that can be read."""
    if schema is None:
        return False
    encoding = channel.message_encoding
    return is_map_type(schema.name, encoding) or (is_patch_type(schema.name) and encoding in ("cdr", "ros1"))
