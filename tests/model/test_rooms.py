"""Where the names of rooms stand: well inside of what was seen."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.model.rooms import RoomMap

GEOMETRY = GridGeometry(0.1, (-3.0, 2.0), 0.4, "map", (40, 100))


def point_of(labels, polygon=None) -> np.ndarray:
    shape = shapely.box(0, 0, 1, 1) if polygon is None else polygon
    rooms = RoomMap(GEOMETRY, labels, (shape,), np.zeros(1))
    return rooms.label_points_m[0]


def test_the_name_of_a_corridor_stands_in_its_middle():
    labels = np.zeros(GEOMETRY.shape, np.int32)
    labels[10:15, 4:94] = 1
    np.testing.assert_allclose(point_of(labels), GEOMETRY.cell_centers(np.array(12), np.array(48)), atol=0.11)


def test_the_name_stands_in_the_seen_part_however_large_the_prediction():
    labels = np.zeros(GEOMETRY.shape, np.int32)
    labels[2:8, 3:9] = 1
    row, column = GEOMETRY.world_to_cell(point_of(labels, shapely.box(0, 0, 50, 50)))
    assert 3 <= row <= 6
    assert 4 <= column <= 7


def test_the_name_of_a_ring_stands_on_its_floor():
    """Not in the middle, which is none of it; where it is widest."""
    labels = np.zeros(GEOMETRY.shape, np.int32)
    labels[2:38, 2:98] = 1
    labels[5:35, 14:95] = 0
    row, column = GEOMETRY.world_to_cell(point_of(labels))
    assert labels[row, column] == 1
    assert column < 14


def test_a_room_without_cells_is_named_in_its_shape_if_it_has_one():
    nothing = np.zeros(GEOMETRY.shape, np.int32)
    shape = shapely.box(2, 2, 4, 4)
    assert shape.contains(shapely.Point(point_of(nothing, shape)))
    assert np.isnan(point_of(nothing, shapely.Polygon())).all()


@pytest.mark.parametrize("count", [0, 3])
def test_there_is_a_point_for_each_room(count):
    rooms = RoomMap(
        GEOMETRY,
        np.zeros(GEOMETRY.shape, np.int32),
        (shapely.Point(0, 0).buffer(1),) * count,
        np.zeros(count),
    )
    assert rooms.label_points_m.shape == (count, 2)
