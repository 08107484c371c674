"""Occupancy from ``foxglove.Grid`` messages: of protobuf, decoded by the schema in the log, and of others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.errors import InvalidMapError
from rose2_logs.io.grids import (
    FOXGLOVE_GRID_TYPE,
    LONGEST_NAME_BYTES,
    MOST_CELLS,
    Cells,
    Decoder,
    Grid,
    MapWarning,
    check_cells,
    make_grid,
)
from rose2_logs.model.occupancy import UNKNOWN

# foxglove.PackedElementField.NumericType
_NUMERIC_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}
NUMERIC_NAMES = (
    "UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64",
)  # fmt: skip
_OCCUPANCY_FIELD = "occupancy"


def grid_decoder(schema: bytes, most_cells: int = MOST_CELLS) -> Decoder:
    """Return the decoder of ``foxglove.Grid`` messages.

    Integers are percent, with -1 (unsigned: all bits set) for unknown, as in a ROS occupancy grid. Floating
    point numbers are probabilities in 0..1, with NaN or a negative number for unknown.

    Parameters
    ----------
    schema : bytes
        A serialized google.protobuf.FileDescriptorSet.
    most_cells : int
        Number of cells of the largest map that is accepted.

    Raises
    ------
    InvalidMapError
        If the schema cannot be read. The returned function raises it if a message is not an occupancy grid.
    """
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from google.protobuf.message import DecodeError

    pool = descriptor_pool.DescriptorPool()
    try:
        files = {file.name: file for file in descriptor_pb2.FileDescriptorSet.FromString(schema).file}
        for name in list(files):
            _add_with_imports(pool, files, name)
        message_class: Any = message_factory.GetMessageClass(pool.FindMessageTypeByName(FOXGLOVE_GRID_TYPE))
    except (DecodeError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise InvalidMapError(
            f"the protobuf schema of {FOXGLOVE_GRID_TYPE} cannot be read: {error}"
        ) from error

    def decode(data: memoryview) -> Grid | None:
        try:
            return grid_of(_packed(message_class.FromString(bytes(data))), most_cells)
        except DecodeError as error:
            raise InvalidMapError(f"it cannot be decoded as {FOXGLOVE_GRID_TYPE}: {error}") from error
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            # The schema has the right name but other fields.
            raise InvalidMapError(f"its schema is not that of {FOXGLOVE_GRID_TYPE}: {error}") from error

    return decode


def _add_with_imports(pool: Any, files: dict[str, Any], name: str) -> None:
    """Add one file of the schema to the pool, after the files it imports; each file once."""
    file = files.pop(name, None)
    if file is not None:
        for imported in file.dependency:
            _add_with_imports(pool, files, imported)
        pool.Add(file)


@dataclass(frozen=True)
class PackedField:
    """A channel of a packed grid: its name, its offset in a cell, and the number of its numeric type."""

    name: str
    offset: int
    type: int


@dataclass(frozen=True, eq=False)
class PackedGrid:
    """A ``foxglove.Grid`` of any encoding.

    Attributes
    ----------
    stamp_ns : int
    frame_id : str
    pose : tuple of float
        Position x, y, z and quaternion x, y, z, w.
    column_count : int
    cell_size : (float, float)
        Sides of a cell along x and y, meters.
    row_stride, cell_stride : int
        Bytes from a row, and from a cell, to the next.
    fields : tuple of PackedField
    data : bytes
        The cells.
    """

    stamp_ns: int
    frame_id: str
    pose: tuple[float, ...]
    column_count: int
    cell_size: tuple[float, float]
    row_stride: int
    cell_stride: int
    fields: tuple[PackedField, ...]
    data: bytes | memoryview


def _packed(message: Any) -> PackedGrid:
    position, turn = message.pose.position, message.pose.orientation
    return PackedGrid(
        message.timestamp.seconds * 10**9 + message.timestamp.nanos,
        message.frame_id,
        (position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w),
        message.column_count,
        (message.cell_size.x, message.cell_size.y),
        message.row_stride,
        message.cell_stride,
        tuple(PackedField(field.name, field.offset, field.type) for field in message.fields),
        message.data,
    )


def grid_of(packed: PackedGrid, most_cells: int, map_warnings: Sequence[MapWarning] = ()) -> Grid | None:
    """Return the map in a packed grid; None if it has no cells.

    Raises
    ------
    InvalidMapError
        If it is no occupancy grid, or inconsistent.
    """
    if len(packed.frame_id) > LONGEST_NAME_BYTES:
        raise InvalidMapError(f"its frame_id is longer than {LONGEST_NAME_BYTES} bytes")
    side_m, other_m = packed.cell_size
    # NaN never equals anything; GridGeometry reports it below.
    if side_m != other_m and not math.isnan(side_m):
        raise InvalidMapError(f"its cells are {side_m} x {other_m} m; only square cells are supported")
    values = _channel(packed)
    check_cells(values.shape[0], values.shape[1], most_cells)
    cells = _occupancy(values)
    return make_grid(packed.stamp_ns, packed.frame_id, side_m, packed.pose, cells, list(map_warnings))


def _channel(message: PackedGrid) -> NDArray[Any]:
    """View of the occupancy channel (H, W) in the packed cells."""
    fields = {field.name: field for field in message.fields}
    if len(fields) > 1:
        fields = {name: field for name, field in fields.items() if name == _OCCUPANCY_FIELD}
    if len(fields) != 1:
        names = ", ".join(field.name for field in message.fields) or "none"
        raise InvalidMapError(
            f"its channels are {names}; it needs a single channel, or one named {_OCCUPANCY_FIELD}"
        )
    (field,) = fields.values()
    if field.type not in _NUMERIC_TYPES:
        raise InvalidMapError(f"its channel {field.name} has the unknown number type {field.type}")
    dtype = np.dtype(_NUMERIC_TYPES[field.type])
    data, columns, cell = message.data, message.column_count, message.cell_stride
    rows = len(data) // message.row_stride if message.row_stride else 0
    # The strides must stay inside the data; ndarray checks the same, with a less clear message.
    if (
        rows * message.row_stride != len(data)
        or columns * cell > message.row_stride
        or field.offset + dtype.itemsize > max(cell, 1)
    ):
        raise InvalidMapError(
            f"{columns} columns of {cell} bytes in rows of {message.row_stride} bytes, with the channel at "
            f"offset {field.offset}, do not fit its {len(data)} bytes of data"
        )
    return np.ndarray((rows, columns), dtype, data, field.offset, (message.row_stride, cell))


def _occupancy(values: NDArray[Any]) -> Cells:
    if values.dtype.kind == "f":
        if values.size and np.nanmax(values, initial=0) > 1:
            raise InvalidMapError(
                "its occupancy is floating point but exceeds 1; expected are probabilities in 0..1"
            )
        known = values >= 0
        return np.where(known, np.round(np.where(known, values, 0) * 100), UNKNOWN).astype(np.int8)
    if values.dtype.itemsize == 1:
        return np.ascontiguousarray(values).view(np.int8)
    known = (values >= 0) & (values <= 100)
    return np.where(known, values, UNKNOWN).astype(np.int8)
