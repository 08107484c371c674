"""Drawn maps have the rooms that were drawn: of all sizes, many, at any angle, with white around them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from drawn_floors import Floor, corridor_of_offices, draw_floor, room_grid, rooms_right, turned
from drawn_maps import agreement, snapshot

from rose2_logs.config.parameters import Parameters
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.segmentation.pipeline import analyze

PARAMETERS = Parameters()
FREE, WALL, UNKNOWN = 0, 100, -1


def analyzed(floor: Floor) -> SnapshotAnalysis:
    return analyze(snapshot(floor.cells, floor.resolution_m), PARAMETERS)


def assert_as_drawn(floor: Floor, least_iou: float = 0.9) -> None:
    """Each drawn room is found, and no other."""
    found = analyzed(floor).labels
    assert rooms_right(found, floor.rooms, least_iou) == 1
    assert found.max() == floor.rooms.max()


@pytest.mark.parametrize("side_m", [1.1, 1.5, 3, 6, 12, 40])
def test_a_room_of_any_size_is_one_room(side_m):
    assert_as_drawn(draw_floor([(0, 0, side_m, side_m)]))


@pytest.mark.parametrize("side_m", [1.5, 2, 3, 5, 10, 20])
def test_a_door_parts_two_rooms_of_any_size(side_m):
    rooms = [(0, 0, side_m, side_m), (side_m + 0.15, 0, 2 * side_m + 0.15, side_m)]
    middle = side_m / 2
    assert_as_drawn(draw_floor(rooms, [(side_m, middle - 0.4, side_m + 0.15, middle + 0.4)]))


@pytest.mark.parametrize(("rows", "side_m"), [(6, 2.6), (6, 3.0), (6, 4.0), (25, 2.6)])
def test_each_room_of_a_grid_is_a_room_though_all_doors_are_in_line(rows, side_m):
    assert_as_drawn(room_grid(rows, rows, side_m))


def test_a_toilet_of_a_square_meter_beside_an_office_is_a_room():
    office, toilet, anteroom = (0, 0, 4, 4), (4.15, 0, 5.2, 1.05), (4.15, 1.2, 7, 4)
    assert_as_drawn(draw_floor([office, toilet, anteroom], [(4, 2, 4.15, 2.9), (4.35, 1.05, 4.95, 1.2)]))


def test_closets_along_a_hall_are_rooms():
    closets = [(k * 1.65, 8.15, k * 1.65 + 1.5, 9.4) for k in range(7)]
    doors = [(k * 1.65 + 0.3, 8, k * 1.65 + 1.1, 8.15) for k in range(7)]
    assert_as_drawn(draw_floor([(0, 0, 12, 8), *closets], doors))


def test_a_flat_has_the_rooms_that_were_drawn():
    rooms = [(0, 0, 4, 5), (4.15, 0, 7.5, 3.5), (4.15, 3.65, 5.5, 5), (5.65, 3.65, 7.5, 5)]
    doors = [(4, 1, 4.15, 1.8), (4, 4, 4.15, 4.7), (5.5, 4, 5.65, 4.7)]
    assert_as_drawn(draw_floor(rooms, doors))


@pytest.mark.parametrize("degrees", [0, 7, 15, 30, 45])
def test_offices_at_any_angle_are_as_drawn(degrees):
    assert_as_drawn(turned(corridor_of_offices(), degrees))


@pytest.mark.parametrize(
    "floor",
    [
        corridor_of_offices(resolution_m=0.025),
        corridor_of_offices(resolution_m=0.1, door_m=1.0),
        corridor_of_offices(margin_m=0.0),
        corridor_of_offices(margin_m=12.0),
    ],
    ids=["finer", "coarser", "cropped", "padded"],
)
def test_offices_of_other_cells_and_canvases_are_as_drawn(floor):
    assert_as_drawn(floor)


def test_offices_of_which_a_cell_in_a_hundred_is_unknown_are_as_drawn():
    floor = corridor_of_offices()
    lost = np.random.default_rng(0).random(floor.cells.shape) < 0.01
    assert_as_drawn(
        Floor(np.where(lost, UNKNOWN, floor.cells).astype(np.int8), np.where(lost, 0, floor.rooms))
    )


@pytest.mark.parametrize("change", [np.fliplr, np.flipud, np.rot90, np.transpose])
def test_offices_mirrored_or_turned_by_quarters_are_the_same(change):
    floor = corridor_of_offices()
    floor.cells[30:36, 60:70] = WALL  # a table, so that no side is like another
    found = analyzed(floor).labels
    changed = analyzed(Floor(np.ascontiguousarray(change(floor.cells)), change(floor.rooms))).labels
    assert agreement(change(found), changed) > 0.97


class TestOutside:
    """White around a drawing, and rays through windows."""

    @pytest.mark.parametrize(("margin_m", "degrees"), [(0.3, 0), (1.0, 30), (5.0, 0), (5.0, 30), (12.0, 0)])
    def test_white_around_a_drawn_building_is_no_room(self, margin_m, degrees):
        floor = turned(corridor_of_offices(outside=FREE, margin_m=margin_m), degrees)
        assert_as_drawn(floor)
        doors_m2 = 8 * 0.9 * 0.15
        white_m2 = ((floor.cells == FREE) & (floor.rooms == 0)).sum() * floor.resolution_m**2 - doors_m2
        assert analyzed(floor).outside_m2 == pytest.approx(white_m2, rel=0.15)

    @pytest.mark.parametrize("gap_m", [0.15, 0.5, 0.9, 1.5])
    def test_gaps_in_outer_walls_do_not_let_the_white_in(self, gap_m):
        floor = corridor_of_offices(outside=FREE, margin_m=5)
        cells, gap = floor.cells.copy(), round(gap_m / floor.resolution_m)
        bottom, left = np.argwhere(cells == WALL).min(0)
        cells[bottom : bottom + 3, left + 40 : left + 40 + gap] = FREE
        cells[-bottom - 60 : -bottom - 60 + gap, left : left + 3] = FREE
        assert (cells != floor.cells).sum() == 2 * 3 * gap
        assert_as_drawn(Floor(cells, floor.rooms))

    def test_nothing_of_a_building_without_white_is_outside(self):
        assert analyzed(corridor_of_offices()).outside_m2 == 0

    def test_a_courtyard_of_unknown_cells_is_no_room(self):
        around = corridor_of_offices(outside=UNKNOWN, margin_m=3)
        assert not analyzed(around).labels[around.cells == UNKNOWN].any()

    def test_rays_through_windows_are_no_rooms(self):
        """Of ten rays a cell or two wide; where a ray ends it is as a room's corner."""
        floor = corridor_of_offices(margin_m=12)
        cells = floor.cells.copy()
        bottom, left = np.argwhere(cells == WALL).min(0)
        for k in range(10):
            start = (int(left) + 12 + 12 * k, int(bottom) + 3)
            end = (start[0] - 90 + 20 * k, 20 + 7 * (k % 3))
            ray = cv2.line(np.zeros(cells.shape, np.uint8), start, end, 1, thickness=1 + k % 2) > 0
            cells[ray & (cells != FREE)] = FREE
        found = analyzed(Floor(cells, floor.rooms)).labels
        assert rooms_right(found, floor.rooms) == 1
        assert found.max() == floor.rooms.max()


class TestMapsWithHardlyAnyStructure:
    """What has no walls is one room, or none."""

    def test_a_field_is_one_room(self):
        found = analyzed(Floor(np.zeros((300, 200), np.int8), np.ones((300, 200), np.int32)))
        assert found.labels.min() == found.labels.max() == 1
        assert found.outside_m2 == 0

    @pytest.mark.parametrize(
        ("first", "last", "rooms"),
        [(0, 300, {2}), (40, 260, {1, 2}), (120, 180, {1})],
        ids=["whole", "long", "short"],
    )
    def test_a_wall_parts_a_field_only_where_it_goes_from_side_to_side(self, first, last, rooms):
        cells = np.zeros((300, 300), np.int8)
        cells[150:153, first:last] = WALL
        found = analyzed(Floor(cells, np.ones(cells.shape, np.int32)))
        assert found.labels.max() in rooms
        assert found.outside_m2 == 0
        assert ((found.labels > 0) == (cells == FREE)).mean() > 0.99

    @pytest.mark.parametrize(("share", "most"), [(0.05, 1), (0.2, 4), (1 / 3, 4)])
    def test_noise_has_hardly_any_rooms(self, share, most):
        rng = np.random.default_rng(1)
        values = np.array([UNKNOWN, FREE, WALL], np.int8)
        cells = rng.choice(values, (200, 200), p=[share, 1 - 2 * share, share])
        assert len(analyzed(Floor(cells, np.zeros(cells.shape, np.int32))).rooms) <= most

    @pytest.mark.parametrize("value", [WALL, UNKNOWN])
    def test_a_map_without_a_free_cell_has_no_room(self, value):
        cells = np.full((80, 60), value, np.int8)
        assert len(analyzed(Floor(cells, np.zeros(cells.shape, np.int32))).rooms) == 0

    def test_one_free_cell_is_no_room(self):
        cells = np.full((80, 60), UNKNOWN, np.int8)
        cells[40, 30] = FREE
        assert len(analyzed(Floor(cells, np.zeros(cells.shape, np.int32))).rooms) == 0

    @pytest.mark.parametrize("shape", [(1, 900), (4, 900), (900, 12), (27, 900)])
    def test_a_strip_of_any_width_is_analyzed(self, shape):
        cells = np.zeros(shape, np.int8)
        found = analyzed(Floor(cells, np.ones(shape, np.int32)))
        assert len(found.rooms) == found.labels.max()


def test_rooms_that_do_not_hang_together_are_two_rooms():
    """Two halves of a hall, of which the strip between was not seen."""
    floor = draw_floor([(0, 0, 8, 5)])
    cells, middle = floor.cells.copy(), floor.cells.shape[1] // 2
    cells[:, middle - 20 : middle + 20] = UNKNOWN
    found = analyzed(Floor(cells, floor.rooms)).labels
    assert found.max() == 2
    for room in (1, 2):
        count, _ = cv2.connectedComponents((found == room).astype(np.uint8), connectivity=4)
        assert count == 2
