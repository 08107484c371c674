"""What is outside: white around a building, and what the fitted rule says, unless hardly anything is left."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_floors import corridor_of_offices, draw_floor, turned
from drawn_maps import snapshot
from test_graph import drawn_graph

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.regions import RegionParameters
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.segmentation.regions.graph import (
    BORDER_MAXIMA,
    BORDER_SUMS,
    NODE_MAXIMA,
    NODE_SUMS,
    RegionGraph,
)
from rose2_logs.segmentation.regions.outside import (
    edge_shares,
    leftovers_joined,
    outside_of,
    rooms_among,
    surroundings,
)
from rose2_logs.segmentation.regions.plan_frame import PlanFrame
from rose2_logs.segmentation.regions.plan_raster import PlanRaster

PARAMETERS = RegionParameters()


def lone_regions(*area_m2):
    node_sums = np.zeros((len(area_m2), len(NODE_SUMS)))
    node_sums[:, 0] = area_m2
    node_maxima = np.ones((len(area_m2), len(NODE_MAXIMA)))
    return RegionGraph(
        node_sums,
        node_maxima,
        np.zeros((0, 2), np.int64),
        np.zeros((0, len(BORDER_SUMS))),
        np.zeros((0, len(BORDER_MAXIMA))),
    )


def rooms(area_m2, log_odds, edge_share=None, narrow=None, outlines_m=()):
    edge = np.zeros(len(area_m2)) if edge_share is None else np.array(edge_share)
    graph = lone_regions(*area_m2)
    for region, of_region in enumerate(outlines_m):
        graph.node_sums[region, 1:3] = of_region
    no_width = None if narrow is None else np.array(narrow)
    outside = outside_of(graph, edge, lambda _: np.array(log_odds), PARAMETERS, no_width)
    room = rooms_among(graph.node_sums[:, 0], outside, PARAMETERS)
    return np.where(room, np.cumsum(room), 0).tolist(), float(np.array(area_m2)[outside].sum())


def test_rooms_are_numbered_and_what_is_outside_is_measured():
    assert rooms([10.0, 4.0, 20.0], [1.0, -1.0, 0.0]) == ([1, 0, 2], 4.0)


@pytest.mark.parametrize(("area_m2", "room"), [(1.0, 1), (0.99, 0)])
def test_what_is_too_small_is_no_room_but_not_outside(area_m2, room):
    assert rooms([area_m2], [3.0]) == ([room], 0.0)


@pytest.mark.parametrize(("outside_m2", "believed"), [(4.0, True), (4.1, False)])
def test_an_answer_by_which_hardly_anything_is_left_is_not_used(outside_m2, believed):
    found, left_out_m2 = rooms([outside_m2, 10 - outside_m2], [-9.0, 9.0])
    assert found == ([0, 1] if believed else [1, 2])
    assert left_out_m2 == (outside_m2 if believed else 0.0)


@pytest.mark.parametrize(
    ("left_m2", "walled_m", "unknown_m", "believed"),
    [
        ((2.0, 2.0), 7.1, 3.0, True),
        ((2.0, 2.0), 6.9, 3.0, False),
        ((2.0, 2.0), 0.0, 0.0, False),
        ((3.5, 0.9), 7.1, 3.0, False),  # a room and a closet
        ((1.6, 1.5), 7.1, 3.0, True),
        ((1.5, 1.4), 7.1, 3.0, False),
    ],
)
def test_an_answer_that_takes_most_of_a_map_is_used_if_what_is_left_are_walled_rooms(
    left_m2, walled_m, unknown_m, believed
):
    """As rays through the windows of a building do."""
    outside_m2 = 20 - sum(left_m2)
    outlines_m = [(walled_m, unknown_m), (0, 0), (3.0, 30.0)]
    _, left_out_m2 = rooms([*left_m2, outside_m2], [9.0, 9.0, -9.0], outlines_m=outlines_m)
    assert left_out_m2 == (outside_m2 if believed else 0.0)


def test_ground_that_is_seen_through_windows_is_no_room_however_large_it_is():
    """Each room has a window of 2 m, through which rays of 12 m lead into the open."""
    floor = draw_floor([(5 * k, 0, 5 * k + 4.8, 6) for k in range(4)])
    margin, cell_m = 280, floor.resolution_m
    cells = np.pad(floor.cells, margin, constant_values=-1)
    inside = np.pad(floor.rooms, margin)
    for room in range(1, 5):
        rows, columns = np.nonzero(inside == room)
        middle, side = int(columns.mean()), int(rows.min())
        cells[side - 6 : side, middle - 20 : middle + 20] = 0
        for at in range(middle - 20, middle + 20):
            for seen_from in range(middle - 40, middle + 41, 20):
                x, y = at - seen_from, -80.0
                scale = 12 / cell_m / np.hypot(x, y)
                end = (round(at + x * scale), round(side + y * scale))
                cv2.line(ray := np.zeros_like(cells), (at, side - 4), end, 1)
                cells[(ray > 0) & (cells == -1)] = 0
    found = analyze(snapshot(cells, resolution_m=cell_m))
    free_m2 = np.count_nonzero(cells == 0) * cell_m**2
    assert found.outside_m2 > PARAMETERS.outside_max_share * free_m2
    kept = {"regions.outside_max_share": 0, "regions.surroundings_min_edge": 1}
    assert analyze(snapshot(cells, resolution_m=cell_m), Parameters.from_any(kept)).outside_m2 == 0
    assert found.rooms.labels.max() == 4
    assert np.count_nonzero(found.rooms.labels[inside == 0]) < 0.05 * np.count_nonzero(inside)


def test_what_is_narrow_is_no_room():
    assert rooms([20.0, 5.0], [9.0, 9.0], narrow=[False, True]) == ([1, 0], 5.0)


@pytest.mark.parametrize(("width_m", "rooms"), [(0.5, 2), (0.55, 3)])
def test_a_strip_along_a_wall_is_a_room_from_the_width_of_a_door_leaf_on(width_m, rooms):
    """A width is told to a cell of 5 cm: 0.55 m may be 0.6."""
    strip = (0, 4.2, 5, 4.2 + width_m)
    floor = draw_floor([(0, 0, 5, 4), strip, (5.2, 0, 8, 4.2 + width_m)])
    found = analyze(snapshot(floor.cells, resolution_m=floor.resolution_m))
    assert found.rooms.labels.max() == rooms
    assert found.outside_m2 == pytest.approx(0 if rooms == 3 else 5 * width_m, abs=0.1)


@pytest.mark.parametrize("value", [-1, 100])
@pytest.mark.parametrize("share", [0.1, 0.15])
def test_a_room_is_as_wide_with_specks_in_it(share, value):
    floor = draw_floor([(0, 0, 8, 5), (8.2, 0, 16.2, 5), (16.4, 0, 21.4, 5)])
    cells = floor.cells.copy()
    specks = np.random.default_rng(5).random(cells.shape) < share
    cells[specks & (floor.rooms == 3)] = value
    found = analyze(snapshot(cells, resolution_m=floor.resolution_m))
    assert found.outside_m2 == 0
    assert set(np.unique(floor.rooms[found.rooms.labels > 0])) == {1, 2, 3}


def test_narrow_regions_do_not_bring_back_what_is_outside():
    """30 m2 of 101 are outside; with 11 narrow ones it would be more than is believed."""
    found = rooms([60.0, 30.0, 11.0], [9.0, -9.0, 9.0], narrow=[False, False, True])
    assert found == ([1, 0, 2], 30.0)


def test_where_all_is_narrow_all_are_rooms():
    assert rooms([5.0, 5.0], [9.0, 9.0], narrow=[True, True]) == ([1, 2], 0.0)


def test_white_around_a_building_may_be_most_of_a_map():
    assert rooms([900.0, 30.0, 30.0], [9.0] * 3, [1.0, 0.0, 0.0]) == ([0, 1, 2], 900.0)


def test_the_fitted_rule_is_held_against_what_is_within_the_white():
    """A ray of a tenth of the building is left out; the building would not be."""
    assert rooms([900.0, 90.0, 10.0], [9.0, 9.0, -9.0], [1.0, 0.0, 0.0])[0] == [0, 1, 0]
    assert rooms([900.0, 90.0, 10.0], [9.0, -9.0, 9.0], [1.0, 0.0, 0.0])[0] == [0, 1, 2]


@pytest.mark.parametrize(
    ("edge_share", "area_m2", "around"),
    [
        ([0.9, 0.0], [50, 50], [True, False]),
        ([0.5, 0.0], [50, 50], [True, False]),
        ([0.49, 0.0], [50, 50], [False, False]),  # a room with a side of glass
        ([0.3, 0.3, 0.0], [30, 30, 40], [True, True, False]),  # the building parts the white
        ([0.3, 0.2, 0.0], [30, 30, 40], [False, False, False]),
        ([1.0], [90], [False]),  # a field
        ([0.5, 0.5], [50, 50], [False, False]),  # a field with a wall across
        ([1.0, 0.0], [97, 3], [True, False]),
        ([1.0, 0.0], [97.1, 2.9], [False, False]),  # a field with a stall
    ],
)
def test_regions_around_a_building_hold_the_edge_of_the_map(edge_share, area_m2, around):
    found = surroundings(np.array(edge_share), np.array(area_m2, float), PARAMETERS)
    assert found.tolist() == around


@pytest.mark.parametrize("degrees", [0, 20, 45])
@pytest.mark.parametrize("margin_m", [0.3, 5.0])
def test_the_white_around_a_drawing_holds_its_edge_however_it_is_turned(degrees, margin_m):
    floor = turned(corridor_of_offices(2, outside=0, margin_m=margin_m), degrees)
    free, wall = floor.cells == 0, floor.cells > 0
    frame = PlanFrame.of(free | wall, np.radians(degrees), floor.resolution_m)
    white = frame.sampled(np.where(free, 1 + (floor.rooms > 0), 0).astype(np.int32))
    around, inside = edge_shares(white, PlanRaster.of(free, wall, frame), 2)
    assert around > 0.9
    assert inside == 0


def test_rooms_behind_walls_hold_nothing_of_the_edge():
    floor = corridor_of_offices(2)
    free, wall = floor.cells == 0, floor.cells > 0
    frame = PlanFrame.of(free | wall, 0.0, floor.resolution_m)
    atoms = frame.sampled(floor.rooms)
    assert not edge_shares(atoms, PlanRaster.of(free, wall, frame), int(floor.rooms.max())).any()


def test_a_map_of_which_nothing_is_known_has_no_edge():
    nothing = np.zeros((3, 3), np.uint8)
    assert edge_shares(nothing.astype(np.int32), PlanRaster(nothing, nothing), 2).tolist() == [0, 0]


def test_the_floor_of_a_doorway_goes_to_the_room_it_is_likeliest_of():
    graph = drawn_graph(["1111#2222", "111133222", "1111#2222", "1111#2222"])
    room, outside = np.array([True, True, False]), np.zeros(3, bool)
    for likeliest in (0, 1):

        def strength(features, likeliest=likeliest):
            return np.where(np.arange(len(features)) == likeliest, 1.0, -1.0)

        region, is_room = leftovers_joined(graph, graph.node_sums[:, 0], room, outside, strength, PARAMETERS)
        assert region.tolist() == [0, 1, likeliest]
        assert is_room.tolist() == room.tolist()
    outside[2] = True
    assert leftovers_joined(graph, graph.node_sums[:, 0], room, outside, strength, PARAMETERS)[
        0
    ].tolist() == [0, 1, 2]


def test_what_belongs_together_comes_before_the_strength_of_a_border():
    graph = drawn_graph(["1111#2222", "111133222", "1111#2222", "1111#2222"])
    room, outside = np.array([True, True, False]), np.zeros(3, bool)
    for wanted in (0, 1):

        def together(one, other, wanted=wanted):
            return (((one == wanted) | (other == wanted)).astype(float),)

        for sign in (1.0, -1.0):
            region, _ = leftovers_joined(
                graph,
                graph.node_sums[:, 0],
                room,
                outside,
                lambda f, sign=sign: sign * np.arange(len(f)),
                PARAMETERS,
                together,
            )
            assert region.tolist() == [0, 1, wanted]


@pytest.mark.parametrize("narrow", [False, True])
def test_small_regions_that_are_as_large_as_a_room_together_are_one_unless_they_are_narrow(narrow):
    graph = drawn_graph(["11112222"] * 4)
    area_m2 = graph.node_sums[:, 0]
    one_room = replace(PARAMETERS, room_min_area_m2=float(area_m2.sum()))
    room = outside = np.zeros(2, bool)
    region, is_room = leftovers_joined(
        graph, area_m2, room, outside, lambda f: np.zeros(len(f)), one_room, narrow=np.array([narrow, False])
    )
    assert region.tolist() == [0, 0]
    assert is_room.tolist() == [not narrow, False]
