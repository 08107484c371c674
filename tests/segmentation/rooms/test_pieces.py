"""Rooms in one piece."""

from dataclasses import replace

import numpy as np
import pytest

from rose2_logs.config.regions import RegionParameters
from rose2_logs.segmentation.rooms.pieces import rooms_in_one_piece

GAP_M, PIECE_M2 = 0.3, 1.0
REGIONS = RegionParameters()


def in_one_piece(labels, resolution_m, gap_m, piece_min_m2, occupied=None, width_m=0.0):
    occupied = np.zeros(labels.shape, bool) if occupied is None else occupied
    parameters = replace(REGIONS, piece_gap_m=gap_m, room_min_area_m2=piece_min_m2, room_min_width_m=width_m)
    return rooms_in_one_piece(labels, occupied, resolution_m, parameters)


def test_the_piece_that_is_wide_enough_is_the_room_though_a_narrow_one_is_larger():
    labels = np.zeros((80, 260), np.int32)
    labels[5:13, 5:255] = 1  # 0.4 m wide, 5 m2
    labels[40:70, 5:35] = 1  # 2.25 m2
    labels[75:79, 5:9] = 1  # too small for a room: stays with it
    pieces, room_of_piece = in_one_piece(labels, 0.05, GAP_M, PIECE_M2, width_m=0.6)
    assert room_of_piece.tolist() == [0, 1]
    assert (pieces[:20] == 0).all()
    assert (pieces[20:] == labels[20:]).all()
    only_narrow = labels[:20]
    assert (in_one_piece(only_narrow, 0.05, GAP_M, PIECE_M2, width_m=0.6)[0] == only_narrow).all()


def test_what_a_wall_closes_is_no_gap():
    labels = two_pieces(4)
    wall = np.zeros(labels.shape, bool)
    wall[:, 31:33] = True
    assert in_one_piece(labels, 0.05, GAP_M, PIECE_M2)[0].max() == 2
    assert in_one_piece(labels, 0.05, GAP_M, PIECE_M2, wall)[0].max() == 3
    wall[20:26] = False
    assert in_one_piece(labels, 0.05, GAP_M, PIECE_M2, wall)[0].max() == 2


def two_pieces(gap_cells, second_cells=30):
    """Room 1 in pieces of 1.5 m x 3 m and some columns more, beside a whole room 2; 5 cm a cell."""
    labels = np.zeros((60, 140), np.int32)
    labels[:, :30] = 1
    labels[:, 30 + gap_cells : 30 + gap_cells + second_cells] = 1
    labels[:, 110:] = 2
    return labels


@pytest.mark.parametrize(("gap_cells", "rooms"), [(0, 2), (6, 2), (7, 3)])
def test_pieces_across_a_wider_gap_than_noise_are_rooms_of_their_own(gap_cells, rooms):
    pieces, room_of_piece = in_one_piece(two_pieces(gap_cells), 0.05, GAP_M, PIECE_M2)
    assert pieces.max() == rooms
    assert room_of_piece.tolist() == [0, 1, 2, 1][: rooms + 1]


@pytest.mark.parametrize(("columns", "rooms"), [(7, 3), (6, 2)])
def test_pieces_below_the_least_area_stay(columns, rooms):
    """Of 60 rows, 7 columns are 1.05 m2, 6 are 0.9 m2."""
    pieces, _ = in_one_piece(two_pieces(20, columns), 0.05, GAP_M, PIECE_M2)
    assert pieces.max() == rooms


@pytest.mark.parametrize(("columns", "rooms"), [(11, 3), (10, 2)])
def test_pieces_that_are_nowhere_wide_enough_are_no_rooms(columns, rooms):
    """A width is told to a cell: 11 columns of 5 cm may be 0.6 m, 10 are less."""
    labels = two_pieces(20, columns)
    pieces, _ = in_one_piece(labels, 0.05, GAP_M, PIECE_M2, width_m=0.6)
    assert pieces.max() == rooms
    assert (pieces[:, 50 : 50 + columns] == (3 if rooms == 3 else 0)).all()


def test_the_largest_piece_keeps_the_number_and_the_rest_its_cells():
    labels = two_pieces(20, second_cells=40)
    pieces, _ = in_one_piece(labels, 0.05, GAP_M, PIECE_M2)
    assert (pieces[:, :30] == 3).all()
    assert (pieces[:, 50:90] == 1).all()
    assert np.array_equal(pieces > 0, labels > 0)
    assert labels.max() == 2  # what was given is as it was


def test_pieces_that_touch_at_corners_alone_hang_together_only_across_gaps():
    labels = np.zeros((80, 80), np.int32)
    labels[:40, :40] = labels[40:, 40:] = 1
    assert in_one_piece(labels, 0.05, GAP_M, PIECE_M2)[0].max() == 1
    assert in_one_piece(labels, 0.05, 0.0, PIECE_M2)[0].max() == 2


def test_no_room_gives_no_piece():
    pieces, room_of_piece = in_one_piece(np.zeros((4, 5), np.int32), 0.05, GAP_M, PIECE_M2)
    assert not pieces.any()
    assert room_of_piece.tolist() == [0]


def object_in_a_room(inner_cells: int = 28, wall_cells: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """A room of 6 m x 6 m with a closed object whose floor is seen, 1.4 m x 1.4 m, in it; 5 cm a cell."""
    labels, occupied = np.zeros((140, 140), np.int32), np.zeros((140, 140), bool)
    labels[10:130, 10:130] = 1
    box = slice(40, 40 + inner_cells + 2 * wall_cells)
    labels[box, box], occupied[box, box] = 0, True
    inner = slice(40 + wall_cells, 40 + wall_cells + inner_cells)
    labels[inner, inner], occupied[inner, inner] = 1, False
    return labels, occupied


def with_object(labels, occupied, **changed) -> tuple[int, bool]:
    """Number of rooms, and whether the floor in the object is in none."""
    pieces, _ = rooms_in_one_piece(labels, occupied, 0.05, replace(REGIONS, **changed))
    return int(pieces.max()), bool(pieces[50, 50] == 0)


def test_the_floor_within_an_object_is_no_room():
    assert with_object(*object_in_a_room()) == (1, True)


def test_larger_closed_floor_is_a_room():
    """34 cells are 2.89 m2, 35 are 3.06."""
    assert with_object(*object_in_a_room(34)) == (1, True)
    assert with_object(*object_in_a_room(35)) == (2, False)
    assert with_object(*object_in_a_room(), object_max_m2=1.9) == (2, False)


def test_floor_behind_a_thick_wall_is_a_room():
    """A wall of 0.25 m is looked across, one of 0.3 m is not."""
    assert with_object(*object_in_a_room(wall_cells=5)) == (1, True)
    assert with_object(*object_in_a_room(wall_cells=6)) == (2, False)
    assert with_object(*object_in_a_room(wall_cells=6), object_wall_m=0.35) == (1, True)


@pytest.mark.parametrize("beside", [0, 2], ids=["the unknown", "another room"])
def test_closed_floor_beside_something_else_than_its_room_is_a_room(beside):
    """As a stall in a corner."""
    labels, occupied = object_in_a_room()
    labels[:40] = beside
    assert with_object(labels, occupied)[1] is False
    assert with_object(labels, occupied, object_min_surrounded=0.5)[1] is True
