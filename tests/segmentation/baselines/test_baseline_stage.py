"""What must hold for every baseline: rooms move with the map, lie in free space, and fit a RoomMap."""

import numpy as np
import pytest
import shapely
from drawn_maps import agreement, office, snapshot
from free_masks import RESOLUTION_M, overlap_with_room, ring, two_rooms

from rose2_logs.config.parameters import Parameters
from rose2_logs.model.outlines import room_outlines
from rose2_logs.segmentation.baselines.stage import BASELINES, segment_by_baseline
from rose2_logs.segmentation.pipeline import METHODS, analyze

PARAMETERS = Parameters()
EVERY_ROOM_TOO_SMALL = {"room_min_area_m2": 1000.0, "room_max_area_m2": 1000.0}
every_method = pytest.mark.parametrize("method", BASELINES)
MOVES = {
    "quarter turn": (np.rot90, lambda image: np.rot90(image, -1)),
    "half turn": (lambda image: np.rot90(image, 2), lambda image: np.rot90(image, -2)),
    "mirrored": (np.fliplr, np.fliplr),
    "upside down": (np.flipud, np.flipud),
    "padded": (lambda image: np.pad(image, ((37, 5), (11, 60))), lambda image: image[37:-5, 11:-60]),
    "moved": (lambda image: np.roll(image, (3, -2), (0, 1)), lambda i: np.roll(i, (-3, 2), (0, 1))),
}


def segment(method, free, parameters=PARAMETERS):
    return segment_by_baseline(method, np.ascontiguousarray(free), RESOLUTION_M, parameters)


def test_the_methods_are_the_papers_and_its_baselines():
    assert METHODS == ("rose2", "morphological", "distance", "voronoi")


@every_method
@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("drawn", ["office", "ring"])
def test_a_map_moved_about_has_the_same_rooms(method, move, drawn):
    change, back = MOVES[move]
    free = office(turn_rad=0.1)[0] == 0 if drawn == "office" else ring()[0]
    assert agreement(back(segment(method, change(free))), segment(method, free)) > 0.95


@every_method
@pytest.mark.parametrize("turn_deg", [0, 17, 45])
def test_the_rooms_of_a_drawn_office_are_found_at_any_angle(method, turn_deg):
    """For the morphological method they are rooms only if all of them together are not."""
    cells, true = office(turn_rad=np.radians(turn_deg))
    parameters = PARAMETERS.replaced({"morphological": {"room_max_area_m2": 18.0}})
    labels = segment(method, cells == 0, parameters)
    assert min(overlap_with_room(labels, true, room) for room in (1, 2)) > 0.9


@every_method
def test_every_reachable_free_cell_is_of_a_room_and_no_other(method):
    free, _ = ring()
    labels = segment(method, free)
    assert (labels > 0).tolist() == free.tolist()
    assert np.unique(labels).tolist() == list(range(labels.max() + 1))


@every_method
def test_rooms_are_numbered_by_their_first_cell(method):
    labels = segment(method, ring()[0])
    first = [np.flatnonzero(labels.ravel() == room)[0] for room in range(1, labels.max() + 1)]
    assert first == sorted(first)


@every_method
def test_a_free_cell_too_few_for_any_room_is_of_none(method):
    free, _ = two_rooms()
    free[0, 0] = True
    assert segment(method, free)[0, 0] == 0


@every_method
@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (3, 3), (40, 1)])
@pytest.mark.parametrize("fill", [False, True])
def test_tiny_maps_give_few_rooms_and_no_error(method, shape, fill):
    assert segment(method, np.full(shape, fill)).max() <= 1


@every_method
def test_noise_gives_no_error(method):
    free = np.random.default_rng(1).random((150, 150)) < 0.7
    assert segment(method, free).shape == free.shape


def test_parameters_of_a_method_are_its_own():
    free, _ = two_rooms()
    for method in BASELINES:
        changed = PARAMETERS.replaced({method: EVERY_ROOM_TOO_SMALL})
        assert segment(method, free, changed).max() == 0
        others = PARAMETERS.replaced({other: EVERY_ROOM_TOO_SMALL for other in BASELINES if other != method})
        assert (segment(method, free, others) == segment(method, free)).all()


def test_outlines_hold_the_cells_of_their_room():
    labels = np.zeros((6, 9), np.int32)
    labels[1:4, 2:5], labels[4:6, 6:9] = 1, 2
    labels[2, 3] = 0
    one, two = room_outlines(labels, 0.5)
    assert one.bounds == (1.0, 0.5, 2.5, 2.0)
    assert one.area == pytest.approx(8 * 0.25)
    assert two.equals(shapely.box(3.0, 2.0, 4.5, 3.0))


@every_method
def test_an_analysis_holds_rooms_and_doorways_in_the_world(method):
    cells = np.where(two_rooms((120, 130))[0], 0, 100).astype(np.int8)
    analysis = analyze(snapshot(cells, RESOLUTION_M, (10.0, -5.0), 0.5), PARAMETERS, method)
    rooms, geometry = analysis.rooms, analysis.geometry
    assert (analysis.structure, analysis.walls, analysis.floor_plan) == (None, None, None)
    assert len(rooms) == 2
    assert rooms.adjacency == ((1, 2),)
    assert [door.width_m for door in rooms.doorways] == [pytest.approx(0.9, abs=0.1)]
    assert rooms.areas_m2 == pytest.approx(rooms.predicted_areas_m2)
    for number, shape in enumerate(rooms.polygons, start=1):
        row, column = np.nonzero(rooms.labels == number)
        assert shapely.contains_xy(shape, geometry.cell_centers(row, column)).all()
    assert method in analysis.seconds


@every_method
def test_a_map_without_free_cells_has_no_rooms(method):
    for fill in (-1, 100):
        assert len(analyze(snapshot(np.full((30, 20), fill)), PARAMETERS, method).rooms) == 0
