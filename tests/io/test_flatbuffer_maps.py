"""``foxglove.Grid`` as FlatBuffers, written by the library of FlatBuffers itself."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reader_logs import START_NS, McapLog

from rose2_logs.errors import InvalidMapError
from rose2_logs.io import open_log
from rose2_logs.io.messages import decoder

flatbuffers = pytest.importorskip("flatbuffers")
UINT8, FLOAT32 = 1, 7


def table(builder: Any, fields: list[tuple[int, str, Any]], count: int) -> int:
    """Write a table of fields: number, kind as the builder names it, value."""
    builder.StartObject(count)
    for number, kind, value in fields:
        if kind == "Struct":
            made = value(builder)
            builder.PrependStructSlot(number, made, 0)
        elif kind == "UOffsetTRelative":
            builder.PrependUOffsetTRelativeSlot(number, value, 0)
        else:
            getattr(builder, f"Prepend{kind}Slot")(number, value, None)
    return builder.EndObject()


def offsets(builder: Any, made: list[int]) -> int:
    builder.StartVector(4, len(made), 4)
    for each in reversed(made):
        builder.PrependUOffsetTRelative(each)
    return builder.EndVector()


def numbers(builder: Any, values: tuple[float, ...], left_out: float | None) -> int:
    """A vector or quaternion; the builder leaves out what has the default."""
    fields = [(k, "Float64", value) for k, value in enumerate(values) if value != left_out]
    return table(builder, fields, len(values))


def long_time(builder: Any) -> int:
    builder.Prep(8, 16)
    builder.Pad(4)
    builder.PrependUint32(START_NS % 10**9 + 5)
    builder.PrependUint64(START_NS // 10**9)
    return builder.Offset()


def short_time(builder: Any) -> int:
    builder.Prep(4, 8)
    builder.PrependUint32(START_NS % 10**9 + 5)
    builder.PrependUint32(START_NS // 10**9)
    return builder.Offset()


def grid_message(
    cells: np.ndarray,
    *,
    origin: tuple[float, float, float] = (-1.5, 2.0, 0.0),
    left_out: float | None = 0.0,
    time: Any = long_time,
    kind: int = UINT8,
) -> bytes:
    builder = flatbuffers.Builder(0)
    data = builder.CreateByteVector(np.ascontiguousarray(cells).tobytes())
    name, frame = builder.CreateString("occupancy"), builder.CreateString("map")
    channel = table(builder, [(0, "UOffsetTRelative", name), (1, "Uint32", 0), (2, "Uint8", kind)], 3)
    fields = offsets(builder, [channel])
    position = numbers(builder, origin, left_out)
    turn = numbers(builder, (0.0, 0.0, 0.0, 1.0), None)
    pose = table(builder, [(0, "UOffsetTRelative", position), (1, "UOffsetTRelative", turn)], 2)
    size = numbers(builder, (0.05, 0.05), left_out)
    row = cells.shape[1] * cells.itemsize
    made = table(
        builder,
        [
            (0, "Struct", time),
            (1, "UOffsetTRelative", frame),
            (2, "UOffsetTRelative", pose),
            (3, "Uint32", cells.shape[1]),
            (4, "UOffsetTRelative", size),
            (5, "Uint32", row),
            (6, "Uint32", cells.itemsize),
            (7, "UOffsetTRelative", fields),
            (8, "UOffsetTRelative", data),
        ],
        9,
    )
    builder.Finish(made)
    return bytes(builder.Output())


def schema_with_default(default: float) -> bytes:
    """What FlatBuffers' reflection says of a vector whose parts have this default."""
    builder = flatbuffers.Builder(0)
    fields = []
    for number, part in enumerate("xyz"):
        name = builder.CreateString(part)
        fields.append(
            table(
                builder,
                [(0, "UOffsetTRelative", name), (2, "Uint16", number), (5, "Float64", default)],
                6,
            )
        )
    listed, name = offsets(builder, fields), builder.CreateString("foxglove.Vector3")
    vector = table(builder, [(0, "UOffsetTRelative", name), (1, "UOffsetTRelative", listed)], 5)
    objects = offsets(builder, [vector])
    builder.Finish(table(builder, [(0, "UOffsetTRelative", objects)], 5), b"BFBS")
    return bytes(builder.Output())


def decoded(message: bytes, schema: bytes = b""):
    decode = decoder("foxglove.Grid", "flatbuffer", schema)
    assert decode is not None
    return decode(memoryview(message))


CELLS = np.array([[255, 0, 100], [0, 0, 100]], np.uint8)


@pytest.mark.parametrize("time", [long_time, short_time], ids=["64 bits", "32 bits"])
def test_a_grid_is_read_as_it_was_written(time: Any):
    grid = decoded(grid_message(CELLS, time=time))
    assert grid.cells.tolist() == [[-1, 0, 100], [0, 0, 100]]
    assert grid.stamp_ns == START_NS + 5
    geometry = grid.geometry
    assert (geometry.resolution_m, geometry.origin_xy_m, geometry.yaw_rad) == (0.05, (-1.5, 2.0), 0.0)
    assert geometry.frame_id == "map"


@pytest.mark.parametrize("default", [0.0, 1.0])
def test_numbers_that_are_left_out_are_those_of_the_stored_schema(default: float):
    message = grid_message(CELLS, origin=(default, 0.5, default), left_out=default)
    assert decoded(message, schema_with_default(default)).geometry.origin_xy_m == (default, 0.5)


def test_probabilities_are_read_as_percent():
    cells = np.array([[0.0, 0.25, np.nan]], np.float32)
    assert decoded(grid_message(cells, kind=FLOAT32)).cells.tolist() == [[0, 25, -1]]


def test_a_log_of_them_is_read(tmp_path):
    log = McapLog(tmp_path / "run.mcap", profile="")
    for second in range(3):
        cells = np.full((40, 50), 255, np.uint8)
        cells[5:35, 5 : 20 + 10 * second] = 0
        message = grid_message(cells)
        schema = ("foxglove.Grid", "flatbuffer", schema_with_default(0.0))
        log.raw("/grid", START_NS + second * 10**9, schema, "flatbuffer", message)
    with open_log(log.close()) as reader:
        assert [int((each.cells == 0).sum()) for each in reader.snapshots()] == [450, 750, 1050]


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_a_damaged_message_is_refused_or_read_but_never_breaks(data: st.DataObject):
    message = bytearray(grid_message(CELLS))
    for _ in range(data.draw(st.integers(1, 4))):
        message[data.draw(st.integers(0, len(message) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(message)))
    schema = data.draw(st.binary(max_size=40))
    for each in (bytes(message), bytes(message[:cut])):
        with suppress(InvalidMapError):
            decoded(each, schema)
