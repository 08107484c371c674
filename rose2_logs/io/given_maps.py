"""Maps that a script gives, and what the numbers in their cells mean."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.io.cell_values import LEAST_CELLS, CellReading, reading_of
from rose2_logs.model.occupancy import UNKNOWN, OccupancySnapshot


def all_in_percent(
    maps: Iterable[OccupancySnapshot], reading: CellReading | None, occupancy: OccupancyParameters
) -> Iterator[OccupancySnapshot]:
    """Read the numbers of all maps alike; of an iterator, as the first that knows enough says."""
    for each in maps:
        if reading is None and np.count_nonzero(each.cells != UNKNOWN) >= LEAST_CELLS:
            reading = decided_reading([each], occupancy)
        yield in_percent(each, reading)


def decided_reading(maps: Sequence[OccupancySnapshot], occupancy: OccupancyParameters) -> CellReading | None:
    """What the numbers of maps mean; None if a reader has decided it already."""
    undecided = [each.cells for each in maps if not each.is_percent]
    return reading_of(undecided, occupancy, maps[0].topic) if undecided else None


def in_percent(snapshot: OccupancySnapshot, reading: CellReading | None) -> OccupancySnapshot:
    """Return a map whose cells are in percent, as a reading says; as it is if they are."""
    if reading is None or reading.table is None or snapshot.is_percent:
        return snapshot
    return dataclasses.replace(snapshot, cells=reading.percent_of(snapshot.cells), is_percent=True)
