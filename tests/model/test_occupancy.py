"""Occupancy grids: what is taken, what is refused, and where cells lie in the world."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.errors import InvalidMapError
from rose2_logs.model.occupancy import (
    CellValues,
    GridGeometry,
    OccupancySnapshot,
    classify,
    free_area_m2,
    is_same_to_analysis,
)


def geometry(shape: Any = (2, 3), **changes: Any) -> GridGeometry:
    given = {
        "resolution_m": 0.05,
        "origin_xy_m": (1.0, -2.0),
        "yaw_rad": 0.3,
        "frame_id": "map",
        "shape": shape,
    }
    return GridGeometry(**(given | changes))


def snapshot(cells: Any) -> OccupancySnapshot:
    return OccupancySnapshot(3, 10, 20, "/map", cells, geometry(np.shape(cells)))


@pytest.mark.parametrize("kind", [np.int8, np.int16, np.int32, np.int64])
def test_integers_in_range_are_taken_as_bytes(kind: type):
    cells = np.array([[-1, 0, 100], [50, 19, 66]], kind)
    taken = snapshot(cells)
    assert taken.cells.dtype == np.int8
    assert np.array_equal(taken.cells, cells)
    assert not taken.cells.flags.writeable
    assert cells.flags.writeable


def test_bytes_are_copied_only_where_they_may_change():
    """A driver may write the next map to the array of the last one."""
    cells = np.zeros((2, 3), np.int8)
    taken = snapshot(cells)
    cells[:] = 100
    assert (taken.cells == 0).all()
    shown = cells.view()
    shown.flags.writeable = False
    assert not np.shares_memory(snapshot(shown).cells, cells)
    cells.flags.writeable = False
    assert np.shares_memory(snapshot(cells).cells, cells)


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        (np.zeros((2, 3)), "cells must be integers, -1 for unknown and 0 to 100 percent, not float64"),
        (np.zeros((2, 3), bool), "cells must be integers, -1 for unknown and 0 to 100 percent, not bool"),
        (np.full((2, 3), 101, np.int8), "cells must lie between -1 and 100, not from 101 to 101"),
        (np.full((2, 3), -2, np.int8), "cells must lie between -1 and 100, not from -2 to -2"),
        (np.full((2, 3), 255, np.uint8), "cells must lie between -1 and 100, not from 255 to 255"),
        (np.array([[0, 300]]), "cells must lie between -1 and 100, not from 0 to 300"),
    ],
)
def test_other_cells_are_refused_in_one_line(cells: np.ndarray, message: str):
    with pytest.raises(InvalidMapError) as raised:
        snapshot(cells)
    assert str(raised.value) == f"map 3 of /map: {message}"


def test_cells_of_another_shape_than_the_geometry_are_refused():
    with pytest.raises(InvalidMapError, match=r"data of shape \(3, 2\) but its header says \(2, 3\)"):
        OccupancySnapshot(0, 0, 0, "/map", np.zeros((3, 2), np.int8), geometry())


@pytest.mark.parametrize("shape", [(2,), (2, 3, 1), (2.0, 3), ("2", "3"), 5, (-1, 3), None])
def test_a_shape_that_is_none_is_refused(shape: Any):
    with pytest.raises(InvalidMapError, match="a grid's shape must be rows and columns"):
        geometry(shape)


def test_a_shape_is_rows_and_columns_as_integers():
    shape = geometry([np.int64(2), np.int32(3)]).shape
    assert shape == (2, 3)
    assert [type(side) for side in shape] == [int, int]


@pytest.mark.parametrize(
    "changes",
    [
        {"resolution_m": 0.0},
        {"resolution_m": float("nan")},
        {"resolution_m": 1e9},
        {"origin_xy_m": (float("inf"), 0.0)},
        {"origin_xy_m": (1e9, 0.0)},
        {"yaw_rad": float("nan")},
        {"resolution_m": 10**400},
        {"origin_xy_m": (0.0, 10**400)},
        {"yaw_rad": 10**400},
        {"origin_xy_m": np.zeros(())},
        {"origin_xy_m": np.zeros((2, 2))},
    ],
)
def test_a_place_that_no_map_has_is_refused(changes: dict[str, Any]):
    with pytest.raises(InvalidMapError):
        geometry(**changes)


@pytest.mark.parametrize(
    "origin_xy_m",
    [[1.0, -2.0], (1, -2), np.array([1.0, -2.0]), np.array([1, -2]), (np.float32(1), Fraction(-2))],
)
def test_equal_places_are_equal_whatever_numbers_they_are_given_in(origin_xy_m: Any):
    usual = geometry(resolution_m=0.5, yaw_rad=0.0)
    found = geometry(resolution_m=Fraction(1, 2), yaw_rad=np.int64(0), origin_xy_m=origin_xy_m)
    assert found == usual
    assert hash(found) == hash(usual)
    assert repr(found) == repr(usual)


def test_the_text_of_a_snapshot_is_one_short_line():
    text = repr(snapshot(np.zeros((400, 300), np.int8)))
    assert text == "OccupancySnapshot(index=3, topic='/map', 300 x 400 cells of 0.05 m)"


@given(st.integers(0, 99), st.integers(0, 49), st.floats(-7, 7))
def test_the_center_of_a_cell_lies_in_the_cell(row: int, column: int, yaw_rad: float):
    grid = geometry((100, 50), yaw_rad=yaw_rad)
    center = grid.cell_centers(np.array(row), np.array(column))
    assert grid.world_to_cell(center).tolist() == [row, column]


def test_a_part_of_a_grid_lies_where_its_cells_lie():
    grid = geometry((10, 20))
    part = grid.part((slice(4, 10), slice(6, 16)), 2)
    assert (part.shape, part.resolution_m) == ((3, 5), 0.1)
    assert np.allclose(part.corners_m()[0], grid.grid_to_world(np.array([6, 4]) * 0.05))


def test_cells_between_the_thresholds_are_neither_free_nor_occupied():
    free, occupied = classify(np.array([[-1, 0, 19, 20, 65, 66, 100]], np.int8), OccupancyParameters())
    assert free.tolist() == [[False, True, True, False, False, False, False]]
    assert occupied.tolist() == [[False] * 5 + [True] * 2]


def test_free_area_counts_cells():
    assert free_area_m2(snapshot(np.array([[0, 0, 100]])), OccupancyParameters()) == pytest.approx(0.005)


def test_maps_are_the_same_to_the_analysis_until_a_threshold_is_passed():
    one, near, other = (snapshot(np.array([[0, value]])) for value in (0, 10, 30))
    assert is_same_to_analysis(one, near, OccupancyParameters())
    assert not is_same_to_analysis(one, other, OccupancyParameters())


def test_values_of_some_cells_make_a_canvas():
    values = CellValues((2, 3), np.array([[0, 1], [1, 2]], np.int32), np.array([5, 7], np.int16))
    assert values.whole().tolist() == [[0, 5, 0], [0, 0, 7]]
