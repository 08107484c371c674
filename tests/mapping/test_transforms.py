import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.mapping.transforms import NotPlacedError, Transform, TransformTree

RANDOM = np.random.default_rng(3)


def transform(stamp_ns, parent, child, position=(0.0, 0.0, 0.0), rotation=None):
    quaternion = (0.0, 0.0, 0.0, 1.0) if rotation is None else rotation.as_quat()
    return Transform(stamp_ns, parent, child, (*position, *quaternion))


def tree_of(*transforms, fixed=()):
    tree = TransformTree(MappingParameters())
    for each in transforms:
        tree.add(each)
    for each in fixed:
        tree.add(each, is_fixed=True)
    return tree


def times(*values):
    return np.array(values, np.int64)


def test_poses_of_a_chain_are_those_of_multiplied_matrices():
    rotations, positions = Rotation.random(3, random_state=4), RANDOM.normal(size=(3, 3))
    names = ["map", "odom", "base", "laser"]
    links = [transform(0, *names[k : k + 2], tuple(positions[k]), rotations[k]) for k in range(3)]
    tree = tree_of(fixed=links)
    found = tree.poses(tree.above("laser")["map"], times(5))
    expected = np.eye(4)
    for rotation, position in zip(rotations, positions, strict=True):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix(), position
        expected = expected @ matrix
    assert found.positions_m[0] == pytest.approx(expected[:3, 3])
    assert Rotation.from_quat(found.quaternions[0]).as_matrix() == pytest.approx(expected[:3, :3])


def test_each_time_gets_the_pose_between_its_neighbors():
    stamps = range(0, 1001, 100)
    moves = [
        transform(t, "map", "laser", (t / 2000, 0, 0), Rotation.from_euler("z", 3.0 + t / 2500))
        for t in stamps
    ]
    tree = tree_of(*moves)
    asked = times(930, 10, 555, 100)
    found = tree.poses(tree.above("laser")["map"], asked)
    assert found.positions_m[:, 0] == pytest.approx(asked / 2000)
    yaw = Rotation.from_quat(found.quaternions).as_euler("xyz")[:, 2]
    assert np.cos(yaw - (3.0 + asked / 2500)) == pytest.approx(np.ones(4), abs=1e-9)


def test_a_quaternion_with_the_other_sign_is_the_same_rotation():
    one, other = transform(0, "map", "laser"), Transform(10, "map", "laser", (0, 0, 0, 0, 0, 0, -1.0))
    tree = tree_of(one, other)
    assert abs(tree.poses((("map", "laser"),), times(5)).quaternions[0, 3]) == pytest.approx(1)


@pytest.mark.parametrize("asked", [(-1,), (11,), (5, 11)])
def test_nothing_is_extrapolated(asked):
    tree = tree_of(transform(0, "map", "laser"), transform(10, "map", "laser"))
    with pytest.raises(NotPlacedError, match="without transforms of their time"):
        tree.poses((("map", "laser"),), times(*asked))


@pytest.mark.parametrize(("position", "angle"), [((1.5, 0, 0), 0.0), ((0, 0, 0), 0.7)], ids=["step", "turn"])
def test_jumps_are_not_interpolated(position, angle):
    later = transform(10, "map", "laser", position, Rotation.from_euler("z", angle))
    tree = tree_of(transform(0, "map", "laser"), later)
    with pytest.raises(NotPlacedError, match="too far apart"):
        tree.poses((("map", "laser"),), times(5))
    assert tree.poses((("map", "laser"),), times(10)).positions_m[0] == pytest.approx(position)


def test_transforms_out_of_order_are_sorted_and_a_clock_set_back_starts_anew():
    tree = tree_of(*(transform(t, "map", "laser", (t / 100, 0, 0)) for t in (0, 20, 10)))
    assert tree.poses((("map", "laser"),), times(12)).positions_m[0, 0] == pytest.approx(0.12)
    tree.add(transform(-(10**12), "map", "laser", (5.0, 0, 0)))
    assert tree.last_ns((("map", "laser"),)) == -(10**12)


def test_old_transforms_are_dropped():
    tree = tree_of(*(transform(k * 10**8, "map", "laser") for k in range(10_000)))
    with pytest.raises(NotPlacedError):
        tree.poses((("map", "laser"),), times(0))
    assert len(tree._moving["map", "laser"].times) < 2000


def test_all_frames_above_are_found_also_where_a_frame_has_two_parents_or_is_its_own_ancestor():
    tree = tree_of(
        transform(0, "odom", "base"),
        transform(0, "wheel", "base"),
        transform(0, "base", "laser"),
        transform(0, "map", "odom"),
        transform(0, "base", "wheel"),
    )
    above = tree.above("laser")
    assert set(above) == {"laser", "base", "odom", "wheel", "map"}
    assert above["map"] == (("map", "odom"), ("odom", "base"), ("base", "laser"))


@pytest.mark.parametrize(
    "pose",
    [
        (1e300, 0, 0, 0, 0, 0, 1),
        (0, 0, 0, 0, 0, 0, 1e-200),
        (0, 0, 0, 0, 0, 1e200, 1),
        (0, 0, 0, math.nan, 0, 0, 1),
        (math.inf, 0, 0, 0, 0, 0, 1),
    ],
)
def test_absurd_transforms_are_ignored(pose):
    tree = tree_of(Transform(0, "map", "laser", pose))
    assert tree.above("laser") == {"laser": ()}


def test_unusable_transforms_are_ignored():
    tree = tree_of(
        Transform(0, "map", "laser", (0.0,) * 7),
        Transform(0, "map", "laser", (math.nan, 0, 0, 0, 0, 0, 1)),
    )
    assert tree.frames == []


def test_a_lidar_upside_down_is_not_tilted():
    for angle, tilt in ((math.pi, 0.0), (0.3, 0.3), (math.pi - 0.2, 0.2)):
        tree = tree_of(fixed=[transform(0, "map", "laser", rotation=Rotation.from_euler("x", angle))])
        assert tree.poses((("map", "laser"),), times(0)).tilt_rad == pytest.approx(tilt, abs=1e-7)
