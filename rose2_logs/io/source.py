"""What every log format implements: its topics, and its map messages by topic and log time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rose2_logs.config.selection import Times
from rose2_logs.errors import LogError
from rose2_logs.io.grids import Grid, Patch


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a log.

    Attributes
    ----------
    name, message_type, encoding : str
        As stored in the log; the encoding is ``cdr`` (ROS 2), ``ros1``, ``protobuf``, ``json`` ...
    message_count : int or None
        None where only reading the whole log would tell.
    is_map : bool
        Whether the messages are occupancy grids that can be read.
    """

    name: str
    message_type: str
    message_count: int | None
    is_map: bool
    encoding: str


@dataclass(frozen=True)
class LogInfo:
    """What a log holds, from its index where it has one.

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
        Whether the log has a usable index; without one it was scanned from the beginning.
    whole : bool
        Whether nothing was found to be missing when it was opened.
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
    """The bytes of one message are lost; those of others may be whole."""


@dataclass(frozen=True)
class LoggedMap:
    """A map message of a log, not decoded yet.

    Attributes
    ----------
    log_time_ns : int
        When it was recorded.
    topic : str
        Where it was sent.
    number : int
        Of the message on its topic, from 1, in the order of log time.
    file : Path
        Where it lies.
    decode : callable
        Gives the message, or None if its grid has no cells; raises InvalidMapError where the message
        contradicts itself and DamagedMessageError where its bytes are lost.
    """

    log_time_ns: int
    topic: str
    number: int
    file: Path
    decode: Callable[[], Grid | Patch | None] = field(repr=False)


@dataclass(frozen=True)
class LoggedBytes:
    """A message of any type, as it stands in the log.

    Attributes
    ----------
    log_time_ns : int
        When it was recorded.
    topic, encoding : str
        Where it was sent; ``cdr`` or ``ros1``.
    data : callable
        Gives its bytes; raises DamagedMessageError where they are lost.
    """

    log_time_ns: int
    topic: str
    encoding: str
    data: Callable[[], bytes | memoryview] = field(repr=False)


class MessageSource(ABC):
    """An open log: what it holds, and its map messages by topic and log time."""

    info: LogInfo

    @abstractmethod
    def log_times(self, topic: str) -> Times:
        """Log times of all messages of `topic`, nanoseconds, sorted."""

    @abstractmethod
    def read(self, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Yield, in the order of log time, the messages of `topics` logged at `times` (sorted, distinct)."""

    def stream(self, topics: Sequence[str]) -> Iterator[LoggedBytes]:
        """Yield all messages of `topics` about in the order of log time, none of them held.

        Parts of the log that overlap in time may follow one another; what is damaged is passed over. A log
        that holds nothing but maps yields nothing.
        """
        return iter(())

    @abstractmethod
    def close(self) -> None:
        """Release the files; may be called twice."""
