"""The explored part of a canvas and its blocks of cells."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from saved_maps import two_rooms

from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.model.explored import ExploredPart, block_side
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot, is_same_to_analysis
from rose2_logs.segmentation.pipeline import analyze

FREE, OCCUPIED, UNKNOWN = 0, 100, -1


def explored_part(rows: list[str], resolution_m: float, **changes: float) -> ExploredPart:
    """Explored part of a canvas drawn with ``.`` free, ``#`` occupied, ``?`` unknown."""
    values = {".": FREE, "#": OCCUPIED, "?": UNKNOWN}
    cells = np.array([[values[sign] for sign in row] for row in rows], np.int8)
    geometry = GridGeometry(resolution_m, (1.0, 2.0), 0.0, "map", cells.shape)
    return ExploredPart.of(cells, geometry, dataclasses.replace(OccupancyParameters(), **changes))


def test_a_map_at_the_working_resolution_is_taken_as_it_is():
    part = explored_part(["????", "?.#?", "????"], 0.05)
    assert (part.factor, part.resolution_m) == (1, 0.05)
    assert part.free.tolist() == [[True, False]]
    assert part.occupied.tolist() == [[False, True]]


@pytest.mark.parametrize(
    ("resolution_m", "cells", "side"),
    [
        (0.05, 100, 1),
        (0.1, 100, 1),
        (0.025, 100, 2),
        (0.05 / 3, 100, 3),
        (0.03, 100, 1),
        (0.05, 20_000_000, 1),
        (0.05, 20_000_001, 2),
        (0.05, 90_000_001, 3),
        (0.01, 100, 5),
    ],
)
def test_blocks_are_as_large_as_the_resolution_and_the_size_ask(resolution_m: float, cells: int, side: int):
    assert block_side(resolution_m, cells, OccupancyParameters()) == side


def test_a_block_is_occupied_by_any_cell_and_free_by_half_of_them():
    part = explored_part(["..?#..", "..??.?", "??..?#", "?.....", ".?...?"], 0.025)
    assert part.factor == 2
    assert part.occupied.tolist() == [[False, True, False], [False, False, True], [False, False, False]]
    # The last row of blocks is half outside of the canvas, which counts as unknown.
    assert part.free.tolist() == [[True, False, True], [False, True, False], [False, True, False]]
    assert part.free_area_m2 == pytest.approx(18 * 0.025**2)


def test_labels_come_back_on_free_cells_only_and_beside_thin_walls():
    part = explored_part(["....#.", "....#.", "....#."], 0.025)
    assert part.occupied.tolist() == [[False, False, True]] * 2
    labels = part.labels(np.array([[1, 1, 0], [1, 1, 0]], np.int32))
    # The last column shares its block with the wall, and takes the room beside it.
    assert labels.tolist() == [[1, 1, 1, 1, 0, 1]] * 3


def test_values_lie_where_their_block_does():
    part = explored_part(["????", "?..#", "?..#"], 0.025)
    full = part.values_at(part.occupied_cells(), np.array([[7, 9]])).whole()
    assert full.tolist() == [[0, 0, 0, 0], [0, 0, 0, 9], [0, 0, 0, 9]]


@pytest.mark.parametrize("side", [2, 3])
def test_finer_cells_give_the_same_rooms(side: int):
    """Each cell of a map cut in `side` x `side`: labels, polygons, lines and areas stay as they are."""
    image = np.flipud(two_rooms(200))
    cells = np.select([image == 254, image == 0], [FREE, OCCUPIED], UNKNOWN).astype(np.int8)
    finer = cells.repeat(side, 0).repeat(side, 1)
    found = []
    for values, resolution_m in ((cells, 0.05), (finer, 0.05 / side)):
        geometry = GridGeometry(resolution_m, (-3.0, 1.0), math.radians(20), "map", values.shape)
        found.append(analyze(OccupancySnapshot(0, 0, 0, "/map", values, geometry), Parameters()))
    coarse, fine = found
    np.testing.assert_array_equal(coarse.rooms.labels.repeat(side, 0).repeat(side, 1), fine.rooms.labels)
    np.testing.assert_allclose(coarse.rooms.areas_m2, fine.rooms.areas_m2)
    assert coarse.free_area_m2 == pytest.approx(fine.free_area_m2)
    assert coarse.walls is not None
    assert fine.walls is not None
    np.testing.assert_allclose(coarse.walls.lines_m, fine.walls.lines_m, atol=1e-9)
    for one, other in zip(coarse.rooms.polygons, fine.rooms.polygons, strict=True):
        assert one.symmetric_difference(other).area < 1e-6


def test_a_large_map_is_analyzed_coarser_and_labeled_at_its_own_resolution():
    image = np.flipud(two_rooms(240))
    cells = np.select([image == 254, image == 0], [FREE, OCCUPIED], UNKNOWN).astype(np.int8)
    geometry = GridGeometry(0.05, (0.0, 0.0), 0.0, "map", cells.shape)
    snapshot = OccupancySnapshot(0, 0, 0, "/map", cells, geometry)
    whole = analyze(snapshot, Parameters())
    blocks = analyze(snapshot, Parameters().replaced({"occupancy": {"analyzed_max_cells": 20_000}}))
    assert (whole.resolution_m, blocks.resolution_m) == (0.05, 0.1)
    assert len(whole.rooms) == len(blocks.rooms) == 2
    assert blocks.rooms.labels.shape == cells.shape
    assert ((blocks.rooms.labels > 0) <= (cells == FREE)).all()
    assert (blocks.rooms.labels == whole.rooms.labels)[whole.rooms.labels > 0].mean() > 0.97


@pytest.mark.parametrize("before", [-1, 0, 40, 100])
@pytest.mark.parametrize("now", [-1, 0, 40, 100])
def test_maps_are_the_same_to_the_analysis_if_no_cell_changes_its_kind(before: int, now: int):
    """Free, occupied, unknown, or known but neither; a probability may change within its kind."""
    geometry = GridGeometry(0.05, (0.0, 0.0), 0.0, "map", (2, 2))

    def one(value: int) -> OccupancySnapshot:
        return OccupancySnapshot(0, 0, 0, "/map", np.array([[0, value], [100, -1]], np.int8), geometry)

    same = is_same_to_analysis(one(before), one(now), OccupancyParameters())
    assert same == (before == now)
    assert is_same_to_analysis(one(0), one(19), OccupancyParameters())
    assert not is_same_to_analysis(one(0), one(20), OccupancyParameters())
