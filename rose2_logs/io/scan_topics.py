"""Which topics of a log say what a lidar saw, and where it was."""

from __future__ import annotations

from rose2_logs.io.carmen_format import CARMEN_FORMAT
from rose2_logs.io.messages import ros_type
from rose2_logs.io.poses import TRANSFORM_TYPES
from rose2_logs.io.source import LogInfo

SCAN_TYPE, ECHOES_TYPE = "sensor_msgs/LaserScan", "sensor_msgs/MultiEchoLaserScan"
ENCODINGS = ("cdr", "ros1")


def _topics(info: LogInfo, types: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(
        topic.name
        for topic in info.topics
        if ros_type(topic.message_type) in types and topic.encoding in ENCODINGS and topic.message_count != 0
    )


def scan_topics(info: LogInfo) -> tuple[str, ...]:
    """Topics with laser scans that can be read."""
    return _topics(info, (SCAN_TYPE, ECHOES_TYPE))


def transform_topics(info: LogInfo) -> tuple[str, ...]:
    """Topics with transforms that can be read."""
    return _topics(info, TRANSFORM_TYPES)


def without_transforms(info: LogInfo) -> str:
    """Say that a log has laser scans, but nothing that tells where they were taken; else nothing."""
    scans = scan_topics(info)
    if not scans or transform_topics(info):
        return ""
    holding = f"{', '.join(scans)} {'holds' if len(scans) == 1 else 'hold'} laser scans"
    return f"{holding}, but no transforms (/tf) tell where they were taken"


def mappable_topics(info: LogInfo) -> tuple[str, ...]:
    """Topics with laser scans from which maps can be built: the log also says where they were taken."""
    if info.format == CARMEN_FORMAT:
        return tuple(topic.name for topic in info.topics)
    return scan_topics(info) if transform_topics(info) else ()
