"""Maps on one topic that do not grow from each other: of publishers in turn, or of a map that was begun anew.

Rooms can only be followed through maps that grow from each other. Parts that follow one another in a log are
parts of one run, each with its own coverage and tracks; of publishers in turn, and of saved maps that are of
several runs, one part is read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.config.selection import Times
from rose2_logs.io.grids import Grid
from rose2_logs.model.occupancy import GridGeometry, classify
from rose2_logs.system.text import counted

LOOKED_AT = 64
"""Maps, evenly spread, that are looked at: where a map is begun anew, all maps around are looked at, too."""
LEAST_RETURNS = 2
"""Times that the maps come back to a grid they had left, from which on they are of several publishers."""
ANOTHER_SHARE = 0.1
"""Maps of two publishers differ by more than this share of their free area, most times. A mapping node that
crops its map to what is known goes back and forth between two grids, too, but not between two areas."""
FALLEN_SHARE = 0.5
"""A map is begun anew if it has less than this share of the free area of the one before. Loop closures and
corrections of a map change a few percent."""
BACK_SHARE = 0.8
"""A map that has this share again one map later was a bad map, and none that was begun anew."""
LEAST_AREA_M2 = 5.0
"""Smaller maps are no loss."""

WALL_REACH_M = 0.2
"""Walls of two maps of one run are no farther apart: two widths of a wall."""
SAME_WALLS_SHARE = 0.5
"""Share of a map's walls that are walls in the next map of its run, too: after loop closures it is 80 %, of a
mask it is 3 %. Floors of one building share so many that only their names tell."""
KEPT_SHARE = 0.8
"""Share of a map's free area that the next map of its run has at least."""
FLOOR = re.compile(
    r"(floor|level|stor(e?)y|etage|building|bldg)[ _-]*[a-z0-9]+|[0-9]+(st|nd|rd|th)[ _-]*floor"
)
"""What names of maps tell of floors."""
LEAST_WALL_CELLS = 100
"""Walls that two maps show, 5 m of 5 cm, below which they are not compared."""


@dataclass(frozen=True)
class MapFacts:
    """What is compared of a map: its grid, and its free area in square meters."""

    geometry: GridGeometry
    free_m2: float


@dataclass(frozen=True, eq=False)
class Part:
    """Maps that grow from each other.

    Attributes
    ----------
    times : (N,) int64
        Their log times.
    free_m2 : float
        Free area of the last of them that was looked at, square meters.
    maps : int
        How many of those that were looked at have a free area of their own.
    """

    times: Times
    free_m2: float
    maps: int


Facts = Callable[[int], MapFacts | None]
"""What is known of a map, by its log time or by its place among the maps; None if it cannot be read."""


@dataclass(frozen=True)
class Parts:
    """The parts of a topic in the order of their first maps, and why there are several.

    Attributes
    ----------
    parts : tuple of Part
    why : str
        What shows that there are several.
    is_one_run : bool
        Whether they follow one another in one log, so that they are parts of one run.
    """

    parts: tuple[Part, ...]
    why: str = ""
    is_one_run: bool = False

    def likeliest(self) -> int:
        """Return the number, from 1, of the part with most maps that differ, then most free area."""
        places = range(len(self.parts))
        key = [(each.maps, each.free_m2) for each in self.parts]
        return max(places, key=lambda place: (*key[place], place)) + 1

    def text(self, number: int | None) -> str:
        """Return what is told of the choice of one part, or of all."""
        sizes = ", ".join(
            f"{place} of {counted(len(each.times), 'map')} ({each.free_m2:.0f} m2 free at its end)"
            for place, each in enumerate(self.parts, start=1)
        )
        done = "each has its own coverage and tracks" if number is None else f"part {number} is analyzed"
        return f"{self.why}, so that there are {len(self.parts)} parts: {sizes}; {done}"


def find_parts(times: Times, look: Facts) -> Parts:
    """Find which maps of a topic belong together.

    Parameters
    ----------
    times : (N,) int64
        Log times of the maps, ascending, each once.
    look : callable
        Returns what is known of the map of a time.
    """
    if len(times) < 2:
        return Parts((Part(times, 0.0, len(times)),))
    seen: dict[int, MapFacts | None] = {}

    def facts(place: int) -> MapFacts | None:
        if place not in seen:
            seen[place] = look(int(times[place]))
        return seen[place]

    if publishers := _publishers(min(len(times), LOOKED_AT), facts):
        grids = [(found := facts(place)) and _grid(found.geometry) for place in range(len(times))]
        parts = [
            _part(times, [place for place, grid in enumerate(grids) if grid == publisher], facts)
            for publisher in publishers
        ]
        return Parts(tuple(parts), "maps of several grids come in turn, as of several publishers")
    spread = np.unique(np.linspace(0, len(times) - 1, LOOKED_AT).round().astype(int)).tolist()
    begins = [0, *_begins(spread, facts), len(times)]
    parts = [_part(times, range(low, high), facts, spread) for low, high in pairwise(begins)]
    return Parts(tuple(parts), "the map is begun anew" if len(parts) > 1 else "", is_one_run=True)


def facts_of(grid: Grid, occupancy: OccupancyParameters) -> MapFacts:
    """Return what is compared of a map in percent."""
    free, _ = classify(grid.cells, occupancy)
    return MapFacts(grid.geometry, float(np.count_nonzero(free)) * grid.geometry.cell_area_m2)


def find_saved_parts(
    names: Sequence[str],
    times: Times,
    read: Callable[[int], Grid | None],
    occupancy: OccupancyParameters,
) -> Parts:
    """Find which saved maps are of one run.

    Names that tell of different floors part them; so do walls that do not stand where those of the map before
    do, and free cells that are lost.

    Parameters
    ----------
    names : sequence of str
        Of the maps.
    times : (N,) int64
        Their times.
    read : callable
        Returns the map of a time, in percent.
    occupancy : OccupancyParameters
        Which cells are free and occupied.
    """
    begins: list[int] = [0]
    areas: list[float] = []
    latest: tuple[Grid, float] | None = None
    for place, time_ns in enumerate(times.tolist()):
        now = read(time_ns)
        area_m2 = 0.0 if now is None else facts_of(now, occupancy).free_m2
        areas.append(area_m2)
        is_next = latest is None or _floor(names[place]) == _floor(names[place - 1])
        if now is not None and latest is not None and area_m2 >= LEAST_AREA_M2:
            before, before_m2 = latest
            is_next &= area_m2 >= KEPT_SHARE * before_m2 and _is_continued(before, now, occupancy)
        if not is_next:
            begins.append(place)
        # A bad map between others, without free cells, parts nothing.
        if now is not None and (area_m2 >= LEAST_AREA_M2 or not is_next):
            latest = now, area_m2
    parts = [
        Part(times[low:high], areas[high - 1], len(set(areas[low:high])))
        for low, high in pairwise([*begins, len(times)])
    ]
    return Parts(tuple(parts), "the maps are not of one run" if len(parts) > 1 else "")


def _floor(name: str) -> str:
    """What a name tells of floor or building, nothing if it tells nothing."""
    found = FLOOR.search(name.lower())
    return found[0] if found else ""


def _is_continued(before: Grid, now: Grid, occupancy: OccupancyParameters) -> bool:
    """Whether most walls of a map that another one shows are walls there, too; also if few are shown."""
    import cv2

    _, walls = classify(before.cells, occupancy)
    free, occupied = classify(now.cells, occupancy)
    row, column = np.moveaxis(
        now.geometry.world_to_cell(before.geometry.cell_centers(*np.nonzero(walls))), -1, 0
    )
    inside = (row >= 0) & (row < free.shape[0]) & (column >= 0) & (column < free.shape[1])
    row, column = row[inside], column[inside]
    reach = 2 * round(WALL_REACH_M / now.geometry.resolution_m) + 1
    near = cv2.dilate(occupied.astype(np.uint8), np.ones((reach, reach), np.uint8)).astype(bool)
    shown = near[row, column] | free[row, column]
    if np.count_nonzero(shown) < LEAST_WALL_CELLS:
        return True
    return bool(np.count_nonzero(near[row, column]) >= SAME_WALLS_SHARE * np.count_nonzero(shown))


def _grid(geometry: GridGeometry) -> GridGeometry:
    return replace(geometry, yaw_rad=round(geometry.yaw_rad, 6))


def _publishers(count: int, facts: Facts) -> list[GridGeometry]:
    """Grids between which the maps go back and forth; none if they do not."""
    order: list[GridGeometry] = []
    returns = switches = 0
    latest: MapFacts | None = None
    for place in range(count):
        if (found := facts(place)) is None:
            continue
        grid = _grid(found.geometry)
        if latest is not None and grid != _grid(latest.geometry):
            returns += grid in order
            low, high = sorted((latest.free_m2, found.free_m2))
            switches += 1 if high - low > ANOTHER_SHARE * high else -1
        if grid not in order:
            order.append(grid)
        latest = found
    return order if returns >= LEAST_RETURNS and 1 < len(order) <= returns + 1 and switches > 0 else []


def _begins(spread: Sequence[int], facts: Facts) -> list[int]:
    """Places of the maps that are begun anew."""
    begins = []
    for low, high in pairwise(spread):
        if not _has_fallen(facts(low), facts(high)):
            continue
        for place in range(low + 1, high + 1):
            if _has_fallen(facts(place - 1), facts(place)) and not _is_back(
                facts(place - 1), facts(place + 1) if place + 1 <= spread[-1] else None
            ):
                begins.append(place)
    return begins


def _has_fallen(before: MapFacts | None, now: MapFacts | None) -> bool:
    return (
        before is not None
        and now is not None
        and before.free_m2 >= LEAST_AREA_M2
        and now.free_m2 < FALLEN_SHARE * before.free_m2
    )


def _is_back(before: MapFacts | None, then: MapFacts | None) -> bool:
    return before is not None and then is not None and then.free_m2 >= BACK_SHARE * before.free_m2


def _part(
    times: Times,
    places: Sequence[int],
    facts: Facts,
    looked_at: Sequence[int] | None = None,
) -> Part:
    known = places if looked_at is None else sorted({*set(places).intersection(looked_at), places[-1]})
    areas = [found.free_m2 for place in known if (found := facts(place)) is not None]
    return Part(times[list(places)], areas[-1] if areas else 0.0, len(set(areas)))
