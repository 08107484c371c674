"""The layout of a run's last map on the maps before it: drawn maps, moved maps, a sample log."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from drawn_maps import office
from moved_maps import motion_about, moved

from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.back_projection import BackProjector, motions_to_last
from rose2_logs.tracking.registration import RigidMotion

RESOLUTION_M = 0.1
PARAMETERS = TrackingParameters(back_projected_min_area_m2=0.5)


def drawn(rows: list[str]) -> OccupancySnapshot:
    """A map from rows, the upper one first: # wall, ? unknown, all else free."""
    value = {"#": 100, "?": -1}
    cells = np.array([[value.get(sign, 0) for sign in row] for row in reversed(rows)], np.int8)
    geometry = GridGeometry(RESOLUTION_M, (0.0, 0.0), 0.0, "map", cells.shape)
    return OccupancySnapshot(0, 0, 0, "/map", cells, geometry)


def rooms_of(rows: list[str]) -> RoomMap:
    """Rooms by their digits."""
    labels = [[int(sign) if sign.isdigit() else 0 for sign in row] for row in reversed(rows)]
    geometry = GridGeometry(RESOLUTION_M, (0.0, 0.0), 0.0, "map", (len(rows), len(rows[0])))
    return RoomMap.from_labels(np.array(labels, np.int32), geometry)


LAST = ["#" * 25, *["#" + "1" * 11 + "#" + "2" * 11 + "#"] * 11, "#" * 25]


def back_projected(rows: list[str], parameters: TrackingParameters = PARAMETERS) -> list[str]:
    projector = BackProjector(drawn(LAST), rooms_of(LAST), parameters)
    found = projector.rooms(drawn(rows), RigidMotion.none())
    return ["".join(map(str, row)) for row in found.labels[::-1].tolist()]


def test_what_was_seen_of_a_room_is_that_room():
    seen = [row[:18] + "?" * 7 for row in LAST]
    assert back_projected(seen)[3] == "0" + "1" * 11 + "0" + "2" * 5 + "0" * 7


def test_areas_are_those_of_the_cells():
    seen = drawn([row[:18] + "?" * 7 for row in LAST])
    found = BackProjector(drawn(LAST), rooms_of(LAST), PARAMETERS).rooms(seen, RigidMotion.none())
    assert found.areas_m2.tolist() == pytest.approx([1.21, 0.55])


def test_free_cells_where_no_room_is_in_the_end_take_the_nearest():
    """The wall between was not seen, and free space went on to the left."""
    seen = ["#" * 25, *["." * 25] * 11, "#" * 25]
    assert back_projected(seen)[5] in ("1" * 12 + "2" * 13, "1" * 13 + "2" * 12)


def test_what_is_outside_in_the_end_is_no_room_before_either():
    """Rays went out through a window: free in the last map too, and in none of its rooms."""
    last = [
        row.replace("#", ".", 1) + ".." if 3 <= number < 6 else row + "??" for number, row in enumerate(LAST)
    ]
    last = ["...." + row if 3 <= number < 6 else "????" + row for number, row in enumerate(last)]
    projector = BackProjector(drawn(last), rooms_of(last), PARAMETERS)
    found = projector.rooms(drawn(last), RigidMotion.none()).labels[::-1]
    assert np.array_equal(found, rooms_of(last).labels[::-1])


def test_a_glimpse_is_the_room_it_was_seen_from():
    """Through the door 2 columns of the second room: 0.22 square meters are no room yet."""
    seen = [row[:15] + "?" * 10 for row in LAST]
    seen[5:8] = [row[:12] + "1" + row[13:] for row in seen[5:8]]  # a door
    assert back_projected(seen)[3] == "0" + "1" * 11 + "0" + "1" * 2 + "0" * 10
    assert back_projected(seen, TrackingParameters(back_projected_min_area_m2=0.2))[3][13:15] == "22"


def test_a_glimpse_stays_where_nothing_else_was_seen():
    assert set("".join(back_projected([row[:3] + "?" * 22 for row in LAST]))) == {"0", "1"}


def test_no_rooms_in_the_end_and_nothing_seen():
    empty = RoomMap.from_labels(np.zeros((13, 25), np.int32), drawn(LAST).geometry)
    found = BackProjector(drawn(LAST), empty, PARAMETERS).rooms(drawn(LAST), RigidMotion.none())
    assert not found.labels.any()
    assert len(found.areas_m2) == 0
    assert not any("1" in row for row in back_projected(["?" * 25] * 13))


@pytest.mark.parametrize(("shift_m", "turn"), [((0.2, -0.1), 0.6), ((-1.4, 0.9), -3.0)])
def test_a_map_that_lay_elsewhere(shift_m: tuple[float, float], turn: float):
    """Known from the shifts of the run or, where it is only some decimeters, from the walls alone."""
    cells, truth = office()
    geometry = GridGeometry(0.05, (1.0, -2.0), 0.3, "map", cells.shape)
    last = OccupancySnapshot(0, 0, 0, "/map", cells, geometry)
    rooms = RoomMap.from_labels(truth, geometry)
    motion = motion_about(last, shift_m, turn)
    before, expected = moved(last, np.where(cells == 0, truth, 0).astype(np.int32), motion)
    start = motion.inverse() if abs(turn) > 1 else RigidMotion.none()
    found = BackProjector(last, rooms, TrackingParameters()).rooms(before, start).labels
    here = expected > 0
    assert (found[here] == expected[here]).mean() > 0.99


def test_a_canvas_that_grew_and_has_other_cells():
    last, rooms = drawn(LAST), rooms_of(LAST)
    coarse = dataclasses.replace(
        last,
        cells=np.zeros((6, 4), np.int8),
        geometry=GridGeometry(0.2, (0.1, 0.1), 0.0, "map", (6, 4)),
    )
    assert np.unique(
        BackProjector(last, rooms, PARAMETERS).rooms(coarse, RigidMotion.none()).labels
    ).tolist() == [1]


def test_motions_add_up_to_the_last():
    one, two = RigidMotion((1.0, 0.0), (0.5, 0.0), 0.2), RigidMotion((0.0, 3.0), (0.0, -0.2), -0.1)
    first, second, third, last = motions_to_last([None, one, None, two])
    point = np.array([4.0, 5.0])
    np.testing.assert_allclose(first.points(point), two.points(one.points(point)))
    np.testing.assert_allclose(second.points(point), two.points(point))
    np.testing.assert_allclose(third.points(point), two.points(point))
    np.testing.assert_allclose(last.points(point), point)
    assert motions_to_last([]) == []
