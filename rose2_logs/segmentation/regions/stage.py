"""Stage C with fitted borders in one call: from the scored map to rooms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.regions import DETAIL_MOST, RegionParameters
from rose2_logs.model.labels import label_sizes, labels_near, narrow_labels
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.floor_plan.stage import FloorPlanResult, cut_by_lines
from rose2_logs.segmentation.regions import fitted
from rose2_logs.segmentation.regions.atoms import cut_atoms
from rose2_logs.segmentation.regions.borders import border_strengths
from rose2_logs.segmentation.regions.graph import STRONG_SCORE, RegionGraph, build_graph
from rose2_logs.segmentation.regions.joining import Joins, Strength, join_regions
from rose2_logs.segmentation.regions.outside import (
    Together,
    edge_shares,
    leftovers_joined,
    outside_of,
    rooms_among,
)
from rose2_logs.segmentation.regions.own_rooms import small_region_joins
from rose2_logs.segmentation.regions.plan_frame import Labels, PlanFrame, without_specks
from rose2_logs.segmentation.regions.plan_raster import PlanRaster
from rose2_logs.segmentation.regions.strengths import FittedStrength
from rose2_logs.segmentation.rose.clean_map import attached_cells
from rose2_logs.segmentation.rose.stage import StructureResult
from rose2_logs.segmentation.walls.stage import WallCounter, WallResult, find_walls

EVEN_ODDS = 0.0
"""Log odds of what is as likely one room as two."""


@dataclass(frozen=True, eq=False)
class Atoms:
    """The floor of a map cut into atoms.

    Attributes
    ----------
    count : int
        Number of atoms, N.
    cells : (H, W) int32
        Atom 1..N of each free cell of the map, 0 elsewhere and on loose cells.
    frame : PlanFrame
    raster : PlanRaster
    on_plan, faces_on_plan : (P, Q) int32
        Atoms and faces on the plan frame.
    strong : (P, Q) bool
        Plan cells with walls that go on for long.
    """

    count: int
    cells: Labels
    frame: PlanFrame
    raster: PlanRaster
    on_plan: Labels
    faces_on_plan: Labels
    strong: BoolArray

    def graph(self, answers: NDArray[np.float32] | None) -> RegionGraph:
        """The graph of the atoms, with a network's answers (OUTPUTS, P, Q)."""
        return build_graph(
            self.on_plan, self.raster, self.strong, self.faces_on_plan, answers, self.frame.cell_m, self.count
        )

    def edge_shares(self) -> FloatArray:
        """Share (N,) of the map's edge that each atom holds."""
        return edge_shares(self.on_plan, self.raster, self.count)


@dataclass(frozen=True, eq=False)
class RegionsResult:
    """Rooms by fitted borders.

    Attributes
    ----------
    labels : (H, W) int32
        Room 1.. of the free cells, 0 for none.
    strengths : dict of (int, int) to float
        Of the border of each two neighboring rooms, the smaller number first, see `border_strengths`.
    outside_m2 : float
        Free area that was left out as outside the building.
    """

    labels: Labels
    strengths: dict[tuple[int, int], float]
    outside_m2: float


@dataclass(frozen=True, eq=False)
class _Split:
    """The atoms of a map joined to regions.

    Attributes
    ----------
    of_atom : (A,) int
        Region 0.. of each atom.
    graph : RegionGraph
        Of the regions.
    area_m2 : (N,) float
        Of their cells.
    room, outside : (N,) bool
        Regions that are large enough for rooms, and those outside.
    """

    of_atom: NDArray[np.int64]
    graph: RegionGraph
    area_m2: FloatArray
    room: BoolArray
    outside: BoolArray


@dataclass(frozen=True, eq=False)
class RegionTree:
    """The atoms of a map and the order in which they are joined: from it follow the rooms at any detail.

    There is one tree for all details, so that more detail never joins what less detail parts: joins down to
    even odds, and, where less detail is asked for, those that follow on them.

    Attributes
    ----------
    cells : (H, W) int32
        Atom 1..N of each free cell of the map, 0 for none.
    free : (H, W) bool
    resolution_m : float
    graph : RegionGraph
        Of the atoms.
    edge_share : (N,) float
        Share of the map's edge that each atom holds.
    strength : callable
        Log odds that two regions are one room.
    parameters : RegionParameters
    """

    cells: Labels
    free: BoolArray
    resolution_m: float
    graph: RegionGraph
    edge_share: FloatArray
    strength: Strength
    parameters: RegionParameters

    @cached_property
    def _atoms_m2(self) -> FloatArray:
        """Area (N,) of the cells of each atom."""
        cells: FloatArray = label_sizes(self.cells, len(self.graph.node_sums))[1:].astype(float)
        return cells * self.resolution_m**2

    @cached_property
    def _to_even_odds(self) -> Joins:
        joins = join_regions(self.graph, self.strength, EVEN_ODDS)
        region = joins.regions(EVEN_ODDS)
        regions, _ = self.graph.joined(region)
        outside = self._outside_of(regions, region)
        return joins.then(
            small_region_joins(regions, outside, self.strength, fitted.own_room_trees(), self.parameters)
        )

    @cached_property
    def _to_the_end(self) -> Joins:
        # What is no room by itself stays with its room when that is joined to others.
        joins = self._to_even_odds
        first_atom = np.unique(joins.regions(EVEN_ODDS), return_index=True)[1]
        home = self._home[first_atom]
        given = np.flatnonzero(home != np.arange(len(home)))
        pairs = np.column_stack([home[given], given])
        joins = joins.then(Joins(len(home), pairs, np.full(len(pairs), DETAIL_MOST)))
        regions, _ = self.graph.joined(joins.regions(EVEN_ODDS))
        return joins.then(join_regions(regions, self.strength, -DETAIL_MOST))

    @cached_property
    def _narrow_atoms(self) -> BoolArray:
        """Which atoms (N,) are of regions at even odds that are large enough for a room, but too narrow."""
        region = self._to_even_odds.regions(EVEN_ODDS)
        return self._narrow(self.graph.joined(region)[0], region)[region]

    @cached_property
    def _outside(self) -> BoolArray:
        """Which atoms (N,) are outside, whatever the detail: regions at even odds tell it best."""
        region = self._to_even_odds.regions(EVEN_ODDS)
        regions, _ = self.graph.joined(region)
        narrow = np.zeros(len(regions.node_sums), bool)
        narrow[region] = self._narrow_atoms
        return self._outside_of(regions, region, narrow)[region]

    @cached_property
    def _home(self) -> NDArray[np.int64]:
        """Region (N,) of each atom at even odds, what is no room by itself with the room it is part of."""
        found = self._split(self._to_even_odds, EVEN_ODDS)
        return self._leftovers_joined(found)[0][found.of_atom]

    def _split(self, joins: Joins, detail: float) -> _Split:
        """Join the atoms as far as a detail asks for, what is outside apart from the rest."""
        # With less detail, floor that is outside may be joined to a room: it is cut off again.
        of_atom = np.unique(2 * joins.regions(detail) + self._outside, return_inverse=True)[1]
        graph, _ = self.graph.joined(of_atom)
        outside = np.zeros(len(graph.node_sums), bool)
        outside[of_atom] = self._outside
        # Plan cells that are free in part count as whole, but a room is as large as its cells.
        area_m2 = np.bincount(of_atom, self._atoms_m2).astype(float)
        return _Split(of_atom, graph, area_m2, rooms_among(area_m2, outside, self.parameters), outside)

    def _narrow(self, regions: RegionGraph, region: NDArray[np.int64]) -> BoolArray:
        """Regions (N,) that are large enough for a room, but nowhere wide enough."""
        large = regions.node_sums[:, 0] >= self.parameters.room_min_area_m2
        number = np.cumsum(large) * large
        of_cells = np.concatenate([[0], number[region]]).astype(np.int32).take(self.cells)
        narrow = np.zeros(len(large), bool)
        narrow[large] = narrow_labels(
            of_cells,
            int(large.sum()),
            self.parameters.room_min_width_m / self.resolution_m,
            self.parameters.speck_max_m / self.resolution_m,
        )
        return narrow

    def _outside_of(
        self, regions: RegionGraph, region: NDArray[np.int64], narrow: BoolArray | None = None
    ) -> BoolArray:
        edge_share = np.bincount(region, self.edge_share).astype(float)
        is_room = FittedStrength.of_rooms(fitted.outside_trees(), self.parameters)
        return outside_of(regions, edge_share, is_room, self.parameters, narrow)

    def _given(self, found: _Split, joins: Joins) -> tuple[NDArray[np.int64], BoolArray]:
        """Region that each is part of, and which are rooms, where there is more detail than at even odds.

        What is no room by itself, and what is nowhere wide enough though its room at even odds was, stays in
        that room, and there with what it is joined to first.
        """
        first_atom = np.unique(found.of_atom, return_index=True)[1]

        def together(one: NDArray[np.int64], other: NDArray[np.int64]) -> tuple[FloatArray, ...]:
            ends = first_atom[one], first_atom[other]
            return (self._home[ends[0]] == self._home[ends[1]]).astype(float), joins.levels(*ends)

        may_be_narrow = self._narrow_atoms[first_atom]
        narrow = self._narrow(found.graph, found.of_atom) & ~may_be_narrow
        while True:
            wide = replace(found, room=found.room & ~narrow)
            given, room = self._leftovers_joined(wide, together, narrow)
            kept, number = np.unique(given, return_inverse=True)
            joined, _ = found.graph.joined(number)
            # Small regions that are large enough together may be narrow, too.
            too_narrow = (self._narrow(joined, number[found.of_atom]) & room[kept])[number] & ~may_be_narrow
            if not (too_narrow & ~narrow).any():
                # What is narrow, but beside no room, stays one.
                whole_m2 = np.bincount(given, found.area_m2, len(given))
                own = (given == np.arange(len(given))) & ~found.outside
                return given, room | (own & (whole_m2 >= self.parameters.room_min_area_m2))
            narrow |= too_narrow

    def _leftovers_joined(
        self, found: _Split, together: Together | None = None, narrow: BoolArray | None = None
    ) -> tuple[NDArray[np.int64], BoolArray]:
        return leftovers_joined(
            found.graph,
            found.area_m2,
            found.room,
            found.outside,
            self.strength,
            self.parameters,
            together,
            narrow,
        )

    def rooms(self, detail: float) -> RegionsResult:
        """Join the atoms as far as a detail asks for, log odds; 0 for even odds, more for more rooms."""
        if not len(self.graph.node_sums):
            return RegionsResult(np.zeros(self.free.shape, np.int32), {}, 0.0)
        joins = self._to_even_odds if detail >= EVEN_ODDS else self._to_the_end
        found = self._split(joins, detail)
        given, is_room = self._given(found, joins) if detail > EVEN_ODDS else self._leftovers_joined(found)
        kept, number = np.unique(given, return_inverse=True)
        regions, _ = found.graph.joined(number)
        region = number[found.of_atom]
        room = np.where(is_room, np.cumsum(is_room), 0)[kept]
        outside_m2 = float(self._atoms_m2[found.outside[kept][region]].sum())
        labels = room_labels(
            self.cells, room[region], self.free, self.resolution_m, self.parameters.loose_reach_m
        )
        borders = border_strengths(regions, room, self.strength, self.parameters.join_margin)
        return RegionsResult(labels, borders, outside_m2)


def generous_walls(scored: StructureResult, count_walls: WallCounter, parameters: Parameters) -> WallResult:
    """Walls of a clean map that keeps every wall, by one low threshold.

    Where faces are no rooms but what rooms are joined from, a wall too many does no harm: the threshold needs
    no search, and no budget of walls.

    Parameters
    ----------
    scored : StructureResult
    count_walls : WallCounter
    parameters : Parameters
    """
    least = parameters.regions.clean_min_score
    clean = scored.supported & (scored.score >= least)
    candidates = scored.supported & (scored.score >= parameters.spectrum.attached_share * least)
    attached = attached_cells(clean, candidates)
    return find_walls(count_walls, clean, attached)


def generous_floor_plan(
    built: WallResult, free: BoolArray, direction_rad: float, resolution_m: float, parameters: Parameters
) -> FloorPlanResult:
    """Faces between the lines of `generous_walls`, with the weights of their edges, in no group yet."""
    lines_m, walls = built.lines.ends_m, built.walls
    return cut_by_lines(lines_m, walls, free, direction_rad, resolution_m, parameters.floor_plan)


def find_atoms(
    free: BoolArray,
    occupied: BoolArray,
    score: NDArray[np.float32],
    faces: Labels,
    direction_rad: float,
    resolution_m: float,
    parameters: RegionParameters,
) -> Atoms:
    """Cut a map (H, W) into atoms, and look at it along its strongest direction."""
    frame = PlanFrame.of(free | occupied, direction_rad, resolution_m)
    walls = without_specks(occupied, parameters.speck_max_m / resolution_m)
    solid, wall, open_cells, strong = frame.counts(walls, occupied, free, score >= STRONG_SCORE)
    cells = cut_atoms(free, faces, solid > 0, open_cells > 0, frame, resolution_m, parameters)
    on_plan, count = frame.sampled(cells), int(cells.max(initial=0))
    has_borders = label_sizes(on_plan, count) > 0
    if not has_borders[1:].all():
        # A sliver between two lines, that no center of a plan cell lies on, could be joined to nothing.
        has_borders[0] = True
        cells = np.where(has_borders.take(cells), cells, np.int32(0))
    return Atoms(
        count,
        cells,
        frame,
        PlanRaster(wall, open_cells),
        on_plan,
        frame.sampled(faces),
        strong > 0,
    )


def region_tree(
    atoms: Atoms, free: BoolArray, resolution_m: float, parameters: RegionParameters
) -> RegionTree:
    """Judge the borders of atoms, to join these to rooms."""
    answers = fitted.answering_network()(atoms.raster, parameters.answer_views) if atoms.count else None
    graph = atoms.graph(answers)
    strength = FittedStrength.of_joins(fitted.join_trees(), parameters)
    return RegionTree(atoms.cells, free, resolution_m, graph, atoms.edge_shares(), strength, parameters)


def room_labels(
    atoms: Labels, room_of_atom: NDArray[np.integer], free: BoolArray, resolution_m: float, reach_m: float
) -> Labels:
    """Room 1.. of each free cell (H, W), 0 for none.

    Parameters
    ----------
    atoms : (H, W) int32
        Atom 1..A of each cell, 0 for none.
    room_of_atom : (A,) int
        Room 1.. of each atom, 0 for those outside.
    free : (H, W) bool
    resolution_m : float
    reach_m : float
        Free cells of pieces that are too small for an atom belong to the room this near.
    """
    labels = np.concatenate([[0], room_of_atom]).astype(np.int32).take(atoms)
    loose = np.flatnonzero(free & (atoms == 0))
    if len(loose):
        labels.reshape(-1)[loose] = labels_near(labels, loose, reach_m / resolution_m)
    return labels
