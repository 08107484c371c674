"""The interface of every log format: its topics, and its map messages by topic and log time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.config.selection import Times
from rose2_logs.errors import LogError
from rose2_logs.io.grids import Grid, Patch
from rose2_logs.model.labels import run_starts


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a log.

    Attributes
    ----------
    name, message_type, encoding : str
        As stored in the log; the encoding is ``cdr`` (ROS 2), ``ros1``, ``protobuf``, ``json`` ...
    message_count : int or None
        None if it is known only after reading the whole log.
    is_map : bool
        Whether the messages are occupancy grids that can be read.
    schema_encoding : str
        Language of the type's definition, as stored in the log; empty without one.
    """

    name: str
    message_type: str
    message_count: int | None
    is_map: bool
    encoding: str
    schema_encoding: str = ""


@dataclass(frozen=True)
class LogInfo:
    """What a log contains, from its index if it has one.

    Attributes
    ----------
    path : Path
        The log; the first one of several files.
    format : str
        Its format in words.
    size_bytes : int
        Size on disk of all its files.
    start_ns, end_ns : int or None
        Log times of the first and the last message of any topic; None in an empty log.
    topics : tuple of TopicInfo
        Sorted by name.
    indexed : bool
        Whether the log has a usable index; otherwise it was scanned from the beginning.
    whole : bool
        Whether the log was complete and undamaged as far as opening it could show.
    """

    path: Path
    format: str
    size_bytes: int
    start_ns: int | None
    end_ns: int | None
    topics: tuple[TopicInfo, ...]
    indexed: bool
    whole: bool = True

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last message; 0 in an empty log."""
        return 0.0 if self.start_ns is None or self.end_ns is None else (self.end_ns - self.start_ns) / 1e9


class DamagedMessageError(LogError):
    """The bytes of one message are lost; other messages may still be readable."""


@dataclass(frozen=True)
class LoggedMap:
    """A map message of a log, not decoded yet.

    Attributes
    ----------
    log_time_ns : int
        When it was recorded.
    topic : str
        Topic it was published on.
    number : int
        Number of the message on its topic, from 1, in log time order.
    file : Path
        File that contains it.
    decode : callable
        Returns the message, or None if its grid has no cells; raises InvalidMapError if the message is
        inconsistent and DamagedMessageError if its bytes are lost.
    """

    log_time_ns: int
    topic: str
    number: int
    file: Path
    decode: Callable[[], Grid | Patch | None] = field(repr=False)


@dataclass(frozen=True)
class LoggedBytes:
    """A message of any type, as stored in the log.

    Attributes
    ----------
    log_time_ns : int
        When it was recorded.
    topic, encoding : str
        Topic it was published on; ``cdr`` or ``ros1``.
    data : callable
        Returns its bytes; raises DamagedMessageError if they are lost.
    """

    log_time_ns: int
    topic: str
    encoding: str
    data: Callable[[], bytes | memoryview] = field(repr=False)

    def data_if_whole(self) -> bytes | None:
        """Return its bytes; None if they are lost."""
        try:
            return bytes(self.data())
        except DamagedMessageError:
            return None


class MessageSource(ABC):
    """An open log: what it contains, and its map messages by topic and log time.

    Attributes
    ----------
    info : LogInfo
        What it contains.
    occupancy : OccupancyParameters
        What the numbers in the cells mean; only sources that decide it themselves heed it.
    """

    info: LogInfo
    occupancy = OccupancyParameters()

    @property
    def value_reading(self) -> Mapping[str, Any] | None:
        """How the source itself turns what it stores into percent; None if it leaves that to the reader."""
        return None

    @property
    def recorded(self) -> MessageSource:
        """The log itself, where this one adds maps that are built from it."""
        return self

    def made_from(self, topic: str) -> str:
        """Topic that the messages of `topic` are made from: the same one, if they were recorded."""
        return topic

    @abstractmethod
    def log_times(self, topic: str) -> Times:
        """Log times of all messages of `topic`, nanoseconds, sorted."""

    @abstractmethod
    def read(self, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Yield the messages of `topics` logged at `times` (sorted, distinct), in log time order."""

    def publishers(self, topic: str) -> Sequence[str] | None:
        """Return who published each message of `topic`; None if the log does not tell them apart."""
        return None

    def recorded_ns(self, time_ns: int) -> int:
        """Return the log time that stands in the log, of a map whose own goes on where a clock was set."""
        return time_ns

    def stream(self, topics: Sequence[str]) -> Iterator[LoggedBytes]:
        """Yield all messages of `topics` one at a time, roughly in log time order.

        Parts of the log that overlap in time may come one after the other; damaged messages are skipped. A
        log that contains only maps yields nothing.
        """
        return iter(())

    @abstractmethod
    def close(self) -> None:
        """Release the files; may be called more than once."""


def distinct(times: Times) -> Times:
    """Return the different ones of some log times, ascending.

    As `numpy.unique` does, which loads the module of masked arrays first.

    Examples
    --------
    >>> distinct(np.array([3, 1, 3])).tolist()
    [1, 3]
    """
    ordered: Times = np.sort(times)
    different: Times = ordered[run_starts(ordered)]
    return different


def places_of(times: Times, among: Times) -> NDArray[np.intp]:
    """Return which of the ascending log times `among` are some of `times`, which are ascending and distinct.

    Examples
    --------
    >>> places_of(np.array([1, 4]), np.array([1, 1, 3, 4])).tolist()
    [0, 1, 3]
    """
    begins, ends = np.searchsorted(among, times), np.searchsorted(among, times, "right")
    ranges = [np.arange(begin, end) for begin, end in zip(begins.tolist(), ends.tolist(), strict=True)]
    return np.concatenate([np.zeros(0, np.intp), *ranges])
