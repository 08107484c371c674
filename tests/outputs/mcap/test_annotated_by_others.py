"""The annotated MCAP as Foxglove's own packages read it, and the files that open it in viewers and ROS 2."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pytest
import yaml
from looking import MUST_LOOK
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from saved_maps import save_run

from rose2_logs.errors import OutputError
from rose2_logs.io import open_log
from rose2_logs.outputs.mcap.annotated import ADDED
from rose2_logs.outputs.mcap.input import NAMED_LATCHED_QOS
from rose2_logs.outputs.mcap.viewer_layouts import offered
from rose2_logs.workflows.analyze import RunOptions, analyze_log

PROJECT = Path(__file__).parents[3]
OFFICE, WING = PROJECT / "sample_logs" / "office.mcap", PROJECT / "sample_logs" / "wing.bag"
PACKAGES = {
    "@mcap/core": "^2",
    "@mcap/nodejs": "^1",
    "@mcap/support": "^1",
    "@foxglove/rosmsg": "^5",
    "@foxglove/rosmsg2-serialization": "^3",
}
INSTALL_S = 240


def analyzed(log: Path, folder: Path, **changes) -> Path:
    """Folder with an annotated log of three maps, as a bag."""
    options = RunOptions(max_snapshots=3, recording=False, bag=True, **changes)
    return analyze_log(log, folder / log.stem, options).folder


@pytest.fixture(scope="module", params=[OFFICE, WING], ids=lambda log: log.suffix)
def folder(request, tmp_path_factory):
    return analyzed(request.param, tmp_path_factory.mktemp("annotated"))


@pytest.fixture(scope="session")
def node_packages(tmp_path_factory):
    """A folder with the reading script and the packages that it needs."""
    if not MUST_LOOK and (shutil.which("node") is None or shutil.which("npm") is None):
        pytest.skip("needs node and npm")
    place = tmp_path_factory.mktemp("node")
    described = {"type": "module", "private": True, "dependencies": PACKAGES}
    (place / "package.json").write_text(json.dumps(described), encoding="utf-8")
    shutil.copy(Path(__file__).with_name("read_annotated.mjs"), place)
    command = ["npm", "install", "--no-audit", "--no-fund", "--no-save", "--prefer-offline"]
    try:
        done = subprocess.run(command, cwd=place, capture_output=True, check=False, timeout=INSTALL_S)
    except subprocess.TimeoutExpired:
        fault = "npm cannot install Foxglove's packages in time"
    else:
        if done.returncode == 0:
            return place
        fault = f"npm cannot install Foxglove's packages here: {done.stderr.decode(errors='replace')[-500:]}"
    if MUST_LOOK:
        pytest.fail(fault)
    pytest.skip(fault)


def test_foxgloves_packages_read_every_message_and_every_marker(tmp_path, node_packages):
    """And find in them what rosbags finds."""
    annotated = analyzed(OFFICE, tmp_path) / "office.rose2.mcap"
    done = subprocess.run(
        ["node", "read_annotated.mjs", annotated],
        cwd=node_packages,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    messages: Counter[str] = Counter()
    markers: dict[str, dict[str, float]] = defaultdict(lambda: {"count": 0, "points": 0, "x": 0.0})
    rooms = []
    with AnyReader([annotated]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            messages[connection.topic] += 1
            for marker in getattr(message, "markers", ()):
                told = markers[marker.ns]
                told["count"] += 1
                told["points"] += len(marker.points)
                told["x"] += sum(point.x for point in marker.points)
            if connection.topic == "/rose2/rooms":
                rooms.append([[room.track, room.area, room.neighbors.tolist()] for room in message.rooms])
    assert found["profile"] == "ros2"
    assert found["messages"] == messages
    there = {*("", "rooms", "outlines", "labels", "walls", "lines", "doorways", "path")}
    assert there <= set(found["markers"]) <= there | {"unsure_borders"}
    for name, told in markers.items():
        assert found["markers"][name] == pytest.approx(told)
    assert found["rooms"] == rooms


def test_the_folder_is_a_bag_with_every_message(folder):
    """Read as rosbag2 reads it, by its description; and our own reader takes it as one, too."""
    (log,) = folder.glob("*.rose2.mcap")
    with AnyReader([log]) as reader:
        counts = Counter(connection.topic for connection, _, _ in reader.messages())
        types = {connection.topic: connection.msgtype for connection in reader.connections}
        span = reader.start_time, reader.end_time
    with Reader(folder) as bag:
        assert {each.topic: each.msgcount for each in bag.connections} == counts
        assert {each.topic: each.msgtype for each in bag.connections} == types
        assert all(each.ext.offered_qos_profiles is not None for each in bag.connections)
        assert Counter(connection.topic for connection, _, _ in bag.messages()) == counts
        assert (bag.start_time, bag.end_time, bag.message_count) == (*span, counts.total())
    described = yaml.safe_load((folder / "metadata.yaml").read_text(encoding="utf-8"))
    (file,) = described["rosbag2_bagfile_information"]["files"]
    assert (file["path"], file["message_count"]) == (log.name, counts.total())
    with open_log(folder) as reader:
        assert reader.info.format == "ROS 2 bag (mcap)"


def test_a_log_with_messages_of_other_kinds_is_refused_as_a_bag(tmp_path):
    mixed = tmp_path / "mixed.mcap"
    with OFFICE.open("rb") as source, mixed.open("wb") as target:
        writer = Writer(target)
        writer.start("ros2", "test")
        note = writer.register_channel("/note", "json", writer.register_schema("note", "jsonschema", b"{}"))
        channel_id = None
        for kind, channel, message in make_reader(source).iter_messages(topics=["/map"]):
            if channel_id is None:
                schema = writer.register_schema(kind.name, kind.encoding, kind.data)
                channel_id = writer.register_channel("/map", "cdr", schema, channel.metadata)
            writer.add_message(channel_id, message.log_time, message.data, message.log_time)
        writer.add_message(note, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(OutputError, match=r"/note has json messages.*leave out bag=True"):
        analyzed(mixed, tmp_path / "out")
    assert not [file for file in (tmp_path / "out").rglob("*") if file.is_file()]


def test_the_layouts_show_topics_that_are_there_in_the_frame_of_the_map(folder):
    (log,) = folder.glob("*.rose2.mcap")
    layout = json.loads((folder / f"{log.stem}.foxglove.json").read_text(encoding="utf-8"))
    config = yaml.safe_load((folder / f"{log.stem}.rviz").read_text(encoding="utf-8"))
    with AnyReader([log]) as reader:
        topics = set(reader.topics)
        array = next(data for c, _, data in reader.messages() if c.topic == "/rose2/markers")
        marker = reader.deserialize(array, ADDED["/rose2/markers"]).markers[1]
        xy = np.array([(point.x, point.y) for point in marker.points])
    panels = layout["configById"]
    world = panels["3D!rooms"]
    assert set(world["topics"]) <= topics
    shown = {topic for topic, settings in world["topics"].items() if settings["visible"]}
    assert shown == {"/map", "/rose2/markers"}
    assert world["followTf"] == config["Visualization Manager"]["Global Options"]["Fixed Frame"] == "map"
    assert set(panels) == set(_leaves(layout["layout"]))
    displays = {each["Name"]: each for each in config["Visualization Manager"]["Displays"]}
    assert {each["Topic"]["Value"] for each in displays.values() if "Topic" in each} <= topics
    assert displays["Map"]["Enabled"]
    assert displays["Rooms"]["Topic"]["Durability Policy"] == "Transient Local"
    # Beside the list of displays RViz leaves the rest of the window to the view.
    assert [panel["Name"] for panel in config["Panels"]] == ["Displays"]
    # What the curves show is a number in the messages: not every viewer counts the elements of a list.
    curves = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
    assert curves == ["/rose2/rooms.coverage", "/rose2/rooms.count"]
    # Both look at the rooms from above.
    view = config["Visualization Manager"]["Views"]["Current"]
    camera = world["cameraState"]
    assert camera["targetOffset"][:2] == [view["X"], view["Y"]]
    assert np.abs(xy - camera["targetOffset"][:2]).max(axis=0)[1] < camera["distance"] / 2


def without_qos(log: Path, of_odometry: str = "") -> Path:
    """The office without quality of service, but for that of the odometry."""
    with OFFICE.open("rb") as source, log.open("wb") as target:
        writer = Writer(target)
        writer.start("ros2", "test")
        channels = {}
        for kind, channel, message in make_reader(source).iter_messages():
            if channel.topic not in channels:
                schema = writer.register_schema(kind.name, kind.encoding, kind.data)
                qos = {"offered_qos_profiles": of_odometry} if channel.topic == "/odom" else {}
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", schema, qos)
            number = channels[channel.topic]
            writer.add_message(number, message.log_time, message.data, message.publish_time)
        writer.finish()
    return log


@pytest.mark.parametrize(("odometry", "version"), [("", 5), (NAMED_LATCHED_QOS, None)])
def test_the_file_says_in_which_notation_quality_of_service_is(tmp_path, odometry, version):
    """In numbers a record says so; in names, as rosbag2 writes since Iron, the added ones are named too."""
    (path,) = analyzed(without_qos(tmp_path / "log.mcap", odometry), tmp_path / "out").glob("*.rose2.mcap")
    with path.open("rb") as file:
        reader = make_reader(file)
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        channels = {channel.topic: channel for channel in reader.get_summary().channels.values()}
    told = yaml.safe_load(records.get("rosbag2", {}).get("serialized_metadata", "{}"))
    assert told.get("version") == version
    (profile,) = yaml.safe_load(channels["/rose2/markers"].metadata["offered_qos_profiles"])
    assert (profile["durability"], profile["reliability"]) == (
        (1, 1) if version else ("transient_local", "reliable")
    )


def test_rviz_asks_for_the_map_as_it_is_played_even_if_the_log_does_not_say(tmp_path):
    """An unknown quality of service is played as volatile; the added topics tell theirs."""
    folder = analyzed(without_qos(tmp_path / "unknown.mcap"), tmp_path / "out")
    (config,) = folder.glob("*.rviz")
    displays = yaml.safe_load(config.read_text(encoding="utf-8"))["Visualization Manager"]["Displays"]
    asked = {each["Name"]: each["Topic"]["Durability Policy"] for each in displays if "Topic" in each}
    assert asked == {
        "Map": "Volatile",
        **dict.fromkeys(["Clean map", "Segmented map", "Rooms"], "Transient Local"),
    }
    described = yaml.safe_load((folder / "metadata.yaml").read_text(encoding="utf-8"))
    for topic in described["rosbag2_bagfile_information"]["topics_with_message_count"]:
        profiles = yaml.safe_load(topic["topic_metadata"]["offered_qos_profiles"]) or []
        assert [each["durability"] for each in profiles] == (
            [1] if topic["topic_metadata"]["name"] in ADDED else []
        )


def _leaves(layout) -> list[str]:
    return [layout] if isinstance(layout, str) else _leaves(layout["first"]) + _leaves(layout["second"])


@pytest.mark.parametrize(
    ("qos", "expected"),
    [
        ("", ("Volatile", "Reliable")),
        ("[]", ("Volatile", "Reliable")),
        ("- durability: 1\n  reliability: 1\n", ("Transient Local", "Reliable")),
        ("- durability: transient_local\n  reliability: reliable\n", ("Transient Local", "Reliable")),
        ("- durability: 2\n  reliability: 2\n", ("Volatile", "Best Effort")),
        ("- durability: 1\n  reliability: 1\n- durability: volatile\n", ("Volatile", "Best Effort")),
        ("{", ("Volatile", "Reliable")),
    ],
)
def test_viewers_ask_for_no_more_than_is_offered(qos, expected):
    assert offered(qos) == expected


def test_layouts_of_saved_maps_look_at_their_rooms(tmp_path):
    """Where the log is no log of messages, the map is on the topic that the annotated one has."""
    options = RunOptions(recording=False)
    done = analyze_log(save_run(tmp_path / "run"), tmp_path / "out", options)
    (layout,) = done.folder.glob("*.foxglove.json")
    world = json.loads(layout.read_text(encoding="utf-8"))["configById"]["3D!rooms"]
    assert world["topics"]["/map"]["visible"]
    assert world["followTf"] == "map"
    assert not (done.folder / "metadata.yaml").exists()
