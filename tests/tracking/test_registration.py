"""How the whole map moved between two snapshots: known motions are found, and nothing else is."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from drawn_maps import office, snapshot
from moved_maps import motion_about, moved

from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.io import open_log
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.tracking.registration import MapAligner, RigidMotion

PARAMETERS = TrackingParameters()
SAMPLE = Path(__file__).parents[2] / "sample_logs" / "office.mcap"


@pytest.fixture(scope="module")
def sample_maps() -> list[OccupancySnapshot]:
    """Every eighth map of a sample log: between them the map grows by rooms."""
    with open_log(SAMPLE) as reader:
        return [map_ for map_ in reader.snapshots() if map_.index % 8 == 7]


def motion_between(*maps: OccupancySnapshot) -> RigidMotion | None:
    aligner = MapAligner(PARAMETERS)
    found = [aligner.update(map_) for map_ in maps]
    assert found[0] is None
    return found[-1]


def test_a_motion_moves_points_and_grids_alike():
    """The corners of a moved grid are the moved corners; the center moves by the shift."""
    motion = RigidMotion((1.0, 2.0), (0.5, -0.25), math.radians(30))
    grid = GridGeometry(0.1, (-3.0, 4.0), 0.2, "map", (7, 9))
    assert motion.grid(grid).corners_m() == pytest.approx(motion.points(grid.corners_m()))
    assert motion.points(np.array([1.0, 2.0])) == pytest.approx([1.5, 1.75])
    quarter = RigidMotion((0.0, 0.0), (0.0, 0.0), math.pi / 2)
    assert quarter.points(np.array([[1.0, 0.0]])) == pytest.approx(np.array([[0.0, 1.0]]))


@pytest.mark.parametrize(
    ("shift_xy_m", "turn_deg"),
    [((0.15, 0.0), 0.0), ((-0.2, 0.3), 1.0), ((0.0, 0.0), -2.0), ((1.2, -0.9), 3.0), ((-1.3, 1.3), -4.5)],
)
def test_a_known_motion_is_found_while_the_map_grows(sample_maps, shift_xy_m, turn_deg: float):
    """Within 3 cm for every point of the map before, also for leaps of meters and turns of degrees."""
    before, after = sample_maps[1:3]
    motion = motion_about(before, shift_xy_m, turn_deg)
    leapt, _ = moved(after, np.zeros(after.cells.shape, np.int32), motion)
    found = motion_between(before, leapt)
    assert found is not None
    walls = before.geometry.cell_centers(*np.nonzero(before.cells > 65))
    assert np.linalg.norm(found.points(walls) - motion.points(walls), axis=1).max() < 0.03


def test_a_map_that_only_grows_does_not_move(sample_maps):
    """Also when the canvas grows and its origin moves."""
    aligner = MapAligner(PARAMETERS)
    assert len({map_.geometry.origin_xy_m for map_ in sample_maps}) > 1
    assert [aligner.update(map_) for map_ in sample_maps] == [None] * len(sample_maps)


def test_less_than_the_least_motion_is_none():
    """A shift of 15 cm counts, unless only more is asked for."""
    cells, _ = office()
    one, two = snapshot(cells), snapshot(cells, origin_xy_m=(0.15, 0.0))
    found = motion_between(one, two)
    assert found is not None
    assert found.shift_xy_m == pytest.approx((0.15, 0.0), abs=1e-3)
    rough = MapAligner(TrackingParameters(shift_min_m=0.2))
    assert [rough.update(one), rough.update(two)] == [None, None]


def test_another_building_is_no_motion(sample_maps):
    """Where the walls of one map are not found in the next, nothing is claimed."""
    cells, _ = office()
    center = sample_maps[-1].geometry.corners_m().mean(axis=0)
    x, y = (center - np.array(cells.shape[::-1]) * 0.05 / 2).tolist()
    assert motion_between(sample_maps[-1], snapshot(cells, origin_xy_m=(x, y))) is None


@pytest.mark.parametrize("cells", [np.full((9, 9), -1), np.zeros((9, 9)), np.full((9, 9), 100)])
def test_maps_without_walls_do_not_tell(cells):
    """Unknown, free or occupied all over: no motion, and no error."""
    drawn, _ = office()
    assert motion_between(snapshot(cells), snapshot(drawn)) is None
    assert motion_between(snapshot(drawn), snapshot(cells)) is None


def test_the_part_that_stays_decides_when_a_map_bends(sample_maps):
    """Where a third of the map moves and the rest stays, the map as a whole stays."""
    before = sample_maps[-1]
    known = np.flatnonzero((before.cells > 65).any(axis=0))
    cut = int(known[len(known) * 2 // 3])
    cells = before.cells.copy()
    cells[6:, cut:] = before.cells[:-6, cut:]
    bent = OccupancySnapshot(1, 1, 1, "/map", cells, before.geometry)
    assert motion_between(before, bent) is None
