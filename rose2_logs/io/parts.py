"""Maps on one topic that do not grow from each other: of publishers in turn, or of a map begun anew.

Rooms can only be followed through maps that grow from each other. Parts that follow one another in a log are
parts of one run, each with its own coverage and tracks; of publishers in turn, and of saved maps that are of
several runs, one part is read.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.config.selection import Times
from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.io.grids import Grid
from rose2_logs.model.occupancy import UNKNOWN, BoolArray, FloatArray, GridGeometry, classify
from rose2_logs.system.text import counted, listed

LOOKED_AT = 64
"""Maps, evenly spread, that are looked at: where a map is begun anew, all maps around are looked at, too."""
LEAST_RETURNS = 2
"""Times that the maps come back to a publisher, or to a grid, that they had left, from which on they are of
several publishers."""
LEAST_TURNS = 3
"""The same of buildings on one grid: a map that is begun anew, and grows again, may look like two turns."""
ANOTHER_SHARE = 0.1
"""Maps of two publishers differ by more than this share of their free area, most times. A mapping node that
crops its map to what is known goes back and forth between two grids, too, but not between two areas."""
FALLEN_SHARE = 0.5
"""A map is begun anew if it has less than this share of the free area of the one before, or knows less of its
floor. Loop closures and corrections of a map change a few percent."""
BACK_SHARE = 0.8
"""A map that has this share again one map later was a bad map, and none that was begun anew. The map of a
publisher has this share of its free area again when its turn comes; a map begun anew on its grid has not."""
LEAST_AREA_M2 = 5.0
"""Smaller maps are no loss."""

WALL_REACH_M = 0.2
"""Walls of two maps of one run are no farther apart: two widths of a wall."""
SAME_WALLS_SHARE = 0.5
"""Share of a map's walls that are walls in the next map of its run, too: after loop closures it is 80 %, of a
mask it is 3 %. Floors of one building share so many that only their names tell."""
TURN_WALLS_SHARE = 0.8
"""The same where buildings come in turn: of one that the log comes back to, nearly all walls are there."""
ALIKE_SHARE = 0.1
"""A map shows this share more of the walls of the map before the last than of those of the last one where two
publishers with much the same building take turns. In a run it is below 2 %, but where a map was bad."""
LEAST_ALIKE = 0.25
"""Share of such maps from which on it is told: a door may open and close a few times."""
KEPT_SHARE = 0.8
"""Share of a map's free area that the next map of its run has at least."""
FLOOR = re.compile(
    r"(floor|level|stor(e?)y|etage|building|bldg)[ _-]*[a-z0-9]+|[0-9]+(st|nd|rd|th)[ _-]*floor"
)
"""What names of maps tell of floors."""
ALIKE = (
    "{} of its first {} maps show the walls of the map before the last rather than those of the last one, "
    "as if two nodes published much the same building in turn; they are not told apart"
)
LEAST_WALL_CELLS = 100
"""Walls that two maps show, 5 m of 5 cm, below which they are not compared."""
MOST_COMPARED = 2000
"""Cells of walls and of the floor, evenly taken, that are enough to compare."""
MOST_LISTED = 4
"""Parts, and publishers, that a line names; `summary.json` has all of them."""
MOST_STEPS = 4
"""Cells between a wall and the end of `WALL_REACH_M`, of 5 cm, of which each is looked at."""


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


@dataclass(frozen=True)
class Parts:
    """The parts of a topic in the order of their first maps, and why there are several.

    Attributes
    ----------
    parts : tuple of Part
    why : str
        What shows that there are several; of one part, what looks as if there were.
    is_one_run : bool
        Whether they follow one another in one log, so that they are parts of one run.
    """

    parts: tuple[Part, ...]
    why: str = ""
    is_one_run: bool = False

    def with_patches(self, times: Times) -> Parts:
        """Give each of several parts that follow one another all times (N,) from its first map on."""
        begins = [0, *(int(np.searchsorted(times, part.times[0])) for part in self.parts[1:]), len(times)]
        parts = (
            replace(part, times=times[low:high])
            for part, (low, high) in zip(self.parts, pairwise(begins), strict=True)
        )
        return replace(self, parts=tuple(parts))

    def text(self, number: int | None, in_range: Mapping[int, Part]) -> str:
        """Return what is told of the choice of one part, or of all, among the numbered ones in the range."""
        sizes = [
            f"{place} of {counted(len(each.times), 'map')} ({each.free_m2:.0f} m2 free at its end)"
            for place, each in in_range.items()
        ]
        done = "each has its own coverage and tracks" if number is None else f"part {number} is analyzed"
        some = f", {len(in_range)} of them in the time range" if len(in_range) < len(self.parts) else ""
        named = f"{len(self.parts)} parts{some}: {listed(sizes, MOST_LISTED)}"
        return f"{self.why}, so that there are {named}; {done}"


def likeliest(parts: Mapping[int, Part]) -> int:
    """Return the number of the part with most maps that differ, then most free area, then the last."""
    return max(parts, key=lambda number: (parts[number].maps, parts[number].free_m2, number))


class _Maps:
    """What is known of the maps of a topic, by their places; each is read as often as another one is between.

    Parameters
    ----------
    times : (N,) int64
        Their log times.
    read : callable
        Returns the map of a time, in percent; None if it cannot be read.
    occupancy : OccupancyParameters
        Which cells are free and occupied.
    """

    def __init__(
        self, times: Times, read: Callable[[int], Grid | None], occupancy: OccupancyParameters
    ) -> None:
        self._times, self._read, self._occupancy = times, read, occupancy
        self._facts: dict[int, MapFacts | None] = {}
        self._walls_kept: dict[tuple[int, int], float] = {}
        self._has_moved: dict[tuple[int, int], bool] = {}
        self._held: deque[tuple[int, _Seen]] = deque(maxlen=2)

    def facts(self, place: int) -> MapFacts | None:
        """Return what is known of a map; None if it cannot be read."""
        if place not in self._facts:
            self._look(place)
        return self._facts[place]

    def is_other(self, before: int, now: int, least_share: float) -> bool:
        """Whether a map has lost the floor of an earlier one, down to a share, or shows other walls."""
        then, there = self.facts(before), self.facts(now)
        if then is None or there is None or then.free_m2 < LEAST_AREA_M2:
            return False
        if there.free_m2 < least_share * then.free_m2:
            return True
        return self.walls_kept(before, now) < SAME_WALLS_SHARE and not self._is_moved(before, now)

    def walls_kept(self, before: int, now: int) -> float:
        """Share of the walls of an earlier map that a map shows where they were."""
        if (before, now) not in self._walls_kept:
            self._look(before)
            self._look(now)
        return self._walls_kept[before, now]

    def like_before_last(self) -> int:
        """How many maps show the walls of the map before the last, and fewer of those of the last one."""
        kept = self._walls_kept
        return sum(
            kept[pair] - kept.get((pair[0] + 1, pair[1]), 1.0) >= ALIKE_SHARE
            for pair in kept
            if pair[1] == pair[0] + 2
        )

    def _is_moved(self, before: int, now: int) -> bool:
        """Whether a map shows the walls of an earlier one, moved as a whole."""
        if (before, now) not in self._has_moved:
            then, there = (self._read(int(self._times[place])) for place in (before, now))
            if then is None or there is None:
                return False
            self._has_moved[before, now] = _has_moved(then, there, self._occupancy)
        return self._has_moved[before, now]

    def _look(self, place: int) -> None:
        """Read a map, and compare it with the one that was read before."""
        if self._held and place == self._held[-1][0]:
            return
        now = self._read(int(self._times[place]))
        if now is None:
            self._facts[place] = None
            return
        for before, held in reversed(self._held):
            kept = self._walls_kept[before, place] = _walls_kept(held, now, self._occupancy)
            if kept > 1 - ALIKE_SHARE:
                break  # of none it can show much more
        seen = _Seen.of(now, self._occupancy)
        self._held.append((place, seen))
        self._facts[place] = seen.facts


def find_parts(
    times: Times,
    read: Callable[[int], Grid | None],
    occupancy: OccupancyParameters,
    publishers: Sequence[str] | None = None,
) -> Parts:
    """Find which maps of a topic belong together.

    Parameters
    ----------
    times : (N,) int64
        Log times of the maps, ascending, each once.
    read : callable
        Returns the map of a time, in percent; None if it cannot be read.
    occupancy : OccupancyParameters
        Which cells are free and occupied.
    publishers : sequence of N str, optional
        Who published each of them; without, their grids tell.
    """
    if len(times) < 2:
        return Parts((Part(times, 0.0, len(times)),))
    maps = _Maps(times, read, occupancy)
    if publishers is not None and _returns(publishers) >= LEAST_RETURNS:
        names = list(dict.fromkeys(publishers))
        of_each = [[place for place, one in enumerate(publishers) if one == name] for name in names]
        parts = [_part(times, places, maps.facts, _spread(places)) for places in of_each]
        return Parts(tuple(parts), f"{listed(names, MOST_LISTED)} publish in turn")
    first, all_maps = range(min(len(times), LOOKED_AT)), range(len(times))
    if publishers is None and (grids_in_turn := _grids_in_turn(first, maps.facts)):
        grids = [_grid_of(place, maps.facts) for place in all_maps]
        of_each = [[place for place in all_maps if grids[place] == grid] for grid in grids_in_turn]
        parts = [_part(times, places, maps.facts) for places in of_each]
        return Parts(tuple(parts), "maps of several grids come in turn, as of several publishers")
    # Where the first maps come in turn, those of the whole log may not.
    begins_in_turn = publishers is None and bool(_buildings_in_turn(first, maps))
    if begins_in_turn and (of_each := _buildings_in_turn(all_maps, maps)):
        parts = [_part(times, places, maps.facts) for places in of_each]
        return Parts(tuple(parts), "maps of several buildings come in turn, as of several publishers")
    alike = maps.like_before_last()
    spread = _spread(range(len(times)))
    begins = [0, *_begins(spread, maps), len(times)]
    parts = [_part(times, range(low, high), maps.facts, spread) for low, high in pairwise(begins)]
    if len(parts) > 1:
        return Parts(tuple(parts), "the map is begun anew", is_one_run=True)
    is_mixed = alike >= max(LEAST_TURNS, LEAST_ALIKE * len(first))
    return Parts(tuple(parts), ALIKE.format(alike, len(first)) if is_mixed else "", is_one_run=True)


def _spread(places: Sequence[int]) -> list[int]:
    """At most `LOOKED_AT` of the places, evenly, the first and the last among them."""
    chosen = np.linspace(0, len(places) - 1, LOOKED_AT).round().astype(int).tolist()
    return [places[at] for at in dict.fromkeys(chosen)]


def _returns(publishers: Sequence[str]) -> int:
    """How often another publisher follows that has published before."""
    seen, returns = set(publishers[:1]), 0
    for before, now in pairwise(publishers):
        returns += now != before and now in seen
        seen.add(now)
    return returns


@dataclass(frozen=True, eq=False)
class _Seen:
    """A map as the next one is compared with it: its facts, and points (N, 2) of its floor and walls."""

    facts: MapFacts
    floor_m: FloatArray
    walls_m: FloatArray

    @classmethod
    def of(cls, grid: Grid, occupancy: OccupancyParameters) -> _Seen:
        """Look at a map in percent."""
        free, occupied = classify(grid.cells, occupancy)
        area_m2 = float(np.count_nonzero(free)) * grid.geometry.cell_area_m2
        floor_m, walls_m = (_some(cells, grid.geometry) for cells in (free, occupied))
        return cls(MapFacts(grid.geometry, area_m2), floor_m, walls_m)


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
    latest: _Seen | None = None
    for place, time_ns in enumerate(times.tolist()):
        now = read(time_ns)
        seen = None if now is None else _Seen.of(now, occupancy)
        area_m2 = 0.0 if seen is None else seen.facts.free_m2
        areas.append(area_m2)
        is_next = latest is None or _floor(names[place]) == _floor(names[place - 1])
        if now is not None and latest is not None and area_m2 >= LEAST_AREA_M2:
            is_kept = area_m2 >= KEPT_SHARE * latest.facts.free_m2
            is_next &= is_kept and _walls_kept(latest, now, occupancy) >= SAME_WALLS_SHARE
        if not is_next:
            begins.append(place)
        # A bad map between others, without free cells, parts nothing.
        if seen is not None and (area_m2 >= LEAST_AREA_M2 or not is_next):
            latest = seen
    parts = [
        Part(times[low:high], areas[high - 1], len(set(areas[low:high])))
        for low, high in pairwise([*begins, len(times)])
    ]
    return Parts(tuple(parts), "the maps are not of one run" if len(parts) > 1 else "")


def _floor(name: str) -> str:
    """What a name tells of floor or building, nothing if it tells nothing."""
    found = FLOOR.search(name.lower())
    return found[0] if found else ""


def _walls_kept(before: _Seen, now: Grid, occupancy: OccupancyParameters) -> float:
    """Share of the walls of another map that a map has; 0 if it does not know its floor, 1 without walls."""
    there = _around(now, np.concatenate([before.floor_m, before.walls_m]), 0.0)[:, 0]
    floor, walls = np.split(there, [len(before.floor_m)])
    if np.count_nonzero(floor != UNKNOWN) < FALLEN_SHARE * len(floor):
        return 0.0
    free, near = classify(walls, occupancy)
    # Most walls are where they were: only around the others is more to look at.
    away = np.flatnonzero(~near)
    near[away] = classify(_around(now, before.walls_m[away], WALL_REACH_M), occupancy)[1].any(axis=1)
    shown = near | free
    if np.count_nonzero(shown) < LEAST_WALL_CELLS:
        return 1.0
    return float(np.count_nonzero(near) / np.count_nonzero(shown))


def _some(cells: BoolArray, geometry: GridGeometry) -> FloatArray:
    """World centers (N, 2) of at most `MOST_COMPARED` cells (H, W), evenly taken."""
    places = np.flatnonzero(cells)
    if len(places) > MOST_COMPARED:
        places = places[np.linspace(0, len(places) - 1, MOST_COMPARED).astype(np.intp)]
    return geometry.cell_centers(*np.unravel_index(places, cells.shape))


def _around(grid: Grid, points_m: FloatArray, reach_m: float) -> NDArray[np.int8]:
    """Cells (N, K) of a map within reach of points (N, 2), its own in the middle; unknown outside the map."""
    reach = round(reach_m / grid.geometry.resolution_m)
    # Of finer cells not all are looked at: walls are thicker than they are.
    steps = np.linspace(-reach, reach, 2 * min(reach, MOST_STEPS) + 1).round().astype(np.intp)
    row, column = np.moveaxis(grid.geometry.world_to_cell(points_m), -1, 0)
    row, column = row[:, None, None] + steps[:, None], column[:, None, None] + steps
    height, width = grid.cells.shape
    cells: NDArray[np.int8] = grid.cells[row.clip(0, height - 1), column.clip(0, width - 1)]
    is_outside = (row < 0) | (row >= height) | (column < 0) | (column >= width)
    cells[is_outside] = UNKNOWN
    return cells.reshape(len(points_m), len(steps) ** 2)


def _has_moved(before: Grid, now: Grid, occupancy: OccupancyParameters) -> bool:
    """Whether a map shows the walls of another one elsewhere, as after a loop closure."""
    from rose2_logs.tracking.registration import WallFit, wall_faces

    tracking = TrackingParameters()
    then, there = (wall_faces(*classify(each.cells, occupancy), each.geometry) for each in (before, now))
    if min(len(then), len(there)) < tracking.fit_min_points:
        return True
    walls = WallFit(then, before.geometry.resolution_m, tracking).sample()
    fit = WallFit(there, now.geometry.resolution_m, tracking)
    return fit.share(walls.points, fit.best(walls)) >= SAME_WALLS_SHARE


def _grid_of(place: int, facts: Callable[[int], MapFacts | None]) -> GridGeometry | None:
    """The grid of a map, its place rounded to cells: less is the rounding of one publisher's numbers."""
    if (found := facts(place)) is None:
        return None
    of, cell_m = found.geometry, found.geometry.resolution_m
    x, y = (round(each / cell_m) * cell_m for each in of.origin_xy_m)
    return replace(of, origin_xy_m=(x, y), yaw_rad=round(of.yaw_rad, 3))


def _grids_in_turn(places: Sequence[int], facts: Callable[[int], MapFacts | None]) -> list[GridGeometry]:
    """Grids between which the maps go back and forth, and find again what they had left; else none."""
    left: dict[GridGeometry, float] = {}
    returns = found_again = switches = 0
    latest: MapFacts | None = None
    before: GridGeometry | None = None
    for place in places:
        found, grid = facts(place), _grid_of(place, facts)
        if found is None or grid is None:
            continue
        if latest is not None and grid != before:
            if grid in left:
                returns += 1
                found_again += found.free_m2 >= BACK_SHARE * left[grid]
            low, high = sorted((latest.free_m2, found.free_m2))
            switches += 1 if high - low > ANOTHER_SHARE * high else -1
        left[grid] = found.free_m2
        latest, before = found, grid
    is_in_turn = found_again >= max(LEAST_RETURNS, len(left) - 1) and 2 * found_again > returns
    return list(left) if is_in_turn and len(left) > 1 and switches > 0 else []


def _buildings_in_turn(places: Sequence[int], maps: _Maps) -> list[list[int]]:
    """Maps that grow from each other, by their places, where the log goes back and forth between these.

    A bad map is none that the log comes back to, nor is where a map was before it was moved as a whole.
    Without such turns, nothing.
    """
    grown: list[list[int]] = []
    returns: list[int] = []
    latest = 0
    for left, place in zip(range(len(places), 0, -1), places, strict=True):
        if sum(returns) + left < len(grown) - 1:
            # Too many buildings, whatever the maps that are left show: each is looked for in all of these.
            return []
        found = maps.facts(place)
        if found is None or (grown and found.free_m2 < LEAST_AREA_M2):
            continue
        recent = sorted(range(len(grown)), key=lambda each: -grown[each][-1])
        of = (each for each in recent if maps.walls_kept(grown[each][-1], place) >= TURN_WALLS_SHARE)
        building = next(of, len(grown))
        if building == len(grown):
            grown.append([])
            returns.append(0)
        elif building != latest:
            returns[building] += 1
        grown[building].append(place)
        latest = building
    in_turn = [places for places, times in zip(grown, returns, strict=True) if times]
    return grown if len(in_turn) > 1 and sum(returns) >= max(LEAST_TURNS, len(grown) - 1) else []


def _begins(spread: Sequence[int], maps: _Maps) -> list[int]:
    """Places of the maps that are begun anew."""
    begins = []
    before = spread[0]
    for low, high in pairwise(spread):
        if not maps.is_other(before, high, FALLEN_SHARE):
            before = high
            continue
        for place in range(low + 1, high + 1):
            if maps.is_other(before, place, FALLEN_SHARE):
                then = place + 1
                if then <= spread[-1] and maps.facts(then) and not maps.is_other(before, then, BACK_SHARE):
                    continue  # a bad map: the next one goes on from those before
                begins.append(place)
            before = place
    return begins


def _part(
    times: Times,
    places: Sequence[int],
    facts: Callable[[int], MapFacts | None],
    looked_at: Sequence[int] | None = None,
) -> Part:
    known = places if looked_at is None else sorted({*set(places).intersection(looked_at), places[-1]})
    areas = [found.free_m2 for place in known if (found := facts(place)) is not None]
    return Part(times[list(places)], areas[-1] if areas else 0.0, len(set(areas)))
