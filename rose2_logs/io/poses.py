"""The robot's path over a log: from its transforms, else its odometry, else its poses."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice, pairwise

import numpy as np

from rose2_logs.errors import InvalidMapError
from rose2_logs.io.grids import yaw_of
from rose2_logs.io.messages import Fields, fields_of, ros_type
from rose2_logs.io.source import LoggedBytes, LogInfo, MessageSource
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.system.text import listed
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

TRANSFORM_TYPES = ("tf2_msgs/TFMessage", "tf/tfMessage")
ODOMETRY_TYPES = ("nav_msgs/Odometry",)
POSE_TYPES = ("geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped")
BASE_FRAMES = ("base_link", "base_footprint", "base", "base_frame")
"""Frames of a mobile base (REP 105, REP 120, and common drivers), the most common first."""
PREFIXED_FRAMES = BASE_FRAMES[:2]
"""Those that may follow the name of a robot and ``_``; ``arm_base`` would be something else."""
ODOMETRY_FRAME = "odom"
"""Frame whose only child is the base, whatever its name (REP 105); also in odom_combined and the like."""
FRAMES_TOLD = 5
"""Frames that are named where none is a robot's base."""
REQUESTED_POSES = ("goal", "initial")
"""Topics with this in their name carry requested poses, not where the robot was."""
POSE_STEP_S = 0.25
"""Minimum time between two poses: at 0.8 m/s a robot moves `POSE_STEP_M` in this time."""
POSE_STEP_M = 0.2
"""Minimum distance between two poses: well below the width of a door."""
JUMP_M = 2.0
"""Poses farther apart than this are no drive: the robot was put elsewhere, or found itself again."""
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
    map_topic : str
        Topic of the map: of several robots, the one in its namespace is followed.
    base_frame : str, optional
        Frame of the robot's base; by default one of `BASE_FRAMES`, else the only frame below ``odom``.

    Attributes
    ----------
    origin : str
        Topics that the poses come from; empty if the log does not say where the robot was.
    """

    def __init__(
        self,
        source: MessageSource,
        frame_id: str,
        start_ns: int | None = None,
        *,
        map_topic: str = "",
        base_frame: str | None = None,
    ) -> None:
        self._start_ns = start_ns or 0
        wanted = _Wanted(map_frame(frame_id), _namespace(map_topic), _plain(base_frame or ""))
        topics, poses = _choose(source, wanted, self._start_ns)
        self.origin = ", ".join(topics)
        self._poses = poses
        self._next: tuple[int, Pose] | None = next(self._poses, None)
        self._last: Pose | None = None

    def until(self, log_time_ns: int, *, is_begun_anew: bool = False) -> FloatArray:
        """Return the poses since the previous call.

        Parameters
        ----------
        log_time_ns : int
            Up to when.
        is_begun_anew : bool
            Whether the map has been begun anew since then: poses that may be on the map before are left out,
            those up to the robot's last jump, or all but the last one if it has not jumped.

        Returns
        -------
        (K, 3) float
            x, y in meters and yaw in radians; consecutive poses are at least `POSE_STEP_M` apart.
        """
        taken = [] if self._last is None else [self._last]
        known = begin = len(taken)
        while self._next is not None and self._next[0] <= log_time_ns:
            time_ns, pose = self._next
            if time_ns >= self._start_ns and (
                self._last is None or math.dist(pose[:2], self._last[:2]) >= POSE_STEP_M
            ):
                taken.append(pose)
                self._last = pose
            self._next = next(self._poses, None)
        if is_begun_anew:
            jumps = [
                place
                for place, (before, now) in enumerate(pairwise(taken), start=1)
                if math.dist(before[:2], now[:2]) > JUMP_M
            ]
            begin = max(known, jumps[-1] if jumps else len(taken) - 1)
        return np.array(taken[begin:], float).reshape(-1, 3)


@dataclass(frozen=True)
class _Wanted:
    """Whose pose is looked for: the map's frame, its topic's namespace, the base's frame if it is known."""

    frame: str
    namespace: str
    base: str = ""

    def bases(self, edges: dict[str, _Edge]) -> list[str]:
        """Frames that may be the robot's base, the likeliest first."""
        if self.base in edges:
            return [self.base]
        if self.base:
            return [name for name in edges if self.base in (name, name.rsplit("/", 1)[-1])]
        # With several robots, frame names start with the robot's name: robot1/base_link, robot1_base_link.
        named = {name: found for name in edges if (found := _robot_and_base(name))}
        own = (_plain(self.namespace), self.namespace.rpartition("/")[2])
        return sorted(
            named, key=lambda name: (named[name][0] not in own, BASE_FRAMES.index(named[name][1]), name)
        )


def _choose(
    source: MessageSource, wanted: _Wanted, start_ns: int
) -> tuple[tuple[str, ...], Iterator[tuple[int, Pose]]]:
    """Topics that say where the robot was, and its poses."""
    path = source.info.path
    transforms = _topics(source.info, TRANSFORM_TYPES)
    connected: list[tuple[tuple[str, ...], _Wanted]] = []
    for topics in _groups(transforms, wanted.namespace):
        found = _connected(source, topics, wanted)
        if found is not None:
            connected.append((topics, found))
            if (space := _namespace(topics[0])) == wanted.namespace or (space and _holds(space, wanted)):
                break
    if connected:
        topics, wanted = connected[0]
        if others := dict.fromkeys(
            name for names, _ in connected[1:] for name in names if name not in topics
        ):
            text = (
                f"{path}: the robot's way is that of {topics[0]}; {', '.join(others)} tell of other robots, "
                "which are not shown"
            )
            log_warning(logger, "one_robot", text, file=path, topic=topics[0])
        return topics, _transformed(source.stream(topics), wanted, start_ns)
    if wanted.base:
        text = f"{path}: no transforms lead from {wanted.frame!r} to the base frame {wanted.base!r}"
        log_warning(logger, "base_frame", text, file=path)
    for types, read in ((ODOMETRY_TYPES, _odometry), (POSE_TYPES, _pose)):
        topics = _topics(source.info, types)
        # The robot's own topic is in the map's namespace; of several, it has the most messages.
        counts = {item.name: item.message_count or 0 for item in source.info.topics}
        order = sorted(topics, key=lambda name: (_namespace(name) != wanted.namespace, -counts[name], name))
        if topics := tuple(order[:1]):
            _tell_other_frame(source, topics, wanted)
            return topics, _posed(source.stream(topics), read, start_ns)
    if transforms and not wanted.base:
        frames = sorted(_first_transforms(source, transforms))
        text = (
            f"{path}: the robot's way is not known: no transforms lead from {wanted.frame!r} to a frame with "
            f"the name of a base, such as {BASE_FRAMES[0]}; base_frame=NAME names it, of "
            f"{listed(frames, FRAMES_TOLD) or 'none'}"
        )
        log_warning(logger, "base_frame", text, file=path)
    return (), iter(())


def _tell_other_frame(source: MessageSource, topics: tuple[str, ...], wanted: _Wanted) -> None:
    """Warn that poses are not in the frame of the map, and no transforms lead from one to the other."""
    for message in islice(source.stream(topics), 1):
        data = message.data_if_whole()
        try:
            frame = "" if data is None else _plain(fields_of(data, message.encoding).header()[1])
        except InvalidMapError:
            return
        if frame and frame != wanted.frame:
            text = (
                f"{source.info.path}: the robot's way is that of {topics[0]}, in the frame {frame!r} instead "
                f"of {wanted.frame!r}: it may drift away from the map; base_frame=NAME names the "
                "robot's frame if transforms lead to it"
            )
            log_warning(logger, "other_frame", text, file=source.info.path, topic=topics[0])


def _holds(space: str, wanted: _Wanted) -> bool:
    """Whether the map's topic is in a namespace or in one below it."""
    return f"{wanted.namespace}/".startswith(f"{space}/")


def _namespace(topic: str) -> str:
    """Namespace of a topic, without the slash at its end: nothing for ``/map``."""
    return f"/{topic.lstrip('/')}".rpartition("/")[0]


def _groups(topics: tuple[str, ...], namespace: str) -> list[tuple[str, ...]]:
    """Topics with transforms that belong together: of one namespace each, that of the map first, then all."""
    spaces = sorted(
        {_namespace(name) for name in topics},
        key=lambda space: (not f"{namespace}/".startswith(f"{space}/"), -len(space) if space else 0, space),
    )
    groups = [tuple(name for name in topics if _namespace(name) == space) for space in spaces]
    return [*groups, topics] if len(groups) > 1 else groups


def _connected(source: MessageSource, topics: tuple[str, ...], wanted: _Wanted) -> _Wanted | None:
    """Whose pose transforms tell, by their first messages; None if they do not lead to the map's frame."""
    path = source.info.path
    edges = _first_transforms(source, topics)
    if robots := _robots_in(wanted, edges):
        if len(robots) > 1:
            text = (
                f"{path}: the robot's way is that of {robots[0]}; other robots are not shown "
                f"({', '.join(robots[1:])}); base_frame=NAME chooses one"
            )
            log_warning(logger, "one_robot", text, file=path, topic=topics[0])
        return replace(wanted, base=robots[0])
    below = [
        name for name, edge in edges.items() if edge.parent.rsplit("/", 1)[-1].startswith(ODOMETRY_FRAME)
    ]
    if wanted.base or len(below) != 1 or not _robots_in(replace(wanted, base=below[0]), edges):
        return None
    text = (
        f"{path}: the robot's base is taken to be {below[0]!r}, the only frame below {edges[below[0]].parent}"
    )
    log_warning(logger, "base_frame", f"{text}; base_frame=NAME names another", file=path, topic=topics[0])
    return replace(wanted, base=below[0])


def _first_transforms(source: MessageSource, topics: tuple[str, ...]) -> dict[str, _Edge]:
    """Transforms in the first messages of some topics, by child frame."""
    edges: dict[str, _Edge] = {}
    for message in islice(source.stream(topics), TRIED_MESSAGES):
        if (data := message.data_if_whole()) is not None:
            with suppress(InvalidMapError):
                edges |= _transforms(fields_of(data, message.encoding))
    return edges


def _topics(info: LogInfo, types: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(
        topic.name
        for topic in info.topics
        if ros_type(topic.message_type) in types
        and topic.encoding in ("cdr", "ros1")
        and topic.message_count != 0
        and not any(word in topic.name for word in REQUESTED_POSES)
    )


def _transformed(
    messages: Iterator[LoggedBytes], wanted: _Wanted, start_ns: int
) -> Iterator[tuple[int, Pose]]:
    """Follow the transforms from the map's frame to that of the robot's base."""
    edges: dict[str, _Edge] = {}
    # The chain of frames from the map to the robot; other transforms, as of joints and sensors, are skipped.
    chain: tuple[bytes, ...] = ()
    latest_ns: int | None = None
    for message in messages:
        if message.log_time_ns < start_ns - LEAD_NS and "static" not in message.topic:
            continue
        data = message.data_if_whole()
        if data is None or (chain and not any(child in data for child in chain)):
            continue
        try:
            edges |= _transforms(fields_of(data, message.encoding))
        except InvalidMapError:
            continue
        if latest_ns is not None and message.log_time_ns - latest_ns < POSE_STEP_S * 1e9:
            continue
        pose, children = _base_in(wanted, edges)
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
        data = message.data_if_whole()
        if data is None:
            continue
        try:
            pose = read(fields_of(data, message.encoding))
        except InvalidMapError:
            continue
        if all(map(math.isfinite, pose)):
            latest_ns = time_ns
            yield time_ns, pose


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


def _robot_and_base(frame: str) -> tuple[str, str] | None:
    """Name of the robot, nothing for a single one, and kind of base of a frame; None if it is no base."""
    robot, _, kind = frame.rpartition("/")
    if kind in BASE_FRAMES:
        return robot, kind
    kind = next((each for each in PREFIXED_FRAMES if frame.endswith(f"_{each}")), "")
    return (frame.removesuffix(f"_{kind}"), kind) if kind else None


def _base_in(wanted: _Wanted, edges: dict[str, _Edge]) -> tuple[Pose | None, tuple[str, ...]]:
    """Pose of the robot's base in the map's frame, and the chain of frames from the base up to it."""
    for name in wanted.bases(edges):
        pose, children = edges[name].pose, [name]
        while (parent := edges[children[-1]].parent) != wanted.frame and parent in edges:
            if parent in children:
                break
            pose = _composed(edges[parent].pose, pose)
            children.append(parent)
        if parent == wanted.frame:
            return pose, tuple(children)
    return None, ()


def _robots_in(wanted: _Wanted, edges: dict[str, _Edge]) -> list[str]:
    """Bases that lead to the map's frame, the likeliest first, one for each robot.

    Of a robot is what has its name, and what it carries, such as an arm with a base of its own.
    """
    robots: dict[str, tuple[str, ...]] = {}
    names: set[str] = set()
    for base in wanted.bases(edges):
        pose, chain = _base_in(replace(wanted, base=base), edges)
        robot, _ = _robot_and_base(base) or (base, "")
        is_carried = any(base in other or name in chain for name, other in robots.items())
        if pose is not None and robot not in names and not is_carried:
            names.add(robot)
            robots[base] = chain
    return list(robots)


def _composed(outer: Pose, inner: Pose) -> Pose:
    x, y, yaw = outer
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return (
        x + cosine * inner[0] - sine * inner[1],
        y + sine * inner[0] + cosine * inner[1],
        math.remainder(yaw + inner[2], math.tau),
    )


def map_frame(frame_id: str) -> str:
    """Name of a map's frame without a leading slash; ``map`` if the map says none."""
    return _plain(frame_id) or "map"


def _plain(frame: str) -> str:
    """Name of a frame without the leading slash of old logs."""
    return frame.lstrip("/")
