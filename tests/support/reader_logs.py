"""Logs for the tests, written by libraries that share no code with the readers under test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START_NS = 1_700_000_000_123_456_789
SHARED = Path(__file__).parents[3] / "shared"

UPDATE = "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"
COSTMAP_METADATA = (
    "builtin_interfaces/Time map_load_time\nbuiltin_interfaces/Time update_time\nstring layer\n"
    "float32 resolution\nuint32 size_x\nuint32 size_y\ngeometry_msgs/Pose origin\n"
)
COSTMAP = "std_msgs/Header header\nnav2_msgs/CostmapMetaData metadata\nuint8[] data\n"
COSTMAP_UPDATE = "std_msgs/Header header\nuint32 x\nuint32 y\nuint32 size_x\nuint32 size_y\nuint8[] data\n"


@dataclass(frozen=True, eq=False)
class Map:
    """A nav_msgs/OccupancyGrid."""

    cells: np.ndarray
    resolution: float = 0.05
    origin: tuple[float, float] = (-1.0, 2.0)
    yaw: float = 0.0
    frame: str = "map"
    stamp_ns: int = START_NS


@dataclass(frozen=True, eq=False)
class Update:
    """A map_msgs/OccupancyGridUpdate."""

    column: int
    row: int
    cells: np.ndarray
    frame: str = "map"
    stamp_ns: int = START_NS


@dataclass(frozen=True)
class Text:
    """A std_msgs/String: traffic beside the maps."""

    text: str


Message = Map | Update | Text
Logged = tuple[str, int, Message]


@cache
def typestore(ros: int) -> Any:
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    types = get_types_from_msg(UPDATE, "map_msgs/msg/OccupancyGridUpdate")
    if ros == 2:
        types |= get_types_from_msg(COSTMAP_METADATA, "nav2_msgs/msg/CostmapMetaData")
        types |= get_types_from_msg(COSTMAP, "nav2_msgs/msg/Costmap")
        types |= get_types_from_msg(COSTMAP_UPDATE, "nav2_msgs/msg/CostmapUpdate")
    store.register(types)
    return store


def message_type(message: Message) -> str:
    return {
        Map: "nav_msgs/msg/OccupancyGrid",
        Update: "map_msgs/msg/OccupancyGridUpdate",
        Text: "std_msgs/msg/String",
    }[type(message)]


def _header(ros: int, stamp_ns: int, frame: str) -> Any:
    types = typestore(ros).types
    stamp = types["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9)
    sequence = (7,) if ros == 1 else ()
    return types["std_msgs/msg/Header"](*sequence, stamp, frame)


def pose(ros: int, origin: tuple[float, float], yaw: float) -> Any:
    types = typestore(ros).types
    return types["geometry_msgs/msg/Pose"](
        types["geometry_msgs/msg/Point"](*origin, 0.0),
        types["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
    )


def serialized(message: Message, ros: int, little_endian: bool = True) -> bytes:
    store = typestore(ros)
    types = store.types
    match message:
        case Map():
            height, width = message.cells.shape
            made = types["nav_msgs/msg/OccupancyGrid"](
                _header(ros, message.stamp_ns, message.frame),
                types["nav_msgs/msg/MapMetaData"](
                    types["builtin_interfaces/msg/Time"](0, 0),
                    message.resolution,
                    width,
                    height,
                    pose(ros, message.origin, message.yaw),
                ),
                message.cells.astype(np.int8).ravel(),
            )
        case Update():
            height, width = message.cells.shape
            made = types["map_msgs/msg/OccupancyGridUpdate"](
                _header(ros, message.stamp_ns, message.frame),
                message.column,
                message.row,
                width,
                height,
                message.cells.astype(np.int8).ravel(),
            )
        case Text():
            made = types["std_msgs/msg/String"](message.text)
    if ros == 1:
        return bytes(store.serialize_ros1(made, message_type(message)))
    return bytes(store.serialize_cdr(made, message_type(message), little_endian=little_endian))


def serialized_costmap(costs: np.ndarray, *, ros: int = 2) -> bytes:
    types = typestore(ros).types
    time = types["builtin_interfaces/msg/Time"](0, 0)
    metadata = types["nav2_msgs/msg/CostmapMetaData"](
        time, time, "obstacles", 0.05, costs.shape[1], costs.shape[0], pose(ros, (1.0, 2.0), 0.0)
    )
    made = types["nav2_msgs/msg/Costmap"](
        _header(ros, START_NS, "odom"), metadata, costs.astype(np.uint8).ravel()
    )
    return bytes(typestore(ros).serialize_cdr(made, "nav2_msgs/msg/Costmap"))


def write_bag(
    path: Path, messages: Sequence[Logged], compression: str = "NONE", chunk_bytes: int = 1
) -> Path:
    """Write a ROS 1 bag; compression NONE, BZ2 or LZ4. By default a chunk for each message, as maps have."""
    writer = rosbag1.Writer(path)
    if compression != "NONE":
        writer.set_compression(rosbag1.Writer.CompressionFormat[compression])
    writer.chunk_threshold = chunk_bytes
    with writer:
        connections: dict[str, Any] = {}
        for topic, time, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, message_type(message), typestore=typestore(1)
                )
            writer.write(connections[topic], time, serialized(message, 1))
    return path


def write_rosbag2(
    path: Path, messages: Sequence[Logged], storage: str = "SQLITE3", compression: str = "NONE"
) -> Path:
    """Write a ROS 2 bag directory; storage SQLITE3 or MCAP, compression NONE, FILE, MESSAGE or STORAGE."""
    writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[storage])
    writer.set_compression(rosbag2.CompressionMode[compression], rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, time, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, message_type(message), typestore=typestore(2)
                )
            writer.write(connections[topic], time, serialized(message, 2))
    return path


class McapLog:
    """Writes an MCAP file of mixed channels; `options` are those of mcap's Writer."""

    def __init__(self, path: Path, profile: str = "ros2", **options: Any) -> None:
        self.path = path
        self._file = path.open("wb")
        # One chunk for each map, unless asked otherwise.
        options = {"chunk_size": 1, "compression": CompressionType.ZSTD} | options
        self._writer = Writer(self._file, **options)
        self._writer.start(profile=profile)
        self._channels: dict[tuple[str, str, str], int] = {}

    def raw(self, topic: str, time: int, schema: tuple[str, str, bytes], encoding: str, data: bytes) -> None:
        key = (topic, schema[0], encoding)
        if key not in self._channels:
            schema_id = self._writer.register_schema(schema[0], schema[1], schema[2])
            self._channels[key] = self._writer.register_channel(topic, encoding, schema_id)
        self._writer.add_message(self._channels[key], time, data, time)

    def add(self, topic: str, time: int, message: Message, ros: int = 2) -> None:
        name = message_type(message)
        definition = typestore(ros).generate_msgdef(name, ros_version=ros)[0].encode()
        if ros == 1:
            self.raw(
                topic,
                time,
                (name.replace("/msg/", "/"), "ros1msg", definition),
                "ros1",
                serialized(message, 1),
            )
        else:
            self.raw(topic, time, (name, "ros2msg", definition), "cdr", serialized(message, 2))

    def close(self) -> Path:
        self._writer.finish()
        self._file.close()
        return self.path


def write_mcap(path: Path, messages: Sequence[Logged], ros: int = 2, **options: Any) -> Path:
    log = McapLog(path, profile=f"ros{ros}", **options)
    for topic, time, message in messages:
        log.add(topic, time, message, ros)
    return log.close()


def growing_maps(count: int = 6, seed: int = 1, frame: str = "map") -> list[Map]:
    """Maps of a run: the known area, the canvas and the origin grow from one to the next."""
    rng = np.random.default_rng(seed)
    maps = []
    for k in range(count):
        cells = np.full((20 + 2 * k, 30 + k), -1, np.int8)
        cells[2 : 8 + 2 * k, 3 : 13 + k] = rng.choice([0, 0, 37, 100], (6 + 2 * k, 10 + k))
        maps.append(
            Map(cells, origin=(-1.0 - 0.05 * k, 2.0), frame=frame, stamp_ns=START_NS + k * 10**10 - 5 * 10**8)
        )
    return maps


def run_of_maps(count: int = 6, topic: str = "/map") -> list[Logged]:
    """A map every ten seconds with other traffic in between."""
    messages: list[Logged] = []
    for k, each in enumerate(growing_maps(count)):
        messages.append((topic, START_NS + k * 10**10, each))
        messages.append(("/chatter", START_NS + k * 10**10 + 10**9, Text(f"map {k}")))
    return messages
