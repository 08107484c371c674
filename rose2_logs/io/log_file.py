"""The interface of one log file of any format: its channels, where their messages are, and their bytes."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from rose2_logs.config.reading import ReadingParameters
from rose2_logs.errors import LogError
from rose2_logs.io.decompression import decompress
from rose2_logs.io.discovery import ZSTD_MAGIC
from rose2_logs.io.messages import is_map_type, is_patch_type
from rose2_logs.io.source import DamagedMessageError
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)


class Place(NamedTuple):
    """Where a message is stored; places sort in reading order.

    `record` is the file offset of the message's chunk, or of the message itself outside chunks. `offset` is
    the message's offset in the uncompressed chunk, or -1 outside chunks. In a database, `record` is the row.
    """

    log_time_ns: int
    record: int
    offset: int
    channel_id: int


@dataclass(frozen=True)
class Channel:
    """Messages of one topic and type, with the definition of the type.

    Attributes
    ----------
    id : int
        Number of the channel in the file.
    topic : str
    message_encoding : str
        ``cdr``, ``ros1``, ``protobuf`` ...
    schema_id : int
        Number of the definition in the file; 0 if there is none.
    schema_name, schema_encoding : str
        Name of the type and language of its definition.
    schema_data : bytes
        The definition.
    metadata : dict of str
        Whatever else the file says about the channel, such as the quality of service.
    """

    id: int
    topic: str
    message_encoding: str
    schema_id: int
    schema_name: str
    schema_encoding: str = ""
    schema_data: bytes = field(default=b"", repr=False, hash=False)
    metadata: dict[str, str] = field(default_factory=dict, hash=False)

    @property
    def is_map(self) -> bool:
        """Whether it carries whole maps that can be read."""
        return is_map_type(self.schema_name, self.message_encoding)

    @property
    def is_wanted(self) -> bool:
        """Whether it carries maps, or patches of maps, that can be read."""
        return self.is_map or (is_patch_type(self.schema_name) and self.message_encoding in ("cdr", "ros1"))


class StoredMessage(NamedTuple):
    """A message with its channel, times and sequence number."""

    channel: Channel
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    data: bytes | memoryview


class LogFile(ABC):
    """An open file of a log; of a damaged file, the readable part.

    Attributes
    ----------
    path : Path
    limits : ReadingParameters
        The largest sizes that are accepted.
    channels : dict of int to Channel
        By id.
    message_counts : Counter
        Messages per channel id, as far as they can be found.
    start_ns, end_ns : int or None
        Log times of the first and the last message.
    indexed : bool
        Whether the file's own index is used; otherwise the file was scanned.
    whole : bool
        Whether the file was complete and undamaged as far as opening it could show.
    """

    path: Path
    limits: ReadingParameters
    channels: dict[int, Channel]
    message_counts: Counter[int]
    start_ns: int | None
    end_ns: int | None
    indexed: bool
    whole: bool = True

    @abstractmethod
    def places(self, channel_ids: Collection[int]) -> list[Place]:
        """Where the messages of some wanted channels are stored, in log time order."""

    @abstractmethod
    def payload(self, place: Place) -> memoryview:
        """Return the data of one message.

        Raises
        ------
        DamagedMessageError
            If it cannot be read.
        """

    @abstractmethod
    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield every readable message of some channels, or of all, one at a time."""

    def decompressed(self, data: bytes | memoryview) -> memoryview:
        """Return a message of a ROS 2 bag, decompressed if the bag compressed its messages one by one.

        Raises
        ------
        DamagedMessageError
            If it is damaged, or larger than the limit.
        """
        if data[:4] != ZSTD_MAGIC:
            return memoryview(data)
        try:
            return memoryview(decompress("zstd", data, None, self.limits.chunk_max_bytes))
        except ValueError as error:
            raise DamagedMessageError(f"damaged ({error})") from error

    @abstractmethod
    def close(self) -> None:
        """Close the file; may be called more than once."""


def warn_of_times(path: Path, count: int) -> None:
    """Tell of messages that are left out for their log time, if there are any."""
    if count:
        text = (
            f"{path}: {count} messages have an impossible log time (before 1970 or after 2262); they are "
            "left out"
        )
        log_warning(logger, "damaged_message", text, file=path)


def check_count(path: Path, count: int, most: int) -> None:
    """Check that a log does not have more map messages than the limit.

    Raises
    ------
    LogError
        If it has; the message says which parameter sets the limit.
    """
    if count > most:
        raise LogError(
            f"{path}: has more than {most} map messages; if that is correct, "
            "raise the parameter reading.map_max_messages",
            file=path,
        )
