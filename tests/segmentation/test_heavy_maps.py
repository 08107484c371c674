"""Maps of an unusual size or kind: no more is computed than there is an answer to."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_maps import office, snapshot

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.model.explored import ExploredPart, is_scattered
from rose2_logs.segmentation.pipeline import METHODS, analyze


@pytest.mark.parametrize("method", METHODS)
def test_where_nothing_is_free_there_is_no_room(method: str):
    found = analyze(snapshot(np.full((2000, 2000), 100, np.int8)), method=method)
    assert (len(found.rooms), found.rooms.labels.shape, found.free_area_m2) == (0, (2000, 2000), 0.0)


def test_a_field_without_walls_is_one_room_whatever_its_size():
    assert len(analyze(snapshot(np.zeros((1500, 1500), np.int8))).rooms) == 1


def test_cells_of_noise_are_put_together_to_blocks():
    cells = np.random.default_rng(3).choice(np.array([-1, 0, 100], np.int8), (1500, 1500))
    assert ExploredPart.of(cells, snapshot(cells).geometry, OccupancyParameters()).factor > 1
    assert not len(analyze(snapshot(cells)).rooms)


def test_a_cluttered_building_is_not_taken_for_noise():
    """However large: only scattered cells are put together to blocks for their number alone."""
    cells, _ = office(clutter=300)
    large = np.tile(cells, (3, 3))
    assert large.size > 500_000
    assert ExploredPart.of(large, snapshot(large).geometry, OccupancyParameters()).factor == 1
    assert is_scattered(np.indices((50, 50)).sum(axis=0) % 2 == 0)
