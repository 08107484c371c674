"""Stage A in two calls: the structure of a map, and the clean map that it leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import SpectrumParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.rose.clean_map import (
    attached_cells,
    clean_threshold,
    structure_score,
    supported_cells,
)
from rose2_logs.segmentation.rose.spectrum import (
    angular_energy,
    compute_spectrum,
    dominant_directions,
    spectrum_picture,
)


@dataclass(frozen=True, eq=False)
class StructureResult:
    """The structure of a map in the grid frame.

    Attributes
    ----------
    directions_rad : (D,) float
        Dominant directions in [0, pi), strongest first.
    strengths : (D,) float
        Share of the spectrum's energy that each holds.
    score : (H, W) float32
        Structure score of the occupied cells, 0 elsewhere.
    supported : (H, W) bool
        Occupied cells but those of small pieces that no structure supports.
    spectrum : (S, S) uint8
        Picture of the spectrum, see `spectrum_picture`.
    """

    directions_rad: FloatArray
    strengths: FloatArray
    score: NDArray[np.float32]
    supported: BoolArray
    spectrum: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class CleanMap:
    """The clean map.

    Attributes
    ----------
    threshold : float
        Least structure score of its cells.
    cells : (H, W) bool
        Its cells.
    attached : (H, W) bool
        These, and cells of lower score that touch them: jambs, ends of walls.
    """

    threshold: float
    cells: BoolArray
    attached: BoolArray


def find_structure(
    occupied: BoolArray, resolution_m: float, parameters: SpectrumParameters
) -> StructureResult:
    """Find dominant directions by the spectrum of the occupied cells (H, W), and score the cells by them."""
    spectrum = compute_spectrum(occupied, resolution_m, parameters)
    directions, strengths = dominant_directions(angular_energy(spectrum, parameters), parameters)
    picture = spectrum_picture(spectrum, parameters)
    score = structure_score(spectrum, occupied, directions, parameters)
    del spectrum  # as large as the rest of the stage needs
    supported = supported_cells(score, occupied, resolution_m, parameters)
    return StructureResult(directions, strengths, score, supported, picture)


def make_clean_map(
    structure: StructureResult,
    free_m2: float,
    count_walls: Callable[[BoolArray], int],
    parameters: SpectrumParameters,
) -> CleanMap:
    """Keep the cells of high structure score.

    Parameters
    ----------
    structure : StructureResult
        The scores.
    free_m2 : float
        Free area of the map, by which the number of walls that it may have is known.
    count_walls : callable
        Number of walls in a map (H, W) of occupied cells: the threshold is the lowest that leaves few enough.
    parameters : SpectrumParameters
    """
    supported, score = structure.supported, structure.score
    threshold = clean_threshold(score, supported, free_m2, count_walls, parameters)
    clean = supported & (score >= threshold)
    attached = attached_cells(clean, supported & (score >= parameters.attached_share * threshold))
    return CleanMap(threshold, clean, attached)
