"""What differs between two layouts: rooms and walls that are the same, gone, new, moved, split, unseen."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from layout_makers import CORRIDOR, ROOM_1, ROOM_2, drawn_office, layout_of, painted, room_at
from moved_maps import motion_about, moved

from rose2_logs.comparison.layouts import compare_layouts
from rose2_logs.comparison.room_changes import compare_rooms
from rose2_logs.comparison.wall_changes import _stretches, compare_walls
from rose2_logs.config.comparison import ComparisonParameters
from rose2_logs.io import open_log
from rose2_logs.tracking.registration import RigidMotion

SAMPLE = Path(__file__).parents[2] / "sample_logs" / "office.mcap"
PARAMETERS = ComparisonParameters()
STILL = RigidMotion.none()
PARTITION_M = (4.85, 2.15, 5.2, 5.85)
"""The wall between the two rooms of the drawn office, without its ends in other walls."""


@pytest.fixture(scope="module")
def office():
    return layout_of(drawn_office())


def by_status(changes):
    return {change.status: (change.tracks_a, change.tracks_b) for change in changes}


def test_a_layout_is_the_same_as_itself(office):
    """All rooms, all walls, no motion."""
    found = compare_layouts(office, office)
    assert found.room_counts == {"same": 3}
    assert [change.tracks_a for change in found.rooms] == [change.tracks_b for change in found.rooms]
    assert (found.floor_iou, found.rooms_iou) == (pytest.approx(1, abs=1e-3), pytest.approx(1, abs=1e-3))
    assert found.walls.changes == ()
    assert found.walls.kept_m == found.walls.compared_m > 50
    assert found.placement.motion.pose == pytest.approx((0, 0, 0), abs=1e-3)


def test_a_turned_run_has_the_same_rooms_and_walls():
    """A whole building turned by 40 degrees and shifted: the layouts agree, and nothing is told to differ."""
    with open_log(SAMPLE) as reader:
        sample = reader.last()
    motion = motion_about(sample, (20.0, -4.0), 40.0)
    other, _ = moved(sample, np.zeros(sample.cells.shape, np.int32), motion)
    found = compare_layouts(layout_of(sample), layout_of(other))
    assert found.floor_iou > 0.95
    assert found.room_counts["same"] >= 0.85 * len(found.a.tracks)
    assert not {"missing", "new"} & set(found.room_counts)
    assert found.walls.kept_m > 0.99 * found.walls.compared_m


def test_a_room_where_the_other_run_found_none_is_missing(office):
    """Its place is explored and is no room; from the other side it is new."""
    room = room_at(office, ROOM_2)
    kept = [track - 1 for track in office.tracks if track != room]
    other = dataclasses.replace(
        office,
        tracks=tuple(office.tracks[row] for row in kept),
        shapes=tuple(office.shapes[row] for row in kept),
        areas_m2=office.areas_m2[kept],
    )
    assert by_status(compare_rooms(office, other, STILL))["missing"] == ((room,), ())
    back = compare_rooms(other, office, STILL)
    assert by_status(back)["new"] == ((), (room,))
    (new,) = (change for change in back if change.status == "new")
    assert new.area_b_m2 == pytest.approx(5 * 4, rel=0.15)
    assert (new.iou, new.area_a_m2, new.shape_a.is_empty) == (0, 0, True)


def test_a_room_that_was_not_entered_is_unseen_and_no_wall_of_it_is_missing(office):
    """Nothing is claimed about what a run has not explored."""
    other = layout_of(painted(drawn_office(), (5.2, 2.2, 10.5, 6.5), -1))
    changes = compare_rooms(office, other, STILL)
    statuses = {status for status, _ in by_status(changes).items()}
    assert not statuses & {"missing", "new", "merged"}
    assert compare_walls(office, other, STILL).changes == ()


def test_a_wall_taken_out_merges_two_rooms(office):
    """The rooms are one and what was taken out of their wall is missing; the other way round, a split."""
    other = layout_of(painted(drawn_office(), PARTITION_M, 0))
    parts = tuple(sorted((room_at(office, ROOM_1), room_at(office, ROOM_2))))
    whole = (room_at(other, ROOM_1),)
    changes = compare_rooms(office, other, STILL)
    assert by_status(changes)["merged"] == (parts, whole)
    assert by_status(compare_rooms(other, office, STILL))["split"] == (whole, parts)
    (merged,) = (change for change in changes if change.status == "merged")
    assert merged.iou > 0.9
    (wall,) = compare_walls(office, other, STILL).changes
    assert wall.status == "missing"
    assert wall.length_m == pytest.approx(3.7, abs=0.3)
    assert wall.ends_a_m.reshape(2, 2)[:, 0] == pytest.approx([5, 5], abs=0.1)
    (wall,) = compare_walls(other, office, STILL).changes
    assert (wall.status, wall.ends_a_m) == ("new", None)


def test_a_wall_set_aside_has_moved_and_changes_both_rooms(office):
    """A partition 1.2 m to the right: moved by this, the rooms grown and shrunk."""
    other = layout_of(painted(painted(drawn_office(), PARTITION_M, 0), (6.1, 2.0, 6.25, 6.0), 100))
    (wall,) = compare_walls(office, other, STILL).changes
    assert wall.status == "moved"
    assert wall.shift_m == pytest.approx(1.2, abs=0.1)
    changes = compare_rooms(office, other, STILL)
    room_1 = room_at(office, ROOM_1)
    (grown,) = (change for change in changes if change.tracks_a == (room_1,))
    assert grown.tracks_b == (room_at(other, ROOM_1),)
    assert grown.iou == pytest.approx(5 / 6.2, abs=0.05)
    assert grown.area_b_m2 - grown.area_a_m2 == pytest.approx(1.2 * 4, abs=1)


def test_changes_are_told_in_the_first_frame(office):
    """The other run's frame is turned: ends of walls and shapes come back to the first one's."""
    still = painted(drawn_office(), PARTITION_M, 0)
    motion = motion_about(still, (7.0, 3.0), 30.0)
    turned = layout_of(moved(still, np.zeros(still.cells.shape, np.int32), motion)[0])
    back = motion.inverse()
    (wall,) = compare_walls(turned, office, motion).changes
    assert wall.status == "new"
    assert back.points(wall.ends_b_m.reshape(2, 2))[:, 0] == pytest.approx([5, 5], abs=0.1)
    for change in compare_rooms(office, turned, back):
        assert change.iou > 0.85


def test_a_method_without_walls_compares_rooms(office):
    """The classical methods find none."""
    other = layout_of(drawn_office(), "voronoi")
    found = compare_layouts(office, other)
    assert found.walls is None
    assert room_at(other, CORRIDOR)
    assert found.floor_iou > 0.8


def test_a_run_without_rooms_is_compared(office):
    """All rooms of the other one are missing, or new; also two without any."""
    without = dataclasses.replace(office, tracks=(), shapes=(), areas_m2=np.zeros(0))
    assert compare_layouts(office, without).room_counts == {"missing": 3}
    assert compare_layouts(without, office).room_counts == {"new": 3}
    assert compare_layouts(without, without).room_counts == {}


@pytest.mark.parametrize("kept", [0, 1])
def test_a_wall_of_which_one_face_is_there_is_not_gone(kept: int):
    """Where the other map drew it thinner, its second face lies on free space."""
    step_m = PARAMETERS.wall_step_m
    steps = np.arange(30) * step_m + step_m / 2
    points = np.concatenate([np.column_stack([steps, np.full(30, y)]) for y in (0.0, 0.15)])
    on = np.repeat([kept == 0, kept == 1], 30)
    line = np.array([0.0, 0.0, 3.0, 0.0])
    gone, compared, there = _stretches(points, on, ~on, line, 0.2, PARAMETERS)
    assert (len(gone), compared, there) == (0, 30, 30)
    gone, compared, there = _stretches(points, np.zeros(60, bool), np.ones(60, bool), line, 0.2, PARAMETERS)
    assert (len(gone), compared, there) == (1, 30, 0)
