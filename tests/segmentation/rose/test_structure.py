"""Stage A: directions, score, clean map."""

import cv2
import numpy as np
import pytest
from drawn_maps import SIZE_M, office
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rose2_logs.config.parameters import SpectrumParameters
from rose2_logs.segmentation.rose.clean_map import (
    attached_cells,
    clean_threshold,
    structure_score,
    supported_cells,
)
from rose2_logs.segmentation.rose.spectrum import (
    PICTURE_SIDE,
    angular_energy,
    compute_spectrum,
    dominant_directions,
    spectrum_picture,
)

PARAMETERS = SpectrumParameters()


def directions_of(occupied):
    spectrum = compute_spectrum(occupied, 0.05, PARAMETERS)
    return dominant_directions(angular_energy(spectrum, PARAMETERS), PARAMETERS)[0]


def away(one, other):
    difference = np.abs(one - other) % np.pi
    return np.minimum(difference, np.pi - difference)


@settings(max_examples=12)
@given(turn=st.floats(0, np.pi))
@example(turn=1.578125)  # so near the raster's direction that a wall has a single step
def test_the_two_directions_of_a_building_are_found_at_any_angle(turn):
    """Closer than the raster can show: a wall that is off by a cell from its one end to its other."""
    directions = directions_of(office(turn_rad=turn)[0] == 100)
    assert len(directions) == 2
    for true, length_m in zip((turn, turn + np.pi / 2), SIZE_M, strict=True):
        assert away(directions, true).min() < 0.05 / length_m


@pytest.mark.parametrize("occupied", [np.zeros((40, 50), bool), np.ones((1, 1), bool), np.eye(3, dtype=bool)])
def test_maps_without_structure_give_no_error(occupied):
    assert np.isfinite(directions_of(occupied)).all()


def test_a_long_wall_scores_high_and_a_chair_leg_low_whatever_the_wall_is_thick():
    occupied = np.zeros((200, 300), bool)
    occupied[50, 20:280] = occupied[100:106, 20:280] = occupied[150:153, 150:153] = True
    spectrum = compute_spectrum(occupied, 0.05, PARAMETERS)
    score = structure_score(spectrum, occupied, np.array([0.0]), PARAMETERS)
    assert score[50, 100:200].min() > 0.9
    assert score[100:106, 100:200].min() > 0.7
    assert score[150:153, 150:153].max() < 0.45
    assert (score[~occupied] == 0).all()


def test_the_threshold_is_the_lowest_that_leaves_few_enough_segments():
    occupied = np.ones((10, 10), bool)
    score = np.linspace(0, 1, 100, dtype=np.float32).reshape(10, 10)
    free_m2 = 40 / PARAMETERS.walls_max_per_m2
    threshold = clean_threshold(score, occupied, free_m2, lambda clean: int(clean.sum()), PARAMETERS)
    assert (score >= threshold).sum() <= 40
    assert (score >= threshold - PARAMETERS.threshold_step).sum() > 40


def test_jambs_that_touch_a_wall_are_attached_and_lone_cells_are_not():
    clean, candidates = np.zeros((5, 9), bool), np.zeros((5, 9), bool)
    clean[2, :4] = candidates[2, 4:6] = candidates[0, 8] = True
    attached = attached_cells(clean, candidates)
    assert attached[2, :6].all()
    assert attached.sum() == 6


def test_small_pieces_are_left_out_unless_they_lie_in_line_with_walls():
    occupied = np.zeros((100, 200), bool)
    occupied[20, 10:190] = occupied[60, 20:30] = occupied[80, 20:30] = True
    score = np.where(occupied, 0.1, 0).astype(np.float32)
    score[80] = np.where(occupied[80], PARAMETERS.piece_min_score + 0.1, 0)
    supported = supported_cells(score, occupied, 0.05, PARAMETERS)
    assert supported[20].sum() == 180
    assert supported[60].sum() == 0
    assert supported[80].sum() == 10


def test_a_piece_at_the_edge_of_the_map_is_as_long_as_elsewhere():
    occupied = np.zeros((40, 120), bool)
    longest = int(np.ceil(PARAMETERS.piece_min_extent_m / 0.05))
    occupied[0, :longest] = True
    assert supported_cells(np.zeros(occupied.shape, np.float32), occupied, 0.05, PARAMETERS).any()
    occupied[0, longest - 2 :] = False
    assert not supported_cells(np.zeros(occupied.shape, np.float32), occupied, 0.05, PARAMETERS).any()


@pytest.mark.parametrize("turn_deg", [0, 30, 75])
def test_the_picture_of_the_spectrum_has_a_ridge_across_the_walls(turn_deg):
    """Bright along the line at right angles to the walls; the same turned by half a circle."""
    occupied = np.zeros((300, 300), np.uint8)
    turn = np.deg2rad(turn_deg)
    center, along = np.array([150, 150]), np.array([np.cos(turn), np.sin(turn)])
    ends = np.rint([center - 100 * along, center + 100 * along]).astype(int)
    cv2.line(occupied, tuple(ends[0].tolist()), tuple(ends[1].tolist()), 1)
    picture = spectrum_picture(compute_spectrum(occupied.astype(bool), 0.05, PARAMETERS), PARAMETERS)
    assert picture.shape == (PICTURE_SIDE, PICTURE_SIDE)
    assert (picture == picture[::-1, ::-1]).all()
    middle, radii = (PICTURE_SIDE - 1) / 2, np.arange(8, 40)

    def mean_along(angle_deg: float) -> float:
        x, y = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
        row, column = np.rint(middle + radii * y).astype(int), np.rint(middle + radii * x).astype(int)
        return float(picture[row, column].mean())

    assert mean_along(turn_deg + 90) > 3 * max(mean_along(turn_deg + other) for other in (0, 45, 135))


def test_the_picture_of_an_empty_map_is_black():
    empty = compute_spectrum(np.zeros((50, 50), bool), 0.05, PARAMETERS)
    assert not spectrum_picture(empty, PARAMETERS).any()


@pytest.mark.parametrize("direction_deg", [0.0, 0.1, 30.0, 90.0, 135.0, 179.9])
def test_a_ridge_alone_gives_what_the_whole_plane_with_its_gain_gives(direction_deg):
    """Frequencies beside the ridge are left out, and so are their rows and columns."""
    occupied = np.random.default_rng(1).random((90, 140)) < 0.1
    spectrum = compute_spectrum(occupied, 0.05, SpectrumParameters())
    direction, sigma_m = np.radians(direction_deg), 1.0
    along = spectrum.frequency_x * np.cos(direction) + spectrum.frequency_y * np.sin(direction)
    gain = np.exp(-2 * (np.pi * sigma_m * along.astype(float)) ** 2)
    expected = np.fft.irfft2(spectrum.values * gain, spectrum.shape)[:90, :140]
    row, column = (index.ravel() for index in np.indices(occupied.shape))
    blurred = spectrum.blurred_along(direction, sigma_m, row, column)
    assert np.abs(blurred - expected.ravel()).max() < 1e-5
