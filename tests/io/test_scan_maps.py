import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scan_logs import START_NS, Echoes, Move, Scan, ranges_in_box, turned, write_scans

import rose2_logs as rl
from rose2_logs.errors import LogError, NoMapTopicError
from rose2_logs.io import open_log
from rose2_logs.io.log import LogReader, choose_topic
from rose2_logs.io.scan_topics import mappable_topics
from rose2_logs.io.source import LogInfo, TopicInfo

BEARINGS = np.linspace(-math.pi, math.pi, 361)[:-1]
LOW, HIGH = (0.025, 0.025), (6.025, 4.025)
"""A room whose walls run through the middle of cells of 5 cm."""
TURN_RATE, SPEED = 0.9, 0.4
"""Of the moving robot, rad/s and m/s: a lidar that sweeps for a tenth of a second turns by 5 degrees."""
MOUNT = (0.2, 0.1, 0.3)


def pose_at(time_s):
    """The robot's base in the room: x, y, heading; it drives along the room and turns."""
    return 1.5 + SPEED * time_s, 2.0 + 0 * time_s, TURN_RATE * time_s


def lidar_at(times_s):
    x, y, heading = pose_at(times_s)
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([x + c * MOUNT[0] - s * MOUNT[1], y + s * MOUNT[0] + c * MOUNT[1]], 1), heading + MOUNT[2]


def drive(kind=Scan, *, sweep_s=0.1, duration_s=6.0, upside_down=False, far=None):
    """Scans at 10 Hz and the transforms of a robot that drives through the room."""
    logged = []
    half = MOUNT[2] / 2
    mount = (math.cos(half), math.sin(half), 0.0, 0.0) if upside_down else turned(MOUNT[2])
    logged.append(("/tf_static", Move(0.02, "base_link", "laser", (*MOUNT[:2], 0.3), mount)))
    for k in range(round(duration_s * 20) + 6):
        x, y, heading = pose_at(k / 20)
        # The odometry starts somewhere else; its frame does not move in the map.
        logged.append(("/tf", Move(k / 20, "map", "odom", (1.5, 2.0, 0.0))))
        logged.append(("/tf", Move(k / 20, "odom", "base_link", (x - 1.5, y - 2.0, 0.0), turned(heading))))
    increment = sweep_s / len(BEARINGS)
    for k in range(1, round(duration_s * 10)):
        begin = k / 10 + 0.013
        starts, headings = lidar_at(begin + increment * np.arange(len(BEARINGS)))
        bearings = -BEARINGS if upside_down else BEARINGS
        ranges = ranges_in_box(starts, headings + bearings, LOW, HIGH)
        if far is not None:
            ranges = np.where(ranges < far, ranges, np.inf)
        logged.append(("/scan", kind(begin, ranges, BEARINGS, increment_s=increment)))
    return logged


def final_map(path, **options):
    with rl.open_log(path, map_from="/scan", **options) as reader:
        return reader.last()


def assert_is_the_room(snapshot):
    """Walls where the room has them, one cell thick, everything inside free and nothing known outside."""
    cells, geometry = snapshot.cells, snapshot.geometry
    (bottom, left), (top, right) = geometry.world_to_cell(np.array([LOW, HIGH]))
    expected = np.full(cells.shape, -1, np.int8)
    expected[bottom : top + 1, left : right + 1] = 100
    expected[bottom + 1 : top, left + 1 : right] = 0
    seen = cells != -1
    assert not (seen & (expected == -1)).any()
    assert (cells[seen] == expected[seen]).mean() > 0.997
    inside = expected != -1
    assert seen[inside].mean() > 0.97


@pytest.mark.parametrize("name", ["run.mcap", "run.bag", "run"])
@pytest.mark.parametrize("kind", [Scan, Echoes])
def test_a_moving_sensor_draws_the_room_as_it_is(tmp_path, name, kind):
    path = write_scans(tmp_path / name, drive(kind))
    found = final_map(path)
    assert found.geometry.frame_id == "map"
    assert found.topic == "/scan/map"
    assert_is_the_room(found)


def test_without_the_times_of_the_beams_the_walls_would_be_smeared(tmp_path):
    logged = drive()
    still = [
        (topic, Scan(each.time_s, each.ranges, each.bearings)) if topic == "/scan" else (topic, each)
        for topic, each in logged
    ]
    exact, smeared = (
        final_map(write_scans(tmp_path / f"{k}.mcap", log)) for k, log in enumerate((logged, still))
    )
    assert (smeared.cells == 100).sum() > 1.5 * (exact.cells == 100).sum()


def test_a_lidar_mounted_upside_down_draws_the_same_room(tmp_path):
    assert_is_the_room(final_map(write_scans(tmp_path / "run.mcap", drive(upside_down=True))))


def test_latched_transforms_hold_before_they_are_recorded(tmp_path):
    late = [
        (topic, Move(5.9, each.parent, each.child, each.position, each.quaternion))
        if topic == "/tf_static"
        else (topic, each)
        for topic, each in drive()
    ]
    assert_is_the_room(final_map(write_scans(tmp_path / "run.mcap", late)))


def test_beams_without_return_free_nothing_unless_they_are_said_to(tmp_path):
    path = write_scans(tmp_path / "run.mcap", drive(far=2.4))
    silent, told = (final_map(path, parameters={"mapping.no_return_m": reach}) for reach in (0.0, 2.3))
    assert (told.cells == 0).sum() > 1.1 * (silent.cells == 0).sum()
    assert ((told.cells == 100).sum()) <= (silent.cells == 100).sum()


def test_resolution_is_a_parameter(tmp_path):
    path = write_scans(tmp_path / "run.mcap", drive())
    fine, coarse = (final_map(path, parameters={"mapping.resolution_m": side}) for side in (0.05, 0.1))
    assert coarse.geometry.resolution_m == 0.1
    area = [(each.cells != -1).sum() * each.geometry.cell_area_m2 for each in (fine, coarse)]
    assert area[1] == pytest.approx(area[0], rel=0.1)


def test_a_robot_that_stands_is_not_looked_through_again_and_again(tmp_path):
    """Someone who stands before the lidar of a waiting robot is in the map only if all scans are used."""
    logged: list = [("/tf_static", Move(0.02, "map", "laser", (3.0, 2.0, 0.3), turned(0.0)))]
    position, headings = np.array([[3.0, 2.0]]), np.zeros(1)
    room = ranges_in_box(np.repeat(position, len(BEARINGS), 0), headings + BEARINGS, LOW, HIGH)
    someone = np.where(np.abs(BEARINGS) < 0.2, 1.0, room)
    for k in range(1, 40):
        logged.append(("/scan", Scan(k / 10, room if k < 3 else someone, BEARINGS)))
    path = write_scans(tmp_path / "run.mcap", logged)
    thinned, all_scans = (final_map(path, parameters={"mapping.min_travel_m": m}) for m in (0.2, 0.0))
    (row, column), *_ = thinned.geometry.world_to_cell(np.array([[4.0, 2.0]]))
    assert thinned.cells[row, column] == 0
    assert (all_scans.cells[row - 2 : row + 3, column - 2 : column + 3] == 100).any()
    assert (thinned.cells == 100).sum() < (all_scans.cells == 100).sum()


def test_maps_come_every_so_often_and_grow_and_the_last_has_all_scans(tmp_path):
    path = write_scans(tmp_path / "run.mcap", drive(duration_s=6.0))
    near = {"mapping.usable_range_m": 1.0}
    with rl.open_log(path, map_from="scan", every_s=1.5, parameters=near) as reader:
        maps = list(reader.snapshots())
        last = reader.last()
    gaps = np.diff([each.log_time_ns for each in maps]) / 1e9
    assert len(maps) == 3
    assert (gaps >= 1.5).all()
    known = [(each.cells != -1).sum() for each in maps]
    assert known == sorted(known)
    assert np.array_equal(maps[-1].cells, last.cells)
    assert last.log_time_ns == START_NS + 5_913_000_000
    assert last.stamp_ns == last.log_time_ns


def test_only_scans_of_the_time_range_are_used_and_few_new_cells_make_no_map(tmp_path):
    path = write_scans(tmp_path / "run.mcap", drive())
    with rl.open_log(path, map_from="/scan", start_s=1.0, end_s=3.0, every_s=0.5) as reader:
        times = [(each.log_time_ns - START_NS) / 1e9 for each in reader.snapshots()]
    assert times[0] == pytest.approx(1.513, abs=0.02)
    assert times[-1] <= 3.0
    with rl.open_log(path, map_from="/scan", every_s=0.5, min_change_m2=100.0) as reader:
        assert len(list(reader.snapshots())) == 1


def test_without_map_frame_the_odometry_serves_with_a_warning(tmp_path, caplog):
    logged = [each for each in drive() if getattr(each[1], "parent", "") != "map"]
    path = write_scans(tmp_path / "run.mcap", logged)
    found = final_map(path)
    assert found.geometry.frame_id == "odom"
    assert "no transform leads from map to laser; the map is built in odom" in caplog.text
    caplog.clear()
    assert final_map(path, map_frame="odom").geometry.frame_id == "odom"
    assert not caplog.records


def without(logged, *topics):
    return [each for each in logged if each[0] not in topics]


@pytest.mark.parametrize(
    ("logged", "options", "message"),
    [
        (
            drive(),
            {"map_from": "/front"},
            "/front is not a topic with laser scans; its scan topics are /scan",
        ),
        (without(drive(), "/tf", "/tf_static"), {}, r"has no transforms \(/tf\)"),
        (without(drive(), "/tf_static"), {}, "the scans are in the frame 'laser', which is not among those"),
        (
            without(drive(), "/tf"),
            {},
            r"no transforms lead from map or odom to the scans in laser, only from base",
        ),
        (drive(), {"map_frame": "world"}, "no transforms lead from world to the scans in laser"),
    ],
)
def test_wrong_topics_and_frames_are_told_in_one_line(tmp_path, logged, options, message):
    path = write_scans(tmp_path / "run.mcap", logged)
    with pytest.raises(NoMapTopicError, match=message) as raised:
        open_log(path, **({"map_from": "/scan"} | options))
    assert "\n" not in str(raised.value)


def test_scans_without_transforms_of_their_time_are_counted(tmp_path, caplog):
    half = [each for each in drive() if each[0] != "/tf" or each[1].time_s < 4.0]
    found = final_map(write_scans(tmp_path / "half.mcap", half))
    assert (found.cells != -1).any()
    assert "21 of 59 scans on /scan are left out: 21 without transforms of their time" in caplog.text
    none = [each for each in drive() if each[0] != "/tf" or each[1].time_s < 0.1]
    with pytest.raises(LogError, match="59 of 59 scans"):
        final_map(write_scans(tmp_path / "none.mcap", none))


def test_clocks_that_differ_are_told(tmp_path):
    """A lidar that stamps its scans since it was switched on."""
    logged = [
        (topic, Scan(each.time_s - 1e9, each.ranges, each.bearings)) if topic == "/scan" else (topic, each)
        for topic, each in drive(duration_s=2.0)
    ]
    with pytest.raises(LogError, match="scans and transforms are 1000000000 s apart"):
        final_map(write_scans(tmp_path / "run.mcap", logged))


def test_a_damaged_scan_at_the_start_is_left_out(tmp_path):
    logged = drive()
    first = next(k for k, (topic, _) in enumerate(logged) if topic == "/scan")
    whole = final_map(write_scans(tmp_path / "whole.mcap", logged[:first] + logged[first + 1 :]))
    scan = logged[first][1]
    logged[first] = ("/scan", replace(scan, bearings=np.full(len(scan.bearings), np.nan)))
    damaged = final_map(write_scans(tmp_path / "damaged.mcap", logged))
    assert np.array_equal(damaged.cells, whole.cells)


def test_a_tilted_lidar_maps_nothing(tmp_path):
    tilted = [
        (topic, Move(0.0, "base_link", "laser", (0, 0, 1), (0.0, math.sin(0.2), 0.0, math.cos(0.2))))
        if topic == "/tf_static"
        else (topic, each)
        for topic, each in drive(duration_s=2.0)
    ]
    with pytest.raises(LogError, match="19 of a tilted lidar"):
        final_map(write_scans(tmp_path / "run.mcap", tilted))


def test_a_log_of_scans_without_maps_says_how_to_build_them(tmp_path):
    path = write_scans(tmp_path / "run.mcap", drive(duration_s=1.0))
    with pytest.raises(NoMapTopicError, match="map_from='/scan' builds maps from its laser scans"):
        open_log(path)


def test_built_maps_are_read_as_recorded_ones_are(tmp_path):
    """Their numbers are percent, they are of one run, and it is said where the way comes from."""
    path = write_scans(tmp_path / "run.mcap", drive())
    with rl.open_log(path, map_from="/scan", every_s=0.5) as reader:
        assert len(list(reader.snapshots())) > 2
        assert len(reader.robot_path("map").until(2**62)) > 5
        assert reader.decided["values"]["values"] == "percent"
        assert reader.decided["path"] == "/tf, /tf_static"
        assert "part" not in reader.decided
    with (
        rl.open_log(path, map_from="/scan", part=2) as reader,
        pytest.raises(LogError, match="/scan/map has no part 2; it has 1"),
    ):
        reader.last()


@pytest.mark.parametrize(("robot", "y"), [("one", 2.0), ("two", 5.0)])
def test_the_way_is_that_of_the_robot_whose_scans_the_map_is_built_from(tmp_path, robot, y):
    logged = []
    for name, shift in (("one", 0.0), ("two", 3.0)):
        for topic, each in drive(duration_s=2.0):
            if isinstance(each, Scan):
                logged.append((f"/{name}/scan", replace(each, frame=f"{name}/laser")))
                continue
            parent = each.parent if each.parent == "map" else f"{name}/{each.parent}"
            x, at, z = each.position
            position = (x, at + shift, z) if parent == "map" else each.position
            logged.append(
                (topic, replace(each, parent=parent, child=f"{name}/{each.child}", position=position))
            )
    path = write_scans(tmp_path / "run.mcap", logged)
    with rl.open_log(path, map_from=f"/{robot}/scan") as reader:
        way = reader.robot_path("map").until(2**62)
    np.testing.assert_allclose(way[:, 1], y)


def test_type_names_as_dds_spells_them_are_scans_and_transforms():
    topics = tuple(
        TopicInfo(name, kind, 1, False, "cdr")
        for name, kind in (
            ("/scan", "sensor_msgs::msg::dds_::LaserScan_"),
            ("/tf", "tf2_msgs::msg::dds_::TFMessage_"),
        )
    )
    assert mappable_topics(LogInfo(Path("run.mcap"), "MCAP", 1, 0, 1, topics, True)) == ("/scan",)


def test_both_ways_are_named_where_maps_may_lie_on_topics_without_a_type():
    topics = (
        TopicInfo("/map", "", 1, False, "cdr"),
        TopicInfo("/scan", "sensor_msgs/msg/LaserScan", 1, False, "cdr"),
        TopicInfo("/tf", "tf2_msgs/msg/TFMessage", 1, False, "cdr"),
    )
    with pytest.raises(
        NoMapTopicError, match=r"message_type='nav_msgs/OccupancyGrid'\); map_from='/scan' builds"
    ):
        choose_topic(LogInfo(Path("run.mcap"), "MCAP", 1, 0, 1, topics, True))


def test_memory_holds_one_map_and_any_map_can_be_read_again(tmp_path):
    path = write_scans(tmp_path / "run.mcap", drive())
    with rl.open_log(path, map_from="/scan", every_s=1.0) as reader:
        assert isinstance(reader, LogReader)
        first, again = ([each.cells for each in reader.snapshots()] for _ in range(2))
    assert all(np.array_equal(one, other) for one, other in zip(first, again, strict=True))


def test_a_carmen_log_is_opened_directly(tmp_path):
    lines = []
    for k in range(30):
        time_s = k / 2
        starts = np.tile([1.5 + 0.1 * k, 2.0], (181, 1))
        bearings = np.linspace(-math.pi / 2, math.pi / 2, 181)
        ranges = ranges_in_box(starts, 0.3 * k + bearings, LOW, HIGH)
        values = " ".join(f"{each:.3f}" for each in ranges)
        pose = f"{starts[0, 0]} 2.0 {0.3 * k}"
        lines.append(f"FLASER 181 {values} {pose} {pose} {100 + time_s} host {100 + time_s}\n")
    path = Path(tmp_path / "run.log")
    path.write_text("# a comment\n" + "".join(lines))
    with rl.open_log(path, every_s=5.0) as reader:
        assert reader.info.format == "CARMEN log"
        maps = list(reader.snapshots())
    assert [each.log_time_ns for each in maps] == [105 * 10**9, int(114.5e9)]
    assert_is_the_room(maps[-1])


def test_maps_are_not_built_from_a_closed_log(tmp_path):
    path = write_scans(tmp_path / "run.mcap", drive())
    with rl.open_log(path, map_from="/scan", every_s=1.0) as reader:
        begun = reader.snapshots()
        next(begun)
    with pytest.raises(LogError, match="the log is closed"):
        next(begun)
