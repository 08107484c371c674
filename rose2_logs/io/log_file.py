"""What one file of a log offers, whatever its format: channels, where messages lie, and their bytes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from rose2_logs.config.parameters import ReadingParameters
from rose2_logs.errors import LogError
from rose2_logs.io.decompression import decompress
from rose2_logs.io.discovery import ZSTD_MAGIC
from rose2_logs.io.messages import is_map_type, is_patch_type
from rose2_logs.io.source import DamagedMessageError

LATEST_NS = 2**63 - 1
"""A later log time is damage: it lies beyond the year 2262."""


class Place(NamedTuple):
    """Where a message lies; the order of the fields is the order of reading.

    `record` is the file offset of the chunk that holds it, or of the message itself outside chunks; `offset`
    that of the message in the uncompressed chunk, or -1 outside chunks. In a database `record` is its row.
    """

    log_time_ns: int
    record: int
    offset: int
    channel_id: int


@dataclass(frozen=True)
class Channel:
    """Messages of one topic and type, with the type's definition; channels are equal by `id`.

    Attributes
    ----------
    id : int
        In the file.
    topic : str
    message_encoding : str
        ``cdr``, ``ros1``, ``protobuf`` ...
    schema_id : int
        Of the definition, in the file; 0 if there is none.
    schema_name, schema_encoding : str
        Name and language of the type.
    schema_data : bytes
        Its definition.
    metadata : dict of str
        Whatever else the file tells of it, as the quality of service.
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
        """Whether it holds whole maps that can be read."""
        return is_map_type(self.schema_name, self.message_encoding)

    @property
    def is_wanted(self) -> bool:
        """Whether it holds maps, or patches of maps, that can be read."""
        return self.is_map or (is_patch_type(self.schema_name) and self.message_encoding in ("cdr", "ros1"))


class StoredMessage(NamedTuple):
    """A message with what stands around it."""

    channel: Channel
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    data: bytes | memoryview


class LogFile(ABC):
    """An open file of a log; of a damaged one as much as is whole.

    Attributes
    ----------
    path : Path
    limits : ReadingParameters
        How much it may claim.
    channels : dict of int to Channel
        By id.
    message_counts : Counter
        Messages per channel id, as far as they can be found.
    start_ns, end_ns : int or None
        Log times of the first and the last message.
    indexed : bool
        Whether the file's own index serves; otherwise the file was scanned.
    whole : bool
        Whether nothing was found to be missing when it was opened.
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
        """Where the messages of some wanted channels lie, in the order of log time."""

    @abstractmethod
    def payload(self, place: Place) -> memoryview:
        """Return the data of one message.

        Raises
        ------
        DamagedMessageError
            If it cannot be read any more.
        """

    @abstractmethod
    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield every message that is whole, of some channels or of all, without holding them."""

    def decompressed(self, data: bytes | memoryview) -> memoryview:
        """Return a message of a ROS 2 bag that may have been compressed message by message.

        Raises
        ------
        DamagedMessageError
            If it is damaged, or larger than may be.
        """
        if data[:4] != ZSTD_MAGIC:
            return memoryview(data)
        try:
            return memoryview(decompress("zstd", data, None, self.limits.chunk_max_bytes))
        except ValueError as error:
            raise DamagedMessageError(f"damaged ({error})") from error

    @abstractmethod
    def close(self) -> None:
        """Close the file; may be called twice."""


def check_count(path: Path, count: int, most: int) -> None:
    """Refuse a log with more map messages than may be.

    Raises
    ------
    LogError
        With the remedy.
    """
    if count > most:
        raise LogError(
            f"{path}: holds more than {most} map messages; if they are real, "
            "raise the parameter reading.map_max_messages",
            file=path,
        )
