"""Changes of a map: cells and labels stay together, and nothing known is lost that should not be."""

from __future__ import annotations

import numpy as np
import pytest

from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot

NAMES = ("quarter turn", "mirror", "padding", "2x finer", "turned by 30 degrees", "1 % unknown")


@pytest.fixture
def drawn() -> tuple[OccupancySnapshot, np.ndarray]:
    """Rooms 1 and 2 in one corner of an unknown canvas; their cells are 1 and 2 too, so that labels show."""
    labels = np.zeros((60, 80), np.int32)
    labels[5:35, 10:40], labels[5:35, 42:50] = 1, 2
    cells = np.where(labels > 0, labels, -1).astype(np.int8)
    return OccupancySnapshot(
        0, 0, 0, "m", cells, GridGeometry(0.05, (1.0, 2.0), 0.0, "map", (60, 80))
    ), labels


def transforms():
    from benchmarking.transforms import TRANSFORMS

    return {transform.name: transform for transform in TRANSFORMS}


def test_there_are_six_changes():
    assert tuple(transforms()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_labels_go_where_their_cells_go(drawn, name: str):
    """Wherever the changed map is known, its cell still says which label it has."""
    snapshot, labels = drawn
    changed, expected = transforms()[name](snapshot, labels)
    assert changed.cells.shape == changed.geometry.shape == expected.shape
    assert np.array_equal(np.where(changed.cells > 0, changed.cells, 0), expected)


@pytest.mark.parametrize("name", NAMES)
def test_areas_of_rooms_stay(drawn, name: str):
    """In square meters: exactly, or within what a turn by nearest cells and the removed cells cost."""
    snapshot, labels = drawn
    changed, expected = transforms()[name](snapshot, labels)
    areas = np.bincount(expected.ravel(), minlength=3)[1:] * changed.geometry.cell_area_m2
    before = np.bincount(labels.ravel(), minlength=3)[1:] * snapshot.geometry.cell_area_m2
    tolerance = 0.03 if name in ("turned by 30 degrees", "1 % unknown") else 1e-9
    assert areas == pytest.approx(before, rel=tolerance)


def test_the_turn_is_by_30_degrees(drawn):
    """The long side of the two rooms together turns by that angle, and no corner leaves the canvas."""
    snapshot, labels = drawn
    labels = np.where(np.indices(labels.shape)[0] == 20, labels, 0)
    _, turned = transforms()["turned by 30 degrees"](snapshot, labels)
    y, x = np.nonzero(turned)
    assert abs(np.polyfit(x, y, 1)[0]) == pytest.approx(np.tan(np.pi / 6), abs=0.05)


def test_one_cell_in_a_hundred_is_removed_the_same_each_time(drawn):
    snapshot, labels = drawn
    known = (snapshot.cells >= 0).sum()
    once, again = (transforms()["1 % unknown"](snapshot, labels)[0].cells for _ in range(2))
    assert known - (once >= 0).sum() == round(known / 100)
    assert np.array_equal(once, again)


def test_agreement_of_two_maps_without_rooms_is_whole():
    from benchmarking.robustness import agreement_of

    none, one = np.zeros((2, 2), int), np.ones((2, 2), int)
    assert agreement_of(none, none) == 100
    assert agreement_of(one, none) == 0
    assert agreement_of(one, 5 * one) == 100
