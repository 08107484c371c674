import gzip

import numpy as np
import pytest
from carmen_lines import front_laser, robot_laser

from rose2_logs.errors import LogError
from rose2_logs.io.carmen import read_carmen


def test_robot_laser_messages_come_in_the_order_of_their_stamps(tmp_path):
    log = tmp_path / "a.log"
    log.write_text("# a comment\n" + "".join(robot_laser(t, t, [1, 2, 3]) for t in (12.5, 10.5, 11.5)))
    scans, stamped = read_carmen(log)
    assert stamped
    assert [scan.time_s for scan in scans] == [10.5, 11.5, 12.5]
    assert [scan.laser_pose[0] for scan in scans] == [10.5, 11.5, 12.5]
    assert scans[0].robot_pose[0] == pytest.approx(10.46)
    assert scans[0].bearings_rad == pytest.approx([-1.5, 0, 1.5])


def test_readings_at_or_past_the_maximum_are_no_returns(tmp_path):
    log = tmp_path / "a.log"
    log.write_text(robot_laser(1, 0, [1, 50.0, 81.83]) + robot_laser(2, 0, [1, 49.9, 0.0]))
    scans, _ = read_carmen(log)
    assert np.isfinite(scans[0].ranges_m).tolist() == [True, False, False]
    assert np.isfinite(scans[1].ranges_m).tolist() == [True, True, False]
    capped, _ = read_carmen(log, max_range_m=10.0)
    assert np.isfinite(capped[1].ranges_m).tolist() == [True, False, False]


def test_front_laser_covers_half_a_turn_and_takes_its_range_from_the_log(tmp_path):
    log = tmp_path / "a.log"
    lines = "PARAM robot_front_laser_max 20.0 nohost 0\nODOM 7 8 0.1 0 0 0 1 host 1\n"
    log.write_text(lines + front_laser(5, 1, [1.0] * 180 + [30.0]) + front_laser(6, 1, [1.0] * 181))
    scans, stamped = read_carmen(log)
    assert stamped
    assert scans[0].bearings_rad[[0, -1]] == pytest.approx([-np.pi / 2, np.pi / 2])
    assert np.isinf(scans[0].ranges_m[-1])
    assert scans[0].odometry.tolist() == [7, 8, 0.1]


def test_damaged_stamps_are_replaced_by_the_order_of_the_file(tmp_path):
    log = tmp_path / "a.log"
    log.write_text("".join(front_laser("1.01893e+09", x, [1.0] * 181) for x in (3, 1, 2)))
    scans, stamped = read_carmen(log)
    assert not stamped
    assert [scan.time_s for scan in scans] == [0, 1, 2]
    assert [scan.laser_pose[0] for scan in scans] == [3, 1, 2]


def test_damaged_lines_and_a_packed_log_that_is_cut_off_are_read_as_far_as_they_are_whole(tmp_path, caplog):
    good = "".join(robot_laser(t, t, [1.0, 2.0, 3.0]) for t in range(1, 2000))
    log = tmp_path / "a.log"
    log.write_text(good.replace("ROBOTLASER1 0 -1.5", "ROBOTLASER1 x", 2) + robot_laser(9, 9, [1, 2, 3])[:40])
    assert len(read_carmen(log)[0]) == 1997
    assert "line 1 is no whole ROBOTLASER1 message and 2 more like it; skipped" in caplog.text
    packed = tmp_path / "a.log.gz"
    packed.write_bytes(gzip.compress(good.encode())[:-3000])
    assert 10 < len(read_carmen(packed)[0]) < 1990
    assert "cannot be read further" in caplog.text
    packed.write_bytes(gzip.compress(b"FLASER 1 2 3")[:-12])
    with pytest.raises(LogError):
        read_carmen(packed)


def test_poses_that_are_no_numbers_are_refused(tmp_path):
    log = tmp_path / "a.log"
    log.write_text("FLASER 1 2.0 nan 0 0 0 0 0 5 host 5\n")
    with pytest.raises(LogError, match="line 1 is no whole FLASER"):
        read_carmen(log)
