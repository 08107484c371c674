"""The plan frame: areas and places stay what they are on the map."""

import numpy as np
import pytest
from drawn_maps import snapshot

from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.segmentation.regions.plan_frame import (
    POINTS_PER_SIDE,
    PlanFrame,
    grown_labels,
    without_specks,
)


@pytest.fixture(scope="module")
def box():
    mask = np.zeros((120, 160), bool)
    mask[20:100, 30:140] = True
    return mask


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.2, np.pi / 2])
@pytest.mark.parametrize("resolution_m", [0.02, 0.05, 0.1])
def test_areas_stay_and_labels_come_back(box, angle, resolution_m):
    frame = PlanFrame.of(box, angle, resolution_m)
    (count,) = frame.counts(box)
    assert count.sum() * (frame.cell_m / POINTS_PER_SIDE) ** 2 == pytest.approx(
        box.sum() * resolution_m**2, rel=0.01
    )
    back = frame.back(frame.sampled(box.astype(np.int32) * 7), box.shape)
    # Cells of the map that are cut at the sides of plan cells.
    assert np.mean((back == 7) == box) > 1 - 0.03 * 0.05 / resolution_m


def test_the_frame_lies_along_the_direction():
    y, x = np.indices((300, 300)) - 150.0
    along, across = x * np.cos(0.5) + y * np.sin(0.5), y * np.cos(0.5) - x * np.sin(0.5)
    strip = (np.abs(along) < 120) & (np.abs(across) < 10)
    rows, columns = PlanFrame.of(strip, 0.5, 0.05).shape
    assert columns == pytest.approx(240 * 0.05 / 0.1, abs=4)
    assert rows == pytest.approx(20 * 0.05 / 0.1, abs=4)


def test_several_masks_are_looked_at_at_once(box):
    frame = PlanFrame.of(box, 0.3, 0.05)
    masks = box, ~box, box & False, box | True, np.roll(box, 5)
    counts = frame.counts(*masks)
    assert counts[3].max() == POINTS_PER_SIDE**2
    assert np.array_equal(counts, np.concatenate([frame.counts(mask) for mask in masks]))


def test_numbers_of_labels_are_exact_beyond_what_32_bit_floats_hold():
    labels = np.full((20, 30), 2**24 + 1, np.int32)
    frame = PlanFrame.of(labels > 0, 0.2, 0.05)
    assert set(np.unique(frame.sampled(labels))) == {0, 2**24 + 1}
    assert frame.back(frame.sampled(labels), labels.shape).max() == 2**24 + 1


def test_maps_longer_than_16_bits_tell_are_sampled():
    labels = np.ones((3, 70_000), np.int32)
    frame = PlanFrame.of(labels > 0, 0.0, 0.05)
    assert frame.sampled(labels)[1, 1:-1].min() == 1
    assert frame.back(frame.sampled(labels), labels.shape)[:2].min() == 1


def test_a_map_of_which_nothing_is_known_has_a_frame_of_one_cell():
    nothing = np.zeros((7, 9), bool)
    frame = PlanFrame.of(nothing, 0.3, 0.05)
    assert frame.shape == (1, 1)
    assert frame.counts(nothing).tolist() == [[[0]]]


def test_labels_grow_up_to_their_reach():
    labels = np.zeros((1, 20), np.int32)
    labels[0, 3], labels[0, 15] = 4, 9
    grown = grown_labels(labels, 2)
    assert grown.tolist() == [[0, 4, 4, 4, 4, 4] + [0] * 7 + [9] * 5 + [0, 0]]
    assert not grown_labels(np.zeros((3, 3), np.int32), 2).any()


def test_specks_go_and_what_is_as_long_as_asked_stays():
    occupied = np.zeros((10, 10), bool)
    occupied[1, 1:4], occupied[5, 1:5] = True, True
    assert np.array_equal(without_specks(occupied, 4), np.where(np.arange(10)[:, None] == 5, occupied, False))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("resolution_m", [0.05, 0.2, 1.0, 100.0])
def test_a_plan_has_no_more_cells_than_the_map_has_for_coarse_maps(resolution_m):
    """A header may claim any length for a cell; the number of cells must not grow with it."""
    cells = np.full((40, 60), -1, np.int8)
    cells[3:37, 3:57] = 100
    cells[4:36, 4:30] = cells[4:36, 31:56] = 0
    frame = PlanFrame.of(cells >= 0, 0.3, resolution_m)
    assert frame.cell_m == max(0.1, resolution_m / 2)
    found = analyze(snapshot(cells, resolution_m=resolution_m))
    assert (found.rooms.labels > 0).sum() <= (cells == 0).sum()
    empty = np.where(cells == 100, -1, cells).astype(np.int8)
    analyze(snapshot(empty, resolution_m=resolution_m))
