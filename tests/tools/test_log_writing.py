from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from rose2_logs.model.occupancy import GridGeometry

KINDS = ["run.mcap", "run.bag", "run"]
START_NS = 1_700_000_000_000_000_000
GEOMETRY = GridGeometry(0.05, (-3.2, 1.6), 0.3, "map", (3, 4))
CELLS = np.arange(12, dtype=np.int8).reshape(3, 4) - 1


def write(path):
    from log_writing import robot_log

    with robot_log(path, START_NS, {"made by": "a test"}) as log:
        log.write_pose(0.5, np.array([2.0, 1.0, 0.7]), np.array([1.5, 0.5, 0.2]))
        log.write_map(1.25, CELLS, GEOMETRY)
    return path


def read(path):
    # A lone MCAP is read by rosbags as a rosbag2 of one file.
    with AnyReader([path]) as reader:
        return [
            (connection.topic, time, reader.deserialize(raw, connection.msgtype))
            for connection, time, raw in reader.messages()
        ]


def stored(path):
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return [file.read_bytes() for file in files]


@pytest.mark.parametrize("name", KINDS)
def test_a_map_reads_back_as_it_was_written(tmp_path, name):
    messages = {topic: (time, message) for topic, time, message in read(write(tmp_path / name))}
    time, grid = messages["/map"]
    assert time == START_NS + 1_250_000_000
    assert (grid.header.stamp.sec, grid.header.stamp.nanosec) == (1_700_000_001, 250_000_000)
    assert grid.header.frame_id == "map"
    assert np.array_equal(grid.data.reshape(grid.info.height, grid.info.width), CELLS)
    assert grid.info.resolution == pytest.approx(0.05)
    assert (grid.info.origin.position.x, grid.info.origin.position.y) == (-3.2, 1.6)
    assert 2 * np.arctan2(grid.info.origin.orientation.z, grid.info.origin.orientation.w) == pytest.approx(
        0.3
    )


@pytest.mark.parametrize("name", KINDS)
def test_transforms_chain_from_the_map_to_the_pose_of_the_robot(tmp_path, name):
    messages = {topic: message for topic, _, message in read(write(tmp_path / name))}
    transforms = messages["/tf"].transforms
    assert [(t.header.frame_id, t.child_frame_id) for t in transforms] == [
        ("map", "odom"),
        ("odom", "base_link"),
    ]
    pose = np.eye(3)
    for t in (transform.transform for transform in transforms):
        yaw = 2 * np.arctan2(t.rotation.z, t.rotation.w)
        c, s = np.cos(yaw), np.sin(yaw)
        pose = pose @ np.array([[c, -s, t.translation.x], [s, c, t.translation.y], [0, 0, 1]])
    assert pose[:2, 2] == pytest.approx([2.0, 1.0])
    assert np.arctan2(pose[1, 0], pose[0, 0]) == pytest.approx(0.7)
    assert messages["/odom"].pose.pose.position.x == pytest.approx(1.5)


@pytest.mark.parametrize("name", KINDS)
def test_writing_again_replaces_the_log_by_the_same_bytes(tmp_path, name):
    first = stored(write(tmp_path / name))
    assert stored(write(tmp_path / name)) == first
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", KINDS)
def test_a_run_that_fails_leaves_no_log_behind(tmp_path, name):
    from log_writing import robot_log

    def interrupted():
        with robot_log(tmp_path / name, START_NS, {}) as log:
            log.write_map(0.0, CELLS, GEOMETRY)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_unknown_suffix_is_refused_before_anything_is_written(tmp_path):
    from log_writing import robot_log

    with pytest.raises(ValueError, match=r"\.mcap, \.bag"), robot_log(tmp_path / "run.csv", START_NS, {}):
        pass
    assert list(tmp_path.iterdir()) == []


def test_mcap_embeds_schemas_and_the_latched_quality_of_service_of_maps(tmp_path):
    from mcap.reader import make_reader

    with write(tmp_path / "run.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        attachments = [attachment.name for attachment in reader.iter_attachments()]
    channel = next(c for c in summary.channels.values() if c.topic == "/map")
    assert channel.message_encoding == "cdr"
    assert "durability: 1" in channel.metadata["offered_qos_profiles"]
    assert b"MapMetaData" in summary.schemas[channel.schema_id].data
    assert attachments == ["origin.json"]


SAMPLES = Path(__file__).parents[2] / "sample_logs"


@pytest.mark.parametrize("name", ["office.mcap", "wing.bag", "ring"])
def test_sample_logs_hold_growing_maps_with_poses_and_true_rooms_beside(name):
    import json

    from PIL import Image

    with AnyReader([SAMPLES / name]) as reader:
        assert {c.topic for c in reader.connections} == {"/map", "/tf", "/odom"}
        maps = [c for c in reader.connections if c.topic == "/map"]
        grids = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(maps)]
    assert 20 <= len(grids) <= 60
    sizes = [grid.info.width * grid.info.height for grid in grids]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[-1]
    assert len({(g.info.origin.position.x, g.info.origin.position.y) for g in grids}) > 1
    truth = json.loads((SAMPLES / f"{Path(name).stem}.rooms.json").read_text())
    labels = np.flipud(np.asarray(Image.open(SAMPLES / truth["image"])))
    assert list(labels.shape) == truth["shape"]
    assert np.unique(labels)[1:].tolist() == [room["label"] for room in truth["rooms"]]
    # The truth lies where the last map has its obstacles. Its free cells prove less: how many of them lie
    # outside the building depends on its windows.
    info, cells = grids[-1].info, grids[-1].data.reshape(grids[-1].info.height, grids[-1].info.width)
    rows, columns = np.nonzero(cells > 65)
    xy = (np.stack([columns, rows], -1) + 0.5) * info.resolution
    xy += np.array([info.origin.position.x, info.origin.position.y])
    at = np.floor((xy - np.array(truth["origin_xy_m"])) / truth["resolution_m"]).astype(int)
    inside = ((at >= 0) & (at < labels.shape[::-1])).all(1)
    found = np.zeros(len(xy), bool)
    found[inside] = labels[at[inside, 1], at[inside, 0]] > 0
    assert found.mean() > 0.95


def test_sample_logs_are_small():
    assert sum(path.stat().st_size for path in SAMPLES.rglob("*") if path.is_file()) < 10_000_000
