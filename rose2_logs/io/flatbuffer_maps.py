"""Maps as FlatBuffers: ``foxglove.Grid`` by the field numbers of its public schema.

A FlatBuffer is read in place: a table points to a list of where its fields are, and a field that has its
default is left out. Only the few fields are looked up; the cells remain a view of the message.
"""

from __future__ import annotations

import struct

from rose2_logs.errors import InvalidMapError
from rose2_logs.io.foxglove_grid import PackedField, PackedGrid, grid_of
from rose2_logs.io.grids import LONGEST_NAME_BYTES, MOST_CELLS, MOST_CHANNELS, Decoder, Grid

TIMESTAMP, FRAME_ID, POSE, COLUMN_COUNT, CELL_SIZE, ROW_STRIDE, CELL_STRIDE, FIELDS, DATA = range(9)
"""Numbers of the fields of ``foxglove.Grid``."""
POSITION, ORIENTATION = range(2)
NAME, OFFSET, TYPE = range(3)
"""Numbers of the fields of ``foxglove.Pose`` and of ``foxglove.PackedElementField``."""
OBJECTS, OBJECT_NAME, OBJECT_FIELDS, NUMBER, DEFAULT = 0, 0, 1, 2, 5
"""Numbers of the fields of a stored schema (FlatBuffers' reflection): its objects, an object's name and
fields, a field's number and its default if it is a floating point number."""
MOST_OBJECTS = 4096
"""Objects of a schema, and fields of an object, that are read; more are damage."""
LONG_TIME_BYTES = 16
"""A time with seconds of 64 bits takes so many bytes; with 32 bits, as others write it, half of them."""
Defaults = dict[tuple[str, int], float]
"""Numbers that are left out where they are these, by the object's name and the field's number."""


def flatbuffer_decoder(schema: bytes = b"", most_cells: int = MOST_CELLS) -> Decoder:
    """Return the decoder of ``foxglove.Grid`` messages in FlatBuffers.

    Parameters
    ----------
    schema : bytes
        The schema stored in the log, in binary; it says which numbers are left out. In the public schema
        these were 1 for the parts of a vector once, and are 0 today, as they are taken to be without one.
    most_cells : int
        Number of cells of the largest map that is accepted.
    """
    defaults = _defaults_of(schema)

    def decode(data: memoryview) -> Grid | None:
        try:
            packed = _packed_grid(_Table.root(data), defaults)
        except struct.error as error:
            raise InvalidMapError(f"its FlatBuffer points outside of its {len(data)} bytes") from error
        return grid_of(packed, most_cells)

    return decode


def _defaults_of(schema: bytes) -> Defaults:
    """Defaults of the numbers of all objects of a schema; none if it cannot be read."""
    try:
        objects = _Table.root(memoryview(schema)).tables(OBJECTS, MOST_OBJECTS)
        return {
            (each.text(OBJECT_NAME), field.integer(NUMBER, "H")): field.double(DEFAULT)
            for each in objects
            for field in each.tables(OBJECT_FIELDS, MOST_OBJECTS)
        }
    except (struct.error, InvalidMapError):
        return {}


def _packed_grid(grid: _Table, defaults: Defaults) -> PackedGrid:
    size = grid.table(CELL_SIZE)
    if size is None:
        raise InvalidMapError("its FlatBuffer has no cell_size; is it a foxglove.Grid?")
    fields = grid.tables(FIELDS, MOST_CHANNELS)
    width, height = size.doubles(2, "foxglove.Vector2", defaults)
    return PackedGrid(
        grid.time_ns(TIMESTAMP),
        grid.text(FRAME_ID),
        _pose(grid.table(POSE), defaults),
        grid.integer(COLUMN_COUNT, "I"),
        (width, height),
        grid.integer(ROW_STRIDE, "I"),
        grid.integer(CELL_STRIDE, "I"),
        tuple(
            PackedField(each.text(NAME), each.integer(OFFSET, "I"), each.integer(TYPE, "B"))
            for each in fields
        ),
        grid.octets(DATA),
    )


def _pose(pose: _Table | None, defaults: Defaults) -> tuple[float, ...]:
    """Position x, y, z and quaternion x, y, z, w; no pose is that at the origin."""
    position = None if pose is None else pose.table(POSITION)
    turn = None if pose is None else pose.table(ORIENTATION)
    place = (0.0, 0.0, 0.0) if position is None else position.doubles(3, "foxglove.Vector3", defaults)
    # Whatever the schema, an orientation of which nothing is written is none at all.
    unturned = {("foxglove.Quaternion", 3): 1.0} | defaults
    around = (0.0, 0.0, 0.0, 1.0) if turn is None else turn.doubles(4, "foxglove.Quaternion", unturned)
    return (*place, *around)


class _Table:
    """A table of a FlatBuffer; every method raises `struct.error` if something lies outside of the data."""

    def __init__(self, data: memoryview, place: int) -> None:
        self._data, self._place = data, place
        self._fields = place - self._number("i", place)
        size, self._bytes = (self._number("H", self._fields + at) for at in (0, 2))
        self._count = max(size // 2 - 2, 0)

    @classmethod
    def root(cls, data: memoryview) -> _Table:
        """Return the table that a message begins with."""
        (place,) = struct.unpack_from("<I", data)
        return cls(data, place)

    def _number(self, code: str, place: int) -> int:
        if place < 0:  # counted from the end by struct
            raise struct.error("before the data")
        return int(struct.unpack_from(f"<{code}", self._data, place)[0])

    def _where(self, field: int) -> int | None:
        """Place of a field in the data; None if it is left out."""
        offset = self._offset(field)
        return self._place + offset if offset else None

    def _offset(self, field: int) -> int:
        return self._number("H", self._fields + 4 + 2 * field) if field < self._count else 0

    def _target(self, field: int) -> int | None:
        """Where something lies that a field points to."""
        where = self._where(field)
        return None if where is None else where + self._number("I", where)

    def integer(self, field: int, code: str) -> int:
        """Read an integer of a `struct` type; 0 if it is left out."""
        where = self._where(field)
        return 0 if where is None else self._number(code, where)

    def double(self, field: int, default: float = 0.0) -> float:
        """Read a number of double precision."""
        where = self._where(field)
        return default if where is None else float(struct.unpack_from("<d", self._data, where)[0])

    def doubles(self, count: int, name: str, defaults: Defaults) -> tuple[float, ...]:
        """Read the first numbers of an object of this name."""
        return tuple(self.double(k, defaults.get((name, k), 0.0)) for k in range(count))

    def table(self, field: int) -> _Table | None:
        """Return another table."""
        target = self._target(field)
        return None if target is None else _Table(self._data, target)

    def tables(self, field: int, most: int) -> list[_Table]:
        """Return a list of tables, of at most so many."""
        target = self._target(field)
        if target is None:
            return []
        count = self._number("I", target)
        if count > most:
            raise InvalidMapError(f"it claims a list of {count} tables, more than {most}")
        places = range(target + 4, target + 4 + 4 * count, 4)
        return [_Table(self._data, place + self._number("I", place)) for place in places]

    def text(self, field: int) -> str:
        """Read a name."""
        octets = self.octets(field)
        if len(octets) > LONGEST_NAME_BYTES:
            raise InvalidMapError(f"it has a name of {len(octets)} bytes, more than {LONGEST_NAME_BYTES}")
        return octets.tobytes().decode("utf-8", errors="replace")

    def octets(self, field: int) -> memoryview:
        """Read a string or an array of bytes, without a copy; empty if it is left out."""
        target = self._target(field)
        if target is None:
            return self._data[:0]
        count, begin = self._number("I", target), target + 4
        if begin + count > len(self._data):
            raise struct.error("beyond the data")
        return self._data[begin : begin + count]

    def time_ns(self, field: int) -> int:
        """Read a time, whose seconds have 64 or 32 bits: by the space up to the next field."""
        where, offset = self._where(field), self._offset(field)
        if where is None:
            return 0
        behind = [each for each in map(self._offset, range(self._count)) if each > offset]
        is_long = min(behind, default=self._bytes) - offset >= LONG_TIME_BYTES
        seconds, rest = struct.unpack_from("<QI" if is_long else "<II", self._data, where)
        return int(seconds) * 10**9 + int(rest)
