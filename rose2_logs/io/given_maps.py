"""Maps that a script gives, what the numbers in their cells mean, and by what they were read already."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from rose2_logs.config.fields import ParameterBlock
from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.errors import InvalidMapError, ParameterError
from rose2_logs.io.cell_values import (
    LEAST_CELLS,
    MAPS_LOOKED_AT,
    READINGS,
    CellReading,
    reading_of,
    stored_bytes,
)
from rose2_logs.io.log import LogReader
from rose2_logs.model.occupancy import UNKNOWN, GridGeometry, OccupancySnapshot, free_area_m2

Block = TypeVar("Block", bound=ParameterBlock)

OF_ANALYSIS = ("working_resolution_m", "analyzed_max_cells")
"""Parameters of ``occupancy`` that do not count before a map is analyzed."""


def snapshot_of_array(
    array: ArrayLike, resolution_m: float | None, occupancy: OccupancyParameters
) -> OccupancySnapshot:
    """Make a map in percent of an array, whatever its numbers mean.

    Raises
    ------
    InvalidMapError
        If the array is no occupancy grid.
    ParameterError
        If it is no array, or the resolution is missing.
    """
    if array is None or isinstance(array, Mapping):
        raise ParameterError(f"a map is an array, a path or an OccupancySnapshot, not {type(array).__name__}")
    if resolution_m is None:
        raise ParameterError("an array does not say how large its cells are; give resolution_m in meters")
    try:
        # A mask is kept: what it hides is unknown to the snapshot.
        cells = array if isinstance(array, np.ma.MaskedArray) else np.asarray(array)
    except ValueError as error:
        raise InvalidMapError("all rows of a map must have the same number of cells") from error
    geometry = GridGeometry(resolution_m, (0.0, 0.0), 0.0, "map", cells.shape)
    if cells.dtype.kind in "iu":
        if isinstance(cells, np.ma.MaskedArray):
            cells = np.ma.filled(cells.astype(np.int64), UNKNOWN)
        cells = stored_bytes(cells)
        cells = reading_of([cells], occupancy, "array").percent_of(cells)
    return OccupancySnapshot(0, 0, 0, "array", cells, geometry, is_percent=True, read_by=occupancy)


def with_maps(given: Parameters, maps: LogReader | Iterable[OccupancySnapshot]) -> Parameters:
    """Take over the parameters that maps were read by, as far as these are known without reading one.

    Raises
    ------
    ParameterError
        If others were given.
    """
    if isinstance(maps, LogReader):
        return _with_reader(given, maps)
    if isinstance(maps, Sequence) and len(maps) and isinstance(maps[0], OccupancySnapshot):
        return with_snapshot(given, maps[0])
    return given


def _with_reader(given: Parameters, reader: LogReader) -> Parameters:
    where = f"{reader.info.path} is open already"
    read_by, names = reader.parameters, ("reading", "mapping", "occupancy")
    blocks: Any = {name: _taken_over(getattr(given, name), getattr(read_by, name), where) for name in names}
    return dataclasses.replace(given, **blocks)


def with_snapshot(given: Parameters, snapshot: OccupancySnapshot) -> Parameters:
    """Take over the parameters that the cells of a map were read by, if a reader made it.

    Raises
    ------
    ParameterError
        If others were given, or it is percent but the parameters name other numbers.
    """
    where = f"map {snapshot.index} of {snapshot.topic} was read already"
    if snapshot.read_by is not None:
        return dataclasses.replace(given, occupancy=_taken_over(given.occupancy, snapshot.read_by, where))
    if snapshot.is_percent and given.occupancy.values in READINGS:
        raise ParameterError(
            f"occupancy.values={given.occupancy.values!r}: map {snapshot.index} of {snapshot.topic} says "
            "that its cells are percent; make it without is_percent=True"
        )
    return given


def _taken_over(given: Block, read_by: Block, where: str) -> Block:
    """Return a block of parameters that maps were read by, with those of the analysis as they are given."""
    changed = given.changed()
    others = [
        name for name, value in changed.items() if name not in OF_ANALYSIS and value != getattr(read_by, name)
    ]
    if others:
        name = others[-1]  # a threshold, rather than the values that it implies
        raise ParameterError(
            f"{given.block}.{name}={changed[name]!r}: {where}, by {getattr(read_by, name)!r}; give this "
            "parameter to open_log or read_map, or give the path in place of what was read"
        )
    return dataclasses.replace(read_by, **changed)  # type: ignore[type-var]


def read_alike(
    maps: Iterable[OccupancySnapshot], parameters: Parameters
) -> tuple[Iterator[OccupancySnapshot], float | None]:
    """Read the numbers of all maps alike.

    Returns
    -------
    maps : iterator of OccupancySnapshot
        In percent.
    final_free_m2 : float or None
        Known free area of the last one in square meters; None if it is not known in advance.
    """
    check, occupancy = partial(_checked, parameters=parameters), parameters.occupancy
    if not isinstance(maps, Sequence) or not len(maps):
        return _as_first_says(map(check, maps), occupancy), None
    some = np.unique(np.linspace(0, len(maps) - 1, MAPS_LOOKED_AT).round().astype(int)).tolist()
    reading = decided_reading([check(maps[k]) for k in some], occupancy)
    final_m2 = free_area_m2(in_percent(maps[-1], reading, occupancy), occupancy)
    return (in_percent(check(each), reading, occupancy) for each in maps), final_m2


def _checked(given: OccupancySnapshot, parameters: Parameters) -> OccupancySnapshot:
    """Return a map that is to be tracked, if it is one and was not read by other parameters."""
    if not isinstance(given, OccupancySnapshot):
        raise ParameterError(
            f"only maps of the type OccupancySnapshot can be tracked, not {type(given).__name__}"
        )
    with_snapshot(parameters, given)
    return given


def _as_first_says(
    maps: Iterable[OccupancySnapshot], occupancy: OccupancyParameters
) -> Iterator[OccupancySnapshot]:
    """Read the numbers of all maps as the first that knows enough says."""
    reading = None
    for each in maps:
        if reading is None and np.count_nonzero(each.cells != UNKNOWN) >= LEAST_CELLS:
            reading = decided_reading([each], occupancy)
        yield in_percent(each, reading, occupancy)


def decided_reading(maps: Sequence[OccupancySnapshot], occupancy: OccupancyParameters) -> CellReading | None:
    """What the numbers of maps mean; None if a reader has decided it already."""
    undecided = [each.cells for each in maps if not each.is_percent]
    return reading_of(undecided, occupancy, maps[0].topic) if undecided else None


def in_percent(
    snapshot: OccupancySnapshot, reading: CellReading | None, occupancy: OccupancyParameters
) -> OccupancySnapshot:
    """Return a map whose cells are in percent, as a reading by parameters says; as it is if they are."""
    if reading is None or reading.table is None or snapshot.is_percent:
        return snapshot
    cells = reading.percent_of(snapshot.cells)
    return dataclasses.replace(snapshot, cells=cells, is_percent=True, read_by=occupancy)
