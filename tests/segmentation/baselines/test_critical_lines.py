"""Critical lines across narrow places."""

import numpy as np
import pytest
from free_masks import DOOR, two_rooms

from rose2_logs.segmentation.baselines.critical_lines import best_lines, critical_lines
from rose2_logs.segmentation.baselines.regions import obstacle_distance
from rose2_logs.segmentation.baselines.voronoi_graph import boundary_cells

CORRIDOR = np.zeros((31, 120), bool)
CORRIDOR[5:26] = True


def lines_at(free, points):
    return critical_lines(np.array(points), boundary_cells(free), obstacle_distance(free), np.zeros(2))


def test_a_line_leads_straight_across_a_corridor():
    """Off its middle; in the very middle both walls are as near, and the second end is a cell farther."""
    lines = lines_at(CORRIDOR, [(14, 60), (15, 60)])
    assert lines.first[0].tolist() == [5, 60]
    assert lines.second[0].tolist() == [25, 60]
    assert lines.angle_rad == pytest.approx([np.pi, np.pi], abs=0.15)
    assert lines.length == pytest.approx([20, 20], abs=0.2)
    assert lines.clearance.tolist() == [10, 11]


def test_a_line_closes_a_door():
    free, _ = two_rooms()
    row, column = 40 + DOOR // 2, 126
    lines = lines_at(free, [(row, column)])
    assert lines.length[0] == pytest.approx(DOOR, abs=2)
    cells = lines.cells(np.ones(1, bool), np.zeros(2))
    assert {40, 40 + DOOR - 1} <= set(cells[:, 0].tolist())


def test_a_point_without_a_second_side_has_no_line():
    """All boundary cells are as near as the first."""
    free = np.zeros((3, 3), bool)
    free[1, 1] = True
    assert len(lines_at(free, [(1, 1)]).points) == 0


def test_of_close_lines_the_straighter_one_stays():
    free = CORRIDOR.copy()
    free[:10, 60:] = False
    lines = lines_at(free, [(15, 40), (15, 55), (17, 62)])
    assert best_lines(lines, 0.5).tolist() == [True, True, True]
    best = best_lines(lines, 1.0)
    assert best.sum() < 3
    assert best[np.argmax(lines.angle_rad)]


def test_lines_as_good_as_each_other_stay():
    lines = lines_at(CORRIDOR, [(14, column) for column in range(50, 60)])
    assert best_lines(lines, 0.5).all()


def test_lines_far_apart_do_not_compete():
    lines = lines_at(CORRIDOR, [(14, 30), (12, 90)])
    assert best_lines(lines, 0.5).all()
