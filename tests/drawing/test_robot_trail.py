"""The robot's path as it is drawn with every map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from finished_runs import SAMPLE_LOGS
from hypothesis import given
from hypothesis import strategies as st

import rose2_logs as rl
from rose2_logs.drawing import robot_trail
from rose2_logs.drawing.robot_trail import GAP_M, TOLERANCE_M, RobotTrail
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot


@pytest.fixture(scope="module")
def office_step() -> TrackedSnapshot:
    return next(rl.track(SAMPLE_LOGS / "office.mcap"))


def trail_of(*paths) -> RobotTrail:
    trail = RobotTrail()
    for xy in paths:
        trail.add(None if xy is None else np.column_stack([xy, np.zeros(len(xy))]))
    return trail


def test_a_straight_way_needs_few_points_and_a_gap_breaks_it():
    """What the maps bring is joined; maps without poses add nothing."""
    there = np.column_stack([np.arange(0, 10, 0.2), np.zeros(50)])
    trail = trail_of(None, there[:20], there[:0], there[20:], there + np.array([0, GAP_M + 1]))
    first, second = trail.pieces_m
    assert len(first) <= 3
    np.testing.assert_array_equal(first[[0, -1]], there[[0, -1]])
    np.testing.assert_array_equal(second, there[[0, -1]] + (0, GAP_M + 1))


def test_a_trail_begins_anew_in_another_part_and_in_another_frame(office_step):
    """The same coordinates are elsewhere there; a slash before its name makes no other frame."""
    trail, pieces = RobotTrail(), []
    for k, (part, frame) in enumerate(
        [(1, "map"), (1, "/map"), (2, "map"), (2, "upstairs"), (2, "upstairs")]
    ):
        path = np.array([[k, 0.0, 0.0], [k + 0.5, 0.0, 0.0]])
        geometry = replace(office_step.snapshot.geometry, frame_id=frame)
        snapshot = replace(office_step.snapshot, geometry=geometry)
        trail.follow(replace(office_step, snapshot=snapshot, part=part, path=path))
        pieces.append([(piece[0, 0], piece[-1, 0]) for piece in trail.pieces_m])
    assert pieces == [[(0, 0.5)], [(0, 1.5)], [(2, 2.5)], [(3, 3.5)], [(3, 4.5)]]


@given(st.integers(0, 10**6), st.integers(1, 40))
def test_the_thinned_path_stays_near_the_poses(seed, maps):
    """Also where it was thinned anew because it had become long."""
    rng = np.random.default_rng(seed)
    turns = rng.normal(0, 0.4, 2000).cumsum()
    poses = np.column_stack([np.cos(turns), np.sin(turns)]).cumsum(axis=0) * 0.2
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(robot_trail, "MOST_POINTS", 300)
        trail = trail_of(*np.array_split(poses, maps))
    (piece,) = trail.pieces_m
    assert len(piece) <= 300
    np.testing.assert_array_equal(piece[[0, -1]], poses[[0, -1]])
    far = shapely.distance(shapely.linestrings(piece), shapely.points(poses)).max()
    assert far <= 2 * trail._tolerance_m
    assert trail._tolerance_m >= TOLERANCE_M
