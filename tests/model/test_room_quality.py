"""How far outlines are walls, and how much of a room is open: counted on drawn maps."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from drawn_maps import office, snapshot
from drawn_rooms import rows

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.config.tracking import QualityParameters
from rose2_logs.model import room_quality as module
from rose2_logs.model.explored import ExploredPart
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.model.outlines import room_outlines
from rose2_logs.model.room_quality import RoomQuality, room_quality
from rose2_logs.model.rooms import RoomMap

PARAMETERS = QualityParameters()


def quality_of(map_: OccupancySnapshot, rooms: RoomMap) -> RoomQuality:
    explored = ExploredPart.of(map_.cells, map_.geometry, OccupancyParameters())
    return room_quality(map_, explored, rooms, PARAMETERS)


def rooms_with(map_: OccupancySnapshot, labels: np.ndarray, *polygons: shapely.Polygon) -> RoomMap:
    return dataclasses.replace(RoomMap.from_labels(labels, map_.geometry), polygons=polygons)


def frontiers(labels: np.ndarray, cells: np.ndarray, resolution_m: float = 1.0) -> list[float]:
    map_ = snapshot(cells, resolution_m)
    return quality_of(map_, RoomMap.from_labels(labels, map_.geometry)).frontier_m.tolist()


def test_a_frontier_is_counted_in_cell_sides():
    """Sides towards unknown cells count; those towards walls and other rooms do not."""
    labels = np.pad(rows("112", "112"), 1)
    cells = np.pad(np.zeros((2, 3), int), 1, constant_values=100)
    assert frontiers(labels, cells) == [0, 0]
    cells[3, :] = cells[:, 0] = cells[:, -1] = -1
    assert frontiers(labels, cells) == [4, 3]
    cells[3] = 100
    assert frontiers(labels, cells, 0.5) == [1, 1]


def test_what_is_beyond_the_grid_is_unknown_as_in_a_map_with_a_border():
    labels, cells = rows("112", "112", "..2"), np.zeros((3, 3), int)
    cells[2, :2] = 100
    cropped = frontiers(labels, cells)
    assert cropped == [4, 5]
    assert frontiers(np.pad(labels, 2), np.pad(cells, 2, constant_values=-1)) == cropped


def test_an_unknown_hole_is_a_frontier_too():
    """One unseen cell within a room has four sides."""
    labels, cells = (
        np.pad(rows("111", "1.1", "111"), 1),
        np.pad(np.zeros((3, 3), int), 1, constant_values=100),
    )
    cells[2, 2] = -1
    assert frontiers(labels, cells) == [4]


@pytest.mark.parametrize("turn_deg", [0, 33])
def test_outlines_along_walls_are_backed_and_others_are_not(turn_deg: int):
    """A room's outline is wall but for its door; the same room drawn two meters off has hardly any."""
    turn = float(np.deg2rad(turn_deg))
    cells, labels = office(turn_rad=turn)
    map_ = snapshot(cells, origin_xy_m=(3.0, -7.0))
    center = map_.geometry.corners_m().mean(axis=0)

    def box(x0: float, y0: float, x1: float, y1: float) -> shapely.Polygon:
        plain = shapely.affinity.translate(shapely.box(x0, y0, x1, y1), -5.0, -3.0)
        turned = shapely.affinity.rotate(plain, turn, origin=(0, 0), use_radians=True)
        return shapely.affinity.translate(turned, *center)

    right, off, nothing = box(0, 2, 5, 6), box(2, 3.5, 4.2, 5.2), shapely.Polygon()
    found = quality_of(map_, rooms_with(map_, labels, right, off, nothing))
    outline = 2 * (5 + 4)
    assert found.wall_support[0] == pytest.approx((outline - 0.5) / outline, abs=0.03)
    assert found.wall_support[1] < 0.1
    assert np.isnan(found.wall_support[2])


@pytest.mark.parametrize("reach_m", [0.0, 0.05, 0.12, 0.2, 0.39])
def test_walls_within_reach_are_the_same_however_they_are_looked_for(reach_m: float, monkeypatch):
    cells, labels = office(turn_rad=0.3)
    map_ = snapshot(cells)
    explored = ExploredPart.of(map_.cells, map_.geometry, OccupancyParameters())
    rooms = rooms_with(map_, labels, *room_outlines(labels, map_.geometry.resolution_m))
    parameters = QualityParameters(wall_reach_m=reach_m)
    grown = room_quality(map_, explored, rooms, parameters).wall_support
    monkeypatch.setattr(module, "DISK_MAX_CELLS", -1)
    measured = room_quality(map_, explored, rooms, parameters).wall_support
    assert np.array_equal(grown, measured)
    assert grown.mean() > 0


def test_an_outline_beyond_the_map_is_not_backed():
    """Predicted parts outside the canvas count as unseen; half of this outline lies there."""
    cells = np.full((20, 20), 100)
    cells[-1, -1] = 0  # a map without any free cell has no explored part
    map_ = snapshot(cells)
    labels = np.ones((20, 20), np.int32)
    found = quality_of(map_, rooms_with(map_, labels, shapely.box(-0.5, 0.3, 0.5, 0.7)))
    assert found.wall_support[0] == pytest.approx(0.5, abs=0.05)


def test_a_map_without_rooms_has_no_evidence():
    """Empty arrays, no error."""
    map_ = snapshot(np.full((5, 5), -1))
    found = quality_of(map_, RoomMap.from_labels(np.zeros((5, 5), np.int32), map_.geometry))
    assert isinstance(found, RoomQuality)
    assert len(found.wall_support) == len(found.frontier_m) == 0
