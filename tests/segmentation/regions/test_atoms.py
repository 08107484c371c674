"""Atoms: small enough for any rooms, and none crosses a wall."""

import numpy as np
import pytest

from rose2_logs.config.regions import RegionParameters
from rose2_logs.segmentation.regions.atoms import absorb_small, clearance_basins
from rose2_logs.segmentation.regions.stage import find_atoms, region_tree

PARAMETERS = RegionParameters()


def test_no_atom_crosses_a_wall(atoms, two_rooms):
    inside = (atoms.cells > 0) & (two_rooms.rooms > 0)
    pairs = np.unique(np.stack([atoms.cells[inside], two_rooms.rooms[inside]]), axis=1)
    assert len(np.unique(pairs[0])) == len(pairs[0]) > 2


def test_every_free_cell_is_in_an_atom_and_no_other(atoms, two_rooms):
    assert np.array_equal(atoms.cells > 0, two_rooms.cells == 0)
    sizes = np.bincount(atoms.cells.ravel())[1:]
    assert len(sizes) == atoms.count
    assert sizes.min() * two_rooms.resolution_m**2 >= PARAMETERS.atom_min_m2


@pytest.mark.parametrize(("cells", "stays"), [(20, True), (19, False)])
def test_a_piece_below_the_least_size_goes_to_the_neighbor_it_touches_most(cells, stays):
    pieces = np.zeros((10, 30), np.int32)
    pieces[:, :10], pieces[:, 15:25] = 1, 2
    pieces[:4, 10:15] = 3
    pieces[3, 14] = 3 if cells == 20 else 0
    pieces[:5, 25] = 0
    absorbed = absorb_small(pieces, 20)
    assert absorbed.max() == (3 if stays else 2)
    assert (absorbed[0, 12] == absorbed[0, 0]) != stays


def test_a_small_piece_without_a_neighbor_is_loose():
    pieces = np.zeros((10, 30), np.int32)
    pieces[:, :14], pieces[5:8, 20:23] = 1, 2
    assert np.array_equal(absorb_small(pieces, 20), np.where(pieces == 1, 1, 0))


def test_each_side_of_a_narrow_place_has_a_basin():
    free = np.zeros((40, 80), bool)
    free[2:38, 2:38] = free[2:38, 42:78] = free[16:24, 38:42] = True
    basins = clearance_basins(free, ~free, 0.1, PARAMETERS)
    assert basins[20, 20] != basins[20, 60]
    assert np.array_equal(basins > 0, free)


def test_a_field_without_walls_is_one_basin_whatever_its_size():
    free = np.ones((50, 70), bool)
    assert len(np.unique(clearance_basins(free, ~free, 0.1, PARAMETERS))) == 1


@pytest.mark.parametrize("column", [60, 61])
def test_a_sliver_between_two_lines_belongs_to_the_floor_around_it(column):
    """Of two columns of cells, the centers of plan cells lie on one."""
    cells = np.full((100, 130), 100, np.int8)
    cells[2:-2, 2:-2] = 0
    faces = np.ones(cells.shape, np.int32)
    faces[:, column], faces[:, column + 1 :] = 2, 3
    free, score = cells == 0, np.zeros(cells.shape, np.float32)
    found = find_atoms(free, ~free, score, faces, 0.0, 0.05, PARAMETERS)
    rooms = region_tree(found, free, 0.05, PARAMETERS).rooms(0.0).labels
    assert np.array_equal(rooms > 0, free)
    assert rooms.max() == 1
