"""How one map lies over another whose frame is anywhere: known motions are found, other buildings told."""

from __future__ import annotations

import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from drawn_maps import office, snapshot
from layout_makers import layout_of
from moved_maps import motion_about, moved

from rose2_logs.comparison.layouts import compare_layouts
from rose2_logs.comparison.placement import PlacedMap, _is_same, place
from rose2_logs.config.comparison import ComparisonParameters
from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.io import open_log
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.tracking.registration import RigidMotion

SAMPLES = Path(__file__).parents[2] / "sample_logs"
OCCUPANCY = OccupancyParameters()


def last_map(name: str) -> OccupancySnapshot:
    with open_log(SAMPLES / name) as reader:
        return reader.last()


@pytest.fixture(scope="module")
def sample() -> OccupancySnapshot:
    return last_map("office.mcap")


def placed(map_: OccupancySnapshot) -> PlacedMap:
    return PlacedMap(map_, OCCUPANCY)


def without_labels(map_: OccupancySnapshot, shift_xy_m: tuple[float, float], turn_deg: float):
    motion = motion_about(map_, shift_xy_m, turn_deg)
    return moved(map_, np.zeros(map_.cells.shape, np.int32), motion)[0], motion


@pytest.mark.parametrize(
    ("shift_xy_m", "turn_deg"),
    [
        ((0.0, 0.0), 0.0),
        ((31.4, -17.2), 90.0),
        ((-3.3, 55.0), 137.3),
        ((8.0, 8.0), -61.8),
        ((0.4, 0.1), 181.0),
    ],
)
def test_a_moved_map_is_laid_back(sample, shift_xy_m, turn_deg: float):
    """Any turn and tens of meters of offset: every wall within half a cell, the turn within 0.05 degrees."""
    other, motion = without_labels(sample, shift_xy_m, turn_deg)
    found = place(placed(other), placed(sample))
    walls = placed(sample).walls
    apart = np.linalg.norm(found.motion.points(motion.points(walls)) - walls, axis=1)
    assert apart.max() < 0.025
    turn = math.remainder(found.motion.turn_rad + motion.turn_rad, 2 * math.pi)
    assert abs(math.degrees(turn)) < 0.05
    assert found.agreement > 0.98
    assert found.common_share > 0.98


def test_a_map_with_other_cells_is_laid_over(sample):
    """A map of twice the cell size, its grid itself turned in the world."""
    geometry = sample.geometry
    coarse = np.ascontiguousarray(sample.cells[::2, ::2])
    other = snapshot(coarse, 2 * geometry.resolution_m, (40.0, -7.0), 2.0)
    found = place(placed(other), placed(sample))
    # The cell taken of each four has its center a quarter of the large cell from that one's center.
    corner = found.motion.points(np.array([40.0, -7.0]))
    assert corner == pytest.approx(geometry.origin_xy_m, abs=0.08)
    turn = math.remainder(found.motion.turn_rad + 2.0 - geometry.yaw_rad, 2 * math.pi)
    assert abs(math.degrees(turn)) < 0.3


def test_two_overlapping_parts_of_a_building_find_each_other(sample):
    """Half of the map against the other two thirds, turned: only what both explored must agree."""
    known = np.flatnonzero((sample.cells >= 0).any(axis=0))
    left, right = sample.cells.copy(), sample.cells.copy()
    left[:, known[len(known) * 2 // 3] :] = -1
    right[:, : known[len(known) // 3]] = -1
    geometry = sample.geometry
    one, two = (
        OccupancySnapshot(0, 1, 1, "/map", np.ascontiguousarray(cells), geometry) for cells in (left, right)
    )
    other, motion = without_labels(two, (12.0, 3.0), 100.0)
    found = compare_layouts(layout_of(one), layout_of(other))
    walls = placed(two).walls
    back = found.placement.motion.points(motion.points(walls))
    assert np.linalg.norm(back - walls, axis=1).max() < 0.1
    assert found.same_building
    assert 0.3 < found.placement.common_share < 0.8


@pytest.mark.parametrize("other", ["wing.bag", "ring"])
def test_other_buildings_are_told(sample, other: str):
    """Simulated by the same tool, with walls of one kind; yet not one building."""
    found = compare_layouts(layout_of(sample), layout_of(last_map(other)))
    assert not found.same_building
    assert found.placement.score < 0.35


def test_a_building_that_looks_the_same_turned_is_ambiguous():
    """The drawn office without its corridor is two equal rooms side by side."""
    cells = np.full((140, 240), -1, np.int8)
    cells[20:120, 20:220] = 100
    cells[23:117, 23:118] = 0
    cells[23:117, 122:217] = 0
    found = compare_layouts(layout_of(snapshot(cells)), layout_of(snapshot(cells)))
    assert found.same_building
    assert found.ambiguous


@pytest.mark.parametrize("cells", [np.full((9, 9), -1), np.zeros((9, 9)), np.full((5, 5), 100)])
def test_a_map_without_walls_cannot_be_laid(cells):
    """Unknown, free or occupied all over: no placement, and no error."""
    drawn, _ = office()
    assert place(placed(snapshot(cells)), placed(snapshot(drawn))) is None
    assert place(placed(snapshot(drawn)), placed(snapshot(cells))) is None


def test_free_space_far_beyond_the_walls_takes_no_more_memory():
    """A yard of 800 m around a building of 40 m, in cells of one meter."""
    cells = np.zeros((800, 800), np.int8)
    cells[400:440, 400:440] = 100
    cells[403:437, 402:420] = cells[403:437, 421:438] = 0
    map_ = snapshot(cells, resolution_m=1.0)
    tracemalloc.start()
    try:
        found = place(placed(map_), placed(map_))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.motion.pose == pytest.approx((0, 0, 0), abs=1e-3)
    assert peak < 600e6


@pytest.mark.parametrize(
    ("shift_m", "turn_rad", "is_same"),
    [(0.9, 0.0, True), (1.1, 0.0, False), (0.0, 0.04, True), (0.0, 0.06, False), (0.0, 2 * np.pi, True)],
)
def test_placements_are_one_where_the_map_lies_and_is_turned_about_the_same(shift_m, turn_rad, is_same):
    center = np.array([30.0, -20.0])
    one = RigidMotion.moving(center, center + 5.0, 1.0)
    other = RigidMotion.moving(center, center + 5.0 + np.array([0.0, shift_m]), 1.0 + turn_rad)
    assert _is_same(one, other, center, ComparisonParameters()) == is_same


@pytest.mark.parametrize("stated", [0.7, 1.4])
def test_a_map_of_a_wrong_cell_size_is_told_with_the_scale_that_fits(sample, stated: float):
    """Whichever way it is wrong; the same building it is not called."""
    other, _ = without_labels(sample, (12.0, -7.0), 30.0)
    wrong = placed(other).scaled(stated).snapshot
    found = compare_layouts(layout_of(sample), layout_of(wrong))
    assert not found.same_building
    assert found.scale == pytest.approx(1 / stated, rel=0.02)


def test_no_scale_makes_another_building_fit(sample):
    found = compare_layouts(layout_of(sample), layout_of(last_map("wing.bag")))
    assert not found.same_building
    assert found.scale is None
