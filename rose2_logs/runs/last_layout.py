"""The last layout of a stored run, as comparisons take it."""

from __future__ import annotations

import numpy as np

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.comparison.placement import PlacedMap
from rose2_logs.config.parameters import Parameters
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.runs.run import Run


def read_final_layout(run: Run, name: str | None = None, parameters: Parameters | None = None) -> FinalLayout:
    """Take the last layout of a stored run, called by the run's name unless another is given.

    Raises
    ------
    ResultsError
        If a file of the results cannot be read.
    """
    last = run.choose()
    below, _ = run.map(last)
    snapshot = OccupancySnapshot(last, 0, 0, "", below.cells, below.geometry)
    rooms = run.table("rooms", ["track", "area_m2", "polygon_wkb"], last).to_pylist()
    return FinalLayout(
        name=name or run.name,
        map=PlacedMap(snapshot, below.occupancy, parameters),
        tracks=tuple(row["track"] for row in rooms),
        shapes=tuple(run.shapes("rooms", [row["polygon_wkb"] for row in rooms])),
        areas_m2=np.array([row["area_m2"] for row in rooms], float),
        walls=run.found_walls(last),
        names=run.names,
    )
