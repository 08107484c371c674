"""Occupancy grids and their patches from message bytes: ROS 2 CDR, ROS 1 serialization, protobuf.

Generic deserializers turn every cell into a Python object, which takes seconds for a large map. Here the few
fields before the cells are unpacked by hand, and the cells remain a view of the message's bytes.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from rose2_logs.errors import InvalidMapError
from rose2_logs.io.cell_values import OCCUPANCY_OF_COST
from rose2_logs.io.grids import (
    FOXGLOVE_GRID_TYPE,
    LONGEST_NAME_BYTES,
    MOST_CELLS,
    MOST_CHANNELS,
    Cells,
    Decoder,
    Grid,
    MapWarning,
    Patch,
    check_cells,
    exact_resolution,
    make_grid,
)

GRID_TYPES = ("nav_msgs/OccupancyGrid", "nav2_msgs/Costmap")
FOXGLOVE_ROS_TYPE = "foxglove_msgs/Grid"
PATCH_TYPES = ("map_msgs/OccupancyGridUpdate", "nav2_msgs/CostmapUpdate")
PADDING_BYTES = 8
"""Fewer bytes than this may follow the last field: some writers pad to the largest alignment."""


def ros_type(name: str) -> str:
    """Normalize the name of a ROS message type to ``package/Type``, without ``/msg/``.

    DDS spells it ``package::msg::dds_::Type_``, tools that read it write slashes, and Python writes dots.
    """
    plain = name.replace("::", "/").replace(".msg.", "/")
    if "/dds_/" in plain:
        plain = plain.replace("/dds_/", "/").removesuffix("_")
    return plain.replace("/msg/", "/")


def is_patch_type(message_type: str) -> bool:
    """Whether messages of this type are patches of a map."""
    return ros_type(message_type) in PATCH_TYPES


def is_called_map(message_type: str) -> bool:
    """Whether a type has the name of a map, whatever the encoding and the package."""
    return message_type.replace(".", "/").rpartition("/")[2] in ("OccupancyGrid", "Costmap", "Grid")


def is_map_type(message_type: str, encoding: str) -> bool:
    """Whether messages of this type and encoding are whole maps that `decoder` can read."""
    if encoding in ("protobuf", "flatbuffer"):
        return message_type == FOXGLOVE_GRID_TYPE
    name = ros_type(message_type)
    if encoding == "json":
        return name in (FOXGLOVE_GRID_TYPE, FOXGLOVE_ROS_TYPE, GRID_TYPES[0])
    return encoding in ("cdr", "ros1") and name in (*GRID_TYPES, FOXGLOVE_ROS_TYPE)


def decoder(
    message_type: str, encoding: str, schema: bytes = b"", most_cells: int = MOST_CELLS
) -> Decoder | None:
    """Return the function that decodes map messages of one kind.

    Parameters
    ----------
    message_type : str
        ROS message type, with or without ``/msg/``, or protobuf message name.
    encoding : str
        ``cdr``, ``ros1``, ``protobuf``, ``flatbuffer`` or ``json``.
    schema : bytes
        The schema stored in the log; needed for protobuf and FlatBuffers.
    most_cells : int
        Number of cells of the largest map that is accepted.

    Returns
    -------
    callable or None
        Turns the bytes of a message into a Grid, a Patch, or None for a grid without cells; raises
        InvalidMapError. None if such messages are neither maps nor patches, or cannot be read.
    """
    if is_map_type(message_type, encoding) and encoding == "protobuf":
        from rose2_logs.io.foxglove_grid import grid_decoder

        return grid_decoder(schema, most_cells)
    if is_map_type(message_type, encoding) and encoding == "flatbuffer":
        from rose2_logs.io.flatbuffer_maps import flatbuffer_decoder

        return flatbuffer_decoder(schema, most_cells)
    if is_map_type(message_type, encoding) and encoding == "json":
        from rose2_logs.io.json_maps import json_decoder

        return json_decoder(ros_type(message_type) != GRID_TYPES[0], most_cells)
    decode = {
        FOXGLOVE_ROS_TYPE: _foxglove_grid,
        "nav_msgs/OccupancyGrid": _occupancy_grid,
        "map_msgs/OccupancyGridUpdate": _occupancy_grid_update,
        "nav2_msgs/Costmap": _costmap,
        "nav2_msgs/CostmapUpdate": _costmap_update,
    }.get(ros_type(message_type))
    if decode is None or encoding not in ("cdr", "ros1"):
        return None
    return lambda data: decode(fields_of(data, encoding, most_cells))


class Fields:
    """Reads the fields of a serialized message in order; strings and arrays start with a 4-byte count.

    Every method raises InvalidMapError if the message ends before the field does.
    """

    byte_order = "<"
    start = 0
    largest_alignment = 1

    def __init__(self, data: memoryview, most_cells: int = MOST_CELLS) -> None:
        self._data = data
        self._place = self.start
        self.most_cells = most_cells
        self.map_warnings: list[MapWarning] = []

    def numbers(self, code: str, count: int = 1) -> tuple[float, ...]:
        """Read `count` numbers of one `struct` type."""
        alignment = min(struct.calcsize(code), self.largest_alignment)
        self._place += -(self._place - self.start) % alignment
        layout = f"{self.byte_order}{count}{code}"
        try:
            values = struct.unpack_from(layout, self._data, self._place)
        except struct.error as error:
            raise InvalidMapError(
                f"the message ends after {len(self._data)} bytes, before its last field"
            ) from error
        self._place += struct.calcsize(layout)
        return values

    def integers(self, code: str, count: int = 1) -> tuple[int, ...]:
        """Read `count` integers of one `struct` type."""
        return tuple(int(value) for value in self.numbers(code, count))

    def octets(self, what: str) -> memoryview:
        """Read a string or an array of bytes, without a copy."""
        (count,) = self.integers("I")
        if count > self.left:
            raise InvalidMapError(f"its {what} claims {count} bytes, but only {self.left} bytes are left")
        self._place += count
        return self._data[self._place - count : self._place]

    def string(self, what: str) -> str:
        """Read a string, without the zero byte that ends it in CDR."""
        octets = self.octets(what)
        if len(octets) > LONGEST_NAME_BYTES:
            raise InvalidMapError(f"its {what} is {len(octets)} bytes long, more than {LONGEST_NAME_BYTES}")
        return bytes(octets).rstrip(b"\0").decode("utf-8", errors="replace")

    @property
    def left(self) -> int:
        """Number of bytes that are left."""
        return len(self._data) - self._place

    def singles(self, what: str) -> NDArray[np.float32]:
        """Read an array of numbers of single precision, without a copy."""
        (count,) = self.integers("I")
        size = 4 * count
        if size > self.left:
            raise InvalidMapError(f"its {what} claim {count} numbers, but only {self.left} bytes are left")
        values = np.frombuffer(self._data, f"{self.byte_order}f4", count, self._place)
        self._place += size
        return values

    def cells(self, rows: int, columns: int) -> NDArray[np.uint8]:
        """Read the last field: the cells (rows, columns), one byte each."""
        data = self.octets("data")
        if rows * columns != len(data):
            raise InvalidMapError(f"it claims {columns} x {rows} cells, but its data has {len(data)}")
        check_cells(rows, columns, self.most_cells)
        if (left := self.left) >= PADDING_BYTES:
            self.map_warnings.append(
                MapWarning(
                    "more_bytes", f"{left} bytes follow its last field; is its message definition different?"
                )
            )
        return np.frombuffer(data, np.uint8).reshape(rows, columns)

    def signed_cells(self, rows: int, columns: int) -> Cells:
        """Read the last field as signed bytes, whatever they mean."""
        return self.cells(rows, columns).view(np.int8)

    def time_ns(self) -> int:
        """Take a time as nanoseconds."""
        seconds, nanoseconds = self.integers("i")[0], self.integers("I")[0]
        return seconds * 10**9 + nanoseconds

    def header(self) -> tuple[int, str]:
        """Take a std_msgs/Header: stamp in nanoseconds and frame."""
        return self.time_ns(), self.string("frame_id")


# Second byte of the encapsulation header -> byte order, largest alignment (XCDR 1 and 2, plain).
_CDR_KINDS = {0: (">", 8), 1: ("<", 8), 6: (">", 4), 7: ("<", 4)}


class CdrFields(Fields):
    """CDR as ROS 2 writes it: a 4-byte header with the byte order, then fields aligned to their own size."""

    start = 4

    def __init__(self, data: memoryview, most_cells: int = MOST_CELLS) -> None:
        super().__init__(data, most_cells)
        if len(data) < self.start or data[0] != 0 or data[1] not in _CDR_KINDS:
            raise InvalidMapError(f"it is not CDR: it starts with the bytes {bytes(data[:4]).hex(' ')!r}")
        self.byte_order, self.largest_alignment = _CDR_KINDS[data[1]]


class Ros1Fields(Fields):
    """ROS 1: little endian, without padding; the header has a sequence number, times are unsigned."""

    def time_ns(self) -> int:
        """Take a time as nanoseconds."""
        seconds, nanoseconds = self.integers("I", 2)
        return seconds * 10**9 + nanoseconds

    def header(self) -> tuple[int, str]:
        """Take a std_msgs/Header: stamp in nanoseconds and frame."""
        self.integers("I")
        return super().header()


def fields_of(data: bytes | memoryview, encoding: str, most_cells: int = MOST_CELLS) -> Fields:
    """Open a message of ROS to take its fields one after the other; the encoding is ``cdr`` or ``ros1``."""
    return (CdrFields if encoding == "cdr" else Ros1Fields)(memoryview(data), most_cells)


def _occupancy_grid(fields: Fields) -> Grid | None:
    stamp_ns, frame_id = fields.header()
    fields.time_ns()  # map_load_time
    (resolution,) = fields.numbers("f")
    width, height = fields.integers("I", 2)
    pose = fields.numbers("d", 7)
    cells = fields.signed_cells(height, width)
    return make_grid(stamp_ns, frame_id, exact_resolution(resolution), pose, cells, fields.map_warnings)


def _occupancy_grid_update(fields: Fields) -> Patch:
    stamp_ns, _ = fields.header()
    x, y = fields.integers("i", 2)
    width, height = fields.integers("I", 2)
    return Patch(stamp_ns, y, x, fields.signed_cells(height, width), tuple(fields.map_warnings))


def _foxglove_grid(fields: Fields) -> Grid | None:
    from rose2_logs.io.foxglove_grid import PackedField, PackedGrid, grid_of

    stamp_ns, frame_id = fields.time_ns(), fields.string("frame_id")
    pose = fields.numbers("d", 7)
    (columns,) = fields.integers("I")
    width_m, height_m = fields.numbers("d", 2)
    row_stride, cell_stride, count = fields.integers("I", 3)
    channels = []
    for _ in range(min(count, MOST_CHANNELS)):
        name = fields.string("field name")
        (offset,), (kind,) = fields.integers("I"), fields.integers("B")
        channels.append(PackedField(name, offset, kind))
    packed = PackedGrid(
        stamp_ns,
        frame_id,
        pose,
        columns,
        (width_m, height_m),
        row_stride,
        cell_stride,
        tuple(channels),
        fields.octets("data"),
    )
    return grid_of(packed, fields.most_cells, fields.map_warnings)


def _costmap(fields: Fields) -> Grid | None:
    stamp_ns, frame_id = fields.header()
    fields.time_ns()  # map_load_time
    fields.time_ns()  # update_time
    fields.string("layer")
    (resolution,) = fields.numbers("f")
    width, height = fields.integers("I", 2)
    pose = fields.numbers("d", 7)
    cells = OCCUPANCY_OF_COST[fields.cells(height, width)]
    return make_grid(stamp_ns, frame_id, exact_resolution(resolution), pose, cells, fields.map_warnings)


def _costmap_update(fields: Fields) -> Patch:
    stamp_ns, _ = fields.header()
    x, y, width, height = fields.integers("I", 4)
    cells = OCCUPANCY_OF_COST[fields.cells(height, width)]
    return Patch(stamp_ns, y, x, cells, tuple(fields.map_warnings))
