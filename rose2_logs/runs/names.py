"""Names of rooms brought to where the rooms of a run are."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely

from rose2_logs.comparison.placement import PlacedMap, fits, is_ambiguous
from rose2_logs.comparison.reference_plan import place_outlines
from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.errors import ParameterError
from rose2_logs.io.room_names import is_plan, read_room_names
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.model.room_names import RoomNames
from rose2_logs.system.text import listed
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

TOLD_MOST = 5
"""Names that are told in one line."""


def names_in(
    last: OccupancySnapshot, path: Path, parameters: Parameters, occupancy: OccupancyParameters
) -> RoomNames:
    """Read names of rooms; a plan of outlines is laid over the last map of a run.

    Parameters
    ----------
    last : OccupancySnapshot
        The last map.
    path : path
        The file, see `read_room_names`.
    parameters : Parameters
        For laying a plan over the map.
    occupancy : OccupancyParameters
        Which cells are walls.

    Raises
    ------
    ParameterError
        If the names cannot be read, or the plan does not fit.
    """
    names = read_room_names(path)
    if not is_plan(path):
        return names
    placement = place_outlines(names.places, PlacedMap(last, occupancy, parameters))
    if placement is None or not fits(placement, parameters.comparison):
        raise ParameterError(
            f"{path}: its outlines do not fit the walls of the last map; give points in a table instead"
        )
    if is_ambiguous(placement, parameters.comparison):
        text = (
            f"{path}: its outlines fit the last map about as well in another way, as in a building that "
            "looks the same turned by half a circle: the names may be those of other rooms; points in a "
            "table are sure"
        )
        log_warning(logger, "ambiguous_plan", text, file=path)
    moved = shapely.transform(np.array(names.places, object), placement.motion.points)
    return dataclasses.replace(names, places=tuple(moved.tolist()))


def tell_unused(path: Path, unused: Sequence[str]) -> None:
    """Warn of names that no room has, if there are any."""
    if unused:
        shown = listed([repr(name) for name in unused], TOLD_MOST)
        text = f"{path}: no room has these names: {shown}"
        log_warning(logger, "unused_names", text, file=path)
