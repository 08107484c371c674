"""How much a log may claim before it is refused as damaged or hostile."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

from rose2_logs.config.fields import ParameterBlock, choice, number

NO_TYPE = "none"
TYPES_WITHOUT_SCHEMA = (NO_TYPE, "nav_msgs/OccupancyGrid", "nav2_msgs/Costmap", "foxglove_msgs/Grid")


@dataclass(frozen=True, repr=False)
class ReadingParameters(ParameterBlock):
    """How much a log may claim before it is refused as damaged or hostile; real ones stay far below."""

    block: ClassVar[str] = "reading"

    map_max_cells: int = number(
        2**27,
        "cells",
        "Largest map that is read: 579 m by 579 m at 5 cm. Reading an image of this size takes 2.7 GB.",
        1,
        2**40,
    )
    chunk_max_bytes: int = number(
        2**28,
        "bytes",
        "Largest decompressed chunk or message: enough for the largest map; 1 MB is usual.",
        1024,
        2**40,
    )
    unpacked_max_bytes: int = number(
        2**38,
        "bytes",
        "Largest log that a compressed file is unpacked to, if the disk has room: 275 GB, hours of cameras.",
        1024,
        2**50,
    )
    map_max_messages: int = number(
        2_000_000, "messages", "Most map messages in a log: one per second for 23 days.", 1, 10**12
    )
    type_without_schema: str = choice(
        NO_TYPE,
        TYPES_WITHOUT_SCHEMA,
        "Type of the messages on channels that have no schema: such a log does not say it itself.",
    )

    def with_type(self, name: str | None) -> Self:
        """Return these with the type of channels without a schema that was named, if one was."""
        return self if name is None else replace(self, type_without_schema=name)
