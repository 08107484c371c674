"""The laser scans of a log at their poses, from its transforms."""

from __future__ import annotations

import logging
import math
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple, Protocol

import numpy as np

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.errors import InvalidMapError, LogError, NoMapTopicError
from rose2_logs.io.messages import fields_of
from rose2_logs.io.scan_topics import scan_topics, transform_topics
from rose2_logs.io.scans import Scan, scan_of, transforms_of
from rose2_logs.io.source import LoggedBytes, MessageSource
from rose2_logs.mapping.log_odds import Beams, beams_of
from rose2_logs.mapping.motion_filter import LidarPose
from rose2_logs.mapping.transforms import Link, NotPlacedError, Transform, TransformTree, rotated
from rose2_logs.system.text import listed
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

FIXED_FRAMES = ("map", "odom")
"""Frames in which the world stands still (REP 105), the better one first: odometry drifts."""
TRIED_TRANSFORMS = 20_000
"""If a log's transforms connect its scans to a frame, they do so within this many of its first messages."""
MOST_LEFT_OUT = 0.05
"""Scans at the ends of a log lack transforms; if more than this share is left out, there is a warning."""
CLOCKS_APART_S = 60.0
"""Stamps that are further apart than this at the end of a log come from different clocks."""
_MOST_LISTED = 6


class PlacedScan(NamedTuple):
    """A scan in the world: when it was recorded and measured, in nanoseconds, from where, and its beams."""

    log_time_ns: int
    stamp_ns: int
    pose: LidarPose
    beams: Beams


class PlacedScans(Protocol):
    """Where maps are built from: scans in the world, one after the other.

    Attributes
    ----------
    topic : str
        Where they come from.
    frame_id : str
        The world.
    """

    topic: str
    frame_id: str

    def __iter__(self) -> Iterator[PlacedScan]:
        """Yield the scans in the order in which they were recorded."""
        ...


@dataclass
class _Waiting:
    """A scan that waits for its transforms, and the links that lead to its frame."""

    log_time_ns: int
    scan: Scan
    links: tuple[Link, ...]


class RosScans:
    """The scans of one topic of a log, each beam placed by the transforms of its own time.

    Parameters
    ----------
    source : MessageSource
        The log.
    asked : str
        The scan topic.
    frame : str or None
        The fixed frame; by default ``map``, else ``odom``.
    parameters : MappingParameters
        What is trusted of beams and transforms.

    Attributes
    ----------
    topic, frame_id : str
        The scan topic as the log has it, and the fixed frame.
    left_out : Counter
        Scans of the latest reading that were left out, by reason.

    Raises
    ------
    NoMapTopicError
        If there is no such topic, or the log has no transforms, or they do not lead to the frame.
    """

    def __init__(
        self, source: MessageSource, asked: str, frame: str | None, parameters: MappingParameters
    ) -> None:
        self._source = source
        self._parameters = parameters
        info, path = source.info, source.info.path
        topics = scan_topics(info)
        named = [name for name in topics if name.lstrip("/") == asked.lstrip("/")]
        if not named:
            has = f"its scan topics are {', '.join(topics)}" if topics else "it has no scan topics"
            raise NoMapTopicError(f"{path}: {asked or repr(asked)} is not a topic with laser scans; {has}")
        self.topic = named[0]
        self._types = {
            topic.encoding: topic.message_type for topic in info.topics if topic.name == self.topic
        }
        transforms = transform_topics(info)
        if not transforms:
            raise NoMapTopicError(
                f"{path}: has no transforms (/tf), which say where the scans on {self.topic} were taken"
            )
        self._fixed_topics = tuple(name for name in transforms if "static" in name)
        self._moving_topics = tuple(name for name in transforms if "static" not in name)
        self.left_out: Counter[str] = Counter()
        self.frame_id = self._fixed_frame(frame)
        # Latest stamps, to tell clocks that differ.
        self._scan_ns = self._transform_ns = 0

    def __iter__(self) -> Iterator[PlacedScan]:
        """Yield the scans that have a pose, in the order in which they were recorded; warn of the others."""
        self.left_out = Counter()
        placed = 0
        for each in self._placed():
            placed += 1
            yield each
        self._tell_left_out(placed)

    def _placed(self) -> Iterator[PlacedScan]:
        tree = self._started_tree()
        wait_ns = round(self._parameters.transform_wait_s * 1e9)
        links_to: dict[str, tuple[Link, ...]] = {}
        needed: tuple[bytes, ...] = ()
        waiting: deque[_Waiting] = deque()
        now_ns = 0
        for message in self._source.stream((self.topic, *self._moving_topics)):
            now_ns = max(now_ns, message.log_time_ns)
            data = message.data_if_whole()
            if message.topic != self.topic:
                # Most transforms are of joints and wheels.
                if data is None or (needed and not any(child in data for child in needed)):
                    continue
                for transform in _transforms_in(message, data):
                    tree.add(transform)
                    self._transform_ns = transform.stamp_ns
            elif (scan := self._scan_in(message, data)) is not None:
                links = links_to.get(scan.frame_id) or tree.above(scan.frame_id).get(self.frame_id, ())
                if not links:
                    needed = ()  # any transform may be one that leads to its frame
                elif scan.frame_id not in links_to:
                    links_to[scan.frame_id] = links
                    needed = tuple(child.encode() for found in links_to.values() for _, child in found)
                self._scan_ns = scan.stamp_ns
                waiting.append(_Waiting(message.log_time_ns, scan, links))
            yield from self._settled(waiting, tree, now_ns - wait_ns)
        yield from self._settled(waiting, tree, None)

    def _settled(
        self, waiting: deque[_Waiting], tree: TransformTree, expired_ns: int | None
    ) -> Iterator[PlacedScan]:
        """Place the waiting scans whose transforms have come; give up those that waited for too long."""
        while waiting:
            first = waiting[0]
            is_over = expired_ns is None or first.log_time_ns <= expired_ns
            first.links = first.links or tree.above(first.scan.frame_id).get(self.frame_id, ())
            if first.links:
                last_ns = tree.last_ns(first.links)
                is_ready = last_ns is None or last_ns >= first.scan.times_ns[[0, -1]].max()
            else:
                is_ready = False
            if not is_ready and not is_over:
                return
            waiting.popleft()
            try:
                yield PlacedScan(first.log_time_ns, first.scan.stamp_ns, *self._in_world(first, tree))
            except NotPlacedError as error:
                self.left_out[str(error)] += 1

    def _in_world(self, taken: _Waiting, tree: TransformTree) -> tuple[LidarPose, Beams]:
        """Where the lidar was at its first beam, and its beams."""
        scan, parameters = taken.scan, self._parameters
        if not taken.links:
            raise NotPlacedError(f"in the frame {scan.frame_id!r}, which no transforms lead to")
        poses = tree.poses(taken.links, scan.times_ns)
        if poses.tilt_rad > parameters.max_tilt_rad:
            raise NotPlacedError("of a tilted lidar")
        level = np.zeros((len(scan.bearings_rad), 3))
        level[:, 0], level[:, 1] = np.cos(scan.bearings_rad), np.sin(scan.bearings_rad)
        starts = poses.positions_m[:, :2]
        directions = rotated(poses.quaternions, level)[:, :2]
        (x, y), (across, along) = starts[0].tolist(), directions[0].tolist()
        pose = LidarPose(x, y, math.atan2(along, across) - float(scan.bearings_rad[0]))
        return pose, beams_of(
            starts[0] if len(starts) == 1 else starts, directions, scan.ranges_m, parameters
        )

    def _started_tree(self) -> TransformTree:
        """Return a tree with the fixed transforms, which hold at all times, whenever they were recorded."""
        tree = TransformTree(self._parameters)
        for message in self._source.stream(self._fixed_topics) if self._fixed_topics else ():
            if (data := message.data_if_whole()) is not None:
                for transform in _transforms_in(message, data):
                    tree.add(transform, is_fixed=True)
        return tree

    def _fixed_frame(self, asked: str | None) -> str:
        """Find the frame of the map above the lidar's."""
        path = self._source.info.path
        frame = self._frame_of_scans()
        tree = self._started_tree()
        wanted = asked.lstrip("/") if asked is not None else FIXED_FRAMES[0]
        found = _frame_named(wanted, tree, frame, exact=asked is not None)
        if found is None:
            stream = self._source.stream(self._moving_topics) if self._moving_topics else iter(())
            links: set[Link] = set()
            for message in islice(stream, TRIED_TRANSFORMS):
                if (data := message.data_if_whole()) is None:
                    continue
                new = [each for each in _transforms_in(message, data) if _link(each) not in links]
                for transform in new:
                    tree.add(transform)
                    links.add(_link(transform))
                found = _frame_named(wanted, tree, frame, exact=asked is not None) if new else None
                if found is not None:
                    break
        if found is None and asked is None:
            found = _frame_named(FIXED_FRAMES[1], tree, frame, exact=False)
            if found is not None:
                text = (
                    f"{path}: no transform leads from map to {frame}; the map is built in {found}, where "
                    "odometry drifts: walls may be bent or double (map_frame= names another frame)"
                )
                log_warning(logger, "map_of_odometry", text, file=path, topic=self.topic)
        if found is None:
            raise NoMapTopicError(f"{path}: {_no_way(frame, asked, tree)}")
        logger.info("%s: the map is built in the frame %s from scans on %s", path, found, self.topic)
        return found

    def _frame_of_scans(self) -> str:
        for message in self._source.stream((self.topic,)):
            if (scan := self._scan_in(message, message.data_if_whole())) is not None:
                return scan.frame_id
        raise LogError(f"{self._source.info.path}: no scan on {self.topic} can be read")

    def _scan_in(self, message: LoggedBytes, data: bytes | None) -> Scan | None:
        try:
            fields = None if data is None else fields_of(data, message.encoding)
            scan = None if fields is None else scan_of(fields, self._types[message.encoding])
        except (InvalidMapError, KeyError):
            scan = None
        if scan is None:
            self.left_out["damaged"] += 1
        elif not len(scan.ranges_m):
            self.left_out["empty"] += 1
            return None
        return scan

    def _tell_left_out(self, placed: int) -> None:
        path, total = self._source.info.path, placed + self.left_out.total()
        if not self.left_out:
            return
        reasons = ", ".join(f"{count} {reason}" for reason, count in self.left_out.most_common())
        text = f"{path}: {self.left_out.total()} of {total} scans on {self.topic} are left out: {reasons}"
        if not placed:
            apart_s = abs(self._scan_ns - self._transform_ns) / 1e9
            clocks = (
                ""
                if apart_s < CLOCKS_APART_S
                else f"; the stamps of scans and transforms are {apart_s:.0f} s apart"
            )
            raise LogError(text + clocks, file=path, topic=self.topic)
        if self.left_out.total() > MOST_LEFT_OUT * total:
            log_warning(logger, "scans_left_out", text, file=path, topic=self.topic)
        else:
            logger.info(text)


def _frame_named(name: str, tree: TransformTree, frame: str, *, exact: bool) -> str | None:
    """Return the nearest frame above another one that has a name, also behind the name of a robot."""
    for each in list(tree.above(frame))[1:]:
        if each == name or (not exact and each.rsplit("/", 1)[-1] == name):
            return each
    return None


def _no_way(frame: str, asked: str | None, tree: TransformTree) -> str:
    """Say why the scans have no place in a map."""
    above = list(tree.above(frame))[1:]
    if not above:
        known = tree.frames
        return (
            f"the scans are in the frame {frame!r}, which is not among those of the transforms: "
            f"{listed(known, _MOST_LISTED) or 'none'}"
        )
    wanted = " or ".join(FIXED_FRAMES) if asked is None else asked
    return (
        f"no transforms lead from {wanted} to the scans in {frame}, only from {', '.join(above)}; if one of "
        f"these stands still, choose it (map_frame={above[-1]!r})"
    )


def _link(transform: Transform) -> Link:
    return transform.parent, transform.child


def _transforms_in(message: LoggedBytes, data: bytes) -> list[Transform]:
    """Transforms of a message; none if it is damaged."""
    try:
        return list(transforms_of(fields_of(data, message.encoding)))
    except InvalidMapError:
        return []
