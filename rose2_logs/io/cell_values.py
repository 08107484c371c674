"""What the numbers in a run's cells mean: decided once, from the numbers that the run's maps hold.

Most maps say -1, 0 and 100. Others hold probabilities that a cell is occupied, -1, 0 and 1 as the definition
of the ROS 2 message says, 50 where nothing is known, or the costs of a costmap. Each is turned into percent
that map_server's thresholds tell apart, so that everything behind the reader sees one kind of map.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.errors import InvalidMapError
from rose2_logs.io.grids import Cells, Grid, MapWarning, Patch, percent
from rose2_logs.model.explored import is_scattered, sides_per_cell
from rose2_logs.model.labels import COUNTED_AT_ONCE, label_sizes
from rose2_logs.model.occupancy import HIGHEST_PERCENT, UNKNOWN, OccupancySnapshot, classify
from rose2_logs.system.text import percent as as_percent
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

Counts = NDArray[np.int64]
"""Number of cells (256,) by the byte that they are stored as; 255 is -1."""
Message = TypeVar("Message", bound=Grid | Patch)

USUAL = OccupancyParameters()
FREE_BELOW, OCCUPIED_ABOVE = USUAL.free_max_percent, USUAL.occupied_min_percent
UNKNOWN_BYTE = 255
HALF = 50
"""Percent at which nothing speaks for free or for occupied."""
HALVES = (HALF, HALF - 1, HALF + 1)
"""What 127 and 128 of 255 are in percent, as they are rounded."""
LETHAL_COST = 254
LEAST_CELLS = 1000
"""Known cells, 2.5 m2 of 5 cm, below which the numbers of the maps decide nothing."""
MAPS_LOOKED_AT = 5
"""Maps, evenly spread over the run, whose numbers decide: the first, the last and some between."""
UNSURE_SHARE = 0.2
"""Where more of the cells below one half lie above the usual threshold of free ones, it does not fit: a tenth
does in maps of probabilities whose rooms are right, none in maps of two values; costmaps, in which many do,
are known by their own numbers. The same of the cells above one half and the threshold of occupied ones."""
WALL_SHARE = 0.01
"""Known cells that are walls at least: 4 to 10 % are, in the maps of buildings that were looked at."""
WALLS_AT_MOST = 1 / 3
"""Known cells above one half at most, if these are walls: a map with more is noise, or of no building."""
FAINT_RATIO = 2
"""Walls are faint where so many times more cells lie between the thresholds than above the upper one: up to
once in saved maps whose walls are clear, 18 times in one whose walls are not."""
SPIKE_RATIO = 5
"""A number stands for something of its own if it comes so many times as often as its two neighbors."""
UNKNOWN_SHARE = 0.01
"""Cells that are unknown, at least, if one number stands for it: 4 % are, with two around a building."""
BORDER_WALL_SHARE = 0.05
"""Where less of the border of the free cells is wall, the map tells no rooms."""
RAY_CELLS = 2
"""Free cells that are nowhere wider are rays of a scan."""
NARROW_M = 0.4
"""Where the free cells are narrower on average, no robot got anywhere: the floor of buildings is 1 m or more
wide between walls and furniture, walls are 0.1 to 0.3 m thick."""
BORDER_LEAST_SIDES = 200
"""Cell sides, 10 m of 5 cm, below which the border of the free cells says nothing."""


@dataclass(frozen=True, eq=False)
class CellReading:
    """How the numbers in the cells of a run are turned into percent.

    Attributes
    ----------
    name : str
        What they are.
    table : (256,) int8 or None
        Percent, -1 for unknown, of each byte; None leaves -1..100 as they are.
    free_below, occupied_above : float
        Stored numbers below and above which cells are free and occupied.
    why : str
        What is told of it: one line; empty where the numbers are the usual ones or were said to be these.
    """

    name: str
    table: Cells | None = None
    free_below: float = FREE_BELOW
    occupied_above: float = OCCUPIED_ABOVE
    why: str = ""

    def of(self, message: Message) -> Message:
        """Return a map or a patch, whose cells are as they are stored, in percent."""
        if self.table is OCCUPANCY_OF_COST:
            return replace(message, cells=OCCUPANCY_OF_COST[message.cells.view(np.uint8)])
        found: list[MapWarning] = []
        cells = percent(message.cells, found)
        if self.table is not None:
            cells = self.table[cells.view(np.uint8)]
        if cells is message.cells:
            return message
        return replace(message, cells=cells, map_warnings=(*message.map_warnings, *found))

    def percent_of(self, cells: Cells) -> Cells:
        """Return cells (H, W), each as the byte that it was stored as, in percent."""
        return cells if self.table is None else self.table[cells.view(np.uint8)]

    def as_json(self) -> dict[str, str | float]:
        """Return name and thresholds."""
        return {
            "values": self.name,
            "free_below": self.free_below,
            "occupied_above": self.occupied_above,
        }


STORED = CellReading("percent")
"""Percent as they are stored."""


def _bytes() -> Cells:
    """Percent of each byte as it is stored: -1, 0..100; all others are unknown."""
    table = np.full(256, UNKNOWN, np.int8)
    table[: HIGHEST_PERCENT + 1] = np.arange(HIGHEST_PERCENT + 1)
    return table


def _zero_one_table() -> Cells:
    table = np.full(256, UNKNOWN, np.int8)
    table[:2] = 0, HIGHEST_PERCENT
    return table


def _without(table: Cells, number: int) -> Cells:
    """The same with one number that is unknown."""
    table = table.copy()
    table[number] = UNKNOWN
    return table


def _cost_table() -> Cells:
    table = np.empty(256, np.int8)
    table[0], table[253], table[LETHAL_COST], table[UNKNOWN_BYTE] = 0, 99, HIGHEST_PERCENT, UNKNOWN
    table[1:253] = 1 + (97 * (np.arange(1, 253) - 1)) // 251
    return table


OCCUPANCY_OF_COST = _cost_table()
"""Occupancy per cost: 0 free, 1..252 to 1..98, 253 (inscribed) 99, 254 (lethal) 100, 255 unknown. nav2
publishes its costmaps as occupancy grids by the same table."""
OVERRULED = "the parameter occupancy.values=stored reads them as they are"
"""Ends what is told of a decision."""
READINGS = {
    "zero_one": CellReading(
        "0 and 1",
        _zero_one_table(),
        0.5,
        0.5,
        "the cells are 0 and 1, not percent: 0 is read as free, 1 as occupied",
    ),
    "fifty_unknown": CellReading(
        "percent, 50 is unknown",
        _without(_bytes(), HALF),
        why="no cell is -1 and many are 50: these are read as unknown",
    ),
    "costs": CellReading(
        "costs",
        OCCUPANCY_OF_COST,
        float(np.count_nonzero(OCCUPANCY_OF_COST[:253] < FREE_BELOW)),
        float(np.flatnonzero(OCCUPANCY_OF_COST > OCCUPIED_ABOVE)[0] - 1),
        "the cells are costs from 0 to 255, not percent: 254 is read as occupied, 255 as unknown",
    ),
}
"""Readings that have a name among `CELL_VALUES`."""


def read_as(parameters: OccupancyParameters) -> CellReading:
    """Return the reading that parameters, whose `values` are not ``auto``, ask for."""
    if parameters.values in READINGS:
        return replace(READINGS[parameters.values], why="")
    return replace(
        STORED, free_below=parameters.free_max_percent, occupied_above=parameters.occupied_min_percent
    )


def count_values(cells: Cells) -> Counts:
    """Count the cells (H, W) by the byte that they are stored as."""
    flat = cells.reshape(-1).view(np.uint8)
    counts = np.zeros(UNKNOWN_BYTE + 1, np.int64)
    for begin in range(0, flat.size, COUNTED_AT_ONCE):
        part = flat[begin : begin + COUNTED_AT_ONCE]
        counts += label_sizes(part[part != UNKNOWN_BYTE], UNKNOWN_BYTE)  # of a large canvas few are known
    counts[UNKNOWN_BYTE] = flat.size - counts.sum()
    return counts


def decide(counts: Counts) -> CellReading:
    """Decide what the numbers in the cells of a run mean.

    Parameters
    ----------
    counts : (256,) int
        Cells of some of its maps, by the byte that they are stored as.

    Returns
    -------
    CellReading
        That of the usual percent where these fit, or where there are too few known cells to say.
    """
    known = counts.copy()
    known[UNKNOWN_BYTE] = 0
    total = int(known.sum())
    if total < LEAST_CELLS:
        return STORED
    lethal = known[LETHAL_COST]
    if max(WALL_SHARE * total, known[HIGHEST_PERCENT]) < lethal <= WALLS_AT_MOST * total:
        return READINGS["costs"]
    unknown = next((number for number in HALVES if _is_unknown(number, counts)), None)
    if unknown is not None:
        known[unknown] = 0
    if known[0] and known[1] and not known[2:].any():
        found = READINGS["zero_one"]
    else:
        found = _of_percent(known[: HIGHEST_PERCENT + 1])
    if unknown is None:
        return found
    why = f"no cell is -1 and many are {unknown}: these are read as unknown"
    return replace(
        found,
        name=f"{found.name}, {unknown} is unknown",
        table=_without(_bytes() if found.table is None else found.table, unknown),
        why=f"{why}; {found.why}" if found.why else why,
    )


def _is_unknown(number: int, counts: Counts) -> bool:
    """Whether a number stands for unknown: no cell is -1, and it comes far more often than its neighbors."""
    known = counts[:UNKNOWN_BYTE]
    return bool(
        counts[number] > UNKNOWN_SHARE * known.sum()
        and counts[number] > SPIKE_RATIO * (counts[number - 1] + counts[number + 1])
        and counts[UNKNOWN_BYTE] < UNKNOWN_SHARE * counts[number]
        and not _are_inflated_costs(known)
    )


def _of_percent(known: Counts) -> CellReading:
    """Decide the thresholds of percent, by the number (101,) of cells with each."""
    total = int(known.sum())
    free = int(known[: int(FREE_BELOW) + 1].sum())
    below_half = int(known[:HALF].sum())
    walls = int(known[int(OCCUPIED_ABOVE) + 1 :].sum())
    if total < LEAST_CELLS or _are_inflated_costs(known):
        return STORED
    free_below, occupied_above = FREE_BELOW, OCCUPIED_ABOVE
    above_half = total - below_half
    between = known.copy()
    between[: int(FREE_BELOW) + 1] = between[int(OCCUPIED_ABOVE) + 1 :] = 0
    count = int(between.sum())
    if below_half - free > UNSURE_SHARE * below_half and WALL_SHARE <= above_half / total <= WALLS_AT_MOST:
        free_below = float(HALF)
        if above_half - walls > UNSURE_SHARE * above_half:
            occupied_above = float(HALF)
    elif count > FAINT_RATIO * walls and WALL_SHARE <= count / total <= WALLS_AT_MOST:
        mean = float(between @ np.arange(len(between))) / count
        occupied_above = float(np.floor((FREE_BELOW + mean) / 2))
    else:
        return STORED
    what = "probabilities" if free_below != FREE_BELOW else "percent with faint walls"
    share = as_percent(count / total)
    why = (
        f"the cells hold {what}, {share} of the known ones between the usual thresholds of {FREE_BELOW:g} "
        f"and {OCCUPIED_ABOVE:g}: below {free_below:g} is read as free, above {occupied_above:g} as occupied"
    )
    return CellReading(what, _threshold_table(free_below, occupied_above), free_below, occupied_above, why)


def _are_inflated_costs(known: Counts) -> bool:
    """Whether percent come from a costmap: next to obstacles it is 99, and falls off from there by a jump."""
    inscribed, lethal, below = known[99], known[HIGHEST_PERCENT], known[95:99]
    return bool(lethal and inscribed > SPIKE_RATIO * max(below.max(), 1) and SPIKE_RATIO * inscribed > lethal)


def _threshold_table(free_below: float, occupied_above: float) -> Cells:
    """Percent that the usual thresholds tell apart as these do the stored ones; order is kept."""
    table = _bytes()
    stored = np.arange(HIGHEST_PERCENT + 1)
    free, occupied = stored < free_below, stored > occupied_above
    between = ~free & ~occupied
    for which, low, high in (
        (free, 0, int(FREE_BELOW)),
        (between, int(FREE_BELOW) + 1, int(OCCUPIED_ABOVE)),
        (occupied, int(OCCUPIED_ABOVE) + 1, HIGHEST_PERCENT),
    ):
        table[:101][which] = np.round(np.linspace(low, high, np.count_nonzero(which)))
    return table


def oddity(snapshot: OccupancySnapshot, parameters: OccupancyParameters) -> tuple[str, str] | None:
    """Say why the rooms of a map mean little: kind of the warning and its text; None where nothing is odd."""
    free, occupied = classify(snapshot.cells, parameters)
    if not free.any() and bool((snapshot.cells != UNKNOWN).any()):
        return "nothing_free", (
            "none of its cells is free, so it has no rooms; if free cells hold higher values, raise the "
            "parameter occupancy.free_max_percent"
        )
    if np.count_nonzero(free) >= BORDER_LEAST_SIDES and is_scattered(free):
        return "no_building", (
            f"its free cells have {sides_per_cell(free):.1f} sides each to cells that are not free, where "
            "the floor of a building has 0.1: this is noise, or a picture of something else, and no map of a "
            "building"
        )
    if np.count_nonzero(occupied) > np.count_nonzero(free) >= BORDER_LEAST_SIDES:
        width_m = 2 * snapshot.geometry.resolution_m / max(sides_per_cell(free), 1e-9)
        if width_m < NARROW_M:
            return "swapped", (
                f"most of its known cells are occupied, and its free ones are lines {width_m:.2f} m wide, as "
                "walls are: free and occupied seem to be swapped, and its rooms mean nothing; negate in the "
                "description of a saved map swaps them"
            )
    text = few_walls(snapshot, parameters)
    return None if text is None else ("few_walls", text)


def reading_of(
    maps: Iterable[Cells],
    parameters: OccupancyParameters,
    name: str,
    *,
    file: Path | None = None,
    topic: str | None = None,
) -> CellReading:
    """Decide what the numbers of the maps of a run mean, by one rule for all of them, and tell it.

    Parameters
    ----------
    maps : iterable of (H, W) int8
        Some maps of the run, as they are stored; not looked at where the parameters decide.
    parameters : OccupancyParameters
        Thresholds that are named there win.
    name : str
        What the maps are called in what is told.
    file, topic : optional
        Of the warning.
    """
    if parameters.values != "auto":
        return read_as(parameters)
    counts = np.zeros(UNKNOWN_BYTE + 1, np.int64)
    for cells in maps:
        counts += count_values(cells)
    found = decide(counts)
    if found.why:
        log_warning(logger, "values", f"{name}: {found.why}; {OVERRULED}", file=file, topic=topic)
    return found


def stored_bytes(values: NDArray[np.integer]) -> Cells:
    """Return integers of an array as the bytes that a map would store them as; -1 is that of unknown.

    The cells of a ROS message as unsigned bytes have 255 for it. In an image of two grays that is free floor.

    Raises
    ------
    InvalidMapError
        If they are neither percent nor the costs of a costmap, whose highest ones are few.
    """
    low, high = (int(values.min()), int(values.max())) if values.size else (0, 0)
    if low < UNKNOWN or high > UNKNOWN_BYTE:
        raise InvalidMapError(
            f"cells must lie between {UNKNOWN} and {HIGHEST_PERCENT}, not from {low} to {high}"
        )
    cells = values.astype(np.uint8).view(np.int8)
    if high > HIGHEST_PERCENT:
        counts = count_values(cells)
        if counts[1 : HIGHEST_PERCENT + 1].any() and not counts[HIGHEST_PERCENT + 1 : UNKNOWN_BYTE].any():
            return cells
        # Where more is 254 than 0, it is an image in which that is the gray of free floor.
        if decide(counts).table is not OCCUPANCY_OF_COST or counts[LETHAL_COST] > counts[0]:
            raise InvalidMapError(
                f"cells must lie between {UNKNOWN} and {HIGHEST_PERCENT}, not from {low} to {high}; "
                "of an image of grays, save it and give its path"
            )
    return cells


def few_walls(snapshot: OccupancySnapshot, parameters: OccupancyParameters) -> str | None:
    """Say that hardly any of the border of a map's free cells is wall; None where enough of it is.

    Rays through windows and doors, which have long borders and no walls, are left out. In costmaps the cells
    around walls are neither, and nothing is said of these.
    """
    if _are_inflated_costs(count_values(snapshot.cells)):
        return None
    import cv2

    free, occupied = classify(snapshot.cells, parameters)
    wider = np.ones((RAY_CELLS + 1, RAY_CELLS + 1), np.uint8)
    free = cv2.morphologyEx(free.view(np.uint8), cv2.MORPH_OPEN, wider).view(bool)
    walls = sides = 0
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        sides += int(np.count_nonzero(free[one] != free[other]))
        walls += int(np.count_nonzero(free[one] & occupied[other]))
        walls += int(np.count_nonzero(occupied[one] & free[other]))
    sides += sum(
        int(np.count_nonzero(free[edge])) for edge in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1])
    )
    if sides < BORDER_LEAST_SIDES or walls >= BORDER_WALL_SHARE * sides:
        return None
    return (
        f"only {as_percent(walls / sides)} of the border of its free cells is wall: rooms cannot be told "
        "apart; if walls are there but fainter, lower the parameter occupancy.occupied_min_percent"
    )
