"""What ``metadata.yaml`` says of an MCAP."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from mcap.writer import Writer

from rose2_logs.outputs.mcap.bag_metadata import write_bag_metadata


def test_a_channel_without_a_type_is_left_out(tmp_path: Path):
    log, path = tmp_path / "run.mcap", tmp_path / "metadata.yaml"
    with log.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        typed = writer.register_channel(
            "/map", "cdr", writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        )
        untyped = writer.register_channel("/raw", "cdr", 0)
        for time, channel in enumerate((typed, untyped, typed)):
            writer.add_message(channel, time, b"", time)
        writer.finish()
    write_bag_metadata(log, path)
    bag = yaml.safe_load(path.read_text())["rosbag2_bagfile_information"]
    (topic,) = bag["topics_with_message_count"]
    assert topic["topic_metadata"]["name"] == "/map"
    assert topic["message_count"] == 2


PROFILE = """\
- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: automatic
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
"""As rosbag2 records it since Iron."""


@pytest.mark.parametrize(("recorded", "expected"), [(PROFILE, [(1, 1)]), ("", []), ("- durability: 1", [])])
def test_quality_of_service_is_in_the_notation_of_the_version(tmp_path: Path, recorded, expected):
    """With numbers and all fields, or not at all: rosbag2 fails on names and on fields that are missing."""
    log, path = tmp_path / "run.mcap", tmp_path / "metadata.yaml"
    with log.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        channel = writer.register_channel("/map", "cdr", schema, {"offered_qos_profiles": recorded})
        writer.add_message(channel, 0, b"", 0)
        writer.finish()
    write_bag_metadata(log, path)
    bag = yaml.safe_load(path.read_text())["rosbag2_bagfile_information"]
    (topic,) = bag["topics_with_message_count"]
    profiles = yaml.safe_load(topic["topic_metadata"]["offered_qos_profiles"]) or []
    assert [(each["durability"], each["reliability"]) for each in profiles] == expected
    for each in profiles:
        assert set(each) == set(yaml.safe_load(PROFILE)[0])
        assert all(
            isinstance(each[name], int) for name in ("history", "reliability", "durability", "liveliness")
        )
