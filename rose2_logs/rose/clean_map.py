"""The structure score of each occupied cell, and the clean map that it gives (paper, III-A)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from skimage.filters import threshold_otsu

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


def clean_threshold(score: NDArray[np.float32], occupied: BoolArray, parameters: SpectrumParameters) -> float:
    """Find the score that best divides walls from clutter (Otsu), within the bounds of the parameters."""
    values = score[occupied]
    low, high = parameters.threshold_min, parameters.threshold_max
    if values.size == 0 or np.ptp(values) == 0:
        return low
    return float(np.clip(threshold_otsu(values), low, high))  # type: ignore[no-untyped-call]
