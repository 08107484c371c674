"""Logs of laser scans and transforms, written by libraries that share no code with the readers under test."""

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
LEVEL = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Scan:
    """A sensor_msgs/LaserScan."""

    time_s: float
    ranges: np.ndarray
    bearings: np.ndarray
    frame: str = "laser"
    increment_s: float = 0.0
    range_min: float = 0.1
    range_max: float = 30.0
    kind = "sensor_msgs/msg/LaserScan"

    def readings(self, ros: int) -> list[Any]:
        return [self.ranges.astype(np.float32), np.zeros(0, np.float32)]


class Echoes(Scan):
    """A sensor_msgs/MultiEchoLaserScan: a second echo behind the first, none where nothing returned."""

    kind = "sensor_msgs/msg/MultiEchoLaserScan"

    def readings(self, ros: int) -> list[Any]:
        echo = typestore(ros).types["sensor_msgs/msg/LaserEcho"]
        found = [[each, each + 1] if np.isfinite(each) else [] for each in self.ranges.tolist()]
        return [[echo(np.array(each, np.float32)) for each in found], []]


@dataclass(frozen=True, eq=False)
class Move:
    """One transform of a tf2_msgs/TFMessage."""

    time_s: float
    parent: str
    child: str
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quaternion: tuple[float, float, float, float] = LEVEL
    kind = "tf2_msgs/msg/TFMessage"


Logged = tuple[str, Scan | Move]
"""Topic and message; recorded when it was stamped."""


def turned(yaw: float) -> tuple[float, float, float, float]:
    return (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))


@cache
def typestore(ros: int) -> Any:
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    if ros == 1:
        store.register(
            get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", "tf2_msgs/msg/TFMessage")
        )
    return store


def _header(ros: int, time_s: float, frame: str) -> Any:
    types = typestore(ros).types
    time_ns = START_NS + round(time_s * 1e9)
    stamp = types["builtin_interfaces/msg/Time"](time_ns // 10**9, time_ns % 10**9)
    return types["std_msgs/msg/Header"](*((7,) if ros == 1 else ()), stamp, frame)


def made(message: Scan | Move, ros: int) -> Any:
    types = typestore(ros).types
    if isinstance(message, Scan):
        first, last = message.bearings[[0, -1]].tolist()
        step = (last - first) / (len(message.bearings) - 1)
        numbers = (first, last, step, message.increment_s, 0.1, message.range_min, message.range_max)
        header = _header(ros, message.time_s, message.frame)
        return types[message.kind](header, *numbers, *message.readings(ros))
    transform = types["geometry_msgs/msg/Transform"](
        types["geometry_msgs/msg/Vector3"](*message.position),
        types["geometry_msgs/msg/Quaternion"](*message.quaternion),
    )
    stamped = types["geometry_msgs/msg/TransformStamped"](
        _header(ros, message.time_s, message.parent), message.child, transform
    )
    return types["tf2_msgs/msg/TFMessage"]([stamped])


def write_scans(path: Path, logged: Sequence[Logged]) -> Path:
    """Write ``*.mcap`` (ROS 2), ``*.bag`` (ROS 1) or a ROS 2 bag directory."""
    kinds = {topic: message.kind for topic, message in logged}
    ordered = sorted(logged, key=lambda each: each[1].time_s)
    ros = 1 if path.suffix == ".bag" else 2
    store = typestore(ros)
    if path.suffix == ".mcap":
        with path.open("wb") as stream:
            writer = Writer(stream, compression=CompressionType.NONE)
            writer.start("ros2", "test")
            channels = {}
            for topic, kind in kinds.items():
                text, _ = store.generate_msgdef(kind, ros_version=2)
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            for topic, message in ordered:
                time_ns = START_NS + round(message.time_s * 1e9)
                data = bytes(store.serialize_cdr(made(message, 2), message.kind))
                writer.add_message(channels[topic], time_ns, data, time_ns)
            writer.finish()
        return path
    with rosbag1.Writer(path) if ros == 1 else rosbag2.Writer(path, version=8) as bag:
        connections = {
            topic: bag.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()
        }
        for topic, message in ordered:
            serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
            data = bytes(serialize(made(message, ros), message.kind))
            bag.write(connections[topic], START_NS + round(message.time_s * 1e9), data)
    return path


def ranges_in_box(
    starts: np.ndarray, angles: np.ndarray, low: tuple[float, float], high: tuple[float, float]
) -> np.ndarray:
    """Distances (B,) from points inside an axis-aligned box to its walls."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rays = np.stack([np.cos(angles), np.sin(angles)], 1)
        to_walls = np.where(rays > 0, np.array(high) - starts, np.array(low) - starts) / rays
    return np.nanmin(np.where(np.abs(rays) < 1e-12, np.inf, to_walls), axis=1)
