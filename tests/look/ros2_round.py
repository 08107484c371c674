"""Reads messages with ROS 2 and sends them over DDS on this machine, run by a Python that has rclpy.

Arguments: a folder with index.json, a list of {"topic", "type", "file", "offered", "asked"}: the serialized
message, how rosbag2 offers its topic, and how the subscription asks for it. Writes each message serialized
again, as FILE.again, and prints how many came of each topic.
"""

import importlib
import json
import sys
import time
from collections import Counter
from pathlib import Path

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message

WAIT_S = 60.0
"""Longest wait for messages that are to come."""
QUIET_S = 3.0
"""How long nothing more may come, until the rest counts as lost."""


def profile(told):
    """Quality of service of two names: durability and reliability."""
    durability, reliability = (name.lower().replace(" ", "_") for name in told)
    return QoSProfile(
        depth=100,
        durability=DurabilityPolicy.get_from_short_key(durability),
        reliability=ReliabilityPolicy.get_from_short_key(reliability),
    )


def get_message(name):
    """Class of a message type, such as nav_msgs/msg/Path."""
    package, kind = name.split("/msg/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)


folder = Path(sys.argv[1])
told = json.loads((folder / "index.json").read_text())
messages = []
for each in told:
    data = (folder / each["file"]).read_bytes()
    message = deserialize_message(data, get_message(each["type"]))
    (folder / f"{each['file']}.again").write_bytes(serialize_message(message))
    messages.append(message)

rclpy.init()
node = rclpy.create_node("results")
topics = {each["topic"]: each for each in told}
publishers, came = {}, Counter()
for topic, each in topics.items():
    kind = get_message(each["type"])
    publishers[topic] = node.create_publisher(kind, topic, profile(each["offered"]))
    node.create_subscription(kind, topic, lambda _, topic=topic: came.update([topic]), profile(each["asked"]))
end = time.monotonic() + WAIT_S
while not all(each.get_subscription_count() for each in publishers.values()) and time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.1)
for each, message in zip(told, messages, strict=True):
    publishers[each["topic"]].publish(message)
last, quiet = 0, time.monotonic()
while came.total() < len(told) and time.monotonic() < min(end, quiet + QUIET_S):
    rclpy.spin_once(node, timeout_sec=0.1)
    if came.total() > last:
        last, quiet = came.total(), time.monotonic()
print(json.dumps(came))
node.destroy_node()
rclpy.shutdown()
