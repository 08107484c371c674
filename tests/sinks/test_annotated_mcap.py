"""The annotated MCAP, read back by other readers than ours."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import shapely
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from saved_maps import save_run

from rose2_logs.errors import OutputError
from rose2_logs.floor_plan.rooms import outline
from rose2_logs.run import RunOptions, analyse_log
from rose2_logs.sinks.annotated_mcap import ADDED, ATTACHMENT, METADATA
from rose2_logs.sinks.ros_messages import triangle_corners

PROJECT = Path(__file__).parents[2]
SHARED = PROJECT.parent / "shared" / "bags"
LOGS = {
    "sample mcap": PROJECT / "sample_logs" / "office.mcap",
    "sample bag": PROJECT / "sample_logs" / "wing.bag",
    "sample rosbag2": PROJECT / "sample_logs" / "ring",
    "ROS 1 bag": SHARED / "fr79.bag",
    "rosbag2 mcap": SHARED / "fr79.ros2_mcap",
    "rosbag2 sqlite3 zstd": SHARED / "fr79.ros2_sqlite3_zstd",
    "costmaps": SHARED / "third_party" / "base_cmaps_mcap",
}


def annotate(log: Path, folder: Path, **changes) -> Path:
    from rose2_logs.readers import Selection

    options = RunOptions(selection=Selection(max_snapshots=3), recording=False, **changes)
    result = analyse_log(log, folder, options)
    (path,) = [file for file in result.files if file.suffix == ".mcap"]
    return path


def topic_of(name: str) -> str | None:
    return "/move_base/global_costmap/costmap" if name == "costmaps" else None


@pytest.fixture(scope="module", params=LOGS)
def annotated(request, tmp_path_factory):
    log = LOGS[request.param]
    if not log.exists():
        pytest.skip(f"{log.name} lies in the shared test data, which is absent")
    return log, annotate(log, tmp_path_factory.mktemp("out"), topic=topic_of(request.param))


def test_every_original_message_is_there_and_every_message_deserialises(annotated):
    log, path = annotated
    with AnyReader([log]) as before, AnyReader([path]) as after:
        originals = Counter((c.topic, time) for c, time, _ in before.messages())
        found = Counter()
        for connection, time, data in after.messages():
            after.deserialize(data, connection.msgtype)
            if connection.topic not in ADDED:
                found[connection.topic, time] += 1
        if before.is2:
            assert sorted(bytes(d) for c, _, d in after.messages() if c.topic not in ADDED) == sorted(
                bytes(d) for _, _, d in before.messages()
            )
    assert found == originals


def test_the_file_is_sound_in_log_time_order_and_of_the_ros2_profile(annotated):
    _, path = annotated
    doctor = subprocess.run(
        [Path(sys.executable).with_name("pymcap-cli"), "doctor", path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert doctor.returncode == 0, doctor.stdout + doctor.stderr
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        assert "rose2_logs" in reader.get_header().library
        times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
        assert times == sorted(times)
        assert METADATA in {record.name for record in reader.iter_metadata()}
        (parameters,) = [item for item in reader.iter_attachments() if item.name == ATTACHMENT]
        assert "floor_plan" in json.loads(parameters.data)


def test_the_added_topics_have_stamp_frame_and_latching_of_the_map(annotated):
    _, path = annotated
    with AnyReader([path]) as log:
        by_topic = {topic: [] for topic in ADDED}
        maps = {}
        for connection, time, data in log.messages():
            message = log.deserialize(data, connection.msgtype)
            if connection.topic in ADDED:
                by_topic[connection.topic].append((time, message))
            elif connection.msgtype == "nav_msgs/msg/OccupancyGrid":
                maps[time] = message
        for topic in ADDED:
            assert len(by_topic[topic]) in (1, 3)
        for time, rooms in by_topic["/rose2/rooms"]:
            assert rooms.header.frame_id == maps[time].header.frame_id
            assert rooms.header.stamp == maps[time].header.stamp
            assert 0 <= rooms.coverage <= 1
            tracks = [room.track for room in rooms.rooms]
            assert tracks == sorted(set(tracks))
            assert all(set(room.neighbours) <= set(tracks) for room in rooms.rooms)
        for time, grid in by_topic["/rose2/segmented_map"]:
            source = maps[time]
            assert (grid.info.width, grid.info.height) == (source.info.width, source.info.height)
            assert (np.asarray(grid.data)[np.asarray(source.data) < 0] == -1).all()
        for _, array in by_topic["/rose2/markers"]:
            assert array.markers[0].action == 3
            names = [(marker.ns, marker.id) for marker in array.markers[1:]]
            assert len(names) == len(set(names))
            assert all(len(marker.points) % 3 == 0 for marker in array.markers if marker.type == 11)


def test_of_saved_maps_each_map_is_written_as_a_message(tmp_path):
    path = annotate(save_run(tmp_path / "run"), tmp_path / "out")
    with AnyReader([path]) as log:
        count = Counter(connection.topic for connection, _, _ in log.messages())
    assert set(count) == {"/map", *ADDED}
    assert count["/map"] == count["/rose2/rooms"] == 3


def test_channels_of_other_encodings_attachments_and_empty_channels_are_kept(tmp_path):
    mixed = tmp_path / "mixed.mcap"
    with LOGS["sample mcap"].open("rb") as source, mixed.open("wb") as target:
        reader, writer = make_reader(source), Writer(target)
        writer.start("ros2", "test")
        schema = writer.register_schema("note", "jsonschema", b"{}")
        note = writer.register_channel("/note", "json", schema, {"by": "hand"})
        writer.register_channel("/silent", "json", schema)
        writer.add_attachment(1, 2, "a.txt", "text/plain", b"kept")
        writer.add_metadata("site", {"floor": "2"})
        channels = {}
        for kind, channel, message in reader.iter_messages(topics=["/map"]):
            if not channels:
                channels["/map"] = writer.register_channel(
                    "/map",
                    "cdr",
                    writer.register_schema(kind.name, kind.encoding, kind.data),
                    channel.metadata,
                )
            time = message.log_time
            writer.add_message(channels["/map"], time, message.data, time, 5)
            writer.add_message(note, time, b'{"text": "hello"}', time + 1, 9)
        writer.finish()
    path = annotate(mixed, tmp_path / "out")
    with path.open("rb") as file:
        reader = make_reader(file)
        topics = {channel.topic: channel for channel in reader.get_summary().channels.values()}
        assert topics["/note"].metadata == {"by": "hand"}
        assert "/silent" in topics
        notes = list(reader.iter_messages(topics=["/note"]))
        assert len(notes) == 40
        assert all(
            (m.publish_time, m.sequence, m.data) == (m.log_time + 1, 9, b'{"text": "hello"}')
            for _, _, m in notes
        )
        assert {item.name for item in reader.iter_attachments()} == {"a.txt", ATTACHMENT}
        assert {"site", METADATA} <= {record.name for record in reader.iter_metadata()}


def test_triangles_fill_any_outline_of_cells():
    rng = np.random.default_rng(3)
    for _ in range(60):
        shape = outline(rng.random((14, 14)) < rng.uniform(0.3, 0.9), 0.05)
        corners = triangle_corners(shape).reshape(-1, 3, 2)
        area = shapely.area(shapely.polygons(corners)).sum()
        assert area == pytest.approx(shape.area, rel=0.05)


def test_an_annotated_log_is_not_annotated_again_and_nothing_is_left_behind(tmp_path):
    once = annotate(save_run(tmp_path / "run"), tmp_path / "out")
    with pytest.raises(OutputError, match="holds /rose2/"):
        annotate(once, tmp_path / "again")
    assert not [file for file in (tmp_path / "again").rglob("*") if file.is_file()]
