"""The robot's path over a log: from its transforms, else its odometry, else its poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from rose2_logs.errors import InvalidMapError
from rose2_logs.io.grids import yaw_of
from rose2_logs.io.messages import CdrFields, Fields, Ros1Fields, ros_type
from rose2_logs.io.source import DamagedMessageError, LoggedBytes, LogInfo, MessageSource
from rose2_logs.model.occupancy import FloatArray

TRANSFORM_TYPES = ("tf2_msgs/TFMessage", "tf/tfMessage")
ODOMETRY_TYPES = ("nav_msgs/Odometry",)
POSE_TYPES = ("geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped")
BASE_FRAMES = ("base_link", "base_footprint", "base", "base_frame")
"""Frames of a mobile base (REP 105, REP 120, and common drivers), the most common first."""
REQUESTED_POSES = ("goal", "initial")
"""Topics with this in their name carry requested poses, not where the robot was."""
POSE_STEP_S = 0.25
"""Minimum time between two poses: at 0.8 m/s a robot moves `POSE_STEP_M` in this time."""
POSE_STEP_M = 0.2
"""Minimum distance between two poses: well below the width of a door."""
LEAD_NS = 10 * 10**9
"""Transforms are read from this long before the first pose on: slow ones are published every second."""
TRIED_MESSAGES = 3000
"""If a log's transforms connect the map to the robot, they do so within this many of its first messages."""

Pose = tuple[float, float, float]
"""x, y in meters, yaw in radians."""


@dataclass(frozen=True)
class _Edge:
    """A frame's parent, and the frame's pose in its parent."""

    parent: str
    pose: Pose


class RobotPath:
    """The robot's poses in the frame of the map, read once in log time order.

    Parameters
    ----------
    source : MessageSource
        The log.
    frame_id : str
        Frame of the map.
    start_ns : int, optional
        Earlier poses are skipped.

    Attributes
    ----------
    origin : str
        Topics that the poses come from; empty if the log does not say where the robot was.
    """

    def __init__(self, source: MessageSource, frame_id: str, start_ns: int | None = None) -> None:
        self._start_ns = start_ns or 0
        topics, poses = _choose(source, _plain(frame_id) or "map", self._start_ns)
        self.origin = ", ".join(topics)
        self._poses = poses
        self._next: tuple[int, Pose] | None = next(self._poses, None)
        self._last: Pose | None = None

    def until(self, log_time_ns: int) -> FloatArray:
        """Return the poses since the previous call.

        Returns
        -------
        (K, 3) float
            x, y in meters and yaw in radians; consecutive poses are at least `POSE_STEP_M` apart.
        """
        taken = []
        while self._next is not None and self._next[0] <= log_time_ns:
            time_ns, pose = self._next
            if time_ns >= self._start_ns and (
                self._last is None or math.dist(pose[:2], self._last[:2]) >= POSE_STEP_M
            ):
                taken.append(pose)
                self._last = pose
            self._next = next(self._poses, None)
        return np.array(taken, float).reshape(-1, 3)


def _choose(
    source: MessageSource, frame: str, start_ns: int
) -> tuple[tuple[str, ...], Iterator[tuple[int, Pose]]]:
    """Topics that say where the robot was, and its poses."""
    transforms = _topics(source.info, TRANSFORM_TYPES)
    tried = _transformed(islice(source.stream(transforms), TRIED_MESSAGES), frame, 0)
    if transforms and next(tried, None) is not None:
        return transforms, _transformed(source.stream(transforms), frame, start_ns)
    for types, read in ((ODOMETRY_TYPES, _odometry), (POSE_TYPES, _pose)):
        topics = _topics(source.info, types)
        # The topic with the most messages is the robot's own.
        counts = {item.name: item.message_count or 0 for item in source.info.topics}
        if topics := tuple(sorted(topics, key=lambda name: (-counts[name], name))[:1]):
            return topics, _posed(source.stream(topics), read, start_ns)
    return (), iter(())


def _topics(info: LogInfo, types: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(
        topic.name
        for topic in info.topics
        if ros_type(topic.message_type) in types
        and topic.encoding in ("cdr", "ros1")
        and topic.message_count != 0
        and not any(word in topic.name for word in REQUESTED_POSES)
    )


def _transformed(messages: Iterator[LoggedBytes], frame: str, start_ns: int) -> Iterator[tuple[int, Pose]]:
    """Follow the transforms from the map's frame to that of the robot's base."""
    edges: dict[str, _Edge] = {}
    # The chain of frames from the map to the robot; other transforms, as of joints and sensors, are skipped.
    chain: tuple[bytes, ...] = ()
    latest_ns: int | None = None
    for message in messages:
        if message.log_time_ns < start_ns - LEAD_NS and "static" not in message.topic:
            continue
        data = _data(message)
        if data is None or (chain and not any(child in data for child in chain)):
            continue
        try:
            edges |= _transforms(_fields(message, data))
        except InvalidMapError:
            continue
        if latest_ns is not None and message.log_time_ns - latest_ns < POSE_STEP_S * 1e9:
            continue
        pose, children = _base_in(frame, edges)
        chain = tuple(child.encode() for child in children)
        if pose is not None:
            latest_ns = message.log_time_ns
            yield message.log_time_ns, pose


def _posed(
    messages: Iterator[LoggedBytes], read: Callable[[Fields], Pose], start_ns: int
) -> Iterator[tuple[int, Pose]]:
    latest_ns: int | None = None
    for message in messages:
        time_ns = message.log_time_ns
        if time_ns < start_ns or (latest_ns is not None and time_ns - latest_ns < POSE_STEP_S * 1e9):
            continue
        data = _data(message)
        if data is None:
            continue
        try:
            pose = read(_fields(message, data))
        except InvalidMapError:
            continue
        if all(map(math.isfinite, pose)):
            latest_ns = time_ns
            yield time_ns, pose


def _data(message: LoggedBytes) -> bytes | None:
    try:
        return bytes(message.data())
    except DamagedMessageError:
        return None


def _fields(message: LoggedBytes, data: bytes) -> Fields:
    return (CdrFields if message.encoding == "cdr" else Ros1Fields)(memoryview(data))


def _transforms(fields: Fields) -> dict[str, _Edge]:
    """Transforms of a message, by child frame."""
    edges = {}
    for _ in range(fields.integers("I")[0]):
        _, parent = fields.header()
        child = _plain(fields.string("child_frame_id"))
        pose = _planar(fields)
        if all(map(math.isfinite, pose)):
            edges[child] = _Edge(_plain(parent), pose)
    return edges


def _odometry(fields: Fields) -> Pose:
    fields.header()
    fields.string("child_frame_id")
    return _planar(fields)


def _pose(fields: Fields) -> Pose:
    fields.header()
    return _planar(fields)


def _planar(fields: Fields) -> Pose:
    """Read a position and a quaternion, projected to the plane."""
    x, y, _, *quaternion = fields.numbers("d", 7)
    return x, y, yaw_of(*quaternion)


def _base_in(frame: str, edges: dict[str, _Edge]) -> tuple[Pose | None, tuple[str, ...]]:
    """Pose of the robot's base in a frame, and the chain of frames from the base up to it."""
    for base in BASE_FRAMES:
        # With several robots, frame names start with the robot's name.
        for name in sorted(each for each in edges if each.rsplit("/", 1)[-1] == base):
            pose, children = edges[name].pose, [name]
            while (parent := edges[children[-1]].parent) != frame and parent in edges:
                if parent in children:
                    break
                pose = _composed(edges[parent].pose, pose)
                children.append(parent)
            if parent == frame:
                return pose, tuple(children)
    return None, ()


def _composed(outer: Pose, inner: Pose) -> Pose:
    x, y, yaw = outer
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return (
        x + cosine * inner[0] - sine * inner[1],
        y + sine * inner[0] + cosine * inner[1],
        math.remainder(yaw + inner[2], math.tau),
    )


def _plain(frame: str) -> str:
    """Name of a frame without the leading slash of old logs."""
    return frame.lstrip("/")
