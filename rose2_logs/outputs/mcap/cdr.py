"""CDR, the serialization of ROS 2 messages, written field by field; arrays are copied as they are.

Generic serializers turn every point into a Python object, which for the markers of one map can take longer
than the analysis of the map.
"""

from __future__ import annotations

import re
import struct
from functools import cache

import numpy as np
from numpy.typing import NDArray

ENCAPSULATION = b"\0\1\0\0"
"""Start of each message: plain CDR, little endian. Fields are aligned relative to the byte after it."""
HEAD_BYTES = len(ENCAPSULATION)
SIZES = {code: struct.calcsize(f"<{code}") for code in "BiIfd"}
"""Size in bytes of each `struct` type that is written."""
LARGEST = max(SIZES.values())


@cache
def _layout(types: str, offset: int) -> struct.Struct:
    """Lay out numbers from an offset on, each aligned to its own size."""
    layout, end = "<", offset
    for count, code in re.findall(r"(\d*)(\D)", types):
        gap = -end % SIZES[code]
        layout += f"{gap}x{count}{code}"
        end += gap + int(count or 1) * SIZES[code]
    return struct.Struct(layout)


class CdrWriter:
    """Builds the bytes of one message; every method appends fields, each aligned to its own size."""

    def __init__(self) -> None:
        self._data = bytearray(ENCAPSULATION)

    def numbers(self, types: str, *values: float) -> None:
        """Append numbers of `struct` types, such as "3id": three integers, then a double."""
        self._data += _layout(types, (len(self._data) - HEAD_BYTES) % LARGEST).pack(*values)

    def written(self, fields: bytes, alignment: int) -> None:
        """Append fields that are already serialized and start at a multiple of `alignment` bytes."""
        self._align(alignment)
        self._data += fields

    def string(self, text: str) -> None:
        """Append a string; its length includes the zero byte at the end."""
        encoded = text.encode() + b"\0"
        self.numbers("I", len(encoded))
        self._data += encoded

    def array(self, values: NDArray[np.generic]) -> None:
        """Append the elements of an array in C order, without a count."""
        if values.size:
            self._align(values.itemsize)
            self._data += values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()

    def sequence(self, values: NDArray[np.generic]) -> None:
        """Append the number of rows of an array, then its elements."""
        self.numbers("I", len(values))
        self.array(values)

    def time(self, nanoseconds: int) -> None:
        """Append a builtin_interfaces/Time."""
        seconds, rest = divmod(nanoseconds, 10**9)
        self.numbers("iI", seconds, rest)

    def header(self, stamp_ns: int, frame_id: str) -> None:
        """Append a std_msgs/Header."""
        self.time(stamp_ns)
        self.string(frame_id)

    def points(self, xy_m: NDArray[np.float64], z_m: float = 0.0) -> None:
        """Append points (N, 2), all at one height, as a sequence of geometry_msgs/Point."""
        points = np.full((len(xy_m), 3), z_m)
        points[:, :2] = xy_m
        self.sequence(points)

    def fields(self) -> bytearray:
        """Return the appended fields, without the start of the message."""
        return self._data[HEAD_BYTES:]

    def message(self) -> bytearray:
        """Return the complete message."""
        return self._data

    def _align(self, size: int) -> None:
        if gap := (len(self._data) - HEAD_BYTES) % size:
            self._data += bytes(size - gap)
