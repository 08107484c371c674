"""Maps with true rooms as the fit takes them: the explored part, and its truths on the same cells."""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
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
UNKNOWN_SHARE_MAX = 0.02
"""Of a varied map up to this share of cells is unknown."""


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


def varied(one: TruthMap, number: int) -> TruthMap:
    """Turn a map, mirror it at times, make some of its cells unknown: the same building, mapped otherwise.

    Odd variants are turned by a quarter or more, which leaves cells as they are, others by any angle.
    """
    rng = np.random.default_rng([zlib.crc32(f"{one.group}/{one.name}".encode()), number])
    turns, mirrored, angle_rad = (
        int(rng.integers(1, 4)),
        bool(rng.integers(2)),
        rng.uniform(0.1, np.pi / 2 - 0.1),
    )
    seen = rng.random(one.free.shape) >= rng.uniform(0, UNKNOWN_SHARE_MAX)

    def changed(image: NDArray[np.uint16]) -> NDArray[np.uint16]:
        image = image[:, ::-1] if mirrored else image
        if number % 2:
            return np.ascontiguousarray(np.rot90(image, turns))
        return _turned(np.ascontiguousarray(image), angle_rad)

    free, occupied = (changed((mask & seen).astype(np.uint16)) > 0 for mask in (one.free, one.occupied))
    truths = tuple(changed(truth.astype(np.uint16)).astype(np.int32) for truth in one.truths)
    return replace(one, name=f"{one.name}_{number}", free=free, occupied=occupied, truths=truths)


def _turned(image: NDArray[np.uint16], angle_rad: float) -> NDArray[np.uint16]:
    """Turn about the middle onto a canvas that holds all; each cell takes the value at its center."""
    height, width = image.shape
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    size = int(np.ceil(height * s + width * c)), int(np.ceil(height * c + width * s))
    matrix = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), float(np.degrees(angle_rad)), 1.0)
    matrix[:, 2] += (size[0] - width) / 2, (size[1] - height) / 2
    turned = cv2.warpAffine(image, matrix, size, flags=cv2.INTER_NEAREST)
    return np.asarray(turned, np.uint16)


def on_blocks(part: ExploredPart, labels: NDArray[np.integer]) -> Labels:
    """Labels of a canvas at the middle of each block of the explored part."""
    window = labels[part.window].astype(np.int32)
    side = part.factor
    if side > 1:
        height, width = part.free.shape
        missing = ((0, height * side - window.shape[0]), (0, width * side - window.shape[1]))
        window = np.pad(window, missing)[side // 2 :: side, side // 2 :: side]
    return np.ascontiguousarray(window)
