"""What ``metadata.yaml`` says of an MCAP."""

from __future__ import annotations

from pathlib import Path

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
