"""Maps with true rooms as the fit takes them: the explored part, and its truths on the same cells."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.evaluation.cases import load_cases
from rose2_logs.model.explored import ExploredPart

Labels = NDArray[np.int32]

BUILDINGS = (
    (r"incremental_intel/.*|.*/.*intel.*|full/map23", "intel"),
    (r"incremental_fr79/.*|.*/.*reiburg.*79.*|full/map15|.*/lab_c_.*", "fr79"),
    (r".*/.*reiburg.*101.*", "fr101"),
    (r"survey_.*/office_.*", "offices"),
    (r"survey_.*/lab_a_.*", "lab a"),
    (r"survey_.*/NLB.*", "NLB"),
    (r"campus/.*", "campus"),
    (r"places/diag.*", "diag"),
)
"""Which maps may show the same building: patterns of "group/name", the first that fits; a map that none fits
is a building by itself. What only looks like one building is taken as one."""

FOLD_OF_BUILDING = {
    "intel": 0,
    "fr101": 0,
    "offices": 0,
    "places/fetch": 0,
    "places/kth": 0,
    "places/depot": 0,
    "places/yujin": 0,
    "places/raillab": 0,
    "fr79": 1,
    "NLB": 1,
    "campus": 1,
    "places/cic": 1,
    "places/museum": 1,
    "places/bookstore": 1,
    "full/map_with_clutter": 1,
}
"""Fold in which a building is left out; homes are dealt round by their number, others are in the last."""
FOLDS = 3


@dataclass(frozen=True, eq=False)
class TruthMap:
    """The explored part of a map and its true rooms, row 0 at the bottom.

    Attributes
    ----------
    group, name, building : str
        What it is called, and the building that it shows.
    resolution_m : float
    free, occupied : (H, W) bool
    truths : tuple of (H, W) int32
        One label image, or two where a careful person may draw the rooms in two ways.
    """

    group: str
    name: str
    building: str
    resolution_m: float
    free: NDArray[np.bool_]
    occupied: NDArray[np.bool_]
    truths: tuple[Labels, ...]

    @property
    def fold(self) -> int:
        """Fold in which the map is left out."""
        if self.building.startswith("homes/"):
            return (int(re.sub(r"\D", "", self.building)) // 2) % FOLDS
        return FOLD_OF_BUILDING.get(self.building, FOLDS - 1)


def building_of(group: str, name: str) -> str:
    """Name of the building that a map shows, see `BUILDINGS`."""
    key = f"{group}/{name}"
    return next((building for pattern, building in BUILDINGS if re.fullmatch(pattern, key)), key)


def load_benchmark(cases: Path) -> list[TruthMap]:
    """Read all maps of a benchmark, with every truth that it lists."""
    maps = []
    for case in load_cases(cases):
        snapshot = case.snapshot()
        part = ExploredPart.of(snapshot.cells, snapshot.geometry, OccupancyParameters())
        truths = tuple(on_blocks(part, np.flipud(labels)) for labels in case.truths().values())
        maps.append(
            TruthMap(
                case.group,
                case.name,
                building_of(case.group, case.name),
                part.resolution_m,
                part.free,
                part.occupied,
                truths,
            )
        )
    return maps


def on_blocks(part: ExploredPart, labels: NDArray[np.integer]) -> Labels:
    """Labels of a canvas at the middle of each block of the explored part."""
    window = labels[part.window].astype(np.int32)
    side = part.factor
    if side > 1:
        height, width = part.free.shape
        missing = ((0, height * side - window.shape[0]), (0, width * side - window.shape[1]))
        window = np.pad(window, missing)[side // 2 :: side, side // 2 :: side]
    return np.ascontiguousarray(window)
