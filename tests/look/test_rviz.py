"""RViz 1.14 of Debian, which draws as RViz2 does, with the configuration that is written for RViz2."""

from __future__ import annotations

import colorsys
import json
import os
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import started, wait_for
from looking import free_port
from PIL import Image
from programs import needed, screen, screenshot
from rosbags.highlevel import AnyReader

DEBIAN_PYTHON = "/usr/bin/python3"
CLASSES = ("rviz_default_plugins/", "rviz_common/")
DRAWN_S = float(os.environ.get("ROSE2_LOGS_DRAWN_S", "60"))
"""Longest time until all is drawn; RViz does not tell."""


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


def last_messages(log: Path) -> dict[str, Any]:
    """The last map and the last markers of an annotated log, and the last rooms."""
    topics = {"map": "/map", "markers": "/rose2/markers", "rooms": "/rose2/rooms"}
    found = {}
    with AnyReader([log]) as reader:
        for key, topic in topics.items():
            connections = [each for each in reader.connections if each.topic == topic]
            *_, (connection, _, data) = reader.messages(connections)
            message = reader.deserialize(data, connection.msgtype)
            found[key] = {"topic": topic, "message": fields_of(message)}
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
    with screen() as display:
        environment = {key: value for key, value in display.items() if key != "PYTHONPATH"} | ros
        with (
            started(rosmaster, "--core", "-p", port, env=environment),
            started(DEBIAN_PYTHON, publisher, messages, env=environment),
            started(rviz, "-d", shown, env=environment) as program,
        ):
            yield environment, program


def hues(picture: Path) -> np.ndarray:
    """Hue (N,) in [0, 1) of each pixel of a picture that has a color."""
    pixels = np.asarray(Image.open(picture).convert("RGB")).reshape(-1, 3).astype(float)
    kinds, counts = np.unique(pixels, axis=0, return_counts=True)
    spread = kinds.max(1) - kinds.min(1)
    kinds, counts = kinds[spread > 25], counts[spread > 25]
    found = np.array([colorsys.rgb_to_hsv(*kind)[0] for kind in kinds])
    return np.repeat(found, counts)


def test_rviz_shows_each_room_in_its_color(wing, pictures, tmp_path):
    """Beside nothing but the list of displays, so that the rooms fill most of the window."""
    (log,) = wing.glob("*.rose2.mcap")
    markers = last_messages(log)["markers"]["message"]["markers"]
    rooms = [marker for marker in markers if marker["ns"] == "rooms"]
    colors = [colorsys.rgb_to_hsv(*(room["color"][part] for part in "rgb"))[0] for room in rooms]
    assert len(colors) > 5

    def shown() -> np.ndarray | None:
        assert program.poll() is None, program.stderr.read()
        found = hues(screenshot(environment, pictures / "rviz_wing.png"))
        time.sleep(1)
        far = np.abs((found[:, None] - colors + 0.5) % 1 - 0.5) if len(found) else np.ones((1, len(colors)))
        counts = (far < 0.02).sum(axis=0)
        return counts if (counts > 100).all() else None

    with rviz_showing(wing, tmp_path) as (environment, program):
        try:
            wait_for(shown, DRAWN_S)
        except AssertionError:
            pytest.fail(f"not all colors of rooms are in {pictures / 'rviz_wing.png'}")
