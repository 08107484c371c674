"""The unseen parts of rooms, hatched."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from drawn_rooms import drawn, rows

from rose2_logs.drawing.hatching import HATCH_STEP_M, cells_within, hatch_unseen
from rose2_logs.model.labels import straight_runs
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

RESOLUTION_M = 0.1


def frame(yaw_rad: float = 0.0) -> tuple[TrackedSnapshot, shapely.Polygon, shapely.Polygon]:
    """Two rooms of 3 x 3 m, the first seen but for its upper half; what is hidden, and its whole shape."""
    labels = np.repeat(np.repeat(rows("122", "122"), 30, axis=0), [30, 15, 15], axis=1)[:30]
    labels[15:, :30] = 0
    snapshot, analysis = drawn(labels, resolution_m=RESOLUTION_M, yaw_rad=yaw_rad, origin_xy_m=(7.0, -3.0))
    corners = np.array([(0, 0), (3, 0), (3, 3), (0, 3)], float)
    whole = shapely.Polygon(analysis.geometry.grid_to_world(corners))
    hidden = shapely.Polygon(analysis.geometry.grid_to_world(corners * (1, 0.5) + (0, 1.5)))
    polygons = (whole, *analysis.rooms.polygons[1:])
    rooms = type(analysis.rooms)(analysis.geometry, analysis.rooms.labels, polygons, analysis.rooms.areas_m2)
    object.__setattr__(analysis, "rooms", rooms)
    return TrackedSnapshot(snapshot, analysis, 0.5, (4, 9), ()), hidden, whole


@pytest.mark.parametrize("yaw_rad", [0.0, 0.7])
def test_lines_lie_where_a_shape_is_unknown_and_fill_it_evenly(yaw_rad):
    hatched, hidden, _ = frame(yaw_rad)
    lines_m, room = hatch_unseen(hatched)
    assert len(lines_m) > 5
    assert set(room) == {0}
    lines = shapely.linestrings(lines_m.reshape(-1, 2, 2))
    assert shapely.within(lines, hidden.buffer(RESOLUTION_M)).all()
    # Lines on diagonals, so far apart along a row: so many meters to a square meter.
    length_m = shapely.length(lines).sum()
    assert length_m == pytest.approx(hidden.area * math.sqrt(2) / HATCH_STEP_M, rel=0.2)


def test_rooms_that_are_seen_whole_are_not_hatched():
    snapshot, analysis = drawn(np.ones((40, 40)), resolution_m=RESOLUTION_M)
    lines_m, room = hatch_unseen(TrackedSnapshot(snapshot, analysis, 1.0, (1,), ()))
    assert (len(lines_m), len(room)) == (0, 0)


def test_what_lies_beyond_the_canvas_is_unknown_too():
    """Of three rooms, the first half beyond it, the second wholly; the third has no shape."""
    snapshot, analysis = drawn(np.tile(rows("123"), (30, 10)), resolution_m=RESOLUTION_M)
    polygons = (shapely.box(-1.5, 0, 1.5, 3), shapely.box(6, 5, 9, 8), shapely.Polygon())
    rooms = type(analysis.rooms)(analysis.geometry, analysis.rooms.labels, polygons, analysis.rooms.areas_m2)
    object.__setattr__(analysis, "rooms", rooms)
    lines_m, room = hatch_unseen(TrackedSnapshot(snapshot, analysis, 0.5, (1, 2, 3), ()))
    lines = shapely.linestrings(lines_m.reshape(-1, 2, 2))
    for number, hidden in enumerate((shapely.box(-1.5, 0, 0, 3), polygons[1])):
        own = lines[room == number]
        assert shapely.within(own, hidden.buffer(RESOLUTION_M)).all()
        assert shapely.length(own).sum() == pytest.approx(hidden.area * math.sqrt(2) / HATCH_STEP_M, rel=0.2)
    assert set(room) == {0, 1}


def test_a_shape_may_reach_beyond_the_canvas_and_have_holes():
    _, analysis = drawn(np.ones((20, 20)), resolution_m=RESOLUTION_M)
    shape = shapely.box(-1.0, -0.5, 1.5, 1.0).difference(shapely.box(0.0, 0.0, 0.5, 0.5))
    (number, inside, (row, column)), other = cells_within(
        (shapely.Polygon(), shape, shape), analysis.geometry
    )
    assert (number, other.number, other.corner) == (1, 2, (row, column))
    assert np.array_equal(other.inside, inside)
    assert (row, column) == (-6, -11)
    assert inside.sum() * RESOLUTION_M**2 == pytest.approx(shape.area, abs=RESOLUTION_M * shape.length)
    assert not inside[2 - row, 2 - column]
    assert inside[2 - row, -5 - column]


@pytest.mark.parametrize("step", [(0, 1), (1, 0), (1, 1), (1, -1)])
def test_runs_hold_every_cell_once_and_cannot_be_longer(step):
    """Any mask: the cells from each first to its last one are those of the mask."""
    mask = np.random.default_rng(3).random((12, 15)) < 0.5
    first, last = straight_runs(*np.nonzero(mask), step)
    found = np.zeros(mask.shape, int)
    for begin, end in zip(first, last, strict=True):
        before = tuple(begin - step)
        assert not (min(before) >= 0 and before[1] < mask.shape[1] and mask[before])
        length = np.abs(end - begin).max() + 1
        cells = begin + np.arange(length)[:, None] * np.array(step)
        assert (cells[-1] == end).all()
        found[tuple(cells.T)] += 1
    assert (found == mask).all()


def test_no_cells_make_no_runs():
    first, last = straight_runs(np.zeros(0, int), np.zeros(0, int), (1, 1))
    assert first.shape == last.shape == (0, 2)
