"""Map messages decoded from bytes that rosbags and protobuf wrote."""

import base64
import json
import math

import numpy as np
import pytest
from foxglove_grids import SCHEMA, foxglove_message
from hypothesis import given, settings
from hypothesis import strategies as st
from reader_logs import START_NS, Map, Update, pose, serialized, serialized_costmap, typestore
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rose2_logs.errors import InvalidMapError
from rose2_logs.io.cell_values import STORED
from rose2_logs.io.grids import Grid, Patch, flat_yaw_of
from rose2_logs.io.messages import decoder

GRID = "nav_msgs/msg/OccupancyGrid"
ENCODINGS = {1: "ros1", 2: "cdr"}


def decode(data: bytes, message_type: str = GRID, encoding: str = "cdr", schema: bytes = b""):
    found = decoder(message_type, encoding, schema)
    assert found is not None
    return found(memoryview(data))


@settings(max_examples=60)
@given(
    ros=st.sampled_from([1, 2]),
    little_endian=st.booleans(),
    shape=st.tuples(st.integers(1, 5), st.integers(1, 7)),
    frame=st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9),
    yaw=st.floats(-3.1, 3.1),
    origin=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)),
    resolution=st.sampled_from([0.01, 0.025, 0.05, 0.1, 1.0]),
    stamp_ns=st.integers(0, 2**31 * 10**9 - 1),
    seed=st.integers(0, 9),
)
def test_a_grid_of_either_ros_and_byte_order_comes_back_as_it_was_written(
    ros, little_endian, shape, frame, yaw, origin, resolution, stamp_ns, seed
):
    cells = np.random.default_rng(seed).integers(-1, 101, shape).astype(np.int8)
    written = Map(cells, resolution, origin, yaw, frame, stamp_ns)
    grid = decode(serialized(written, ros, little_endian), encoding=ENCODINGS[ros])
    assert isinstance(grid, Grid)
    np.testing.assert_array_equal(grid.cells, cells)
    assert grid.cells.dtype == np.int8
    assert grid.cells.flags.c_contiguous
    geometry = grid.geometry
    assert (grid.stamp_ns, geometry.frame_id, geometry.origin_xy_m) == (stamp_ns, frame, origin)
    assert geometry.resolution_m == resolution, "the nearest short decimal of the single-precision field"
    assert math.isclose(geometry.yaw_rad, yaw, abs_tol=1e-12)


@pytest.mark.parametrize("ros", [1, 2])
def test_the_cells_are_a_view_of_the_message_not_a_copy(ros):
    data = bytearray(serialized(Map(np.zeros((2, 3))), ros))
    grid = decode(data, encoding=ENCODINGS[ros])
    data[-1] = 42
    assert grid.cells[-1, -1] == 42


@pytest.mark.parametrize("ros", [1, 2])
def test_a_message_cut_anywhere_is_an_invalid_map_and_nothing_else(ros):
    data = serialized(Map(np.zeros((2, 3))), ros)
    for length in range(len(data)):
        with pytest.raises(InvalidMapError):
            decode(data[:length], encoding=ENCODINGS[ros])


@pytest.mark.parametrize(
    ("width", "height"), [(4, 3), (2, 2), (2**32 - 1, 2**32 - 1), (0, 5)], ids=["4x3", "2x2", "huge", "0x5"]
)
def test_a_size_that_is_not_that_of_the_data_is_an_error(width, height):
    store = typestore(2)
    message = store.deserialize_cdr(serialized(Map(np.zeros((2, 3))), 2), GRID)
    message.info.width, message.info.height = width, height
    with pytest.raises(InvalidMapError, match=f"{width} x {height} cells, but its data has 6"):
        decode(bytes(store.serialize_cdr(message, GRID)))


def test_a_grid_without_cells_is_no_map_and_its_zero_resolution_no_error():
    assert decode(serialized(Map(np.zeros((0, 0)), resolution=0.0), 2)) is None


@pytest.mark.parametrize("resolution", [0.0, -0.05, math.nan, math.inf])
def test_a_resolution_that_is_no_positive_number_is_an_error(resolution):
    with pytest.raises(InvalidMapError, match="resolution"):
        decode(serialized(Map(np.zeros((2, 3)), resolution=resolution), 2))


@pytest.mark.parametrize("origin", [(math.nan, 0.0), (0.0, math.inf)])
def test_an_origin_that_is_not_finite_is_an_error(origin):
    with pytest.raises(InvalidMapError, match="origin"):
        decode(serialized(Map(np.zeros((2, 3)), origin=origin), 2))


@pytest.mark.parametrize(
    ("quaternion", "yaw"),
    [((0, 0, 0, 0), 0.0), ((0, 0, 2, 2), math.pi / 2), ((0, 0, -1, 1e-9), -math.pi), ((0, 0, 0, -1), 0.0)],
    ids=["left unset", "not of length 1", "half a turn", "negative"],
)
def test_any_quaternion_about_z_gives_its_yaw(quaternion, yaw):
    store = typestore(2)
    message = store.deserialize_cdr(serialized(Map(np.zeros((2, 3))), 2), GRID)
    turn = message.info.origin.orientation
    turn.x, turn.y, turn.z, turn.w = map(float, quaternion)
    grid = decode(bytes(store.serialize_cdr(message, GRID)))
    difference = grid.geometry.yaw_rad - yaw
    assert abs(math.remainder(difference, 2 * math.pi)) < 1e-6


@pytest.mark.parametrize(("written", "read"), [(3.5, 3.5), (math.nan, 0.0), (math.inf, 0.0)])
def test_a_grid_has_the_height_of_its_origin(written, read):
    """Rooms do not depend on it, so that a height that is none costs no map."""
    store = typestore(2)
    message = store.deserialize_cdr(serialized(Map(np.zeros((2, 3))), 2), GRID)
    message.info.origin.position.z = written
    assert decode(bytes(store.serialize_cdr(message, GRID))).z_m == read


def test_values_outside_the_range_of_occupancy_count_as_unknown():
    cells = np.array([[-128, -2, -1, 0, 100, 101, 127]], np.int8)
    read = STORED.of(decode(serialized(Map(cells), 2)))
    assert read.cells.tolist() == [[-1, -1, -1, 0, 100, -1, -1]]
    assert [each.kind for each in read.map_warnings] == ["odd_values"]


def test_bytes_that_are_not_cdr_are_an_error():
    with pytest.raises(InvalidMapError, match="CDR"):
        decode(b"\x00\x09\x00\x00" + bytes(100))


@pytest.mark.parametrize("ros", [1, 2])
def test_a_patch_comes_back_with_its_place_and_values(ros):
    cells = np.array([[1, 2, 3], [4, 5, -1]], np.int8)
    data = serialized(Update(5, 7, cells), ros)
    patch = decode(data, "map_msgs/OccupancyGridUpdate", ENCODINGS[ros])
    assert isinstance(patch, Patch)
    assert (patch.row, patch.column, patch.stamp_ns) == (7, 5, START_NS)
    np.testing.assert_array_equal(patch.cells, cells)


def test_costs_of_nav2_become_percent_in_their_order():
    costs = np.arange(256, dtype=np.uint8).reshape(16, 16)
    grid = decode(serialized_costmap(costs), "nav2_msgs/msg/Costmap")
    percent = grid.cells.ravel()
    assert (percent[0], percent[1], percent[252], percent[253], percent[254], percent[255]) == (
        0, 1, 98, 99, 100, -1,
    )  # fmt: skip
    assert (np.diff(percent[:255].astype(int)) >= 0).all()
    assert grid.geometry.frame_id == "odom"
    assert grid.geometry.origin_xy_m == (1.0, 2.0)


@pytest.mark.parametrize(
    ("message_type", "encoding"),
    [("nav2_msgs/msg/Costmap", "json"), ("sensor_msgs/msg/Image", "cdr"), ("foxglove.Grid", "ros1")],
)
def test_other_types_and_encodings_are_not_maps(message_type, encoding):
    assert decoder(message_type, encoding) is None


@pytest.mark.parametrize("padding", [0, 3])
@pytest.mark.parametrize(
    ("dtype", "kind", "values", "expected"),
    [
        ("u1", 1, [[0, 50, 100], [255, 101, 7]], [[0, 50, 100], [-1, -1, 7]]),
        ("i1", 2, [[0, 50, 100], [-1, 101, 7]], [[0, 50, 100], [-1, -1, 7]]),
        ("<i4", 6, [[0, 50, 100], [-1, 1000, 7]], [[0, 50, 100], [-1, -1, 7]]),
        ("<f4", 7, [[0, 0.5, 1], [math.nan, -1, 0.07]], [[0, 50, 100], [-1, -1, 7]]),
    ],
)
def test_a_foxglove_grid_of_one_channel_becomes_percent(padding, dtype, kind, values, expected):
    message = foxglove_message(np.array(values, dtype), kind, padding=padding)
    grid = STORED.of(decode(message.SerializeToString(), "foxglove.Grid", "protobuf", SCHEMA))
    assert grid.cells.tolist() == expected
    assert grid.cells.dtype == np.int8
    assert grid.cells.flags.c_contiguous
    assert grid.stamp_ns == 12_000_000_034
    assert grid.geometry.origin_xy_m == (1.5, -2.5)
    assert (grid.geometry.resolution_m, grid.geometry.frame_id) == (0.1, "odom")
    assert math.isclose(grid.geometry.yaw_rad, 0.4)


def two_channels(grid):
    grid.fields.add(name="height", offset=0, type=1)
    grid.fields[0].name = "cost"


@pytest.mark.parametrize(
    ("spoil", "match"),
    [
        (lambda grid: setattr(grid.cell_size, "y", 0.2), "square"),
        (lambda grid: grid.ClearField("fields"), "channels are none"),
        (two_channels, "channels are cost, height"),
        (lambda grid: setattr(grid, "row_stride", 4), "do not fit"),
        (lambda grid: setattr(grid, "column_count", 100), "do not fit"),
        (lambda grid: setattr(grid.fields[0], "offset", 1), "do not fit"),
        (lambda grid: setattr(grid.fields[0], "type", 0), "number type"),
    ],
    ids=["oblong cells", "no channel", "two channels", "row stride", "columns", "offset", "number type"],
)
def test_a_foxglove_grid_that_contradicts_itself_is_an_error(spoil, match):
    message = foxglove_message(np.zeros((2, 3), np.uint8), 1)
    spoil(message)
    with pytest.raises(InvalidMapError, match=match):
        decode(message.SerializeToString(), "foxglove.Grid", "protobuf", SCHEMA)


def test_broken_protobuf_is_an_error():
    with pytest.raises(InvalidMapError, match="cannot be decoded"):
        decode(b"\x0a\xff\xff", "foxglove.Grid", "protobuf", SCHEMA)
    with pytest.raises(InvalidMapError, match="schema"):
        decoder("foxglove.Grid", "protobuf", b"\x0a\xff\xff")


@pytest.mark.parametrize("degrees", [4.0, 10.0, 90.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_map_that_is_tilted_about_either_axis_is_no_flat_one(axis, degrees):
    """By some degrees it is, and keeps its yaw: its lengths are right to half a percent."""
    quaternion = [0.0, 0.0, 0.0, math.cos(math.radians(degrees) / 2)]
    quaternion[axis] = math.sin(math.radians(degrees) / 2)
    if degrees < 5:
        assert flat_yaw_of(tuple(quaternion), []) == pytest.approx(0.0, abs=1e-6)
    else:
        with pytest.raises(InvalidMapError, match=f"tilted by {degrees:.0f} degrees"):
            flat_yaw_of(tuple(quaternion), [])


CELLS = np.array([[0, 100, -1], [50, 0, -1]], np.int8)
PLACE = {
    "position": {"x": 1.5, "y": -2.5, "z": 0},
    "orientation": {"x": 0, "y": 0, "z": math.sin(0.2), "w": math.cos(0.2)},
}


def foxglove_json(**changes):
    return {
        "timestamp": {"sec": 12, "nsec": 34},
        "frame_id": "odom",
        "pose": PLACE,
        "column_count": 3,
        "cell_size": {"x": 0.1, "y": 0.1},
        "row_stride": 3,
        "cell_stride": 1,
        "fields": [{"name": "occupancy", "offset": 0, "type": 2}],
        "data": base64.b64encode(CELLS.tobytes()).decode(),
    } | changes


def grid_json(**changes):
    return {
        "header": {"stamp": {"sec": 12, "nanosec": 34}, "frame_id": "odom"},
        "info": {"resolution": 0.1, "width": 3, "height": 2, "origin": PLACE},
        "data": CELLS.ravel().tolist(),
    } | changes


def is_as_written(grid):
    assert grid.cells.tolist() == CELLS.tolist()
    assert grid.stamp_ns == 12_000_000_034
    assert grid.geometry.origin_xy_m == (1.5, -2.5)
    assert (grid.geometry.resolution_m, grid.geometry.frame_id) == (0.1, "odom")
    assert math.isclose(grid.geometry.yaw_rad, 0.4)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("foxglove.Grid", foxglove_json()),
        ("foxglove_msgs/msg/Grid", foxglove_json()),
        ("foxglove.Grid", foxglove_json(fields=[{"name": "any", "offset": 0, "type": "INT8"}])),
        (GRID, grid_json()),
        (GRID, grid_json(data=base64.b64encode(CELLS.tobytes()).decode())),
        (GRID, grid_json(data=CELLS.view(np.uint8).ravel().tolist())),
        (GRID, grid_json(data=CELLS.ravel().astype(float).tolist())),
        (GRID, grid_json(header={"stamp": {"secs": 12, "nsecs": 34}, "frame_id": "odom"})),
    ],
)
def test_maps_in_json_are_read(kind, message):
    is_as_written(decode(json.dumps(message).encode(), kind, "json"))


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        (GRID, "[]"),
        (GRID, "{"),
        (GRID, "\xff"),
        (GRID, json.dumps(grid_json(data=[0] * 5))),
        (GRID, json.dumps(grid_json(data=["a"] * 6))),
        (GRID, json.dumps(grid_json(data=[300, 0, 0, 0, 0, 0]))),
        (GRID, json.dumps(grid_json(data=[-129, 0, 0, 0, 0, 0]))),
        (GRID, json.dumps(grid_json(data=[0.4, 0, 0, 0, 0, 0]))),
        (GRID, json.dumps(grid_json(data=[math.nan, 0, 0, 0, 0, 0]))),
        (GRID, json.dumps(grid_json(info={}))),
        (GRID, json.dumps(grid_json(info=grid_json()["info"] | {"width": 2**40}))),
        ("foxglove.Grid", json.dumps(foxglove_json(data="?"))),
        ("foxglove.Grid", json.dumps(foxglove_json(row_stride=4))),
        ("foxglove.Grid", json.dumps(foxglove_json(fields=[]))),
        ("foxglove.Grid", "[" * 100_000),
    ],
)
def test_other_json_is_an_invalid_map_and_nothing_else(kind, text):
    with pytest.raises(InvalidMapError):
        decode(text.encode("latin-1"), kind, "json")


FOXGLOVE_ROS = """
builtin_interfaces/Time timestamp
string frame_id
geometry_msgs/Pose pose
uint32 column_count
foxglove_msgs/Vector2 cell_size
uint32 row_stride
uint32 cell_stride
foxglove_msgs/PackedElementField[] fields
uint8[] data
"""


@pytest.mark.parametrize("ros", [1, 2])
def test_foxglove_grids_of_ros_are_read(ros):
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    store.register(
        get_types_from_msg("float64 x\nfloat64 y\n", "foxglove_msgs/msg/Vector2")
        | get_types_from_msg(
            "string name\nuint32 offset\nuint8 type\n", "foxglove_msgs/msg/PackedElementField"
        )
        | get_types_from_msg(FOXGLOVE_ROS, "foxglove_msgs/msg/Grid")
    )
    types = store.types
    message = types["foxglove_msgs/msg/Grid"](
        types["builtin_interfaces/msg/Time"](12, 34),
        "odom",
        pose(ros, (1.5, -2.5), 0.4),
        3,
        types["foxglove_msgs/msg/Vector2"](0.1, 0.1),
        3,
        1,
        [types["foxglove_msgs/msg/PackedElementField"]("occupancy", 0, 2)],
        CELLS.view(np.uint8).ravel(),
    )
    serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    data = bytes(serialize(message, "foxglove_msgs/msg/Grid"))
    is_as_written(decode(data, "foxglove_msgs/msg/Grid", ENCODINGS[ros]))
    for length in range(0, len(data), 7):
        with pytest.raises(InvalidMapError):
            decode(data[:length], "foxglove_msgs/msg/Grid", ENCODINGS[ros])


@pytest.mark.parametrize(
    "name",
    [
        "nav_msgs::msg::dds_::OccupancyGrid_",
        "nav_msgs/msg/dds_/OccupancyGrid_",
        "nav_msgs::msg::OccupancyGrid",
    ],
)
def test_type_names_may_be_spelled_as_dds_does(name):
    assert decode(serialized(Map(CELLS), 2), name).cells.tolist() == CELLS.tolist()
