from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from rose2_logs.errors import LogError

SHARED = Path(__file__).parents[3] / "shared" / "carmen"


def robot_laser(stamp, x, readings):
    values = " ".join(str(reading) for reading in readings)
    poses = f"{x} 0 0.5 {x - 0.04} 0 0.5"
    laser = f"ROBOTLASER1 0 -1.5 3.0 1.5 50.0 0.1 0 {len(readings)} {values} 0"
    return f"{laser} {poses} 0 0 0 0 0 {stamp} host 1.0\n"


def front_laser(stamp, x, readings):
    values = " ".join(str(reading) for reading in readings)
    return f"FLASER {len(readings)} {values} {x} 0 0.5 {x} 0 0.5 {stamp} host {stamp}\n"


def test_robot_laser_messages_come_in_the_order_of_their_stamps(tmp_path):
    from carmen import read_carmen

    log = tmp_path / "a.log"
    log.write_text("# a comment\n" + "".join(robot_laser(t, t, [1, 2, 3]) for t in (12.5, 10.5, 11.5)))
    scans, stamped = read_carmen(log)
    assert stamped
    assert [scan.time_s for scan in scans] == [10.5, 11.5, 12.5]
    assert [scan.laser_pose[0] for scan in scans] == [10.5, 11.5, 12.5]
    assert scans[0].robot_pose[0] == pytest.approx(10.46)
    assert scans[0].bearings_rad == pytest.approx([-1.5, 0, 1.5])


def test_readings_at_or_past_the_maximum_are_no_returns(tmp_path):
    from carmen import read_carmen

    log = tmp_path / "a.log"
    log.write_text(robot_laser(1, 0, [1, 50.0, 81.83]) + robot_laser(2, 0, [1, 49.9, 0.0]))
    scans, _ = read_carmen(log)
    assert np.isfinite(scans[0].ranges_m).tolist() == [True, False, False]
    assert np.isfinite(scans[1].ranges_m).tolist() == [True, True, False]
    capped, _ = read_carmen(log, max_range_m=10.0)
    assert np.isfinite(capped[1].ranges_m).tolist() == [True, False, False]


def test_front_laser_covers_half_a_turn_and_takes_its_range_from_the_log(tmp_path):
    from carmen import read_carmen

    log = tmp_path / "a.log"
    lines = "PARAM robot_front_laser_max 20.0 nohost 0\nODOM 7 8 0.1 0 0 0 1 host 1\n"
    log.write_text(lines + front_laser(5, 1, [1.0] * 180 + [30.0]) + front_laser(6, 1, [1.0] * 181))
    scans, stamped = read_carmen(log)
    assert stamped
    assert scans[0].bearings_rad[[0, -1]] == pytest.approx([-np.pi / 2, np.pi / 2])
    assert np.isnan(scans[0].ranges_m[-1])
    assert scans[0].odometry.tolist() == [7, 8, 0.1]


def test_damaged_stamps_are_replaced_by_the_order_of_the_file(tmp_path):
    from carmen import read_carmen

    log = tmp_path / "a.log"
    log.write_text("".join(front_laser("1.01893e+09", x, [1.0] * 181) for x in (3, 1, 2)))
    scans, stamped = read_carmen(log)
    assert not stamped
    assert [scan.time_s for scan in scans] == [0, 1, 2]
    assert [scan.laser_pose[0] for scan in scans] == [3, 1, 2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("PARAM a 1 nohost 0\n", "no ROBOTLASER1 or FLASER"),
        (robot_laser(1, 0, [1, 2, 3])[:60] + "\n", "line 1 is no whole ROBOTLASER1"),
    ],
)
def test_a_log_without_whole_scans_is_refused_in_one_line(tmp_path, text, message, capsys):
    from carmen import read_carmen
    from carmen_to_bag import main

    log = tmp_path / "a.log"
    log.write_text(text)
    with pytest.raises(LogError, match=message):
        read_carmen(log)
    assert main([str(log), str(tmp_path / "out.mcap")]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()


def test_a_map_is_written_for_every_interval_that_has_scans(tmp_path):
    from carmen_to_bag import main

    log = tmp_path / "a.log"
    log.write_text("".join(robot_laser(t, 0, [1, 2, 3]) for t in (100, 101, 104.5, 112, 120)))
    assert main([str(log), str(tmp_path / "out.bag"), "--every", "5"]) == 0
    with AnyReader([tmp_path / "out.bag"]) as reader:
        maps = [c for c in reader.connections if c.topic == "/map"]
        times = [time / 1e9 for _, time, _ in reader.messages(maps)]
    assert times == [105, 115, 120]


@pytest.mark.parametrize("name", ["belgioioso-corrected.log.gz", "fr079.log.gz"])
@pytest.mark.skipif(not SHARED.exists(), reason="needs the CARMEN logs in ../shared beside the project")
def test_real_logs_give_twenty_to_sixty_growing_maps(tmp_path, name):
    from carmen_to_bag import main

    target = tmp_path / "run.mcap"
    assert main([str(SHARED / name), str(target)]) == 0
    with AnyReader([target]) as reader:
        maps = [c for c in reader.connections if c.topic == "/map"]
        grids = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(maps)]
    assert 20 <= len(grids) <= 60
    free = [int((grid.data == 0).sum()) for grid in grids]
    assert free[-1] > 3 * free[0]
    assert 0.0025 * free[-1] > 250  # square meters of floor: no building is smaller than that
