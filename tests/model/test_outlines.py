"""Outlines of cells against the union of their squares."""

import numpy as np
import pytest
import shapely

from rose2_logs.model.outlines import outline, room_outlines


def squares(mask):
    row, column = np.nonzero(mask)
    return shapely.union_all(shapely.box(column, row, column + 1, row + 1))


@pytest.mark.parametrize("seed", range(30))
def test_outlines_are_those_of_the_cells(seed: int):
    """Also where cells meet at corners only, around holes, and along the edge of the image."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 4, rng.integers(1, 14, 2)).astype(np.int32)
    shapes = room_outlines(labels, 0.5)
    assert len(shapes) == labels.max()
    for room, shape in enumerate(shapes, start=1):
        expected = shapely.transform(squares(labels == room), lambda xy: xy * 0.5)
        assert shape.is_valid
        assert shape.symmetric_difference(expected).area == 0
    assert shapely.coverage_is_valid(shapes)


def test_an_island_in_a_hole_is_a_part_of_its_own():
    mask = np.ones((9, 9), bool)
    mask[2:7, 2:7] = False
    mask[4, 4] = True
    shape = outline(mask, 1.0)
    assert len(shapely.get_parts(shape)) == 2
    assert shape.area == mask.sum()


def test_a_ring_that_closes_at_a_corner_has_a_hole():
    shape = outline(np.array([[0, 1, 1], [1, 0, 1], [1, 1, 1]], bool), 1.0)
    assert shape.is_valid
    assert shape.area == 7


def test_nothing_has_no_outline():
    assert outline(np.zeros((3, 3), bool), 0.05).is_empty
    assert room_outlines(np.array([[0, 2]], np.int32), 1.0)[0].is_empty
