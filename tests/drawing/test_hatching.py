"""The unseen parts of rooms, hatched."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from drawn_rooms import drawn, rows

from rose2_logs.drawing.hatching import HATCH_GAP_M, hatch_cells, hatch_lines, hatch_unseen, hatching
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
    length_m = shapely.length(lines).sum()
    assert length_m == pytest.approx(hidden.area / HATCH_GAP_M, rel=0.2)


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
        assert shapely.length(own).sum() == pytest.approx(hidden.area / HATCH_GAP_M, rel=0.2)
    assert set(room) == {0, 1}


@pytest.mark.parametrize("gap", [0.5, 2.0])
def test_hatching_fills_a_shape_evenly(gap: float):
    """Its lines lie within, rise at 45 degrees and are as long together as the area over the gap."""
    shape = shapely.Point(3, -2).buffer(20)
    lines = hatching(shape, gap)
    assert lines.difference(shape.buffer(1e-6)).is_empty
    assert lines.length == pytest.approx(shape.area / gap, rel=0.05)
    ends = shapely.get_coordinates(shapely.get_parts(lines)).reshape(-1, 2, 2)
    across = np.diff(ends, axis=1)[:, 0]
    assert across[:, 0] == pytest.approx(-across[:, 1])


def test_shapes_side_by_side_have_lines_that_go_on_in_one_another():
    """Hatched in two parts or at once, it is the same; a hole and an empty shape have no lines."""
    whole = shapely.box(0.3, 0.2, 9.1, 7.7)
    parts = [shapely.box(0.3, 0.2, 4.4, 7.7), shapely.box(4.4, 0.2, 9.1, 7.7), shapely.Polygon()]
    lines, shape = hatch_lines(parts, 0.7, (1.0, 1.0))
    together = shapely.union_all(shapely.linestrings(lines))
    assert together.difference(hatching(whole, 0.7).buffer(1e-6)).is_empty
    assert together.length == pytest.approx(hatching(whole, 0.7).length)
    assert set(shape.tolist()) == {0, 1}
    ring = whole.difference(shapely.box(2, 2, 5, 5))
    assert not hatching(ring, 0.3).intersects(shapely.box(2.01, 2.01, 4.99, 4.99))
    assert hatching(shapely.Polygon(), 1.0).is_empty


def test_cells_of_a_mask_are_hatched():
    mask = np.zeros((60, 80), bool)
    mask[10:40, 20:70] = True
    lines = shapely.linestrings(hatch_cells(mask, 3.0))
    assert shapely.within(lines, shapely.box(20, 10, 70, 40).buffer(1.0)).all()
    assert shapely.length(lines).sum() == pytest.approx(mask.sum() / 3.0, rel=0.1)
    assert hatch_cells(np.zeros((4, 4), bool), 2.0).shape == (0, 2, 2)
