"""RViz 1.14 of Debian, which draws as RViz2 does, with the configuration that is written for RViz2."""

from __future__ import annotations

import json
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from colors import shares_of_hues
from commands import WAIT_S, started, wait_for
from looking import free_port
from programs import needed, screen, screenshot
from rosbags.highlevel import AnyReader

from rose2_logs.outputs.mcap.viewer_layouts import RVIZ_WINDOW_PX

DEBIAN_PYTHON = "/usr/bin/python3"
CLASSES = ("rviz_default_plugins/", "rviz_common/")
LEAST_SHARE = 1e-3
"""Share of the window that a room of a few square meters fills at least."""


def fields_of(message: Any) -> Any:
    """A message as JSON values."""
    if isinstance(message, np.ndarray):
        return message.tolist()
    if isinstance(message, list):
        return [fields_of(each) for each in message]
    if hasattr(message, "__dataclass_fields__"):
        names = (name for name in message.__dataclass_fields__ if not name.startswith("__"))
        return {name: fields_of(getattr(message, name)) for name in names}
    return message


def last_messages(log: Path) -> list[dict[str, Any]]:
    """The last map, markers and transforms of an annotated log, as they are published again."""
    found = []
    with AnyReader([log]) as reader:
        for topic in ("/map", "/rose2/markers", "/tf"):
            connections = [each for each in reader.connections if each.topic == topic]
            *_, (connection, _, data) = reader.messages(connections)
            message = fields_of(reader.deserialize(data, connection.msgtype))
            kind = connection.msgtype.replace("/msg/", "/")
            found.append({"topic": topic.replace("/tf", "/tf_static"), "type": kind, "message": message})
    return found


def of_rviz1(settings: Any) -> Any:
    """A configuration of RViz2 in the terms of RViz: other classes, topics without quality of service."""
    if isinstance(settings, list):
        return [of_rviz1(each) for each in settings]
    if not isinstance(settings, dict):
        return settings
    changed = {key: of_rviz1(value) for key, value in settings.items() if key != "Update Topic"}
    kind = str(settings.get("Class", ""))
    for package in CLASSES:
        kind = kind.replace(package, "rviz/")
    if kind:
        changed["Class"] = kind
    if isinstance(settings.get("Topic"), dict):
        changed.pop("Topic")
        changed["Marker Topic" if kind == "rviz/MarkerArray" else "Topic"] = settings["Topic"]["Value"]
    return changed


@contextmanager
def rviz_showing(folder: Path, place: Path):
    """RViz with the last map of a run; gives the environment of its screen."""
    rviz, rosmaster = needed("rviz", "rosmaster")
    (log,), (config,) = folder.glob("*.rose2.mcap"), folder.glob("*.rose2.rviz")
    messages, shown = place / "messages.json", place / "shown.rviz"
    messages.write_text(json.dumps(last_messages(log)))
    shown.write_text(yaml.safe_dump(of_rviz1(yaml.safe_load(config.read_text(encoding="utf-8")))))
    port = free_port()
    ros = {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(place),
        "HOME": str(place),
        "PATH": "/usr/bin:/bin",
    }
    publisher = Path(__file__).with_name("ros1_publisher.py")
    with screen(RVIZ_WINDOW_PX) as display:
        environment = {key: value for key, value in display.items() if key != "PYTHONPATH"} | ros
        with (
            started(rosmaster, "--core", "-p", port, env=environment),
            started(DEBIAN_PYTHON, publisher, messages, env=environment),
            started(rviz, "-d", shown, env=environment) as program,
        ):
            yield environment, program


def test_rviz_shows_each_room_in_its_color(wing, pictures, tmp_path):
    """Beside nothing but the list of displays, so that the rooms fill most of the window."""
    (log,) = wing.glob("*.rose2.mcap")
    _, array, _ = last_messages(log)
    colors = [
        [each["color"][part] for part in "rgb"]
        for each in array["message"]["markers"]
        if each["ns"] == "rooms"
    ]
    picture = pictures / "rviz_wing.png"

    def shown() -> bool:
        assert program.poll() is None, program.stderr.read()
        time.sleep(1)
        return bool((shares_of_hues(screenshot(environment, picture), colors) > LEAST_SHARE).all())

    with rviz_showing(wing, tmp_path) as (environment, program):
        try:
            wait_for(shown, WAIT_S)
        except AssertionError:
            pytest.fail(f"not all colors of rooms are in {picture}")
    # Most of what is in color belongs to rooms, and there is much of it.
    assert shares_of_hues(picture, colors).sum() > 0.1
