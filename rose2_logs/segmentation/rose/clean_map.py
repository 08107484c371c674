"""The structure score of each occupied cell, and the clean map that it gives (paper, III-A)."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import SpectrumParameters
from rose2_logs.model.labels import Pieces
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.rose.spectrum import Spectrum

SCORE_STEPS = 1000
"""Scores are rounded to this many steps, so that they are the same whatever instructions a CPU has."""


def structure_score(
    spectrum: Spectrum,
    occupied: BoolArray,
    directions_rad: FloatArray,
    parameters: SpectrumParameters,
) -> NDArray[np.float32]:
    """Score how much each occupied cell belongs to a straight wall along a dominant direction.

    Of the spectrum only the ridge of one direction is kept (a Gaussian band, whose width is the reciprocal of
    `structure_length_m`), the rest set to zero, and what remains transformed back. The score is the share
    of the cell's neighborhood along the wall that is occupied, so that a straight wall without an end
    scores 1, whatever its thickness, the size of the map, and the number of walls in it.

    Parameters
    ----------
    spectrum : Spectrum
        Of the occupied cells.
    occupied : (H, W) bool
    directions_rad : (D,) float
        Dominant directions; without any, every cell scores 0.
    parameters : SpectrumParameters

    Returns
    -------
    score : (H, W) float32
        The best score over the directions on occupied cells, 0 elsewhere.
    """
    row, column = np.divmod(np.flatnonzero(occupied), occupied.shape[1])
    best = np.zeros(len(row), np.float32)
    for direction in directions_rad:
        blurred = spectrum.blurred_along(direction, parameters.structure_length_m / 4, row, column)
        np.maximum(best, blurred, out=best)
    np.minimum(best, 1, out=best)
    best *= np.float32(SCORE_STEPS)
    np.rint(best, out=best)
    best /= np.float32(SCORE_STEPS)
    score = np.zeros(occupied.shape, np.float32)
    score[row, column] = best
    return score


def supported_cells(
    score: NDArray[np.float32], occupied: BoolArray, resolution_m: float, parameters: SpectrumParameters
) -> BoolArray:
    """Leave out small pieces of occupied cells that no structure supports: chairs, tables, people.

    A piece is what hangs together over gaps of `piece_max_gap_m`. One shorter than `piece_min_extent_m` is a
    wall only where it is in line with others, which its mean score shows.

    Parameters
    ----------
    score : (H, W) float32
        See `structure_score`.
    occupied : (H, W) bool
    resolution_m : float
        Side of a cell.
    parameters : SpectrumParameters

    Returns
    -------
    supported : (H, W) bool
        The occupied cells of the other pieces.
    """
    margin = round(parameters.piece_max_gap_m / resolution_m / 2)
    pieces = Pieces.of(occupied, margin)
    total = np.bincount(pieces.number, score.take(pieces.cell), minlength=pieces.count)
    mean = total / np.maximum(np.bincount(pieces.number, minlength=pieces.count), 1)
    wall = (np.hypot(*(pieces.sides * resolution_m).T) >= parameters.piece_min_extent_m) | (
        mean >= parameters.piece_min_score
    )
    return pieces.cells(wall, occupied.shape)


def clean_threshold(
    score: NDArray[np.float32],
    occupied: BoolArray,
    free_m2: float,
    count_walls: Callable[[BoolArray], int],
    parameters: SpectrumParameters,
) -> float:
    """Find the lowest threshold whose clean map has few enough walls for its free space.

    A building has about so many walls per square meter; a map with more than that still holds clutter. The
    paper asks for the line segments per free cell to lie in an interval; area makes it independent of the
    resolution, and wall clusters of the walls' thickness. The number falls as the threshold rises, so the
    search halves the range.

    Parameters
    ----------
    score : (H, W) float32
        See `structure_score`.
    occupied : (H, W) bool
    free_m2 : float
        Free area of the map.
    count_walls : callable
        Number of wall clusters of a clean map (H, W).
    parameters : SpectrumParameters

    Returns
    -------
    float
        Where no threshold leaves few enough, the highest.
    """
    allowed = parameters.walls_max_per_m2 * free_m2
    step = parameters.threshold_step
    steps = np.arange(parameters.threshold_min, parameters.threshold_max + step / 2, step)
    low, high = 0, len(steps) - 1
    while low < high:
        middle = (low + high) // 2
        if count_walls(occupied & (score >= steps[middle])) <= allowed:
            high = middle
        else:
            low = middle + 1
    return float(steps[low])


def attached_cells(clean: BoolArray, candidates: BoolArray) -> BoolArray:
    """Add to the clean map (H, W) the candidates (H, W) connected with it: a threshold with hysteresis.

    Jambs and ends of walls have a low score, for half of their neighborhood is open.
    """
    either = clean | candidates
    _, part = cv2.connectedComponents(either.view(np.uint8), connectivity=8)
    cells = np.flatnonzero(either)
    number = part.take(cells).astype(np.intp)
    touched = np.zeros(int(number.max(initial=0)) + 1, bool)
    touched[number.compress(clean.take(cells))] = True
    attached = np.zeros(clean.shape, bool)
    attached.reshape(-1)[cells.compress(touched.take(number))] = True
    return attached
