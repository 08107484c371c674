"""A Foxglove layout and an RViz2 configuration that show an annotated log with everything in view."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from rose2_logs.model.occupancy import FloatArray
from rose2_logs.outputs.mcap.ros_messages import MARKER_LAYERS
from rose2_logs.system.files import replacing

MARGIN = 1.1
"""Size of the view relative to the rooms."""
RVIZ_VIEW_PX = (1100, 850)
"""Width and height of RViz's 3D view in the window that the configuration asks for."""
RVIZ_WINDOW_PX = (1500, 950)
FOXGLOVE_ASPECT = 1.0
"""Width over height of Foxglove's large panel in a window of 1600 x 900 points with the sidebar."""
FOXGLOVE_SMALL_ASPECT = 0.9
"""The same of its small panel for the clean map."""
AXES_SHARE = 0.025
"""Length of the axes of frames relative to the height of the view."""
AXES_M = 0.2
"""Their length in RViz and Foxglove at the scale 1, meters."""
MAP_ALPHA = 0.7
SHOWN = {name: name != "lines" for name in MARKER_LAYERS}
"""Namespaces of markers that are on at first: the representative lines go on beyond the building."""
TRANSIENT_LOCAL, VOLATILE = "Transient Local", "Volatile"
RELIABLE, BEST_EFFORT = "Reliable", "Best Effort"


@dataclass(frozen=True, eq=False)
class MapScene:
    """What the viewers should show.

    Attributes
    ----------
    frame_id : str
        Frame of the map.
    map_topic : str
        Topic of the map.
    low_m, high_m : (2,) float
        Corners of the area to show, meters.
    map_qos : str
        Quality of service that the map is offered with, in rosbag2's notation; empty if it is not known.
    qos : str
        The same of the added topics.
    z_m : float
        Height of the map in its frame.
    """

    frame_id: str
    map_topic: str
    low_m: FloatArray
    high_m: FloatArray
    map_qos: str
    qos: str
    z_m: float = 0.0

    @property
    def center_m(self) -> tuple[float, float]:
        """Center of the area to show."""
        x, y = ((self.low_m + self.high_m) / 2).tolist()
        return x, y

    def height_m(self, aspect: float) -> float:
        """Height of the smallest view with a given width over height that shows everything."""
        return view_height_m(self.low_m, self.high_m, aspect)


def _axes_scale(height_m: float) -> float:
    """Scale at which the axes of frames can be seen in a view."""
    return round(max(1.0, AXES_SHARE * height_m / AXES_M), 2)


def view_height_m(low_m: FloatArray, high_m: FloatArray, aspect: float) -> float:
    """Height of the smallest view with a given width over height that shows a rectangle with some margin."""
    width, height = high_m - low_m
    return MARGIN * float(max(width / aspect, height, 1.0))


def foxglove_path(log: Path) -> Path:
    """Path of the Foxglove layout of an annotated log."""
    return log.with_suffix(".foxglove.json")


def rviz_path(log: Path) -> Path:
    """Path of the RViz2 configuration of an annotated log."""
    return log.with_suffix(".rviz")


def bag_metadata_path(log: Path) -> Path:
    """Path at which rosbag2 looks for the description of a bag."""
    return log.with_name("metadata.yaml")


def write_layouts(log: Path, scene: MapScene) -> None:
    """Write layout and configuration next to an annotated log.

    Raises
    ------
    OutputError
        If one cannot be written.
    """
    with replacing(foxglove_path(log)) as part:
        part.write_text(json.dumps(foxglove_layout(scene), indent=2) + "\n", encoding="utf-8")
    with replacing(rviz_path(log)) as part:
        part.write_text(yaml.safe_dump(rviz_config(scene), sort_keys=False), encoding="utf-8")


def foxglove_layout(scene: MapScene) -> dict[str, Any]:
    """Make a Foxglove layout: rooms over the map, clean map, coverage, number of rooms, robot frames."""
    rooms = {
        scene.map_topic: {"visible": True, "colorMode": "map", "alpha": MAP_ALPHA},
        "/rose2/markers": {
            "visible": True,
            "namespaces": {name: {"visible": shown} for name, shown in SHOWN.items()},
        },
        "/rose2/segmented_map": {"visible": False},
        "/rose2/clean_map": {"visible": False, "colorMode": "map"},
    }
    clean = {
        "/rose2/clean_map": {"visible": True, "colorMode": "map"},
        scene.map_topic: {"visible": False},
        "/rose2/segmented_map": {"visible": False},
        "/rose2/markers": {"visible": False},
    }
    return {
        "configById": {
            "3D!rooms": _foxglove_world("Rooms", scene, rooms, FOXGLOVE_ASPECT),
            "3D!clean": _foxglove_world("Clean map", scene, clean, FOXGLOVE_SMALL_ASPECT),
            "Plot!coverage": _foxglove_plot("Coverage", "/rose2/rooms.coverage"),
            "Plot!rooms": _foxglove_plot("Number of rooms", "/rose2/rooms.count"),
        },
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {
            "direction": "row",
            "splitPercentage": 70,
            "first": "3D!rooms",
            "second": {
                "direction": "column",
                "splitPercentage": 50,
                "first": "3D!clean",
                "second": {
                    "direction": "column",
                    "splitPercentage": 50,
                    "first": "Plot!coverage",
                    "second": "Plot!rooms",
                },
            },
        },
    }


def _foxglove_world(title: str, scene: MapScene, topics: dict[str, Any], aspect: float) -> dict[str, Any]:
    x, y = scene.center_m
    return {
        "foxglovePanelTitle": title,
        "cameraState": {
            # From straight above, without perspective; the distance equals the height of the view.
            "perspective": False,
            "phi": 0,
            "thetaOffset": 0,
            "distance": scene.height_m(aspect),
            "target": [0, 0, 0],
            "targetOffset": [x, y, scene.z_m or 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.5,
            "far": 5000,
        },
        "followMode": "follow-none",
        "followTf": scene.frame_id,
        "scene": {
            "labelScaleFactor": 1,
            # Without the line from each frame to its parent, which crosses the plan.
            "transforms": {
                "showLabel": False,
                "axisScale": _axes_scale(scene.height_m(aspect)),
                "lineWidth": 0,
            },
        },
        "transforms": {},
        "topics": topics,
        "layers": {},
    }


def _foxglove_plot(title: str, path: str) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "title": title,
        "paths": [{"value": path, "enabled": True, "timestampMethod": "receiveTime"}],
        "xAxisVal": "timestamp",
        "showLegend": False,
        "isSynced": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
    }


def rviz_config(scene: MapScene) -> dict[str, Any]:
    """Make an RViz2 configuration: the maps, the markers over them, the frames, seen from above."""
    x, y = scene.center_m
    width, height = RVIZ_VIEW_PX
    view_m = scene.height_m(width / height)
    displays = [
        _rviz_map("Map", scene.map_topic, scene.map_qos, is_on=True),
        _rviz_map("Clean map", "/rose2/clean_map", scene.qos, is_on=False),
        _rviz_map("Segmented map", "/rose2/segmented_map", scene.qos, is_on=False, colors="costmap"),
        {
            "Class": "rviz_default_plugins/MarkerArray",
            "Name": "Rooms",
            "Enabled": True,
            "Namespaces": dict(SHOWN),
            "Topic": _rviz_topic("/rose2/markers", scene.qos),
            "Value": True,
        },
        {
            "Class": "rviz_default_plugins/TF",
            "Name": "Frames",
            "Enabled": True,
            "Marker Scale": _axes_scale(view_m),
            "Show Arrows": False,
            "Show Axes": True,
            "Show Names": True,
            "Value": True,
        },
    ]
    return {
        # Further panels, Time above all, would be docked on the same side and leave no room for the view.
        "Panels": [{"Class": "rviz_common/Displays", "Name": "Displays"}],
        "Visualization Manager": {
            "Class": "",
            "Displays": displays,
            "Enabled": True,
            "Global Options": {
                "Background Color": "236; 236; 236",
                "Fixed Frame": scene.frame_id,
                "Frame Rate": 30,
            },
            "Name": "root",
            "Tools": [
                {"Class": f"rviz_default_plugins/{name}"}
                for name in ("Interact", "MoveCamera", "Select", "FocusCamera", "Measure")
            ],
            "Value": True,
            "Views": {
                "Current": {
                    "Class": "rviz_default_plugins/TopDownOrtho",
                    "Name": "Current View",
                    "Angle": 0,
                    "Scale": height / view_m,
                    "Target Frame": "<Fixed Frame>",
                    "Value": "TopDownOrtho (rviz_default_plugins)",
                    "X": x,
                    "Y": y,
                },
                "Saved": None,
            },
        },
        "Window Geometry": {"Width": RVIZ_WINDOW_PX[0], "Height": RVIZ_WINDOW_PX[1]},
    }


def _rviz_map(name: str, topic: str, qos: str, *, is_on: bool, colors: str = "map") -> dict[str, Any]:
    return {
        "Class": "rviz_default_plugins/Map",
        "Name": name,
        "Enabled": is_on,
        "Alpha": MAP_ALPHA,
        "Color Scheme": colors,
        "Draw Behind": True,
        "Topic": _rviz_topic(topic, qos),
        "Update Topic": _rviz_topic(f"{topic}_updates", qos),
        "Use Timestamp": False,
        "Value": is_on,
    }


def _rviz_topic(topic: str, qos: str) -> dict[str, Any]:
    """Request exactly the quality of service that is offered: requesting more gets no messages."""
    durability, reliability = offered(qos)
    return {
        "Depth": 1,
        "Durability Policy": durability,
        "History Policy": "Keep Last",
        "Reliability Policy": reliability,
        "Value": topic,
    }


@lru_cache(maxsize=2)
def offered(qos: str) -> tuple[str, str]:
    """Durability and reliability of a topic, in RViz's notation, from rosbag2's list of its publishers.

    Where that does not say, rosbag2 plays the topic as volatile and reliable, the default of ROS 2. Up to the
    release Iron they are numbers of rmw: 1 is transient local and reliable.
    """
    try:
        profiles = yaml.safe_load(qos)
    except yaml.YAMLError:
        profiles = None
    if not isinstance(profiles, list) or not all(isinstance(each, dict) for each in profiles):
        profiles = []
    durable = len(profiles) > 0 and all(each.get("durability") in (1, "transient_local") for each in profiles)
    reliable = all(each.get("reliability") in (1, "reliable") for each in profiles)
    return TRANSIENT_LOCAL if durable else VOLATILE, RELIABLE if reliable else BEST_EFFORT
