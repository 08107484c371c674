"""A map in, its rooms out: what must hold for any map."""

import numpy as np
import pytest
import shapely
from drawn_maps import agreement, office, snapshot

from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import ParameterError
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

PARAMETERS = Parameters()


def labels_of(cells, resolution_m=0.05):
    return analyze(snapshot(cells, resolution_m), PARAMETERS).rooms.labels


@pytest.mark.parametrize("turn_deg", [0, 17, 45, 110])
def test_the_rooms_of_a_drawn_office_are_found_at_any_angle(turn_deg):
    cells, true = office(turn_rad=np.radians(turn_deg), clutter=25)
    found = labels_of(cells)
    assert found.max() == 3
    assert agreement(found, np.where(cells == 0, true, 0)) > 0.9


def test_the_doors_of_the_office_are_found_with_their_width():
    rooms = analyze(snapshot(office()[0]), PARAMETERS).rooms
    assert len(rooms.doorways) == 2
    assert len(rooms.adjacency) == 2
    assert len({room for pair in rooms.adjacency for room in pair}) == 3
    for door in rooms.doorways:
        # The walls' round ends take half their thickness from the gap of 0.9 m on both sides.
        assert door.width_m == pytest.approx(0.75, abs=0.2)


@pytest.mark.parametrize(
    ("change", "back"),
    [
        (np.rot90, lambda image: np.rot90(image, -1)),
        (lambda cells: np.rot90(cells, 2), lambda image: np.rot90(image, -2)),
        (np.fliplr, np.fliplr),
        (np.flipud, np.flipud),
        (lambda cells: np.pad(cells, ((37, 5), (11, 60)), constant_values=-1), lambda i: i[37:-5, 11:-60]),
    ],
    ids=["quarter turn", "half turn", "mirrored", "upside down", "padded"],
)
def test_a_map_moved_about_has_the_same_rooms(change, back):
    cells, _ = office(turn_rad=0.1, clutter=25)
    assert agreement(back(labels_of(change(cells))), labels_of(cells)) > 0.95


def test_a_map_of_twice_the_resolution_has_the_same_rooms():
    cells, _ = office(clutter=25)
    fine = labels_of(np.repeat(np.repeat(cells, 2, 0), 2, 1), 0.025)
    assert agreement(fine[::2, ::2], labels_of(cells)) > 0.95


def test_shapes_lie_where_the_map_lies_in_the_world():
    cells, _ = office()
    turned = analyze(snapshot(cells, origin_xy_m=(10.0, -5.0), yaw_rad=0.5), PARAMETERS)
    rooms, geometry = turned.rooms, turned.geometry
    for number, shape in enumerate(rooms.polygons, start=1):
        rows, columns = np.nonzero(rooms.labels == number)
        inside = shapely.contains_xy(shape, geometry.cell_centers(rows, columns))
        assert shape.is_valid
        assert inside.mean() > 0.97
    directions = np.sort(turned.structure.directions_rad % (np.pi / 2))
    assert np.allclose(directions, 0.5, atol=0.01)


def test_the_unseen_part_of_a_room_is_predicted():
    cells, _ = office()
    whole = analyze(snapshot(cells), PARAMETERS)
    seen = cells.copy()
    right = whole.rooms.labels == whole.rooms.labels[150, 190]
    columns = np.flatnonzero(right.any(0))
    # A quarter of the room that lies in the shadow of a cupboard.
    seen[170:200, columns[-40] : columns[-15]] = -1
    partial = analyze(snapshot(seen), PARAMETERS)
    number = partial.rooms.labels[150, 190]
    assert partial.rooms.polygons[number - 1].area > partial.rooms.areas_m2[number - 1] + 1.0


def test_the_same_map_gives_the_same_bytes():
    cells, _ = office(turn_rad=0.3, clutter=40)
    one, two = (analyze(snapshot(cells), PARAMETERS) for _ in range(2))
    assert one.rooms.labels.tobytes() == two.rooms.labels.tobytes()
    assert [shape.wkb for shape in one.rooms.polygons] == [shape.wkb for shape in two.rooms.polygons]


def test_rooms_are_numbered_free_and_measured():
    cells, _ = office(clutter=25)
    rooms = analyze(snapshot(cells), PARAMETERS).rooms
    assert (cells[rooms.labels > 0] == 0).all()
    assert np.unique(rooms.labels).tolist() == list(range(len(rooms) + 1))
    sizes = np.bincount(rooms.labels.ravel())[1:] * 0.05**2
    assert np.allclose(rooms.areas_m2, sizes)
    with pytest.raises(ValueError, match="read-only"):
        rooms.labels[0, 0] = 1


def disc():
    y, x = np.mgrid[-100:101, -100:101]
    radius = np.hypot(x, y)
    return np.where(radius < 92, 0, np.where(radius < 96, 100, -1)).astype(np.int8)


def single_wall():
    cells = np.zeros((100, 100), np.int8)
    cells[50, 20:80] = 100
    return cells


def three_cells():
    cells = np.full((50, 50), -1, np.int8)
    cells[10, 10], cells[10, 11], cells[30, 5] = 0, 100, 0
    return cells


@pytest.mark.parametrize(
    ("cells", "most"),
    [
        (np.zeros((120, 90), np.int8), 1),
        (np.full((40, 40), -1, np.int8), 0),
        (np.full((40, 40), 100, np.int8), 0),
        (np.zeros((1, 1), np.int8), 0),
        (np.full((1, 1), -1, np.int8), 0),
        (disc(), 1),
        (single_wall(), 2),
        (three_cells(), 0),
        (np.random.default_rng(1).choice(np.array([-1, 0, 100], np.int8), (150, 150)), 12),
    ],
    ids=["field", "unknown", "occupied", "one free", "one unknown", "hall", "wall", "three", "noise"],
)
def test_maps_without_structure_give_few_rooms_and_no_error(cells, most):
    analysis = analyze(snapshot(cells), PARAMETERS)
    assert len(analysis.rooms) <= most
    assert len(analysis.rooms) == analysis.rooms.labels.max(initial=0)


def test_a_field_without_walls_is_one_room():
    assert labels_of(np.zeros((120, 90), np.int8)).min() == 1


def test_a_method_that_does_not_exist_is_named():
    with pytest.raises(ParameterError, match="method='magic': it must be one of "):
        analyze(snapshot(three_cells()), PARAMETERS, "magic")


def test_an_analysis_needs_no_options_and_shows_itself_in_one_line():
    cells, _ = office()
    analysis = analyze(snapshot(cells))
    rooms = analysis.rooms
    assert analysis.labels is rooms.labels
    assert (analysis.polygons, analysis.doorways) == (rooms.polygons, rooms.doorways)
    assert analysis.areas_m2 is rooms.areas_m2
    assert len(analysis.quality.wall_support) == len(rooms)
    for shown in (analysis, rooms, analysis.structure, analysis.walls, analysis.floor_plan):
        assert len(repr(shown)) < 200
        assert "\n" not in repr(shown)


def test_parameters_are_taken_by_dotted_names():
    cells, _ = office()
    by_name = analyze(snapshot(cells), {"regions.room_min_area_m2": 1000})
    assert len(by_name.rooms) == 0
    by_walls = {"floor_plan.grouping": "walls", "floor_plan.room_min_area_m2": 1000}
    assert len(analyze(snapshot(cells), by_walls).rooms) == 0


def test_a_tracked_snapshot_gives_its_rooms_and_labels():
    taken = snapshot(office()[0])
    analysis = analyze(taken)
    step = TrackedSnapshot(taken, analysis, 0.5, tuple(range(1, len(analysis.rooms) + 1)), ())
    assert step.rooms is analysis.rooms
    assert step.labels is analysis.rooms.labels
    assert len(repr(step)) < 200
