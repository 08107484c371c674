"""Rooms in one piece."""

import numpy as np
import pytest

from rose2_logs.segmentation.rooms.pieces import rooms_in_one_piece

GAP_M, PIECE_M2 = 0.3, 1.0


def in_one_piece(labels, resolution_m, gap_m, piece_min_m2, occupied=None):
    occupied = np.zeros(labels.shape, bool) if occupied is None else occupied
    return rooms_in_one_piece(labels, occupied, resolution_m, gap_m, piece_min_m2)


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
