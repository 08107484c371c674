"""Maps cut into atoms, kept on disk, so that networks and trees can be fitted on them again and again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fit_grouping.answers import AnsweringNetwork
from fit_grouping.atoms import (
    AtomParameters,
    BoolArray,
    Labels,
    PlanFrame,
    cut_atoms,
    find_generous_structure,
)
from fit_grouping.buildings.make_buildings import read_maps
from fit_grouping.buildings.raster import CELL_M
from fit_grouping.keeping import kept
from fit_grouping.maps_with_truth import TruthMap
from fit_grouping.plan_rasters import PlanRaster
from fit_grouping.regions import STRONG_SCORE, RegionGraph, build_graph
from fit_grouping.scores import overlap_table

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """What grouping needs of a map, on its plan frame.

    Attributes
    ----------
    group, name, building : str
    fold : int
        -1 for simulated maps.
    raster : PlanRaster
    atoms, faces : (H, W) int32
    strong : (H, W) bool
    cell_m : float
    tables : tuple of (A + 1, T + 1) float
        Cells of the map that each atom shares with each true room; row and column 0 are none.
    """

    group: str
    name: str
    building: str
    fold: int
    raster: PlanRaster
    atoms: Labels
    faces: Labels
    strong: BoolArray
    cell_m: float
    tables: tuple[FloatArray, ...]

    def graph(self, answers: NDArray[np.float32] | None) -> RegionGraph:
        """The graph of the atoms, with a network's answers."""
        count = len(self.tables[0]) - 1
        return build_graph(self.atoms, self.raster, self.strong, self.faces, answers, self.cell_m, count)


def prepare(one: TruthMap, parameters: AtomParameters, fold: int) -> PreparedMap:
    """Cut a map into atoms."""
    free, occupied, resolution = one.free, one.occupied, one.resolution_m
    structure = find_generous_structure(free, occupied, resolution, parameters)
    frame = PlanFrame.of(free | occupied, structure.direction_rad, resolution, parameters.plan_cell_m)
    atoms = cut_atoms(free, occupied, structure.faces, frame, resolution, parameters)
    return PreparedMap(
        one.group,
        one.name,
        one.building,
        fold,
        PlanRaster.of(free, occupied, frame),
        frame.sampled(atoms),
        frame.sampled(structure.faces),
        frame.share(structure.score >= STRONG_SCORE) > 0,
        frame.cell_m,
        tuple(overlap_table(atoms, truth) for truth in one.truths),
    )


def prepared_benchmark(maps: Iterable[TruthMap], keep: Path) -> list[PreparedMap]:
    """Prepare the maps of a benchmark, or read them from `keep`."""
    return kept(keep, lambda: [prepare(one, AtomParameters(), one.fold) for one in maps])


def prepared_simulated(path: Path, keep: Path) -> list[PreparedMap]:
    """Prepare the simulated maps of a file, or read them from `keep`."""

    def made() -> list[PreparedMap]:
        maps = []
        for number, sim in enumerate(read_maps(path)):
            name, free, occupied = f"{path.stem}_{number}", sim.gray > 229, sim.gray < 90
            one = TruthMap(f"simulated/{sim.kind}", name, name, CELL_M, free, occupied, sim.truths)
            maps.append(prepare(one, AtomParameters(), -1))
        return maps

    return kept(keep, made)


def answered(maps: list[PreparedMap], network_of_fold: dict[int, Path]) -> list[NDArray[np.float32]]:
    """Answers for each map, of the network that did not see its fold."""
    networks = {path: AnsweringNetwork(path) for path in set(network_of_fold.values())}
    return [networks[network_of_fold[one.fold]](one.raster) for one in maps]
