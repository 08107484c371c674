"""Each parameter of rooms by fitted borders, with a drawn case just below and just above it."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_floors import draw_floor

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.regions import RegionParameters
from rose2_logs.segmentation.regions.atoms import clearance_basins
from rose2_logs.segmentation.regions.features import FEATURES, REGION_FEATURES
from rose2_logs.segmentation.regions.outside import surroundings
from rose2_logs.segmentation.regions.stage import find_atoms, generous_walls, room_labels
from rose2_logs.segmentation.regions.strengths import BoostedTrees, FittedStrength
from rose2_logs.segmentation.rose.stage import find_structure
from rose2_logs.segmentation.walls.stage import WallCounter
from rose2_logs.segmentation.walls.strips import WallCells

CELL_M = 0.1
PARAMETERS = RegionParameters()


def lobes(apart_cells, neck_cells, radius_cells=6):
    """Two round rooms whose centers are so far apart, with a passage between them."""
    row, column = np.mgrid[:30, : apart_cells + 30]
    free = np.zeros(row.shape, bool)
    for center in (15, 15 + apart_cells):
        free |= np.hypot(row - 15, column - center) <= radius_cells
    half = neck_cells // 2
    free[15 - half : 15 + half + 1, 15 : 15 + apart_cells] = True
    return free


def basins(free, **changed):
    return int(clearance_basins(free, ~free, CELL_M, replace(PARAMETERS, **changed)).max())


@pytest.mark.parametrize(("reach_m", "count"), [(1.4, 2), (1.7, 1)])
def test_summits_within_reach_of_a_higher_one_have_no_basin(reach_m, count):
    """Centers 1.6 m apart; one room is a little wider than the other."""
    free = lobes(16, 4)
    free |= np.roll(lobes(16, 4, 7), 0, 1) & (np.arange(free.shape[1]) < 23)
    assert basins(free, summit_reach_m=reach_m) == count


@pytest.mark.parametrize(("blur_m", "count"), [(0.05, 2), (0.4, 1)])
def test_a_notch_in_the_clearance_narrower_than_its_blur_parts_no_basins(blur_m, count):
    free = np.zeros((30, 60), bool)
    free[8:23, 5:55] = True
    free[8, 30] = free[22, 30] = False  # a pilaster of one cell on either side
    ends = free.copy()
    ends[:, :20] = ends[:, 41:] = False
    assert basins(ends, clearance_blur_m=blur_m, summit_reach_m=0.3) == count


def atoms_around_a_post(post_cells, speck_max_m):
    """A room of 4 m x 4 m with a square post in its middle."""
    floor = draw_floor([(0, 0, 4, 4)])
    middle = np.array(floor.cells.shape) // 2
    floor.cells[middle[0] : middle[0] + post_cells, middle[1] : middle[1] + post_cells] = 100
    free, occupied = floor.cells == 0, floor.cells > 0
    score, faces = np.zeros(free.shape, np.float32), np.ones(free.shape, np.int32)
    parameters = replace(PARAMETERS, speck_max_m=speck_max_m)
    return find_atoms(free, occupied, score, faces, 0.0, floor.resolution_m, parameters).count


def test_a_post_as_short_as_a_speck_bounds_no_basin():
    assert atoms_around_a_post(4, 0.25) == 1
    assert atoms_around_a_post(4, 0.15) > 1
    assert atoms_around_a_post(6, 0.25) > 1


def test_a_wall_is_in_the_generous_clean_map_from_its_score_on():
    floor = draw_floor([(0, 0, 6, 4)])
    floor.cells[50:80, 70:73] = 100  # 1.5 m that stand free
    scored = find_structure(floor.cells > 0, floor.resolution_m, Parameters().spectrum)
    score = float(scored.score[50:80, 70:73].max())
    count_walls = WallCounter(
        WallCells(scored.supported, scored.directions_rad, floor.resolution_m), Parameters().walls
    )

    def walls_there(least):
        parameters = replace(Parameters(), regions=replace(PARAMETERS, clean_min_score=least))
        return bool(generous_walls(scored, count_walls, parameters).walls[55:75, 71].all())

    assert walls_there(0.8 * score)
    assert not walls_there(min(1.0, 1.001 * score))


def strength(mean_answer, log_odds=0.0, **changed):
    features = np.zeros((1, len(FEATURES)))
    features[0, FEATURES.index("different")] = mean_answer
    joins = FittedStrength.of_joins(BoostedTrees.constant(log_odds), replace(PARAMETERS, **changed))
    return float(joins(features)[0])


@pytest.mark.parametrize(
    ("below", "above"),
    [
        ({"join_margin": 0.73}, {"join_margin": 0.66}),
        ({"answer_least": 0.05, "join_margin": 0.65}, {"answer_least": 0.001, "join_margin": 0.65}),
        ({"answer_weight": 0.9, "join_margin": 0.69}, {"answer_weight": 1.1, "join_margin": 0.69}),
    ],
)
def test_a_border_goes_from_even_odds_on(below, above):
    """A mean answer of 0.2 is 1.39 log odds for one room; the trees say even odds."""
    assert strength(0.2, **below) < 0 < strength(0.2, **above)


@pytest.mark.parametrize(("least", "is_room"), [(0.99, True), (1.01, False)])
def test_a_region_is_a_room_from_the_least_odds_on(least, is_room):
    features = np.zeros((1, len(REGION_FEATURES)))
    features[0, REGION_FEATURES.index("outside")] = 0.5
    parameters = replace(PARAMETERS, room_min_log_odds=least)
    odds = FittedStrength.of_rooms(BoostedTrees.constant(2.0), parameters)(features)[0]
    assert (odds >= parameters.room_min_log_odds) == is_room


@pytest.mark.parametrize(("rest", "around"), [(0.05, True), (0.049, False)])
def test_a_corner_cut_off_the_white_is_told_by_its_share_of_the_edge(rest, around):
    found = surroundings(np.array([0.6, rest, 0.0]), np.array([60.0, 3.0, 40.0]), PARAMETERS)
    assert found.tolist() == [True, around, False]


@pytest.mark.parametrize(("reach_m", "labeled"), [(0.26, 5), (0.24, 4)])
def test_loose_cells_belong_to_a_room_within_reach(reach_m, labeled):
    """Loose cells of 5 cm in a row beside an atom."""
    atoms = np.zeros((9, 20), np.int32)
    atoms[:, :5] = 1
    free = atoms > 0
    free[4, 5:15] = True
    labels = room_labels(atoms, np.array([1]), free, 0.05, reach_m)
    assert int((labels[4, 5:] > 0).sum()) == labeled
