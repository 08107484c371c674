"""Identity of rooms over hand-drawn runs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawn_maps import office, snapshot
from drawn_rooms import drawn, rows
from hypothesis import given, settings
from hypothesis import strategies as st
from moved_maps import motion_about, moved

from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.model.rooms import RoomMap
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.tracking.tracked_snapshot import MAP_TRACK
from rose2_logs.tracking.tracker import RoomTracker


def run(*maps, parameters: TrackingParameters | None = None):
    """Track ids and events (as kind, track, others) of each map; a map is labels or (labels, geometry)."""
    tracker = RoomTracker(parameters or TrackingParameters())
    ids, events = [], []
    for index, map_ in enumerate(maps):
        labels, where = map_ if isinstance(map_, tuple) else (map_, {})
        track_ids, happened = tracker.update(*drawn(labels, index, **where))
        ids.append(track_ids)
        events.append([(event.kind, event.track, event.others) for event in happened])
    return ids, events


def test_rooms_keep_their_number_whatever_their_label():
    """Swapped labels do not swap tracks."""
    ids, events = run(rows("1122"), rows("2211"))
    assert ids == [(1, 2), (2, 1)]
    assert events[0] == [("born", 1, ()), ("born", 2, ())]
    assert events[1] == [("continued", 1, ()), ("continued", 2, ())]


def test_a_growing_canvas_with_a_moving_origin_changes_nothing():
    """Rooms are compared in the world: the same cells on a larger canvas are the same rooms."""
    small = rows("1122", "1122")
    large = np.pad(small, ((3, 1), (5, 2)))
    ids, events = run(small, (large, {"origin_xy_m": (-5.0, -3.0)}))
    assert ids == [(1, 2), (1, 2)]
    tracker = RoomTracker(TrackingParameters())
    tracker.update(*drawn(small))
    _, happened = tracker.update(*drawn(large, 1, origin_xy_m=(-5.0, -3.0)))
    assert [event.overlap for event in happened] == [1.0, 1.0]
    assert events[1] == [("continued", 1, ()), ("continued", 2, ())]


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_grid_over_the_same_world_changes_nothing(turns: int):
    """A grid with yaw whose cells cover the same floor has full overlap, up to the last cell."""
    labels = rows("11122", "11122", "33322")
    corner = {1: (5.0, 0.0), 2: (5.0, 3.0), 3: (0.0, 3.0)}[turns]
    tracker = RoomTracker(TrackingParameters())
    tracker.update(*drawn(labels))
    # Cell (r, c) of the turned grid lies over the cell of the first that np.rot90 brings there.
    turned = np.rot90(labels, turns)
    ids, happened = tracker.update(*drawn(turned, 1, origin_xy_m=corner, yaw_rad=turns * math.pi / 2))
    assert ids == (1, 2, 3)
    assert [event.overlap for event in happened] == [1.0, 1.0, 1.0]


def test_half_the_cell_size_changes_nothing():
    """The same floor at another resolution is the same rooms with the same areas."""
    labels = rows("1122", "1133")
    fine = np.kron(labels, np.ones((2, 2), int))
    tracker = RoomTracker(TrackingParameters())
    tracker.update(*drawn(labels))
    ids, happened = tracker.update(*drawn(fine, 1, resolution_m=0.5))
    assert ids == (1, 2, 3)
    assert [event.overlap for event in happened] == [1.0, 1.0, 1.0]


def test_a_smaller_canvas_counts_the_area_it_cuts_off():
    """What lies outside the new canvas still belongs to the old room's size."""
    tracker = RoomTracker(TrackingParameters())
    tracker.update(*drawn(rows("1111")))
    _, happened = tracker.update(*drawn(rows("11"), 1))
    assert happened[0].overlap == 0.5


def test_a_room_seen_through_its_door_keeps_its_number_when_entered():
    """A sliver of a tenth of the room is continued by the room that holds all of it."""
    ids, events = run(rows("1........."), rows("1111111111"))
    assert ids == [(1,), (1,)]
    assert events[1] == [("continued", 1, ())]


def test_a_split_names_the_part_that_it_gave_birth_to():
    """The larger part goes on; the other is born, and the split ties it to where it came from."""
    ids, events = run(rows("111111"), rows("112222"))
    assert ids[1] == (2, 1)
    assert events[1] == [("continued", 1, ()), ("born", 2, ()), ("split", 1, (2,))]


def test_a_new_room_beside_a_growing_one_is_no_split():
    """A room on floor that no track held is only born."""
    _, events = run(rows("111..."), rows("111222"))
    assert events[1] == [("continued", 1, ()), ("born", 2, ())]


def test_a_merge_names_the_tracks_that_it_ended():
    """The larger part's track stays; the other is lost, and the merge says to whom."""
    ids, events = run(rows("112222"), rows("111111"))
    assert ids[1] == (2,)
    assert events[1] == [("continued", 2, ()), ("merged", 2, (1,)), ("lost", 1, ())]


def test_a_lost_room_that_comes_back_gets_its_number_again():
    """Also after several maps, on another canvas, and when others were born meanwhile."""
    ids, events = run(
        rows("1122"),
        rows("11.."),
        rows("11..", "22.."),
        (rows("....", "1122", "33.."), {"origin_xy_m": (0.0, -1.0)}),
    )
    assert ids == [(1, 2), (1,), (1, 3), (1, 2, 3)]
    assert ("lost", 2, ()) in events[1]
    assert ("returned", 2, ()) in events[3]


def test_a_merge_that_is_taken_back_restores_both_numbers():
    """Flicker between one room and two does not eat numbers."""
    two, one = rows("112222"), rows("111111")
    ids, events = run(two, one, two, one, two)
    assert ids == [(1, 2), (2,), (1, 2), (2,), (1, 2)]
    assert events[2] == [("continued", 2, ()), ("returned", 1, ()), ("split", 2, (1,))]


def test_a_room_that_is_split_and_merged_back_has_its_old_number_throughout():
    """The part that comes and goes has one number, too, whatever the map shows in between."""
    one, two, other = rows("111111..."), rows("111122..."), rows("111111.22")
    ids, events = run(one, two, one, other, two)
    assert ids == [(1,), (1, 2), (1,), (1, 3), (1, 2)]
    assert events[1] == [("continued", 1, ()), ("born", 2, ()), ("split", 1, (2,))]
    assert events[2] == [("continued", 1, ()), ("merged", 1, (2,)), ("lost", 2, ())]
    assert ("returned", 2, ()) in events[4]
    assert ("split", 1, (2,)) in events[4]


def test_numbers_are_never_used_again():
    """A room at another place gets a new number, though the old one is lost."""
    ids, _ = run(rows("11......"), rows("........"), rows("......11"))
    assert ids == [(1,), (), (2,)]


def test_the_longest_lost_shape_goes_first_when_there_are_too_many():
    """Memory for lost rooms is bounded; a room forgotten comes back under a new number."""
    kept_one = TrackingParameters(lost_kept=1)
    ids, _ = run(rows("11.22"), rows("...11"), rows("....."), rows("11.22"), parameters=kept_one)
    assert ids == [(1, 2), (2,), (), (3, 2)]


def test_maps_without_rooms_are_no_trouble():
    """Empty first, middle and last maps."""
    ids, events = run(rows("..."), rows("111"), rows("..."))
    assert ids == [(), (1,), ()]
    assert events == [[], [("born", 1, ())], [("lost", 1, ())]]


@pytest.mark.parametrize("shape", [(0, 5), (5, 0), (0, 0)])
def test_maps_without_cells_are_no_trouble(shape):
    empty = snapshot(np.zeros(shape, np.int8))
    assert RoomTracker(TrackingParameters()).update(empty, analyze(empty)) == ((), ())


@given(
    st.lists(st.integers(0, 2**31), min_size=2, max_size=6),
    st.tuples(st.integers(-9, 9), st.integers(-9, 9)),
)
@settings(max_examples=30)
def test_moving_the_world_changes_no_track(seeds, shift):
    """The same run elsewhere in the world has the same tracks; a track is one room at a time."""
    maps = [np.random.default_rng(seed).integers(0, 4, (3, 3)).repeat(4, 0).repeat(4, 1) for seed in seeds]
    ids, events = run(*maps)
    moved, moved_events = run(*[(labels, {"origin_xy_m": shift}) for labels in maps])
    assert moved == ids
    assert moved_events == events
    alive: set[int] = set()
    for tracks, happened in zip(ids, events, strict=True):
        assert len(set(tracks)) == len(tracks)
        begun = {track for kind, track, _ in happened if kind in ("born", "returned")}
        ended = {track for kind, track, _ in happened if kind == "lost"}
        assert alive & begun == set()
        assert ended <= alive
        alive = (alive | begun) - ended
        assert alive == set(tracks)


def test_flicker_of_parts_does_not_swap_numbers():
    """Which of two parts is the larger one changes from map to map, and they are one in between."""
    one, left, right = rows("1111111111"), rows("1111112222"), rows("1111222222")
    ids, _ = run(one, left, one, right, one, left, one)
    assert ids == [(1,), (1, 2), (1,), (1, 2), (1,), (1, 2), (1,)]


def test_a_good_pair_is_not_given_up_for_two_poor_ones():
    """A track stays with the room that it overlaps most, though two tracks could be continued instead."""
    ids, events = run(rows("11111111112."), rows("222211111111"))
    assert ids[1] == (1, 3)
    assert ("merged", 1, (2,)) in events[1]


def test_when_the_whole_map_shifts_rooms_are_looked_for_where_they_now_are():
    """Rooms a meter wide that all move by a meter keep their numbers, a lost one too."""
    cells, labels = office(pad=(30, 30))
    narrow = np.where(labels > 0, 1 + np.arange(labels.shape[1]) // 20, 0).astype(np.int32)
    narrow = np.unique(narrow, return_inverse=True)[1].reshape(labels.shape).astype(np.int32)
    first = snapshot(cells)
    second, there = moved(first, narrow, motion_about(first, (1.0, 0.0), 0.0))
    tracker = RoomTracker(TrackingParameters())
    before, _ = tracker.update(first, RoomMap.from_labels(narrow, first.geometry))
    kept = np.where(there == 3, 0, there).astype(np.int32)
    after, events = tracker.update(second, RoomMap.from_labels(kept, second.geometry))
    assert [track for track in after if track != after[2]] == [track for track in before if track != 3]
    (shift,) = [event for event in events if event.kind == "shifted"]
    assert shift.track == MAP_TRACK
    assert shift.motion is not None
    assert shift.motion.shift_xy_m == pytest.approx((1.0, 0.0), abs=0.01)
    returned, events = tracker.update(second, RoomMap.from_labels(there, second.geometry))
    assert returned == before
    assert ("returned", 3) in [(event.kind, event.track) for event in events]


def test_a_memory_of_one_shape_forgets_the_whole():
    """With one shape a track, the part that was last seen is what is compared."""
    parameters = TrackingParameters(shapes_kept=1)
    one, left, right = rows("1111111111"), rows("1111112222"), rows("1112222222")
    assert run(one, left, one, right)[0][3] == (1, 2)
    assert run(one, left, one, right, parameters=parameters)[0][3] != (1, 2)
