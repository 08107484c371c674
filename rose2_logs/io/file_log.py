"""One or more files of any format, read as one log: a source of map messages."""

from __future__ import annotations

import logging
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import median_low
from typing import NamedTuple

import numpy as np

from rose2_logs.config.reading import ReadingParameters
from rose2_logs.config.selection import Times
from rose2_logs.config.times import LATEST_NS
from rose2_logs.errors import LogError
from rose2_logs.io.discovery import LAST_NUMBER
from rose2_logs.io.grids import Decoder, Grid, Patch
from rose2_logs.io.log_file import LogFile, Place
from rose2_logs.io.messages import decoder
from rose2_logs.io.source import LoggedBytes, LoggedMap, LogInfo, MessageSource, TopicInfo, places_of
from rose2_logs.system.files import OnFailure
from rose2_logs.system.text import apart
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

CLOCK_SET_BACK_NS = 10**9
"""Recorders with several threads write messages out of order by milliseconds; if the log time goes back by
more than this, the recorder's clock was set back."""

LONGEST_RUN_NS = 366 * 86400 * 10**9
"""No robot is on the way for a year; a clock that is set after the start makes a log last for decades."""
OpenFile = Callable[[Path, ReadingParameters], LogFile]


class Timed(NamedTuple):
    """A message in the order of reading: log time, continued where the clock jumps, file and place."""

    time_ns: int
    file: int
    place: Place


class Clock:
    """The log time of a file's messages in their order, continued where its clock was set.

    Parameters
    ----------
    delays_ns : sequence of int
        How much later than written the messages are taken before the first jump, after it, and so on.
    """

    def __init__(self, delays_ns: Sequence[int]) -> None:
        self._delays_ns = delays_ns
        self._latest_ns: int | None = None
        self._part = 0

    def continued(self, time_ns: int) -> int:
        """Take the time of the next message; return the one that goes on from the ones before."""
        if not self._delays_ns:
            return time_ns
        self._jumps_at(time_ns)
        return time_ns + self._delays_ns[min(self._part, len(self._delays_ns) - 1)]

    def jumps(self, times_ns: Sequence[int]) -> list[int]:
        """Return which of the messages, in the order of the file, are the first after a jump."""
        return [k for k, time_ns in enumerate(times_ns) if self._jumps_at(time_ns)]

    def _jumps_at(self, time_ns: int) -> bool:
        latest_ns = self._latest_ns
        has_jumped = latest_ns is not None and not (
            latest_ns - CLOCK_SET_BACK_NS <= time_ns <= latest_ns + LONGEST_RUN_NS
        )
        self._part += has_jumped
        self._latest_ns = time_ns if latest_ns is None or has_jumped else max(latest_ns, time_ns)
        return has_jumped


def delays_of(times_ns: Sequence[int], jumps: Sequence[int]) -> list[int]:
    """Find how much later messages must be, part by part, for the time to go on where the clock jumps.

    After a jump the time goes on by the usual step. What was recorded before a clock was set forward, as of a
    computer that starts in 1970, is moved; what was recorded after one was set back is moved, too.

    Parameters
    ----------
    times_ns : sequence of int
        Log times in the order of the file.
    jumps : sequence of int
        The first message after each jump.
    """
    steps = [
        later - earlier
        for k, (earlier, later) in enumerate(pairwise(times_ns), start=1)
        if k not in jumps and later > earlier
    ]
    step_ns = int(median_low(steps)) if steps else CLOCK_SET_BACK_NS
    delays, forward_ns, begin = [0], 0, 0
    for jump in jumps:
        change_ns = max(times_ns[begin:jump]) + step_ns - times_ns[jump]
        forward_ns += max(-change_ns, 0)
        delays.append(delays[-1] + change_ns)
        begin = jump
    return [delay + forward_ns for delay in delays]


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
        # By topic, sorted; filled when a topic is first read.
        self._places: dict[str, list[Timed]] = {}
        # By file: how much later its log times are taken from each place on where they jump.
        self._delays: dict[int, list[int]] = {}
        with OnFailure(self.close):
            self._open(files, open_file)
        start_ns, end_ns = self._extent(path)
        self.info = LogInfo(
            path,
            format_name,
            sum(file.stat().st_size for file in files) if size_bytes is None else size_bytes,
            start_ns,
            end_ns,
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

    def _extent(self, path: Path) -> tuple[int | None, int | None]:
        """Log times of the first and the last message; of the maps if these are too far apart for one run."""
        start_ns = min((each.start_ns for each in self._files if each.start_ns is not None), default=None)
        end_ns = max((each.end_ns for each in self._files if each.end_ns is not None), default=None)
        if start_ns is None or end_ns is None or end_ns - start_ns <= LONGEST_RUN_NS:
            return start_ns, end_ns
        topics = {each.topic for file in self._files for each in file.channels.values() if each.is_wanted}
        times = [each.time_ns for topic in sorted(topics) for each in self._topic_places(topic)]
        if not times:
            return start_ns, end_ns
        text = (
            f"{path}: its log times are {apart(end_ns - start_ns)} apart: the clock was set while it was "
            "recorded; it is taken to last from its first map to its last"
        )
        log_warning(logger, "clock_apart", text, file=path)
        return min(times), max(times)

    def log_times(self, topic: str) -> Times:
        """Log times of all map messages and patches of `topic`, nanoseconds, sorted."""
        return np.array([each.time_ns for each in self._topic_places(topic)], np.int64)

    def publishers(self, topic: str) -> Sequence[str] | None:
        """Return who published each message of `topic`, by node or connection; None if it is not known."""
        places = self._topic_places(topic)
        channels = [self._files[each.file].channels[each.place.channel_id] for each in places]
        names = [channel.metadata.get("callerid", "") for channel in channels]
        if all(names):
            return names
        # One channel may hold the messages of several nodes, and its number is that of a file.
        if len({each.file for each in places}) > 1 or len({channel.id for channel in channels}) < 2:
            return None
        return [f"channel {channel.id}" for channel in channels]

    def recorded_ns(self, time_ns: int) -> int:
        """Return the log time that stands in the file."""
        for places in self._places.values() if self._delays else ():
            at = bisect_left(places, time_ns, key=lambda each: each.time_ns)
            if at < len(places) and places[at].time_ns == time_ns:
                return places[at].place.log_time_ns
        return time_ns

    def read(self, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Yield the messages of `topics` logged at `times` (sorted, distinct), in log time order."""
        chosen = []
        for topic in topics:
            places = self._topic_places(topic)
            for k in places_of(times, self.log_times(topic)):
                chosen.append((*places[k], topic, int(k) + 1))
        for time, number, place, topic, index in sorted(chosen, key=lambda found: found[:3]):
            decode = partial(self._decode, number, place)
            yield LoggedMap(time, topic, index, self._files[number].path, decode)

    def stream(self, topics: Sequence[str]) -> Iterator[LoggedBytes]:
        """Yield all messages of `topics` one at a time, roughly in log time order."""
        for number, file in sorted(enumerate(self._files), key=self._begin_ns):
            wanted = [each.id for each in file.channels.values() if each.topic in topics]
            clock = Clock(self._delays.get(number, []))
            for message in file.messages(wanted) if wanted else ():
                if message.log_time_ns > LATEST_NS:  # damage; no map of such a time is read either
                    continue
                channel = message.channel
                is_cdr = channel.message_encoding == "cdr"
                read = partial(file.decompressed if is_cdr else memoryview, message.data)
                time_ns = clock.continued(message.log_time_ns)
                yield LoggedBytes(time_ns, channel.topic, channel.message_encoding, read)

    def _begin_ns(self, numbered: tuple[int, LogFile]) -> int:
        """When a file begins, in times that go on where a clock jumps."""
        number, file = numbered
        return (file.start_ns or 0) + self._delays.get(number, [0])[0]

    def _topic_places(self, topic: str) -> list[Timed]:
        if topic not in self._places:
            found: dict[int, list[Place]] = {}
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
                if len(places) > 1 and places[0].log_time_ns == places[-1].log_time_ns:
                    text = (
                        f"{file.path}: all {len(places)} messages on {topic} have the log time "
                        f"{places[0].log_time_ns} ns"
                    )
                    log_warning(logger, "clock_stands", text, file=file.path, topic=topic)
                found[number] = sorted(places, key=lambda place: place[1:3])
            self._places[topic] = sorted(
                timed for files in self._sequences() for timed in self._timed(topic, files, found)
            )
        return self._places[topic]

    def _sequences(self) -> list[list[int]]:
        """Files that a recorder wrote one after the other; one alone where it is not known."""
        numbered = [LAST_NUMBER.search(file.path.name) for file in self._files]
        numbers = [int(found[1]) for found in numbered if found is not None]
        if len(numbers) < len(self._files) or np.any(np.diff(sorted(numbers)) != 1):
            return [[number] for number in range(len(self._files))]
        return [np.argsort(numbers).tolist()]

    def _timed(self, topic: str, files: list[int], found: dict[int, list[Place]]) -> list[Timed]:
        """Give a topic's messages, in the order of files and in each, times that go on at jumps."""
        places = [(number, place) for number in files for place in found[number]]
        written = [place.log_time_ns for _, place in places]
        jumps = Clock([]).jumps(written)
        firsts = np.cumsum([0] + [len(found[number]) for number in files]).tolist()
        if jumps and self._delays.keys().isdisjoint(files):
            delays = delays_of(written, jumps)
            for number, (begin, end) in zip(files, pairwise(firsts), strict=True):
                last = max(end - 1, 0)
                # A file without this topic goes on from the one before.
                parts = [bisect_right(jumps, k) for k in (min(begin, last), last)]
                self._delays[number] = delays[parts[0] : parts[1] + 1]
        for k in jumps:
            before, after = written[k - 1], written[k]
            number = places[k][0]
            path, earlier = self._files[number].path, self._files[places[k - 1][0]].path
            kind, way = ("clock_set_back", "back") if after < before else ("clock_set_forward", "forward")
            first = firsts[files.index(number)]
            at = (
                f"at message {k - first + 1} of the file"
                if k > first
                else f"from {earlier.name} to this file"
            )
            text = (
                f"{path}: the log time on {topic} goes {way} by {apart(abs(after - before))} {at}; messages "
                "are read in the order of the file, with log times that go on"
            )
            log_warning(logger, kind, text, file=path, topic=topic, index=k - first + 1)
        clocks = {number: Clock(self._delays.get(number, [])) for number in files}
        return [Timed(clocks[number].continued(place.log_time_ns), number, place) for number, place in places]

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
        topics: dict[tuple[str, str, str, str], tuple[int, bool]] = {}
        for file in self._files:
            for channel in file.channels.values():
                key = (
                    channel.topic,
                    channel.schema_name,
                    channel.message_encoding,
                    channel.schema_encoding,
                )
                count, is_map = topics.get(key, (0, False))
                topics[key] = (count + file.message_counts[channel.id], is_map or channel.is_map)
        return tuple(
            TopicInfo(name, message_type, count, is_map, encoding, language)
            for (name, message_type, encoding, language), (count, is_map) in sorted(topics.items())
        )
