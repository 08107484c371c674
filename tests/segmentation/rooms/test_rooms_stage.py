"""The end of stage D: left out space, borders, doorways."""

import numpy as np
import pytest
from drawn_floors import draw_floor

from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.topology import TopologyParameters
from rose2_logs.segmentation.regions.stage import RegionsResult, generous_floor_plan, generous_walls
from rose2_logs.segmentation.rooms.borders import adopt_left_out, settle_borders
from rose2_logs.segmentation.rooms.doorways import find_doorways
from rose2_logs.segmentation.rooms.stage import finish_rooms
from rose2_logs.segmentation.rose.stage import find_structure
from rose2_logs.segmentation.walls.stage import WallCounter
from rose2_logs.segmentation.walls.strips import WallCells

PARAMETERS, TOPOLOGY = FloorPlanParameters(), TopologyParameters()


@pytest.mark.parametrize(("upper", "lower"), [(1, 2), (255, 256), (65_535, 70_000)])
def test_a_strip_along_the_other_side_of_a_wall_changes_room(upper: int, lower: int):
    """However many rooms there are: their numbers are held in the narrowest type."""
    labels = np.full((60, 60), upper, np.int32)
    labels[32:] = lower
    labels[30, 10:50] = 0  # the wall, with the upper room spilling over to row 31
    settled = settle_borders(labels, 0.05, 0.25)
    assert (settled[31, 15:45] == lower).all()
    assert (settled[:29] == upper).all()
    assert ((settled > 0) == (labels > 0)).all()


def test_wide_space_outside_joins_the_room_that_it_opens_to_and_rays_do_not():
    free, labels = np.ones((100, 160), bool), np.zeros((100, 160), np.int32)
    labels[:, :60], labels[:40, 60:80] = 1, 2
    free[:, 100:] = False
    free[50:53, 100:150] = True  # a ray
    free[80:, 130:] = True  # seen on its own, beside no room
    adopted = adopt_left_out(labels, free, 0.05, PARAMETERS)
    assert (adopted[:, :60] == 1).all()
    assert (adopted[60:, 60:95] == 1).all()
    assert (adopted[51, 105:145] == 0).all()
    assert (adopted[80:, 130:] == 0).all()
    assert (adopted[labels > 0] == labels[labels > 0]).all()


def test_a_doorway_is_found_where_it_was_drawn():
    labels = np.zeros((40, 80), np.int32)
    labels[:, :39] = 1
    labels[:, 40:] = 2
    labels[10:28, 39] = 1
    ((rooms, ends),) = find_doorways(labels, 0.05, TOPOLOGY)
    assert rooms == (1, 2)
    assert np.allclose(ends[:, 0], 2.0, atol=0.05)
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(0.9, abs=0.1)


def test_rooms_that_do_not_touch_have_no_doorway():
    assert find_doorways(np.array([[1, 0, 2]], np.int32), 0.05, TOPOLOGY) == []


def test_finished_rooms_have_no_strips_along_the_other_side_of_a_wall():
    floor = draw_floor([(0, 0, 5, 4), (5.2, 0, 10.2, 4)], [(5, 1.5, 5.2, 2.4)], wall_m=0.2)
    free, occupied, parameters = floor.cells == 0, floor.cells > 0, Parameters()
    scored = find_structure(occupied, floor.resolution_m, parameters.spectrum)
    count_walls = WallCounter(
        WallCells(scored.supported, scored.directions_rad, floor.resolution_m), parameters.walls
    )
    built = generous_walls(scored, count_walls, parameters)
    plan = generous_floor_plan(built, free, 0.0, floor.resolution_m, parameters)
    labels = floor.rooms.astype(np.int32)
    right = np.flatnonzero((labels == labels.max()).any(0))[0]
    spilled = labels.copy()
    spilled[:, right : right + 2][labels[:, right : right + 2] > 0] = labels[labels > 0].min()
    found = RegionsResult(spilled, {}, 0.0)
    rooms, _ = finish_rooms(found, plan, free, occupied, floor.resolution_m, parameters)
    beside = rooms.labels[:, [right, right + 10]][labels[:, right] == labels.max()]
    assert (beside[:, 0] == beside[:, 1]).mean() > 0.7
