"""Maps cut into atoms, kept on disk, so that networks and trees can be fitted on them again and again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fit_grouping.buildings.make_buildings import read_maps
from fit_grouping.buildings.raster import CELL_M
from fit_grouping.keeping import kept
from fit_grouping.maps_with_truth import TruthMap
from fit_grouping.scores import overlap_table
from rose2_logs.config.parameters import Parameters
from rose2_logs.segmentation.regions.answers import AnsweringNetwork
from rose2_logs.segmentation.regions.graph import RegionGraph
from rose2_logs.segmentation.regions.stage import Atoms, find_atoms, generous_floor_plan, generous_walls
from rose2_logs.segmentation.rose.stage import find_structure
from rose2_logs.segmentation.walls.stage import WallCounter
from rose2_logs.segmentation.walls.strips import WallCells

FloatArray = NDArray[np.float64]
FREE_MIN_GRAY, OCCUPIED_MAX_GRAY = 230, 89
"""What is free and occupied in simulated maps."""
FIT_VIEWS = 2
"""Trees are fitted on steadier answers than one view gives: 81.1 on buildings left out rather than 80.8."""


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """What grouping needs of a map.

    Attributes
    ----------
    group, name, building : str
    fold : int
        -1 for simulated maps.
    atoms : Atoms
        Without `cells`.
    tables : tuple of (A + 1, T + 1) float
        Cells of the map that each atom shares with each true room; row and column 0 are none.
    """

    group: str
    name: str
    building: str
    fold: int
    atoms: Atoms
    tables: tuple[FloatArray, ...]

    def graph(self, answers: NDArray[np.float32] | None) -> RegionGraph:
        """The graph of the atoms, with a network's answers."""
        return self.atoms.graph(answers)


def atoms_of(one: TruthMap, parameters: Parameters) -> Atoms:
    """Cut a map into atoms as the analysis does."""
    scored = find_structure(one.occupied, one.resolution_m, parameters.spectrum)
    direction = float(scored.directions_rad[0]) if len(scored.directions_rad) else 0.0
    count_walls = WallCounter(
        WallCells(scored.supported, scored.directions_rad, one.resolution_m), parameters.walls
    )
    walls = generous_walls(scored, count_walls, parameters)
    plan = generous_floor_plan(walls, one.free, direction, one.resolution_m, parameters)
    return find_atoms(
        one.free,
        one.occupied,
        scored.score,
        plan.face_of_cell,
        direction,
        one.resolution_m,
        parameters.regions,
    )


def prepare(one: TruthMap, parameters: Parameters, fold: int) -> PreparedMap:
    """Cut a map into atoms and look up their rooms."""
    atoms = atoms_of(one, parameters)
    tables = tuple(overlap_table(atoms.cells, truth) for truth in one.truths)
    atoms = replace(atoms, cells=np.zeros((0, 0), np.int32))  # large, and not needed any more
    return PreparedMap(one.group, one.name, one.building, fold, atoms, tables)


def prepared_benchmark(maps: Iterable[TruthMap], keep: Path) -> list[PreparedMap]:
    """Prepare the maps of a benchmark, or read them from `keep`."""
    return kept(keep, lambda: [prepare(one, Parameters(), one.fold) for one in maps])


def prepared_simulated(path: Path, keep: Path) -> list[PreparedMap]:
    """Prepare the simulated maps of a file, or read them from `keep`."""

    def made() -> list[PreparedMap]:
        maps = []
        for number, sim in enumerate(read_maps(path)):
            name, free = f"{path.stem}_{number}", sim.gray >= FREE_MIN_GRAY
            occupied = sim.gray <= OCCUPIED_MAX_GRAY
            one = TruthMap(f"simulated/{sim.kind}", name, name, CELL_M, free, occupied, sim.truths)
            maps.append(prepare(one, Parameters(), -1))
        return maps

    return kept(keep, made)


def answered(maps: list[PreparedMap], network_of_fold: dict[int, Path]) -> list[NDArray[np.float32]]:
    """Answers for each map, of the network that did not see its fold, as the mean of `FIT_VIEWS` views."""
    networks = {path: AnsweringNetwork(path) for path in set(network_of_fold.values())}
    return [networks[network_of_fold[one.fold]](one.atoms.raster, FIT_VIEWS) for one in maps]
