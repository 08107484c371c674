"""The ``metadata.yaml`` of rosbag2, which makes a folder with an MCAP a bag for ``ros2 bag play``."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import yaml
from mcap.reader import make_reader

from rose2_logs.errors import OutputError
from rose2_logs.outputs.mcap.input import qos_of_version_8
from rose2_logs.system.files import replacing

VERSION = 5
"""Version of the format: that of Humble, which all later releases can read."""


def version_record() -> dict[str, str]:
    """Content of a record by which rosbag2 reads the quality of service in the notation of `VERSION`.

    Without one it expects that of its own version. All but the version it takes from the file itself.
    """
    described = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": 0},
        "starting_time": {"nanoseconds_since_epoch": 0},
        "message_count": 0,
        "topics_with_message_count": [],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [],
        "files": [],
    }
    return {"serialized_metadata": yaml.safe_dump(described, sort_keys=False)}


def write_bag_metadata(log: Path, path: Path) -> None:
    """Describe an MCAP of the ros2 profile in the same folder.

    Parameters
    ----------
    log : path
        The complete MCAP.
    path : path
        Output file.

    Raises
    ------
    OutputError
        If it cannot be written, or the MCAP has no summary.
    """
    with log.open("rb") as file:
        summary = make_reader(file).get_summary()
    if summary is None or summary.statistics is None:
        raise OutputError(f"{path}: cannot be written: {log.name} has no summary")
    statistics = summary.statistics
    topics: dict[str, dict[str, Any]] = {}
    for number, channel in sorted(summary.channels.items()):
        if channel.schema_id not in summary.schemas:
            continue  # ROS cannot play messages without a type
        count = statistics.channel_message_counts.get(number, 0)
        if channel.topic in topics:
            topics[channel.topic]["message_count"] += count
            continue
        topics[channel.topic] = {
            "topic_metadata": {
                "name": channel.topic,
                "type": summary.schemas[channel.schema_id].name,
                "serialization_format": channel.message_encoding,
                # Since Iron they are recorded with names, which rosbag2 refuses in a bag of this version.
                "offered_qos_profiles": qos_of_version_8(channel.metadata.get("offered_qos_profiles", "")),
            },
            "message_count": count,
        }
    duration_ns = statistics.message_end_time - statistics.message_start_time
    contents = {
        "starting_time": {"nanoseconds_since_epoch": statistics.message_start_time},
        "duration": {"nanoseconds": duration_ns},
        "message_count": statistics.message_count,
    }
    described = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "relative_file_paths": [log.name],
        **contents,
        "topics_with_message_count": list(topics.values()),
        "compression_format": "",
        "compression_mode": "",
        # A copy: YAML would write the same object as a reference to the first one.
        "files": [{"path": log.name, **deepcopy(contents)}],
    }
    with replacing(path) as part:
        text = yaml.safe_dump({"rosbag2_bagfile_information": described}, sort_keys=False)
        part.write_text(text, encoding="utf-8")
