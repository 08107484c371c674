"""The Voronoi graph of free space, and the narrowest places along it."""

import numpy as np
from free_masks import DOOR, two_rooms

from rose2_logs.segmentation.baselines.regions import connected_parts, obstacle_distance
from rose2_logs.segmentation.baselines.voronoi_graph import boundary_cells, narrowest_cells, voronoi_cells


def test_boundary_cells_are_free_and_have_an_obstacle_at_a_side():
    free = np.zeros((6, 7), bool)
    free[1:5, 1:6] = True
    cells = boundary_cells(free)
    assert len(cells) == 14
    assert free[cells[:, 0], cells[:, 1]].all()


def test_the_graph_of_a_corridor_is_its_middle_line():
    free = np.zeros((40, 200), bool)
    free[10:30] = True
    graph = np.argwhere(voronoi_cells(free, 2, 0))
    middle = graph[(graph[:, 1] > 30) & (graph[:, 1] < 170)]
    assert len(np.unique(middle[:, 1])) == 139
    assert np.abs(middle[:, 0] - 19.5).max() <= 1


def test_the_graph_leads_through_a_door_in_one_piece():
    free, _ = two_rooms()
    graph = voronoi_cells(free, 2, 100)
    assert connected_parts(graph)[0].max() == 1
    assert graph[:, 60].any()
    assert graph[:, 180].any()


def test_pruning_takes_loose_ends_only():
    free, _ = two_rooms()
    whole, pruned = voronoi_cells(free, 2, 0), voronoi_cells(free, 2, 100)
    assert not (pruned & ~whole).any()
    assert pruned.sum() < whole.sum()
    # The arms to the corners are loose, the way through the door is not.
    assert not pruned[:25, :25].any()
    assert pruned[40 : 40 + DOOR, 120:135].any(axis=0).all()


def test_maps_without_a_middle_have_no_graph():
    free = np.zeros((20, 20), bool)
    assert not voronoi_cells(free, 2, 100).any()
    free[5, 5:8] = True
    assert not voronoi_cells(free, 2, 100).any()


def path(values):
    """A graph of one row with these distances from obstacles."""
    distance = np.array([values], np.float32)
    return np.ones(distance.shape, bool), distance


def test_every_cell_points_to_the_narrowest_cell_near_it():
    graph, distance = path([9, 8, 7, 5, 7, 8, 9])
    assert narrowest_cells(graph, distance, 60.0, 150).tolist() == [[0, 3]]


def test_the_neighborhood_is_the_longer_the_narrower_the_passage():
    graph, distance = path([20, 19, 18, 17, 16, 15, 14, 13, 4])
    # More than three cells around the first one do not reach to the end.
    reached = narrowest_cells(graph, distance, 60.0, 150)[:, 1].tolist()
    assert reached[0] == 3
    assert reached[-1] == 8
    assert narrowest_cells(graph, distance, 60.0, 1)[:, 1].tolist() == [1, 2, 3, 4, 5, 6, 7, 8]


def test_along_a_corridor_of_one_width_every_cell_is_critical():
    graph, distance = path([8.0] * 30)
    assert len(narrowest_cells(graph, distance, 280.0, 150)) == 30


def test_an_empty_graph_has_no_narrow_cells():
    assert len(narrowest_cells(np.zeros((4, 4), bool), np.ones((4, 4), np.float32), 280.0, 150)) == 0


def test_neighborhoods_follow_the_graph_and_not_the_plane():
    """Two passages side by side do not see each other."""
    free = np.zeros((5, 20), bool)
    free[0], free[4] = True, True
    distance = np.where(free, 9.0, 0.0).astype(np.float32)
    distance[0, 10] = 2.0
    assert (0, 10) in set(map(tuple, narrowest_cells(free, distance, 200.0, 150).tolist()))
    assert (narrowest_cells(free, distance, 200.0, 150)[:, 0] == 4).sum() == 20


def test_the_distance_along_the_graph_is_that_of_its_cells():
    free, _ = two_rooms()
    graph, distance = voronoi_cells(free, 2, 100), obstacle_distance(free)
    narrow = narrowest_cells(graph, distance, 280.0, 150)
    at_door = (narrow[:, 1] > 118) & (narrow[:, 1] < 136)
    assert at_door.any()
    assert distance[narrow[at_door, 0], narrow[at_door, 1]].max() <= DOOR / 2 + 2
