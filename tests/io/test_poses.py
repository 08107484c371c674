"""The robot's way from transforms, odometry or poses, of ROS 1 and ROS 2, whole logs and cut ones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rose2_logs.config.selection import Selection
from rose2_logs.io import open_log
from rose2_logs.io.poses import BASE_FRAMES, POSE_STEP_M, POSE_STEP_S, RobotPath

PROJECT = Path(__file__).parents[2]
ROS2, ROS1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
SECOND = 10**9
TF, ODOMETRY, POSE = "tf2_msgs/msg/TFMessage", "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"
Message = tuple[int, str, str, object]
"""Log time, topic, type, content."""


def header(store, frame: str, time_ns: int):
    stamp = store.types["builtin_interfaces/msg/Time"](time_ns // SECOND, time_ns % SECOND)
    extra = {"seq": 0} if store is ROS1 else {}
    return store.types["std_msgs/msg/Header"](**extra, stamp=stamp, frame_id=frame)


def placed(store, kind: str, x: float, y: float, yaw: float):
    names = {
        "Pose": ("Point", "position", "orientation"),
        "Transform": ("Vector3", "translation", "rotation"),
    }
    point, where, turn = names[kind]
    types = store.types
    return types[f"geometry_msgs/msg/{kind}"](
        **{
            where: types[f"geometry_msgs/msg/{point}"](x, y, 0.0),
            turn: types["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
        }
    )


def transform(store, time_ns: int, parent: str, child: str, x: float, y: float, yaw: float) -> object:
    return store.types["geometry_msgs/msg/TransformStamped"](
        header(store, parent, time_ns), child, placed(store, "Transform", x, y, yaw)
    )


def odometry(store, time_ns: int, x: float) -> object:
    types = store.types
    zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    twist = types["geometry_msgs/msg/Twist"](zero, zero)
    return types[ODOMETRY](
        header(store, "odom", time_ns),
        "base_link",
        types["geometry_msgs/msg/PoseWithCovariance"](placed(store, "Pose", x, 0.0, 0.0), np.zeros(36)),
        types["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
    )


def grid(store) -> object:
    types = store.types
    info = types["nav_msgs/msg/MapMetaData"](
        types["builtin_interfaces/msg/Time"](0, 0), 0.05, 4, 4, placed(store, "Pose", 0.0, 0.0, 0.0)
    )
    return types["nav_msgs/msg/OccupancyGrid"](header(store, "map", 0), info, np.zeros(16, np.int8))


def write(path: Path, messages: Iterator[Message], store=ROS2) -> Path:
    """Write an MCAP of ROS 1 or ROS 2 messages, with a map at the beginning and one at the end."""
    told = sorted(messages, key=lambda message: message[0])
    ends = [(0, "/map", "nav_msgs/msg/OccupancyGrid", grid(store))]
    with path.open("wb") as file:
        writer, channels = Writer(file, chunk_size=2000), {}
        writer.start("ros1" if store is ROS1 else "ros2", "test")
        for time, topic, kind, content in [*ends, *told, (10**12, *ends[0][1:])]:
            if topic not in channels:
                name = kind.replace("/msg/", "/") if store is ROS1 else kind
                encoding = ("ros1msg", "ros1") if store is ROS1 else ("ros2msg", "cdr")
                text, _ = store.generate_msgdef(kind, ros_version=1 if store is ROS1 else 2)
                schema = writer.register_schema(name, encoding[0], text.encode())
                channels[topic] = writer.register_channel(topic, encoding[1], schema)
            serialize = store.serialize_ros1 if store is ROS1 else store.serialize_cdr
            writer.add_message(channels[topic], time, bytes(serialize(content, kind)), time)
        writer.finish()
    return path


def way(path: Path, frame: str = "map", **selection) -> tuple[str, np.ndarray]:
    with open_log(path, selection=Selection(**selection)) as log:
        found = log.robot_path(frame)
        return found.origin, found.until(2**62)


def drive(store=ROS2, base: str = "base_link") -> Iterator[Message]:
    """Drive along x of the odometry's frame, which lies turned in the map's; joints turn besides."""
    kind = store.types[TF]
    for tick in range(600):
        time = tick * SECOND // 10
        yield time, "/tf", TF, kind([transform(store, time, "odom", base, tick / 20, 0.0, 0.0)])
        yield time + 1, "/tf", TF, kind([transform(store, time, base, "wheel", 0.0, 0.1, tick / 3)])
        if tick % 10 == 5:
            yield time, "/tf", TF, kind([transform(store, time, "map", "odom", 1.0, 2.0, math.pi / 2)])


@pytest.mark.parametrize("store", [ROS1, ROS2], ids=["ros1", "ros2"])
@pytest.mark.parametrize("base", ["base_link", "robot7/base_footprint"])
def test_transforms_are_followed_from_the_map_to_the_robot(tmp_path, store, base):
    """Two transforms, of different rates, one turned by a quarter: the way goes along y of the map."""
    origin, found = way(write(tmp_path / "run.mcap", drive(store, base), store))
    assert origin == "/tf"
    assert found[:, 0] == pytest.approx(1.0)
    assert found[:, 2] == pytest.approx(math.pi / 2)
    steps = np.diff(found[:, 1])
    assert (steps >= POSE_STEP_M - 1e-9).all()
    assert steps.max() < 2 * POSE_STEP_M
    assert found[-1, 1] == pytest.approx(2 + 59.9 / 2, abs=2 * POSE_STEP_M)


def test_a_fixed_transform_stands_on_its_own_topic_and_frames_may_have_a_slash(tmp_path):
    def messages() -> Iterator[Message]:
        kind = ROS2.types[TF]
        yield 0, "/tf_static", TF, kind([transform(ROS2, 0, "/map", "/odom", 5.0, 0.0, 0.0)])
        for second in range(10):
            time = second * SECOND
            yield time, "/tf", TF, kind([transform(ROS2, time, "/odom", "/base_link", second, 0.0, 0.0)])

    origin, found = way(write(tmp_path / "run.mcap", messages()))
    assert origin == "/tf, /tf_static"
    assert found[:, 0].tolist() == [5.0 + second for second in range(10)]


def test_without_transforms_to_the_map_it_is_odometry_and_then_poses(tmp_path):
    def odometries() -> Iterator[Message]:
        kind = ROS2.types[TF]
        for second in range(10):
            time = second * SECOND
            yield time, "/odom", ODOMETRY, odometry(ROS2, time, float(second))
            # Leads to no frame of the robot from that of the map.
            yield time, "/tf", TF, kind([transform(ROS2, time, "odom", "base_link", 3.0, 3.0, 0.0)])

    def poses() -> Iterator[Message]:
        for second in range(10):
            time = second * SECOND
            pose = ROS2.types[POSE](header(ROS2, "map", time), placed(ROS2, "Pose", 0.0, second, 1.0))
            yield time, "/robot_pose", POSE, pose
            for topic in ("/goal_pose", "/initialpose"):
                yield time, topic, POSE, ROS2.types[POSE](pose.header, placed(ROS2, "Pose", 99.0, 0.0, 0.0))
                yield time + 1, topic, POSE, pose

    origin, found = way(write(tmp_path / "odometry.mcap", odometries()))
    assert (origin, found[:, 0].tolist()) == ("/odom", list(range(10)))
    origin, found = way(write(tmp_path / "poses.mcap", poses()))
    assert (origin, found[:, 1].tolist()) == ("/robot_pose", list(range(10)))
    assert found[:, 2] == pytest.approx(1.0)


def test_a_log_that_tells_nothing_of_the_robot_has_no_way(tmp_path):
    origin, found = way(write(tmp_path / "run.mcap", iter(())))
    assert (origin, found.shape) == ("", (0, 3))


def test_the_way_begins_where_the_selection_does(tmp_path):
    """With the transforms that came before it."""
    path = write(tmp_path / "run.mcap", drive())
    _, found = way(path, start_ns=30 * SECOND)
    assert found[0, 1] == pytest.approx(2 + 15, abs=POSE_STEP_M)
    assert found[:, 0] == pytest.approx(1.0)


def test_broken_numbers_are_passed_over(tmp_path):
    def messages() -> Iterator[Message]:
        for second in range(6):
            time, x = second * SECOND, math.nan if second == 3 else float(second)
            yield time, "/odom", ODOMETRY, odometry(ROS2, time, x)

    _, found = way(write(tmp_path / "run.mcap", messages()))
    assert found[:, 0].tolist() == [0, 1, 2, 4, 5]


def test_transforms_in_a_circle_end():
    from rose2_logs.io.poses import _base_in, _Edge, _Wanted

    edges = {BASE_FRAMES[0]: _Edge("odom", (1.0, 0.0, 0.0)), "odom": _Edge(BASE_FRAMES[0], (1.0, 0.0, 0.0))}
    assert _base_in(_Wanted("map", ""), edges) == (None, ())


def both_robots(topics: tuple[str, str], bases: tuple[str, str]) -> Iterator[Message]:
    """Drive two robots along two lines; each tells it on a topic of its own or on the same."""
    kind = ROS2.types[TF]
    for tick in range(100):
        time = tick * SECOND // 2
        for y, topic, base in zip((1.0, 7.0), topics, bases, strict=True):
            yield time, topic, TF, kind([transform(ROS2, time, "map", base, tick / 5, y, 0.0)])


def test_the_way_is_that_of_the_robot_in_the_namespace_of_the_map(tmp_path, caplog):
    topics = ("/one/tf", "/two/tf")
    path = write(tmp_path / "run.mcap", both_robots(topics, ("base_link", "base_link")))
    with open_log(path) as log:
        for topic, y in zip(topics, (1.0, 7.0), strict=True):
            found = RobotPath(log.source, "map", map_topic=topic.replace("tf", "map"))
            assert found.origin == topic
            assert set(found.until(2**62)[:, 1]) == {y}
        assert not caplog.text
        assert set(RobotPath(log.source, "map", map_topic="/map").until(2**62)[:, 1]) == {1.0}
    assert "/two/tf tell of other robots, which are not shown" in caplog.text


def test_of_two_robots_on_one_topic_one_is_shown_and_the_other_is_told_of(tmp_path, caplog):
    path = write(tmp_path / "run.mcap", both_robots(("/tf", "/tf"), ("one/base_link", "two/base_link")))
    assert set(way(path)[1][:, 1]) == {1.0}
    assert "other robots are not shown (two/base_link)" in caplog.text
    with open_log(path) as log:
        assert set(log.robot_path("map", "two/base_link").until(2**62)[:, 1]) == {7.0}
        assert log.decided["path"] == "/tf"


def test_a_base_of_another_name_is_found_below_odom_or_named(tmp_path, caplog):
    path = write(tmp_path / "run.mcap", drive(base="chassis"))
    origin, found = way(path)
    assert origin == "/tf"
    assert found[:, 0] == pytest.approx(1.0)
    assert "the robot's base is taken to be 'chassis'" in caplog.text
    with open_log(path) as log:
        np.testing.assert_array_equal(log.robot_path("map", "chassis").until(2**62), found)
        assert log.robot_path("map", "wheel").origin == "/tf"
        assert log.robot_path("map", "arm").origin == ""
    assert "no transforms lead from 'map' to the base frame 'arm'" in caplog.text


def chain(topic: str, *frames: str, y: float = 0.0) -> Iterator[Message]:
    """Transforms from frame to frame, of which the last one moves."""
    for tick in range(100):
        time = tick * SECOND // 5
        below = [(time, *pair, 0.0, 0.0, 0.0) for pair in pairwise(frames)]
        below[-1] = (time, *frames[-2:], tick / 20, y, 0.0)
        yield time, topic, TF, ROS2.types[TF]([transform(ROS2, *each) for each in below])


def test_names_of_robots_may_end_with_an_underscore(tmp_path, caplog):
    robots = [("robot1_odom", "robot1_base_link", 1.0), ("robot2_odom", "robot2_base_link", 7.0)]
    messages = [each for odom, base, y in robots for each in chain("/tf", "map", odom, base, y=y)]
    with open_log(write(tmp_path / "run.mcap", messages)) as log:
        for topic, y in (("/map", 1.0), ("/robot2/map", 7.0)):
            assert set(RobotPath(log.source, "map", map_topic=topic).until(2**62)[:, 1]) == {y}
    assert "other robots are not shown (robot2_base_link)" in caplog.text


def test_a_robot_is_not_what_it_carries(tmp_path, caplog):
    """The arm has a base of its own, 30 cm from that of the robot."""
    messages = [
        *chain("/tf", "map", "odom", "base_footprint"),
        (
            0,
            "/tf_static",
            TF,
            ROS2.types[TF]([transform(ROS2, 0, "base_footprint", "arm/base_link", 0, 0.3, 0)]),
        ),
    ]
    assert set(way(write(tmp_path / "run.mcap", messages))[1][:, 1]) == {0.0}
    assert not caplog.text


def test_the_map_may_lie_deeper_in_a_namespace_than_the_transforms(tmp_path, caplog):
    spaces = (("/fleet/a/tf", 1.0), ("/fleet/b/tf", 7.0))
    messages = [each for topic, y in spaces for each in chain(topic, "map", "odom", "base_link", y=y)]
    with open_log(write(tmp_path / "run.mcap", messages)) as log:
        found = RobotPath(log.source, "map", map_topic="/fleet/b/slam/map")
    assert found.origin == "/fleet/b/tf"
    assert not caplog.text


def test_a_base_below_odometry_of_another_name(tmp_path, caplog):
    assert len(way(write(tmp_path / "run.mcap", chain("/tf", "map", "odom_combined", "chassis")))[1]) > 1
    assert "taken to be 'chassis', the only frame below odom_combined" in caplog.text


def test_transforms_that_lead_to_no_base_are_told_of(tmp_path, caplog):
    path = write(tmp_path / "run.mcap", chain("/tf", "map", "chassis"))
    assert way(path)[0] == ""
    assert "the robot's way is not known" in caplog.text
    assert "base_frame=NAME names it, of chassis" in caplog.text
    with open_log(path) as log:
        assert len(log.robot_path("map", "chassis").until(2**62)) > 1


@pytest.mark.parametrize(("jump", "expected"), [(10.0, [13.0, 14.0, 15.0]), (0.0, [5.0])])
def test_where_the_map_is_begun_anew_the_way_is_that_on_the_new_one(tmp_path, jump, expected):
    """From the last jump on; without one only the last pose is sure to be."""
    xs = [k + (jump if k >= 3 else 0.0) for k in range(6)]
    messages = ((k * SECOND, "/odom", ODOMETRY, odometry(ROS2, k * SECOND, x)) for k, x in enumerate(xs))
    with open_log(write(tmp_path / "run.mcap", messages)) as log:
        path = log.robot_path("odom")
        assert path.until(SECOND)[:, 0].tolist() == [0.0, 1.0]
        assert path.until(2**62, is_begun_anew=True)[:, 0].tolist() == expected
        assert len(path.until(2**62, is_begun_anew=True)) == 0


def test_odometry_in_another_frame_than_the_map_is_told_of(tmp_path, caplog):
    messages = ((k * SECOND, "/odom", ODOMETRY, odometry(ROS2, k * SECOND, float(k))) for k in range(5))
    assert way(write(tmp_path / "run.mcap", messages))[0] == "/odom"
    assert "in the frame 'odom' instead of 'map'" in caplog.text


@pytest.mark.parametrize("log", ["office.mcap", "wing.bag", "ring"])
def test_the_ways_of_the_sample_logs_lie_in_their_free_space(log):
    """Of MCAP, ROS 1 bag and SQLite: taken map by map, each pose is free in the map of its time or later."""
    with open_log(PROJECT / "sample_logs" / log) as reader:
        last = reader.last()
        path = reader.robot_path(last.geometry.frame_id)
        assert path.origin == "/tf"
        pieces = [path.until(snapshot.log_time_ns) for snapshot in reader.snapshots()]
    poses = np.concatenate(pieces)
    assert sum(len(piece) > 0 for piece in pieces) > 30
    row, column = np.moveaxis(last.geometry.world_to_cell(poses[:, :2]), -1, 0)
    values = last.cells[row, column]
    assert ((values >= 0) & (values < 50)).mean() > 0.97


def test_a_log_that_was_cut_off_tells_the_way_so_far(tmp_path):
    """Without its index, and with half of a message at its end."""
    whole = PROJECT / "sample_logs" / "office.mcap"
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    _, expected = way(whole)
    origin, found = way(cut)
    assert origin == "/tf"
    assert 50 < len(found) < len(expected)
    assert found == pytest.approx(expected[: len(found)])


def test_a_fixed_transform_from_long_before_the_selection_still_holds(tmp_path):
    """It is sent once, when the robot starts."""
    kind = ROS2.types[TF]
    messages = [
        (0, "/tf_static", TF, kind([transform(ROS2, 0, "map", "odom", 5.0, 0.0, 0.0)])),
        *(
            (second * SECOND, "/tf", TF, kind([transform(ROS2, 0, "odom", "base_link", second, 0.0, 0.0)]))
            for second in range(100)
        ),
    ]
    _, found = way(write(tmp_path / "run.mcap", iter(messages)), start_ns=90 * SECOND)
    assert found[:, 0].tolist() == [95.0, 96.0, 97.0, 98.0, 99.0, 100.0, 101.0, 102.0, 103.0, 104.0]


@pytest.mark.parametrize("topic", ["/tf", "/odom"])
def test_a_fast_robot_is_looked_at_no_oftener_than_its_poses_are_far_apart_in_time(tmp_path, topic):
    """A hundred messages a second, a meter from each to the next."""
    kind = ROS2.types[TF]
    messages = (
        (tick * SECOND // 100, topic, TF, kind([transform(ROS2, 0, "map", "base_link", tick, 0.0, 0.0)]))
        if topic == "/tf"
        else (tick * SECOND // 100, topic, ODOMETRY, odometry(ROS2, 0, float(tick)))
        for tick in range(300)
    )
    _, found = way(write(tmp_path / "run.mcap", messages))
    assert found[:, 0].tolist() == list(range(0, 300, round(100 * POSE_STEP_S)))


def test_turns_along_a_chain_add_up_within_a_circle(tmp_path):
    kind = ROS2.types[TF]
    chain = [
        transform(ROS2, 0, "map", "odom", 0.0, 0.0, 3.0),
        transform(ROS2, 0, "odom", "base_link", 0.0, 0.0, 3.0),
    ]
    _, found = way(write(tmp_path / "run.mcap", iter([(SECOND, "/tf", TF, kind(chain))])))
    assert found[0, 2] == pytest.approx(6.0 - math.tau)
