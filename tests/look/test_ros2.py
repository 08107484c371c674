"""ROS 2 Jazzy itself reads the added messages, and what rosbag2 offers reaches what RViz2 asks for."""

from __future__ import annotations

import json
import subprocess
from collections import Counter
from pathlib import Path

import pytest
import yaml
from commands import WAIT_S
from programs import installed
from rosbags.highlevel import AnyReader

from rose2_logs.outputs.mcap.ros_messages import ros2_typestore

TYPES = ("nav_msgs/msg/OccupancyGrid", "visualization_msgs/msg/MarkerArray", "nav_msgs/msg/Odometry")
"""Those whose packages are on PyPI; of the rooms' own type there is none."""
MOST = 12
"""Messages of each topic that are sent."""


def offered_by_rosbag2(profiles: str) -> tuple[str, str]:
    """Durability and reliability of a topic that `ros2 bag play` publishes, after rosbag2's own rule.

    It takes the profile that all publishers had, else the default of ROS 2. A bag of version 8 or older must
    have numbers there, and each profile all its fields.
    """
    found = yaml.safe_load(profiles) or []
    if not found or any(each != found[0] for each in found):
        return "volatile", "reliable"
    names = {1: "transient_local", 2: "volatile"}[found[0]["durability"]], {1: "reliable", 2: "best_effort"}
    assert set(found[0]) >= {"history", "depth", "deadline", "lifespan", "liveliness"}
    return names[0], names[1][found[0]["reliability"]]


def asked_by_rviz(config: Path) -> dict[str, tuple[str, str]]:
    """Durability and reliability that RViz2 asks for, by topic."""
    displays = yaml.safe_load(config.read_text(encoding="utf-8"))["Visualization Manager"]["Displays"]
    topics = [each["Topic"] for each in displays if "Topic" in each]
    return {each["Value"]: (each["Durability Policy"], each["Reliability Policy"]) for each in topics}


@pytest.mark.parametrize("run", ["wing", "office"])
def test_all_messages_are_read_by_ros_and_reach_rviz(run, request, tmp_path):
    """Deserialized and serialized again they have the same fields, and over DDS all arrive."""
    ros, folder = installed("ros2"), request.getfixturevalue(run)
    (log,), (config,) = folder.glob("*.rose2.mcap"), folder.glob("*.rose2.rviz")
    described = yaml.safe_load((folder / "metadata.yaml").read_text(encoding="utf-8"))
    topics = [
        each["topic_metadata"]
        for each in described["rosbag2_bagfile_information"]["topics_with_message_count"]
    ]
    offers = {each["name"]: offered_by_rosbag2(each["offered_qos_profiles"]) for each in topics}
    asked = asked_by_rviz(config)
    assert set(asked) <= set(offers)
    index, counts = [], Counter()
    with AnyReader([log]) as reader:
        connections = [each for each in reader.connections if each.msgtype in TYPES]
        for number, (connection, _, data) in enumerate(reader.messages(connections)):
            topic = connection.topic
            counts[topic] += 1
            if counts[topic] <= MOST:
                (tmp_path / f"{number}.cdr").write_bytes(data)
                offer = offers[topic]
                told = {"topic": topic, "type": connection.msgtype, "file": f"{number}.cdr"}
                index.append(told | {"offered": offer, "asked": asked.get(topic, offer)})
    (tmp_path / "index.json").write_text(json.dumps(index))
    program = Path(__file__).with_name("ros2_round.py")
    done = subprocess.run(
        [ros / "bin" / "python", program, tmp_path],
        env={
            "ROS_LOCALHOST_ONLY": "1",
            "ROS_DOMAIN_ID": "77",
            "HOME": str(tmp_path),
            "PATH": "/usr/bin:/bin",
        },
        capture_output=True,
        text=True,
        check=False,
        timeout=2 * WAIT_S,
    )
    assert done.returncode == 0, done.stderr
    assert "incompatible QoS" not in done.stderr
    assert json.loads(done.stdout) == {topic: min(count, MOST) for topic, count in counts.items()}
    store = ros2_typestore(wanted=TYPES)

    def fields(file: str, kind: str) -> bytes:
        """Serialized without what may stand in gaps between fields."""
        return bytes(store.serialize_cdr(store.deserialize_cdr((tmp_path / file).read_bytes(), kind), kind))

    for told in index:
        assert fields(f"{told['file']}.again", told["type"]) == fields(told["file"], told["type"])
