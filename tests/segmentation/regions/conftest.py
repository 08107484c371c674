"""Two drawn rooms, cut into atoms."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_floors import Floor, draw_floor
from numpy.typing import NDArray

from rose2_logs.config.parameters import Parameters
from rose2_logs.segmentation.regions.plan_raster import OUTPUTS
from rose2_logs.segmentation.regions.stage import Atoms, find_atoms, generous_floor_plan, generous_walls
from rose2_logs.segmentation.rose.stage import find_structure
from rose2_logs.segmentation.walls.stage import WallCounter
from rose2_logs.segmentation.walls.strips import WallCells


@pytest.fixture(scope="session")
def two_rooms() -> Floor:
    """Two rooms of 5 m x 4 m with a door of 0.9 m, a wall of 2 m in each."""
    floor = draw_floor([(0, 0, 5, 4), (5.2, 0, 10.2, 4)], [(5, 1.5, 5.2, 2.4)], wall_m=0.2)
    for left in (70, 180):
        floor.cells[64:104, left : left + 3] = 100
        floor.rooms[64:104, left : left + 3] = 0
    return floor


@pytest.fixture(scope="session")
def atoms(two_rooms: Floor) -> Atoms:
    """The atoms of the two rooms."""
    free, occupied = two_rooms.cells == 0, two_rooms.cells > 0
    parameters = Parameters()
    scored = find_structure(occupied, two_rooms.resolution_m, parameters.spectrum)
    direction = float(scored.directions_rad[0])
    count_walls = WallCounter(
        WallCells(scored.supported, scored.directions_rad, two_rooms.resolution_m), parameters.walls
    )
    walls = generous_walls(scored, count_walls, parameters)
    plan = generous_floor_plan(walls, free, direction, two_rooms.resolution_m, parameters)
    return find_atoms(
        free, occupied, scored.score, plan.face_of_cell, direction, two_rooms.resolution_m, parameters.regions
    )


@pytest.fixture(scope="session")
def answers(atoms: Atoms) -> NDArray[np.float32]:
    """Answers by chance: what must hold for any network."""
    rng = np.random.default_rng(0)
    return rng.random((OUTPUTS, *atoms.on_plan.shape)).astype(np.float32)
