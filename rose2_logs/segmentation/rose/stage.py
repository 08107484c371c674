"""Stage A in one call."""

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
class RoseResult:
    """Stage A in the grid frame: see `rose.structure.Structure`, which is the same in the world.

    `attached` (H, W) holds the clean map and the cells of lower score that touch it: jambs, ends of walls;
    `supported` (H, W) all occupied cells but those of small pieces that no structure supports.
    """

    directions_rad: FloatArray
    strengths: FloatArray
    score: NDArray[np.float32]
    threshold: float
    clean: BoolArray
    attached: BoolArray
    supported: BoolArray
    spectrum: NDArray[np.uint8]


def find_structure(
    occupied: BoolArray,
    free_m2: float,
    resolution_m: float,
    count_walls: Callable[[BoolArray, FloatArray], int],
    parameters: SpectrumParameters,
) -> RoseResult:
    """Spectrum, dominant directions, structure score, clean map of the occupied cells (H, W).

    `free_m2` and `count_walls` set the clean map's threshold, see `clean_threshold`.
    """
    spectrum = compute_spectrum(occupied, resolution_m, parameters)
    directions, strengths = dominant_directions(angular_energy(spectrum, parameters), parameters)
    picture = spectrum_picture(spectrum, parameters)
    score = structure_score(spectrum, occupied, directions, parameters)
    del spectrum  # as large as the rest of the stage needs
    supported = supported_cells(score, occupied, resolution_m, parameters)
    threshold = clean_threshold(
        score, supported, free_m2, lambda clean: count_walls(clean, directions), parameters
    )
    clean = supported & (score >= threshold)
    attached = attached_cells(clean, supported & (score >= parameters.attached_share * threshold))
    return RoseResult(directions, strengths, score, threshold, clean, attached, supported, picture)
