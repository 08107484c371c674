"""Which scans of a lidar a map is built from."""

from __future__ import annotations

import math

import pytest

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.mapping.motion_filter import LidarPose, MotionFilter

S = 1_000_000_000
PARAMETERS = MappingParameters(min_travel_m=0.2, min_turn_rad=0.2, scan_at_least_every_s=5.0)


def taken(poses: list[tuple[float, float, float]], period_s: float = 0.1, parameters=PARAMETERS) -> list[int]:
    moved = MotionFilter(parameters)
    return [k for k, pose in enumerate(poses) if moved.takes(round(k * period_s * S), LidarPose(*pose))]


def test_a_lidar_that_stands_is_looked_through_now_and_then():
    assert taken([(1.0, 2.0, 0.5)] * 120) == [0, 50, 100]


@pytest.mark.parametrize(("heading", "x", "y"), [(0.0, 1.0, 0.0), (2.0, 0.0, 1.0), (0.0, 0.6, -0.8)])
def test_a_lidar_that_drives_gives_a_scan_at_each_step(heading, x, y):
    poses = [(0.0625 * k * x, 0.0625 * k * y, heading) for k in range(13)]
    assert taken(poses) == [0, 4, 8, 12]


def test_steps_add_up_since_the_last_scan_that_was_taken():
    there_and_back = [
        (0.0, 0.0, 0.0),
        (0.15, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (-0.15, 0.0, 0.0),
        (-0.25, 0.0, 0.0),
    ]
    assert taken(there_and_back) == [0, 4]


@pytest.mark.parametrize("start", [0.0, math.pi - 0.1, -7.0])
def test_a_lidar_that_turns_gives_a_scan_at_each_angle(start):
    assert taken([(0.0, 0.0, start + 0.11 * k) for k in range(7)]) == [0, 2, 4, 6]
    assert taken([(0.0, 0.0, math.remainder(start - 0.11 * k, math.tau)) for k in range(7)]) == [0, 2, 4, 6]


def test_whole_turns_of_the_numbers_are_none_of_the_lidar():
    assert taken([(0.0, 0.0, math.tau * k) for k in range(5)]) == [0]


def test_all_scans_are_taken_if_no_travel_is_asked_for():
    every = MappingParameters(min_travel_m=0.0)
    assert taken([(0.0, 0.0, 0.0)] * 5, parameters=every) == [0, 1, 2, 3, 4]


def test_a_clock_that_goes_back_keeps_no_scan_out():
    moved = MotionFilter(PARAMETERS)
    assert moved.takes(100 * S, LidarPose(0.0, 0.0, 0.0))
    assert not moved.takes(101 * S, LidarPose(0.0, 0.0, 0.0))
    assert moved.takes(1 * S, LidarPose(0.0, 0.0, 0.0))
