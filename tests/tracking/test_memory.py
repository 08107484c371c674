"""What is kept of a room's shapes: those that were seen most often, and the newest."""

from __future__ import annotations

import numpy as np

from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.tracking.matching import RegionShape
from rose2_logs.tracking.memory import TrackMemory


def shape(cells: int) -> RegionShape:
    """Cells in a row."""
    geometry = GridGeometry(1.0, (0.0, 0.0), 0.0, "map", (1, cells))
    return RegionShape(geometry, np.packbits(np.ones(cells, bool)), float(cells))


def take(memory: TrackMemory, cells: int, most: int = 2) -> None:
    new = shape(cells)
    iou = [min(each.area_m2, new.area_m2) / max(each.area_m2, new.area_m2) for each in memory.shapes]
    memory.take(new, np.array(iou), 0.95, most)


def areas(memory: TrackMemory) -> list[float]:
    return [each.area_m2 for each in memory.shapes]


def test_a_shape_that_was_seen_often_outlasts_one_that_was_seen_once():
    """However long ago it was."""
    memory = TrackMemory(shape(100))
    for _ in range(2):
        take(memory, 100)
    take(memory, 50)
    take(memory, 20)
    assert areas(memory) == [100, 20]


def test_of_shapes_seen_as_often_the_older_one_goes():
    memory = TrackMemory(shape(100))
    take(memory, 50)
    take(memory, 20)
    assert areas(memory) == [50, 20]


def test_a_shape_like_one_in_memory_takes_its_place_as_the_newest():
    memory = TrackMemory(shape(100))
    take(memory, 50, most=3)
    take(memory, 98, most=3)
    assert areas(memory) == [50, 98]
