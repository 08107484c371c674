"""One or more files of any format, read as one log: a source of map messages."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from rose2_logs.config.parameters import ReadingParameters
from rose2_logs.config.selection import Times
from rose2_logs.errors import LogError
from rose2_logs.io.grids import Decoder, Grid, Patch
from rose2_logs.io.log_file import LogFile, Place
from rose2_logs.io.messages import decoder
from rose2_logs.io.source import LoggedBytes, LoggedMap, LogInfo, MessageSource, TopicInfo
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

CLOCK_SET_BACK_NS = 10**9
"""Recorders with several threads write messages out of order by milliseconds; if the log time goes back by
more than this, the recorder's clock was set back."""

OpenFile = Callable[[Path, ReadingParameters], LogFile]


class FileLog(MessageSource):
    """Files that make up one log.

    Parameters
    ----------
    path : Path
        Name of the log.
    files : sequence of Path
        Its files. A file that cannot be opened is skipped with a warning as long as another one can.
    open_file : callable
        Opens one of them.
    limits : ReadingParameters
        The largest sizes that are accepted.
    format_name : str
        The log's format in words.
    size_bytes : int, optional
        Size of the log on disk; by default that of the files.
    on_close : callable, optional
        Called once after the files are closed.

    Raises
    ------
    LogError
        If no file can be opened.
    """

    def __init__(
        self,
        path: Path,
        files: Sequence[Path],
        open_file: OpenFile,
        limits: ReadingParameters,
        *,
        format_name: str,
        size_bytes: int | None = None,
        on_close: Callable[[], None] = lambda: None,
    ) -> None:
        self._files: list[LogFile] = []
        self._on_close = on_close
        self._limits = limits
        self._decoders: dict[tuple[int, int], Decoder] = {}
        # By topic: sorted places with the number of their file; filled when a topic is first read.
        self._places: dict[str, list[tuple[Place, int]]] = {}
        try:
            self._open(files, open_file)
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
            len(self._files) == len(files) and all(file.whole for file in self._files),
        )

    def _open(self, files: Sequence[Path], open_file: OpenFile) -> None:
        failures: list[LogError] = []
        for file in files:
            try:
                self._files.append(open_file(file, self._limits))
            except LogError as error:
                if isinstance(error.__cause__, OSError):
                    raise  # the storage failed, not the log: a retry may succeed
                failures.append(error)
        if failures and not self._files:
            raise failures[0]
        for failure in failures:
            log_warning(logger, "file_left_out", f"{failure}; the other files are read", file=failure.file)

    @property
    def files(self) -> tuple[LogFile, ...]:
        """The open files."""
        return tuple(self._files)

    def close(self) -> None:
        """Release the files; may be called more than once."""
        for file in self._files:
            file.close()
        self._on_close()
        self._on_close = lambda: None

    def log_times(self, topic: str) -> Times:
        """Log times of all map messages and patches of `topic`, nanoseconds, sorted."""
        return np.array([place.log_time_ns for place, _ in self._topic_places(topic)], np.int64)

    def read(self, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Yield the messages of `topics` logged at `times` (sorted, distinct), in log time order."""
        chosen = []
        for topic in topics:
            places = self._topic_places(topic)
            for k in np.flatnonzero(np.isin(self.log_times(topic), times)):
                place, number = places[k]
                chosen.append((place.log_time_ns, number, place, topic, int(k) + 1))
        for time, number, place, topic, index in sorted(chosen, key=lambda found: found[:3]):
            decode = partial(self._decode, number, place)
            yield LoggedMap(time, topic, index, self._files[number].path, decode)

    def stream(self, topics: Sequence[str]) -> Iterator[LoggedBytes]:
        """Yield all messages of `topics` one at a time, roughly in log time order."""
        for file in sorted(self._files, key=lambda each: each.start_ns or 0):
            wanted = [each.id for each in file.channels.values() if each.topic in topics]
            for message in file.messages(wanted) if wanted else ():
                channel = message.channel
                is_cdr = channel.message_encoding == "cdr"
                read = partial(file.decompressed if is_cdr else memoryview, message.data)
                yield LoggedBytes(message.log_time_ns, channel.topic, channel.message_encoding, read)

    def _topic_places(self, topic: str) -> list[tuple[Place, int]]:
        if topic not in self._places:
            found = []
            for number, file in enumerate(self._files):
                channels = [each for each in file.channels.values() if each.topic == topic]
                for channel in channels:
                    if not channel.is_wanted and (count := file.message_counts[channel.id]):
                        text = (
                            f"{file.path}: {topic} also has {count} messages of type {channel.schema_name} "
                            f"({channel.message_encoding}), which are not readable maps; skipped"
                        )
                        log_warning(logger, "type_changes", text, file=file.path, topic=topic)
                places = file.places([channel.id for channel in channels if channel.is_wanted])
                self._look_at_clock(file, topic, places)
                found += [(place, number) for place in places]
            self._places[topic] = sorted(found, key=lambda each: (each[0].log_time_ns, each[1], each[0]))
        return self._places[topic]

    def _look_at_clock(self, file: LogFile, topic: str, places: list[Place]) -> None:
        """Warn where the log time of a topic goes backwards in the file."""
        order = np.array([place[1:3] for place in places], np.int64).reshape(-1, 2)
        times = np.array([place.log_time_ns for place in places], np.int64)
        along_file = times[np.lexsort((order[:, 1], order[:, 0]))]
        if len(times) > 1 and times[0] == times[-1]:
            text = f"{file.path}: all {len(times)} messages on {topic} have the log time {times[0]} ns"
            log_warning(logger, "clock_stands", text, file=file.path, topic=topic)
        back = np.flatnonzero(np.diff(along_file) < -CLOCK_SET_BACK_NS)
        for k in back:
            seconds = (int(along_file[k]) - int(along_file[k + 1])) / 1e9
            text = (
                f"{file.path}: the log time on {topic} goes back by {seconds:.1f} s at message {k + 2} of "
                "the file; messages are read in log time order"
            )
            log_warning(logger, "clock_set_back", text, file=file.path, topic=topic, index=int(k) + 2)

    def _decode(self, number: int, place: Place) -> Grid | Patch | None:
        file = self._files[number]
        data = file.payload(place)
        channel = file.channels[place.channel_id]
        if channel.message_encoding == "cdr":
            data = file.decompressed(data)
        key = (number, place.channel_id)
        if key not in self._decoders:
            found = decoder(
                channel.schema_name, channel.message_encoding, channel.schema_data, self._limits.map_max_cells
            )
            assert found is not None, "only wanted channels have places"
            self._decoders[key] = found
        return self._decoders[key](data)

    def _topics(self) -> tuple[TopicInfo, ...]:
        topics: dict[tuple[str, str, str], tuple[int, bool]] = {}
        for file in self._files:
            for channel in file.channels.values():
                key = (channel.topic, channel.schema_name, channel.message_encoding)
                count, is_map = topics.get(key, (0, False))
                topics[key] = (count + file.message_counts[channel.id], is_map or channel.is_map)
        return tuple(
            TopicInfo(name, message_type, count, is_map, encoding)
            for (name, message_type, encoding), (count, is_map) in sorted(topics.items())
        )
