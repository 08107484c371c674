"""Publishes messages as a ROS 1 node, run by the Python of Debian's ROS; latched, until it is ended.

Arguments: a JSON file [{"topic", "type", "message"}], in which messages are nested fields.
"""

import json
import sys
from pathlib import Path

import rospy


def fill(message, fields):
    """Set the fields of a message, those of ROS 1 only."""
    for name, kind in zip(message.__slots__, message._slot_types, strict=True):
        if name not in fields or kind == "time" or kind == "duration":
            continue
        value = fields[name]
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        elif value and isinstance(value, list) and isinstance(value[0], dict):
            setattr(message, name, [fill(element_of(kind), each) for each in value])
        else:
            setattr(message, name, value)
    return message


def element_of(kind):
    """Return an empty message of a type, or of an array's type, such as geometry_msgs/Point[]."""
    package, name = kind.removesuffix("[]").split("/")
    return getattr(__import__(package + ".msg", fromlist=[name]), name)()


told = json.loads(Path(sys.argv[1]).read_text())
rospy.init_node("results", disable_signals=True)
publishers = []
for each in told:
    message = fill(element_of(each["type"]), each["message"])
    publisher = rospy.Publisher(each["topic"], type(message), latch=True, queue_size=1)
    publisher.publish(message)
    publishers.append(publisher)
rospy.spin()
