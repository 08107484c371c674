"""The network's answers: rounded, in place, and the same in tiles."""

import numpy as np
import pytest
from drawn_floors import room_grid

from rose2_logs.segmentation.regions import answers as module
from rose2_logs.segmentation.regions import fitted
from rose2_logs.segmentation.regions.answers import ANSWER_STEPS, STRIDE, turned_by_half
from rose2_logs.segmentation.regions.plan_raster import (
    DISTANCE_MAX,
    OFFSETS,
    OUTPUTS,
    SHARE_STEPS,
    PlanRaster,
    network_input,
    shares_of,
)


@pytest.fixture(scope="module")
def raster():
    cells = room_grid(6, 8, 3.0).cells[::2, ::2]
    return PlanRaster(
        ((cells > 0) * SHARE_STEPS).astype(np.uint8), ((cells == 0) * SHARE_STEPS).astype(np.uint8)
    )


@pytest.fixture(scope="module")
def whole(raster):
    return fitted.answering_network()(raster)


def test_answers_are_steps_between_0_and_1(raster, whole):
    assert whole.shape == (OUTPUTS, *raster.wall.shape)
    assert whole.min() >= 0
    assert whole.max() <= 1
    assert np.array_equal(np.rint(whole * ANSWER_STEPS).astype(np.float32) / np.float32(ANSWER_STEPS), whole)


@pytest.fixture(scope="module")
def whole_steps(raster):
    """The raster with sides of whole steps, so that it is padded alike when turned."""
    pad = [(0, -side % STRIDE) for side in raster.wall.shape]
    return PlanRaster(np.pad(raster.wall, pad), np.pad(raster.free, pad))


def test_with_two_views_a_map_turned_by_half_has_the_same_answers_turned(whole_steps):
    """Each pair of cells is told of at its lower or right cell, which is the other one when turned."""
    network, turned = fitted.answering_network(), half_turn(whole_steps)
    back, answers = turned_by_half(network(turned, views=2)), network(whole_steps, views=2)
    for k, (down, right) in enumerate((*OFFSETS, (0, 0))):
        np.testing.assert_allclose(back[k, down:, right:], answers[k, down:, right:], atol=2e-3)


def test_answers_are_the_mean_of_those_for_both_views(whole_steps):
    network = fitted.answering_network()
    one = network(whole_steps, views=1)
    other = turned_by_half(network(half_turn(whole_steps), views=1))
    np.testing.assert_allclose(network(whole_steps, views=2), (one + other) / 2, atol=2e-3)
    assert np.abs(other - one).max() > 0.01


def half_turn(raster):
    return PlanRaster(raster.wall[::-1, ::-1], raster.free[::-1, ::-1])


def test_tiles_give_the_answers_of_the_whole_but_for_a_few(raster, whole, monkeypatch):
    monkeypatch.setattr(module, "TILE_CELLS", 256)
    monkeypatch.setattr(module, "OVERLAP_CELLS", 96)
    tiled = fitted.answering_network()(raster)
    inside = raster.free > 0
    difference = np.abs(tiled - whole)[:, inside]
    # Not the same to the last step, for tiles begin elsewhere than in the middle of a coarse step.
    assert difference.mean() < 0.015
    # The same pairs of cells are in different rooms, but for a few.
    assert np.mean((tiled > 0.5) != (whole > 0.5)) < 0.015


def test_tiles_without_free_cells_are_not_looked_at(raster, monkeypatch):
    monkeypatch.setattr(module, "TILE_CELLS", 96)
    monkeypatch.setattr(module, "OVERLAP_CELLS", 16)
    empty = PlanRaster(np.pad(raster.wall, ((0, 0), (0, 400))), np.pad(raster.free, ((0, 0), (0, 400))))
    assert not fitted.answering_network()(empty)[..., -256:].any()


def test_tiles_without_walls_are_outside(raster, monkeypatch):
    monkeypatch.setattr(module, "TILE_CELLS", 96)
    monkeypatch.setattr(module, "OVERLAP_CELLS", 16)
    wall, free = (np.pad(raster.wall, ((0, 0), (0, 400))), np.pad(raster.free, ((0, 0), (0, 400)), "edge"))
    answers = fitted.answering_network()(PlanRaster(wall, np.maximum(free, 1)))[..., -256:]
    assert not answers[:-1].any()
    assert (answers[-1] == 1).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 200), (STRIDE, STRIDE), (STRIDE + 1, 2 * STRIDE - 1)])
def test_rasters_of_any_shape_are_answered(shape):
    free = PlanRaster(np.zeros(shape, np.uint8), np.full(shape, SHARE_STEPS, np.uint8))
    assert fitted.answering_network()(free).shape == (OUTPUTS, *shape)


def test_the_network_sees_shares_and_distances():
    wall, free = np.zeros((9, 60), np.uint8), np.full((9, 60), SHARE_STEPS, np.uint8)
    wall[:, 10], free[:, 10] = SHARE_STEPS, 0
    free[:, 50:] = 0
    seen = network_input(shares_of(wall), shares_of(free))
    assert seen.shape == (4, 9, 60)
    assert seen[0, 4, 10] == seen[1, 4, 11] == 1
    assert seen[2, 4, 15] == pytest.approx(5 / DISTANCE_MAX, abs=0.02)
    assert seen[3, 4, 47] == pytest.approx(3 / DISTANCE_MAX, abs=0.02)
    assert seen[2].max() == 1
