"""The baselines by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import Parameters
from rose2_logs.model.labels import LabelRuns, number_rooms
from rose2_logs.model.occupancy import BoolArray

Labels = NDArray[np.int32]

# Each is imported only when it is used: most runs need none of them, and their imports take time.


def _morphological(free: BoolArray, resolution_m: float, parameters: Parameters) -> Labels:
    from rose2_logs.segmentation.baselines.morphological import segment_morphological

    return segment_morphological(free, resolution_m, parameters.morphological)


def _distance(free: BoolArray, resolution_m: float, parameters: Parameters) -> Labels:
    from rose2_logs.segmentation.baselines.distance import segment_distance

    return segment_distance(free, resolution_m, parameters.distance)


def _voronoi(free: BoolArray, resolution_m: float, parameters: Parameters) -> Labels:
    from rose2_logs.segmentation.baselines.voronoi import segment_voronoi

    return segment_voronoi(free, resolution_m, parameters.voronoi, parameters.voronoi_merge)


BASELINES: dict[str, Callable[[BoolArray, float, Parameters], Labels]] = {
    "morphological": _morphological,
    "distance": _distance,
    "voronoi": _voronoi,
}
"""Segmentation of free cells, side of a cell and all parameters into labels, by the method's name."""


def segment_by_baseline(
    method: str, free: BoolArray, resolution_m: float, parameters: Parameters
) -> NDArray[np.int32]:
    """Segment free space by one of `BASELINES`.

    Parameters
    ----------
    method : str
    free : (H, W) bool
        The free cells; all others, unknown ones too, are obstacles.
    resolution_m : float
        Side of a cell.
    parameters : Parameters

    Returns
    -------
    labels : (H, W) int32
        Rooms 1.. by their first cell, 0 for none; so are free cells from which no room can be reached.
    """
    labels = BASELINES[method](free, resolution_m, parameters)
    runs = LabelRuns.of(labels)
    return runs.renumbered(number_rooms(runs, int(labels.max(initial=0)), 0.0, resolution_m))
