"""Change of the layout from map to map, and what the last map tells of the ones before: counted by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely
from drawn_rooms import drawn, rows

from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.convergence import Convergence, RoomRows, measure_convergence
from rose2_logs.tracking.layout_change import LayoutFollower, variation_of_information
from rose2_logs.tracking.matching import cut_out_rooms
from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.track_history import SnapshotRef, TrackHistories
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot
from rose2_logs.tracking.tracker import RoomTracker

MOTION = RigidMotion((4.0, -1.0), (0.5, 0.25), math.radians(20))


def changes(*maps) -> list[tuple[float | None, float | None]]:
    """Variation of information and changed share of each map; a map is labels and track ids."""
    follower = LayoutFollower()
    found = []
    for labels, track_ids in maps:
        _, analysis = drawn(labels)
        change = follower.update(analysis.rooms, cut_out_rooms(analysis.rooms), track_ids, None)
        found.append((change.variation_bits, change.changed_share))
    return found


def test_the_same_rooms_have_no_variation_whatever_their_numbers():
    """Labels do not matter; tracks matter for the changed share alone."""
    first, again, other = changes((rows("1122"), (1, 2)), (rows("2211"), (2, 1)), (rows("1122"), (1, 3)))
    assert first == (None, None)
    assert again == (0.0, 0.0)
    assert other == (0.0, 0.5)


def test_a_room_cut_in_halves_varies_by_one_bit():
    """Half of its floor is in another track then; floor that is new does not count."""
    _, halves = changes((rows("1111...."), (1,)), (rows("11223333"), (1, 2, 3)))
    assert halves == pytest.approx((1.0, 0.5))
    _, thirds = changes((rows("111..."), (1,)), (rows("112..."), (1, 2)))
    assert thirds == pytest.approx((math.log2(3) - 2 / 3, 1 / 3))


def test_two_divisions_across_each_other_vary_by_both():
    """Four equal parts: a bit in each direction, and the same the other way round."""
    common = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert variation_of_information(common) == pytest.approx(2.0)
    uneven = np.array([[3.0, 1.0, 0.0], [0.0, 2.0, 5.0]])
    assert variation_of_information(uneven) == pytest.approx(variation_of_information(uneven.T))


def test_rooms_are_compared_where_the_map_moved_to():
    """A map that moves as a whole changes nothing, and the motions add up."""
    labels = rows("1122", "1122", "3322")
    rooms = [drawn(labels)[1].rooms]
    for _ in range(2):
        moved = MOTION.grid(rooms[-1].geometry)
        rooms.append(RoomMap.from_labels(labels, moved))
    follower = LayoutFollower()
    follower.update(rooms[0], cut_out_rooms(rooms[0]), (1, 2, 3), None)
    found = [follower.update(later, cut_out_rooms(later), (1, 2, 3), MOTION) for later in rooms[1:]]
    assert [change.changed_share for change in found] == [0.0, 0.0]
    corner = rooms[-1].geometry
    assert found[-1].drift.pose == pytest.approx((*corner.origin_xy_m, corner.yaw_rad))


def test_a_motion_and_its_inverse_leave_everything_where_it_is():
    """One after the other, in either order."""
    points = np.array([[0.0, 0.0], [3.0, -2.0]])
    for both in (MOTION.then(MOTION.inverse()), MOTION.inverse().then(MOTION)):
        assert both.points(points) == pytest.approx(points)
        assert both.turn_rad == pytest.approx(0)
    twice = MOTION.then(MOTION)
    assert twice.points(points) == pytest.approx(MOTION.points(MOTION.points(points)))


def tracked(*labels: np.ndarray) -> tuple[TrackHistories, list[RoomRows], dict[int, SnapshotRef]]:
    """Track histories of a run, its rooms as rows, and its maps; each map adds 0.1 of coverage."""
    histories, tracker, all_rows, snapshot_refs = TrackHistories(), RoomTracker(TrackingParameters()), [], {}
    for index, map_ in enumerate(labels):
        snapshot, analysis = drawn(map_, index)
        ids, events = tracker.update(snapshot, analysis)
        step = TrackedSnapshot(snapshot, analysis, (index + 1) / 10, ids, events)
        histories.add(step)
        snapshot_refs[index] = histories.snapshot_ref(step)
        polygons = np.array(analysis.rooms.polygons, object)
        all_rows.append(RoomRows(np.full(len(ids), index), np.array(ids), analysis.rooms.areas_m2, polygons))
    return histories, all_rows, snapshot_refs


def measured(
    *labels: np.ndarray, parameters: TrackingParameters | None = None
) -> tuple[TrackHistories, Convergence]:
    histories, all_rows, snapshot_refs = tracked(*labels)
    still = dict.fromkeys(snapshot_refs, RigidMotion.none())
    return histories, measure_convergence(all_rows, histories, snapshot_refs, still, parameters)


GROWING = (
    rows("1111......"),
    rows("1111111..."),
    rows("1111111112"),
    rows("111111111."),
    rows("1111111112"),
)
"""A room of 9 cells in the end, seen to 4, 7, 9, and one of 1 that comes, goes, and comes back."""


def test_a_life_is_gathered_map_by_map():
    """First and last map, number of maps, last area, losses."""
    histories, _ = measured(*GROWING)
    one, two = histories.tracks[1], histories.tracks[2]
    assert (one.first.snapshot, one.last.snapshot, one.maps, one.area_m2) == (0, 4, 5, 9.0)
    assert (two.first, two.last) == (SnapshotRef(2, 2.0, 0.3), SnapshotRef(4, 4.0, 0.5))
    assert (two.maps, two.losses) == (2, 1)
    assert histories.in_last_map == (1, 2)


def test_since_when_a_room_was_right():
    """Area within a tenth of the last, shape within 0.8 of it: the growing room from its third map on."""
    _, found = measured(*GROWING)
    assert {track: snapshot_ref.snapshot for track, snapshot_ref in found.area_settled.items()} == {
        1: 2,
        2: 2,
    }
    assert {track: snapshot_ref.snapshot for track, snapshot_ref in found.shape_right.items()} == {1: 2, 2: 2}
    assert found.shape_right_seen == {1: 1.0, 2: 1.0}


def test_an_area_that_changes_again_has_not_settled():
    """Right, wrong, right: it settled the second time; its shape was right the first time."""
    full, half = rows("1111111111"), rows("1111......")
    _, found = measured(full, half, full)
    assert found.area_settled[1].snapshot == 2
    assert found.shape_right[1].snapshot == 0


def test_a_prediction_is_right_before_the_room_is_seen():
    """The shape counts with its predicted part; how much was seen is told."""
    histories, all_rows, snapshot_refs = tracked(rows("1111......"), rows("1111111111"))
    all_rows[0].polygons[0] = shapely.box(0, 0, 9, 1)
    found = measure_convergence(
        all_rows, histories, snapshot_refs, dict.fromkeys(snapshot_refs, RigidMotion.none())
    )
    assert found.shape_right[1].snapshot == 0
    assert found.shape_right_seen[1] == pytest.approx(0.4)


def test_how_far_a_layout_was_the_last_one():
    """Weighted by the last rooms' area; final from the first map after which it stays so."""
    _, found = measured(*GROWING)
    assert found.final_iou == pytest.approx({0: 0.4, 1: 0.7, 2: 1.0, 3: 0.9, 4: 1.0})
    assert found.final_share == pytest.approx({0: 0.0, 1: 0.9, 2: 1.0, 3: 0.9, 4: 1.0})
    assert found.layout_final is not None
    assert found.layout_final.snapshot == 1


FRONTIER = (
    rows("1111......"),
    rows("11112222.."),
    rows("11112222.3"),
    rows("111122223."),
    rows("1111222233"),
)
"""Two rooms that are right from the second map on, and one at the frontier that moves to the end."""


def test_a_room_at_the_frontier_does_not_undo_the_layout():
    """It is a fifth of the floor, and wrong up to the last map; the rest was as in the end long before."""
    _, found = measured(*FRONTIER)
    assert found.final_share == pytest.approx({0: 0.4, 1: 0.8, 2: 0.8, 3: 0.8, 4: 1.0})
    assert found.layout_final is not None
    assert found.layout_final.snapshot == 1
    none_may_change = TrackingParameters(final_min_share=0.81)
    _, strict = measured(*FRONTIER, parameters=none_may_change)
    assert strict.layout_final is not None
    assert strict.layout_final.snapshot == 4


def test_what_was_not_seen_yet_does_not_count_against_what_was_known():
    """Rooms come to light one after the other: each is right as soon as it is seen, the layout late."""
    _, found = measured(rows("11........"), rows("1111......"), rows("11112222.."), rows("1111222233"))
    assert found.known_final_share == pytest.approx({0: 1.0, 1: 1.0, 2: 1.0, 3: 1.0})
    assert found.known_final is not None
    assert found.known_final.snapshot == 0
    assert found.layout_final is not None
    assert found.layout_final.snapshot == 2


def test_two_rooms_in_one_are_not_known_yet():
    """Rooms of 4 and 4 that are one at first; one of 1 at its edge would not be missed."""
    halves, whole = rows("11112222"), rows("11111111")
    _, found = measured(whole, halves)
    assert found.known_final_share == {0: 0.0, 1: 1.0}
    _, found = measured(rows("111111111"), rows("111111112"))
    assert found.known_final_share == pytest.approx({0: 8 / 9, 1: 1.0})
    assert found.final_iou[0] == pytest.approx((8 / 9 * 8 + 1 / 9) / 9)


def test_a_room_counts_from_the_overlap_that_is_asked():
    """Seven tenths of a room are the room; with more asked they are not."""
    short, full = rows("1111111..."), rows("1111111111")
    for least, share in ((0.7, 1.0), (0.71, 0.0)):
        _, found = measured(short, full, parameters=TrackingParameters(final_room_min_iou=least))
        assert found.final_share == {0: share, 1: 1.0}


def test_a_layout_is_final_whatever_the_numbers_of_its_rooms():
    """The rooms lie as in the end, though a track ended and another began in its place."""
    histories, all_rows, snapshot_refs = tracked(rows("1122"), rows("1122"))
    all_rows[0] = dataclasses.replace(all_rows[0], track=np.array([1, 3]))
    histories.tracks[3] = dataclasses.replace(histories.tracks[2])
    found = measure_convergence(
        all_rows, histories, snapshot_refs, dict.fromkeys(snapshot_refs, RigidMotion.none())
    )
    assert found.final_share == {0: 1.0, 1: 1.0}
    assert found.layout_final == snapshot_refs[0]


def test_a_map_without_rooms_ends_a_final_layout():
    """Nothing was known of it then, and the layout has to be found again."""
    _, found = measured(rows("11"), rows(".."), rows("11"))
    assert found.final_share == {0: 1.0, 1: 0.0, 2: 1.0}
    assert found.known_final_share == {0: 1.0, 1: None, 2: 1.0}
    for since in (found.layout_final, found.known_final):
        assert since is not None
        assert since.snapshot == 2


def test_rows_of_a_map_may_come_in_pieces():
    """However the rows are read, a map is compared as a whole; by however many threads."""
    histories, all_rows, snapshot_refs = tracked(*FRONTIER)
    still = dict.fromkeys(snapshot_refs, RigidMotion.none())
    whole = measure_convergence(all_rows, histories, snapshot_refs, still)
    joined = RoomRows.joined(all_rows)
    for size in (1, 2, 5, len(joined.track)):
        pieces = [joined.part(begin, begin + size) for begin in range(0, len(joined.track), size)]
        found = measure_convergence(pieces, histories, snapshot_refs, still, threads=size)
        assert found == whole


def test_tracks_that_few_maps_show_are_brief():
    """Two maps are few, three are not; a room that the last map shows may be a room that was found late."""
    two, three = rows("11.22...."), rows("11.22.33.")
    gone, late = rows("11....22."), rows("11....22.33")
    histories, found = measured(two, two, three, gone, late)
    assert {track: history.maps for track, history in histories.tracks.items()} == {1: 5, 2: 3, 3: 3, 4: 1}
    assert found.brief == ()
    _, found = measured(two, three, gone, late)
    assert found.brief == (2,)
    _, found = measured(two, three, gone, late, parameters=TrackingParameters(lasting_min_maps=2))
    assert found.brief == ()


def test_a_last_map_without_rooms_has_no_layout():
    """There is nothing to compare with."""
    _, found = measured(rows("11"), rows(".."))
    assert found.final_iou == {0: None, 1: None}
    assert found.layout_final is None


def test_shapes_are_compared_where_the_last_map_has_them():
    """A room that moved with the whole map was right from the beginning."""
    histories, all_rows, snapshot_refs = tracked(rows("1111", "1111"), rows("1111", "1111"))
    moved = shapely.transform(all_rows[1].polygons, MOTION.points)
    histories.tracks[1] = dataclasses.replace(histories.tracks[1], polygon=moved[0])
    all_rows[1] = dataclasses.replace(all_rows[1], polygons=moved)
    drifts = {0: RigidMotion.none(), 1: RigidMotion.none().then(MOTION)}
    # And if the map had moved before: only the way from map to map counts.
    earlier = RigidMotion.none().then(RigidMotion((2.0, -1.0), (0.7, 0.3), -0.4))
    later = {0: earlier, 1: earlier.then(MOTION)}
    assert measure_convergence(all_rows, histories, snapshot_refs, later).final_iou == pytest.approx(
        {0: 1.0, 1: 1.0}
    )
    assert measure_convergence(all_rows, histories, snapshot_refs, drifts).final_iou == pytest.approx(
        {0: 1.0, 1: 1.0}
    )
    unmoved = measure_convergence(
        all_rows, histories, snapshot_refs, dict.fromkeys(snapshot_refs, RigidMotion.none())
    )
    assert unmoved.final_iou[0] is not None
    assert unmoved.final_iou[0] < 0.8
