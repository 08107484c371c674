"""A log as the rest of the program sees it: what it contains, and its distinct maps in log time order."""

from __future__ import annotations

import dataclasses
import logging
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from types import TracebackType
from typing import Any, Self

import numpy as np

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.selection import Selection, Times
from rose2_logs.errors import InvalidMapError, LogError, NoMapTopicError
from rose2_logs.io.cell_values import MAPS_LOOKED_AT, CellReading, reading_of
from rose2_logs.io.grids import Cells, Grid, MapWarning, Patch
from rose2_logs.io.map_stream import MapChecks, MapStream, ReadCounts, without_far_cells
from rose2_logs.io.messages import is_called_map, is_patch_type, ros_type
from rose2_logs.io.parts import Part, Parts, find_parts, find_saved_parts, likeliest
from rose2_logs.io.poses import RobotPath
from rose2_logs.io.saved_maps import MapFilesSource
from rose2_logs.io.scan_topics import mappable_topics, without_transforms
from rose2_logs.io.source import DamagedMessageError, LoggedMap, LogInfo, MessageSource, TopicInfo, distinct
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.system.warnings import log_warning

__all__ = ["LogInfo", "LogReader", "ReadCounts", "Selection", "TopicInfo", "choose_topic"]

logger = logging.getLogger(__name__)

# Compared without the leading slash, which old ROS 1 bags omit.
PREFERRED_TOPIC = "map"
# Patches are published on the map's topic with this suffix: the convention of costmap_2d and nav2.
PATCH_SUFFIX = "_updates"
USUAL = Parameters()
# Number of message types named in the error about a log without maps, so that it stays one readable line.
MOST_LISTED = 6


class LogReader:
    """The distinct maps of one topic of a log; a context manager that closes the log's files.

    Attributes
    ----------
    info : LogInfo
        What the log contains.
    topic : str
        The map topic that is read.
    source : MessageSource
        The open log.
    counts : ReadCounts
        Message counts of the latest call of `snapshots`.
    parameters : Parameters
        Those that it reads by: of ``reading``, ``mapping`` and ``occupancy``.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> with rl.open_log("sample_logs/office.mcap", every_s=60.0) as reader:
    ...     print(reader.topic, len(list(reader.snapshots())), reader.counts.messages)
    /map 10 40
    """

    def __init__(
        self,
        source: MessageSource,
        topic: str | None,
        selection: Selection,
        parameters: Parameters = USUAL,
        part: int | None = None,
    ) -> None:
        self.info = source.info
        self.topic = choose_topic(source.info, topic)
        others = [
            each.name
            for each in source.info.topics
            if each.is_map and each.message_count != 0 and each.name != self.topic
        ]
        if topic is None and others:
            held = f"{', '.join(others)} {'holds' if len(others) == 1 else 'hold'} maps, too"
            text = f"{source.info.path}: {self.topic} is read; {held}; topic={others[0]!r} chooses another"
            log_warning(logger, "topic", text, file=source.info.path, topic=self.topic)
        self.counts = ReadCounts()
        self.source = source
        self._selection = selection.since(source.info.start_ns)
        self.parameters = parameters
        self._occupancy = parameters.occupancy
        self._asked_part = part
        self._is_closed = False
        self._first_failure: str | None = None
        self._path_origin: str | None = None
        self._topics = [self.topic] + [
            item.name
            for item in self.info.topics
            if item.name == self.topic + PATCH_SUFFIX and is_patch_type(item.message_type)
        ]

    def __repr__(self) -> str:
        return f"LogReader({self.info.path.name!r}, {self.info.format}, topic={self.topic!r})"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the log's files."""
        self._is_closed = True
        self.source.close()

    @property
    def is_built(self) -> bool:
        """Whether the maps are built from scans, and not recorded."""
        return self.source.made_from(self.topic) != self.topic

    def _require_open(self) -> None:
        """Refuse to read a closed log, whose messages would all seem to be damaged."""
        if self._is_closed:
            text = f"{self.info.path}: the log is closed; read its maps before it is, inside of `with`"
            raise LogError(text, file=self.info.path)

    @cached_property
    def cell_reading(self) -> CellReading:
        """What the numbers in the cells mean: decided once for the whole log, whatever is selected of it."""
        self._require_open()
        name = f"{self.info.path}: {self.topic}"
        return reading_of(self._some_cells(), self._occupancy, name, file=self.info.path, topic=self.topic)

    def _some_cells(self) -> Iterator[Cells]:
        """Yield the cells of maps and patches spread over the log, as they are stored."""
        times = [distinct(self.source.log_times(topic)) for topic in self._topics]
        spread = [
            each[np.linspace(0, len(each) - 1, MAPS_LOOKED_AT).round().astype(int)]
            for each in times
            if len(each)
        ]
        # Nanoseconds since 1970 are no floats, which an empty list would make of them.
        looked_at = distinct(np.concatenate([np.zeros(0, np.int64), *spread]))
        for message in self.source.read(self._topics, looked_at):
            with suppress(LogError):  # it is told of where the map is needed
                if (decoded := message.decode()) is not None:
                    yield decoded.cells

    @property
    def decided(self) -> dict[str, Any]:
        """What was decided about how the log is read, as JSON values for the summary."""
        decided: dict[str, Any] = {"values": self.source.value_reading or self.cell_reading.as_json()}
        if self._path_origin is not None:
            decided["path"] = self._path_origin
        if self.part_count > 1:
            found, taken = self._found_parts
            sizes = [
                {"part": number, "maps": len(part.times), "free_m2": round(part.free_m2, 1)}
                for number, part in enumerate(found.parts, start=1)
            ]
            decided["parts"] = {"count": len(sizes), "analyzed": list(taken), "found": sizes}
        return decided

    @property
    def part_count(self) -> int:
        """How many parts the maps of the topic have that do not grow from each other."""
        return len(self._found_parts[0].parts)

    def part_at(self, log_time_ns: int) -> int | None:
        """Return which part a map is of that is read, from 1; None if the topic has but one."""
        if self.part_count == 1:
            return None
        numbers = list(self._parts)
        begins = [int(part.times[0]) for part in self._parts.values()]
        return numbers[max(bisect_right(begins, log_time_ns) - 1, 0)]

    def snapshots(self) -> Iterator[OccupancySnapshot]:
        """Yield the selected maps in log time order.

        A map equal to the previous one is dropped and counted. A damaged or inconsistent map is skipped with
        a warning and counted. Only one map is in memory at a time, plus the times of the topic's messages.

        Raises
        ------
        LogError
            If the topic has no map in the time range, none can be read, or the log is closed.
        """
        times = self._times_in_range()
        chosen = self._selection.thin(distinct(times))
        taken = int(np.isin(times, chosen).sum())
        self.counts = ReadCounts(messages=len(times), skipped=len(times) - taken)
        snapshot = None
        for snapshot in self._read(chosen, self.counts, self._selection.min_change_m2, warn=True):
            yield snapshot
        if snapshot is None:
            raise self._no_map(self.counts)

    def first(self) -> OccupancySnapshot:
        """Return the first map in the time range (index 0), regardless of the rest of the selection.

        Raises
        ------
        LogError
            As for `snapshots`.
        """
        counts = ReadCounts()
        snapshot = next(self._read(distinct(self._times_in_range()), counts), None)
        if snapshot is None:
            raise self._no_map(counts)
        return snapshot

    def last(self) -> OccupancySnapshot:
        """Return the last map in the time range, regardless of the rest of the selection.

        Its index is -1, counted from the end, because the maps before it are not read.

        Raises
        ------
        LogError
            As for `snapshots`.
        """
        counts = ReadCounts()
        found = self._last_of(distinct(self._times_in_range()), counts)
        if found is None:
            raise self._no_map(counts)
        return found

    def lasts(self) -> dict[int | None, OccupancySnapshot]:
        """Return the last map in the time range of each part that has one, by number; see `part_at`.

        Raises
        ------
        LogError
            As for `snapshots`.
        """
        if self.part_count == 1:
            return {None: self.last()}
        times = distinct(self._times_in_range())
        parts = np.array([self.part_at(time) for time in times.tolist()])
        lasts: dict[int | None, OccupancySnapshot] = {}
        for number in self._parts:
            if (last := self._last_of(times[parts == number], ReadCounts())) is not None:
                lasts[number] = last
        return lasts or {None: self.last()}

    def _last_of(self, times: Times, counts: ReadCounts) -> OccupancySnapshot | None:
        # Search backwards: a log may end with messages that are damaged or have no cells.
        for time in times[::-1]:
            # Several messages may share a log time, as in logs without times: take the last of them.
            latest = deque(self._read(np.array([time]), counts), maxlen=1)
            if latest:
                return dataclasses.replace(latest[0], index=-1)
        return None

    def robot_path(self, frame_id: str, base_frame: str | None = None) -> RobotPath:
        """Return the robot's path over the selected time range.

        Parameters
        ----------
        frame_id : str
            Frame of the map; the poses are given in it.
        base_frame : str, optional
            Frame of the robot's base, where it is none of the usual ones.
        """
        self._require_open()
        start_ns = self._selection.start_ns
        if (first := next(iter(self._parts))) > 1:
            start_ns = max(start_ns or 0, int(self._parts[first].times[0]))
        map_topic = self.source.made_from(self.topic)
        path = RobotPath(self.source, frame_id, start_ns, map_topic=map_topic, base_frame=base_frame)
        self._path_origin = path.origin
        return path

    def _read(
        self, chosen: Times, counts: ReadCounts, min_change_m2: float | None = None, *, warn: bool = False
    ) -> Iterator[OccupancySnapshot]:
        """Yield the distinct maps as they are at the `chosen` times (sorted); log warnings if `warn`."""
        wanted = set(chosen.tolist())
        has_patches = len(self._topics) > 1
        stream = MapStream(self.topic, counts, min_change_m2, self._occupancy, has_patches=has_patches)
        map_checks = MapChecks()
        reading = self.cell_reading
        has_told_far = False
        for message in self.source.read(self._topics, self._needed(chosen)):
            is_wanted = message.log_time_ns in wanted
            map_warnings: tuple[MapWarning, ...] = ()
            try:
                decoded = message.decode()
                if isinstance(decoded, Patch) and stream.is_empty:
                    map_warnings = (
                        MapWarning("patch_without_map", "a patch with no map before it; skipped"),
                    )
                else:
                    decoded = None if decoded is None else reading.of(decoded)
                    map_warnings = map_checks.of(decoded, message.log_time_ns)
                stream.apply(decoded)
            except LogError as error:
                is_damaged = isinstance(error, DamagedMessageError)
                counts.damaged += is_wanted and is_damaged
                counts.invalid += is_wanted and not is_damaged
                if message.topic == self.topic:
                    stream.forget()
                self._first_failure = self._first_failure or f"{self._place(message)}: {error}"
                kind = "damaged_message" if is_damaged else "invalid_map"
                if warn:
                    self._warn(message, MapWarning(kind, f"{error}; skipped"))
                continue
            for map_warning in map_warnings if warn else ():
                self._warn(message, map_warning)
            if is_wanted and (snapshot := stream.snapshot(message.log_time_ns)) is not None:
                if warn and (far := stream.far_cells) is not None and not has_told_far:
                    self._warn(message, MapWarning("far_cells", f"{far.note}; so are those of later maps"))
                    has_told_far = True
                del message, decoded  # a large canvas is not kept while what it shows is analyzed
                yield snapshot
                self._require_open()

    def _place(self, message: LoggedMap) -> str:
        total = len(self.source.log_times(message.topic))
        return f"{self.info.path}: message {message.number} of {total} on {message.topic}"

    def _warn(self, message: LoggedMap, map_warning: MapWarning) -> None:
        text = f"{self._place(message)}: {map_warning.text}"
        log_warning(
            logger, map_warning.kind, text, file=message.file, topic=message.topic, index=message.number
        )

    def _needed(self, chosen: Times) -> Times:
        """Log times of the messages needed to build the maps at the `chosen` times.

        Without patches each map is one message. With patches it is the last full grid and all patches since.
        """
        if len(self._topics) == 1 or not len(chosen):
            return chosen
        grids, patches = (distinct(self.source.log_times(topic)) for topic in self._topics)
        last_grid = np.searchsorted(grids, chosen, "right") - 1
        begins = np.where(last_grid >= 0, grids[last_grid], chosen) if len(grids) else chosen
        # A patch is needed if it lies between the full grid that a chosen map starts from and that map.
        following = np.searchsorted(chosen, patches, "left")
        inside = following < len(chosen)
        patches, following = patches[inside], following[inside]
        return distinct(np.concatenate([chosen, begins, patches[begins[following] <= patches]]))

    @property
    def _parts(self) -> dict[int, Part]:
        """The parts of the maps that are read, by number from 1."""
        return self._found_parts[1]

    @cached_property
    def _found_parts(self) -> tuple[Parts, dict[int, Part]]:
        """The parts of the topic, and those that are read, by number."""
        self._require_open()
        times = self.source.log_times(self.topic)
        if len(times) > 1 and isinstance(self.source, MapFilesSource):
            return self._chosen(find_saved_parts(self.source.names, times, self._grid, self._occupancy))
        whole = Parts((Part(times, 0.0, len(times)),))
        if len(distinct(times)) < len(times):
            return self._chosen(whole)  # maps of one time cannot be told apart
        publishers = self.source.publishers(self.topic)
        found = find_parts(times, self._grid, self._occupancy, publishers)
        if found.why and len(found.parts) == 1:
            text = f"{self.info.path}: {self.topic}: {found.why}"
            log_warning(logger, "in_turn", text, file=self.info.path, topic=self.topic)
        if len(self._topics) > 1 and len(found.parts) > 1:
            # Patches are of the full map before them, which does not say who published them.
            found = found.with_patches(self._all_times()) if found.is_one_run else whole
        return self._chosen(found)

    def _chosen(self, found: Parts) -> tuple[Parts, dict[int, Part]]:
        """Parts, and those of them that are read.

        The one that was asked for; else all in the time range, or one if they are of several runs.
        """
        count, number = len(found.parts), self._asked_part
        if number is not None and not 1 <= number <= count:
            raise LogError(f"{self.info.path}: {self.topic} has no part {number}; it has {count}")
        numbered = dict(enumerate(found.parts, start=1))
        in_range = {
            place: part for place, part in numbered.items() if len(self._selection.in_range(part.times))
        }
        if number is None and len(in_range) > 1:
            number = None if found.is_one_run else likeliest(in_range)
            other = "takes one alone" if number is None else "takes another"
            other = f"part={next(place for place in in_range if place != number)} {other}"
            text = f"{self.info.path}: {self.topic}: {found.text(number, in_range)}; {other}"
            log_warning(logger, "parts", text, file=self.info.path, topic=self.topic)
        taken = (in_range or numbered) if number is None else {number: numbered[number]}
        return found, taken

    def _grid(self, time_ns: int) -> Grid | None:
        """Read the map of one log time; None if there is none."""
        for message in self.source.read([self.topic], np.array([time_ns], np.int64)):
            with suppress(LogError):  # it is told of where the map is needed
                decoded = message.decode()
                if isinstance(decoded, Grid):
                    return without_far_cells(self.cell_reading.of(decoded), self._occupancy)[0]
        return None

    def _all_times(self) -> Times:
        """Log times (N,) of all maps and patches, ascending."""
        return np.sort(np.concatenate([self.source.log_times(topic) for topic in self._topics]))

    def _times_in_range(self) -> Times:
        self._require_open()
        times = self._all_times()
        if len(times) and self.part_count > 1:
            times = np.concatenate([part.times for part in self._parts.values()])
        if not len(times):
            raise LogError(f"{self.info.path}: no messages on {self.topic}; choose another topic")
        in_range = self._selection.in_range(times)
        if not len(in_range):
            begin_ns = times[0] if self.info.start_ns is None else self.info.start_ns
            first_s, last_s = ((int(each) - int(begin_ns)) / 1e9 for each in (times[0], times[-1]))
            raise LogError(
                f"{self.info.path}: no messages on {self.topic} in the time range; "
                f"its messages are {first_s:.1f} to {last_s:.1f} s after the start of the log"
            )
        return in_range

    def _no_map(self, counts: ReadCounts) -> LogError:
        where = f"no message on {self.topic} in the time range contains a usable map"
        if self._first_failure is None:
            text = f"{self.info.path}: {where}; choose another topic or time range"
            return LogError(text, file=self.info.path, topic=self.topic)
        why = [f"{counts.damaged} messages are damaged"] if counts.damaged else []
        why += [f"{counts.invalid} maps are inconsistent"] if counts.invalid else []
        kind = InvalidMapError if counts.invalid else LogError
        text = f"{self._first_failure}; {where}: {', '.join(why)}"
        return kind(text, file=self.info.path, topic=self.topic)


def _why_unread(topic: TopicInfo) -> str:
    """Say that a topic's maps cannot be read, and what to do."""
    language = f", defined in {topic.schema_encoding}" if topic.schema_encoding else ""
    return (
        f"{topic.name} holds {topic.message_type} in the encoding {topic.encoding or 'none'}{language}, "
        "which is not read; read are nav_msgs/OccupancyGrid as cdr, ros1 or json, and foxglove.Grid as "
        "protobuf, flatbuffer or json: record or convert to one of these"
    )


def choose_topic(info: LogInfo, asked: str | None = None) -> str:
    """Choose the map topic: the requested one, else ``/map``, else the only one with messages.

    Raises
    ------
    NoMapTopicError
        If there is none, or there are several and none was requested; the message lists them.
    """
    where = f"{info.path}:" if info.whole else f"{info.path}: is damaged; in its readable part"
    maps = {topic.name: topic for topic in info.topics if topic.is_map}
    listed = ", ".join(maps)
    if asked is not None:
        for name in maps:
            if name.lstrip("/") == asked.lstrip("/"):
                return name
        has = f"its map topics are {listed}" if maps else "it has no map topics"
        raise NoMapTopicError(
            f"{info.path}: {asked or repr(asked)} is not a topic with occupancy grids; {has}"
        )
    scans = mappable_topics(info)
    building = f"map_from={scans[0]!r} builds maps from its laser scans" if scans else ""
    untyped = sorted({each.name for each in info.topics if not each.message_type})
    if untyped and not maps:
        raise NoMapTopicError(
            f"{where} no topic has occupancy grids, and {', '.join(untyped[:MOST_LISTED])} has no schema "
            "that says what its messages are; if they are maps, name their type "
            "(message_type='nav_msgs/OccupancyGrid')" + (f"; {building}" if building else "")
        )
    if not maps and (unread := [each for each in info.topics if is_called_map(ros_type(each.message_type))]):
        raise NoMapTopicError(f"{where} {_why_unread(unread[0])}" + (f"; {building}" if building else ""))
    if not maps:
        others = ", ".join(sorted({topic.message_type for topic in info.topics})[:MOST_LISTED])
        found = f", only {others}" if others else ""
        remedy = building or "record the mapping node's topic too, usually /map"
        if scans_alone := without_transforms(info):
            remedy = f"{scans_alone}; {remedy}, or the transforms"
        raise NoMapTopicError(
            f"{where} no topic has occupancy grids (nav_msgs/OccupancyGrid){found}; {remedy}"
        )
    filled = {name: topic for name, topic in maps.items() if topic.message_count != 0}
    if not filled:
        raise NoMapTopicError(f"{where} no messages were recorded on the map topics {listed}")
    for name in filled:
        if name.lstrip("/") == PREFERRED_TOPIC:
            return name
    if len(filled) > 1:
        raise NoMapTopicError(
            f"{info.path}: several topics have maps: {', '.join(filled)}; choose one (topic={min(filled)!r})"
        )
    return next(iter(filled))
