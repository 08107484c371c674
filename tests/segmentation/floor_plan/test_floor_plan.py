"""Stage C: faces, what is seen along edges, grouping."""

import dataclasses

import numpy as np
import pytest
import shapely

from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.model.labels import distance_from
from rose2_logs.model.outlines import outline
from rose2_logs.segmentation.floor_plan.edge_weights import EdgeEvidence, edge_evidence
from rose2_logs.segmentation.floor_plan.faces import build_faces, rasterize
from rose2_logs.segmentation.floor_plan.grouping import group_faces
from rose2_logs.segmentation.floor_plan.stage import make_floor_plan

PARAMETERS = FloorPlanParameters()
GRID_LINES = np.array([(x, -1, x, 7) for x in (2, 4)] + [(-1, y, 7, y) for y in (1, 3, 5)], float)


def test_lines_cut_the_frame_into_faces_that_fill_it():
    graph = build_faces(GRID_LINES, shapely.box(0, 0, 6, 6))
    assert len(graph.polygons) == 12
    assert shapely.area(graph.polygons).sum() == pytest.approx(36)
    inner = (graph.edge_faces >= 0).all(1)
    assert inner.sum() == 3 * 3 + 2 * 4
    assert (graph.edge_faces[:, 0] >= 0).all()


def test_a_line_that_ends_in_the_open_cuts_nothing():
    graph = build_faces(np.array([(1.0, 1.0, 3.0, 1.0)]), shapely.box(0, 0, 6, 6))
    assert len(graph.polygons) == 1


def test_a_face_within_a_face_is_a_hole_of_it():
    square = np.array([(2, 2, 4, 2), (4, 2, 4, 4), (4, 4, 2, 4), (2, 4, 2, 2)], float)
    graph = build_faces(square, shapely.box(0, 0, 6, 6))
    assert sorted(shapely.area(graph.polygons).round(6)) == [4, 32]
    assert ((graph.edge_faces >= 0).all(1)).sum() == 4


def test_painted_faces_cover_every_cell():
    graph = build_faces(GRID_LINES, shapely.box(0, 0, 6, 6))
    painted = rasterize(graph.polygons, np.arange(1, 13, dtype=np.int32), (120, 120), 0.05)
    assert (painted > 0).all()
    sizes = np.bincount(painted.ravel(), minlength=13)[1:] * 0.05**2
    assert np.allclose(sizes, shapely.area(graph.polygons), rtol=0.1)


def test_wall_and_gap_of_an_edge_are_measured_and_a_doorway_is_narrow():
    walls, free = np.zeros((120, 120), bool), np.ones((120, 120), bool)
    walls[58:62] = True
    walls[58:62, 50:70] = False  # a door of 1 m in a wall of 6 m
    free &= ~walls
    lines = np.array([(0.0, 3.0, 6.0, 3.0), (3.0, 0.0, 3.0, 6.0)])
    edges = np.array([(0.0, 3.0, 6.0, 3.0), (3.0, 0.0, 3.0, 2.5)])
    evidence = edge_evidence(edges, lines, walls, distance_from(walls), free, 0.05, PARAMETERS)
    assert evidence.wall_m[0] == pytest.approx(5.0, abs=0.1)
    assert evidence.open_m[0] == pytest.approx(1.0, abs=0.1)
    assert evidence.passage_share[0] < PARAMETERS.join_min_passage
    assert evidence.wall_m[1] == pytest.approx(0.0, abs=0.1)
    assert evidence.weight[0] == pytest.approx(5 / 6, abs=0.03)


def mouth_of_corridor(jamb_cells=40, corridor_cells=24):
    """Passage share of the line along the wall of a hall of 5 m where a corridor of 1.2 m leaves it."""
    walls = np.zeros((200, 160), bool)
    walls[:, :2] = walls[100:] = True
    first = 2 + jamb_cells
    walls[100:, first : first + corridor_cells] = False
    line = np.array([(0.0, 5.1, 8.0, 5.1)])
    return edge_evidence(line, line, walls, distance_from(walls), ~walls, 0.05, PARAMETERS).passage_share[0]


def test_the_mouth_of_a_narrow_corridor_is_a_doorway_of_the_hall():
    assert mouth_of_corridor() < PARAMETERS.join_min_passage
    # Without a jamb on one side it is no gap in a wall, and too wide it is no doorway.
    assert mouth_of_corridor(jamb_cells=0) > PARAMETERS.join_min_passage
    assert mouth_of_corridor(corridor_cells=48) > PARAMETERS.join_min_passage


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_last_sample_of_a_line_counts_as_the_first_one_does(mirrored):
    walls = np.zeros((40, 40), bool)
    walls[20, :39] = True
    walls = walls[:, ::-1] if mirrored else walls
    line = np.array([[0, 20.5 * 0.05, 2.0, 20.5 * 0.05]])
    found = edge_evidence(line, line, walls, distance_from(walls), ~walls, 0.05, PARAMETERS)
    assert found.passage_share[0] == pytest.approx(0.2276, abs=0.001)


def test_a_line_across_a_narrow_corridor_is_no_doorway_though_walls_go_on_at_both_sides():
    walls = np.zeros((160, 160), bool)
    walls[:, 60:62] = walls[:, 86:88] = True  # the corridor
    walls[79:81, :60] = walls[79:81, 88:] = True  # walls between the offices beside it
    line = np.array([(0.0, 4.0, 8.0, 4.0)])
    share = edge_evidence(line, line, walls, distance_from(walls), ~walls, 0.05, PARAMETERS).passage_share[0]
    assert share > PARAMETERS.join_min_passage


@pytest.mark.parametrize("turn_deg", [0, 30, 77])
def test_how_much_of_a_face_was_seen_does_not_hang_on_the_raster(turn_deg):
    """A corridor of 8 x 2 m without walls at its ends, seen for half of its length, at any angle."""
    turn = np.radians(turn_deg)
    c, s = np.cos(turn), np.sin(turn)
    y, x = (np.indices((300, 300)) + 0.5) * 0.05 - 7.5
    along, across = x * c + y * s, y * c - x * s
    known = (np.abs(along) < 4) & (np.abs(across) < 1)
    free = known & (along < 0)
    free[np.unravel_index(np.argmax(np.where(known, along, -9)), free.shape)] = True
    walls = np.zeros_like(free)
    ends = np.array([(-9.0, side, 9.0, side) for side in (-1.05, 1.05)]).reshape(-1, 2)
    lines = (ends @ np.array([(c, s), (-s, c)]) + 7.5).reshape(-1, 4)
    plan = make_floor_plan(lines, walls, distance_from(walls), free, turn, 0.05, PARAMETERS)
    middle = shapely.Point(7.5 - 2 * c, 7.5 - 2 * s)
    (face,) = (k for k, polygon in enumerate(plan.graph.polygons) if polygon.contains(middle))
    # Half of the corridor, less the margin of a meter at both ends and the lines' distance from its cells.
    assert plan.seen[face] == pytest.approx(4 * 2 / (10 * 2.1), abs=0.01)


def make_quality(wall, is_open, passage, blind=0.0):
    wall, is_open = np.array(wall, float), np.array(is_open, float)
    return EdgeEvidence(wall, wall + is_open, blind * wall, is_open, np.array(passage, float))


@pytest.mark.parametrize("grouping", ["walls", "dbscan"])
@pytest.mark.parametrize("order", [[0, 1, 2], [2, 1, 0], [1, 2, 0]])
def test_what_is_open_joins_and_a_door_does_not_in_any_order_of_edges(order, grouping):
    # Faces 0 and 1 are one room cut by a line; 2 lies behind a wall with a door.
    faces = np.array([(0, 1), (1, 2), (0, 2)], np.int32)[order]
    evidence = make_quality(
        np.array([0, 3, 3])[order], np.array([4, 1, 0])[order], np.array([1, 0.3, 0])[order]
    )
    parameters = dataclasses.replace(PARAMETERS, grouping=grouping)
    group = group_faces(faces, evidence, np.array([8.0, 8.0, 16.0]), np.ones(3), np.full(3, 1.5), parameters)
    assert group[0] == group[1] != group[2]


def test_a_niche_joins_its_room_and_a_face_that_was_not_seen_takes_no_part():
    faces = np.array([(0, 1), (0, 2)], np.int32)
    evidence = make_quality([0.5, 0], [0.5, 4], [0.4, 1])
    group = group_faces(
        faces, evidence, np.array([16.0, 0.5, 0.0]), np.ones(3), np.array([2, 0.3, 2]), PARAMETERS
    )
    assert group.tolist() == [0, 0, -1]


@pytest.mark.parametrize(
    ("seen", "rooms"), [((1.0, 0.9), 1), ((1.0, 0.7), 2), ((1.0, 0.4), 2), ((0.4, 1.0), 2)]
)
def test_a_wall_with_nothing_behind_divides_faces_that_are_hardly_known(seen, rooms):
    """A cupboard of 2 m beside a passage of 2 m; behind it, the rest of a room or another one."""
    evidence = make_quality([2.0], [2.0], [1.0], blind=1.0)
    group = group_faces(
        np.array([(0, 1)], np.int32), evidence, np.full(2, 9.0), np.array(seen), np.full(2, 1.5), PARAMETERS
    )
    assert len(set(group)) == rooms


def test_a_wall_is_blind_where_it_shows_no_free_space_on_a_side():
    """A wall of 6 m: behind the first third free space, then nothing, then a wall that comes across."""
    free, walls = np.zeros((2, 100, 160), bool)
    free[20:49, 20:140] = True
    free[52:80, 20:60] = True
    walls[49:52, 20:140] = True
    walls[52:80, 100:140] = True
    line = np.array([(1.0, 2.525, 7.0, 2.525)])
    evidence = edge_evidence(line, line, walls, distance_from(walls), free, 0.05, PARAMETERS)
    assert evidence.wall_m[0] == pytest.approx(6.0, abs=0.1)
    assert evidence.blind_m[0] == pytest.approx(2.0, abs=0.1)


def test_an_outline_has_the_area_and_the_hole_of_its_cells():
    mask = np.ones((6, 8), bool)
    mask[2:4, 3:5] = False
    shape = outline(mask, 0.5)
    assert shape.area == pytest.approx(mask.sum() * 0.25)
    assert shape.bounds == (0, 0, 4, 3)
