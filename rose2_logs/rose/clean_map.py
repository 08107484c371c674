"""The structure score of each occupied cell, and the clean map that it gives (paper, III-A)."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import BoolArray, FloatArray
from rose2_logs.parameters import SpectrumParameters
from rose2_logs.rose.spectrum import Spectrum


def structure_score(
    spectrum: Spectrum,
    occupied: BoolArray,
    directions_rad: FloatArray,
    parameters: SpectrumParameters,
) -> NDArray[np.float32]:
    """Score how much each occupied cell belongs to a straight wall along a dominant direction.

    Of the spectrum only the ridge of one direction is kept (a Gaussian band, whose width is the reciprocal of
    `structure_length_m`), the rest set to zero, and what remains transformed back. The score is the share
    of the cell's neighbourhood along the wall that is occupied, so that a straight wall without an end
    scores 1, whatever its thickness, the size of the map, and the number of walls in it.

    Returns
    -------
    score : (H, W) float32
        The best score over the directions on occupied cells, 0 elsewhere.
    """
    score = np.zeros(occupied.shape, np.float32)
    sigma_along = parameters.structure_length_m / 4
    for direction in directions_rad:
        along = spectrum.frequency_x * np.float32(np.cos(direction)) + spectrum.frequency_y * np.float32(
            np.sin(direction)
        )
        gain = np.exp(-2 * (np.pi * sigma_along * along) ** 2)
        np.maximum(score, spectrum.filtered(gain, occupied.shape), out=score)
    score[~occupied] = 0
    return np.clip(score, 0, 1, out=score)


def clean_threshold(
    score: NDArray[np.float32],
    occupied: BoolArray,
    free_m2: float,
    count_segments: Callable[[BoolArray], int],
    parameters: SpectrumParameters,
) -> float:
    """Find the lowest threshold whose clean map has few enough line segments for its free space.

    A building has about so many walls per square metre; a map with more segments than that still holds
    clutter. The paper asks for the segments per free cell to lie in an interval; area makes it independent
    of the resolution. The number falls as the threshold rises, so the search halves the range.

    Parameters
    ----------
    free_m2 : float
        Free area of the map.
    count_segments : callable
        Number of line segments of a clean map.
    """
    allowed = parameters.segments_max_per_m2 * free_m2
    step = parameters.threshold_step
    steps = np.arange(parameters.threshold_min, parameters.threshold_max + step / 2, step)
    low, high = 0, len(steps) - 1
    while low < high:
        middle = (low + high) // 2
        if count_segments(occupied & (score >= steps[middle])) <= allowed:
            high = middle
        else:
            low = middle + 1
    return float(steps[low])


def attached_cells(clean: BoolArray, candidates: BoolArray) -> BoolArray:
    """Add to the clean map the candidates that are connected with it: a threshold with hysteresis.

    Jambs and ends of walls have a low score, for half of their neighbourhood is open.
    """
    _, part = cv2.connectedComponents((clean | candidates).astype(np.uint8), connectivity=8)
    touched = np.zeros(int(part.max()) + 1, bool)
    touched[part[clean]] = True
    touched[0] = False
    attached: BoolArray = touched[part]
    return attached
