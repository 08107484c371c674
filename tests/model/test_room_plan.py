"""What of a room was not seen."""

import dataclasses

import numpy as np
import pytest
import shapely
from drawn_plans import LEFT, RIGHT, two_rooms_plan

from rose2_logs.model.room_plan import predicted_parts


@pytest.mark.parametrize("yaw_rad", [0.0, 0.5, -2.0])
def test_the_unknown_half_of_a_room_is_predicted(yaw_rad):
    """It is found where it lies, however the grid is turned; a room that was seen has none."""
    plan = two_rooms_plan(yaw_rad)
    parts = predicted_parts(plan)
    assert set(parts) == {RIGHT}
    true = shapely.transform(shapely.box(7, 1, 9, 4), plan.map.geometry.grid_to_world)
    assert true.intersection(parts[RIGHT]).area / true.union(parts[RIGHT]).area > 0.9


def test_the_unknown_half_of_a_room_in_several_pieces_is_predicted():
    plan = two_rooms_plan()
    (room,) = (each for each in plan.rooms if each.number == RIGHT)
    pieces = shapely.MultiPolygon([*shapely.get_parts(room.shape), shapely.box(-0.5, 2.5, -0.3, 2.7)])
    several = dataclasses.replace(room, shape=pieces)
    found = predicted_parts(dataclasses.replace(plan, rooms=(several,)))
    assert found[RIGHT].area == pytest.approx(predicted_parts(plan)[RIGHT].area, rel=0.02)


def test_thin_unknown_strips_are_walls():
    """The inside of a wall is never seen and is no part of a room that was not."""
    plan = two_rooms_plan()
    cells = plan.map.cells.copy()
    cells[10:40, 20:22] = -1
    plan = dataclasses.replace(plan, map=dataclasses.replace(plan.map, cells=cells))
    assert LEFT not in predicted_parts(plan)


def test_a_plan_without_a_map_tells_nothing_of_it():
    assert predicted_parts(dataclasses.replace(two_rooms_plan(), map=None)) == {}


def test_shapes_may_reach_beyond_the_canvas():
    """What lies outside the grid was not seen either."""
    plan = two_rooms_plan()
    window = (slice(0, 50), slice(0, 60))
    geometry = plan.map.geometry.part(window)
    below = dataclasses.replace(
        plan.map, geometry=geometry, cells=plan.map.cells[window], labels=plan.map.labels[window]
    )
    parts = predicted_parts(dataclasses.replace(plan, map=below))
    assert parts[RIGHT].area == pytest.approx(9.0, abs=0.5)


def test_bounds_hold_shapes_and_known_cells():
    x0, y0, x1, y1 = two_rooms_plan().bounds_m
    assert np.allclose([x0, y0, x1, y1], [-1.1, 1.9, 7.0, 5.1])


def test_bounds_leave_out_rays_and_keep_what_a_robot_fits_in():
    """A strip of a few cells that leaves the rooms, against one of half a meter that belongs to no room."""
    plan = two_rooms_plan()
    cells = plan.map.cells.copy()
    cells[20:22, 70:100] = 0
    ray = dataclasses.replace(plan, map=dataclasses.replace(plan.map, cells=cells))
    assert ray.bounds_m == plan.bounds_m
    cells = cells.copy()
    cells[20:25, 70:100] = 0
    corridor = dataclasses.replace(plan, map=dataclasses.replace(plan.map, cells=cells))
    assert corridor.bounds_m[2] == pytest.approx(8.0)
