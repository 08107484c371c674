"""The map's two-dimensional spectrum and the dominant directions that its ridges show (paper, III-A)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

from rose2_logs.config.parameters import SpectrumParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.circular_peaks import circular_peaks

PICTURE_SIDE = 160
"""Pixels along a side of the spectrum's picture: enough to separate its ridges, and still small."""
DIRECTION_STEPS = 36_000
"""Directions are rounded to this many steps of half a turn, 0.005 degrees: Whatever
instructions a CPU has, they are the same, and upright is upright."""
NO_GAIN = 1e-12
"""A gain below this is none: what it leaves is lost in single precision, whose smallest numbers are slow."""
ROWS_AT_ONCE = 64
"""Rows that are transformed back at once: they stay in a CPU's cache."""
STRENGTH_STEPS = 10_000
"""Strengths are rounded to this many steps: of equal ones the first direction is the strongest."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Half-plane Fourier transform of the occupied cells, with all walls brought to one thickness.

    Attributes
    ----------
    values : (h, w // 2 + 1) complex64
        The transform, zero padded to a size (h, w) that is good for it.
    frequency_x, frequency_y : (1, w // 2 + 1) and (h, 1) float32
        Frequencies in cycles per meter.
    shape : (int, int)
        The padded size (h, w).
    """

    values: NDArray[np.complex64]
    frequency_x: NDArray[np.float32]
    frequency_y: NDArray[np.float32]
    shape: tuple[int, int]

    def blurred_along(
        self, direction_rad: float, sigma_m: float, row: NDArray[np.intp], column: NDArray[np.intp]
    ) -> NDArray[np.float32]:
        """Keep the ridge of one direction and transform it back: the walls blurred along it.

        Parameters
        ----------
        direction_rad : float
            The blur's direction.
        sigma_m : float
            Its standard deviation.
        row, column : (N,) int
            The cells whose values (N,) are returned, row by row.
        """
        cos, sin = np.float32(np.cos(direction_rad)), np.float32(np.sin(direction_rad))
        x, y = self.frequency_x, self.frequency_y
        # Most of the plane lies beside the ridge; of one along an axis, all but a few rows or columns.
        reach = np.sqrt(-np.log(NO_GAIN) / 2) / (np.pi * sigma_m)
        columns = np.count_nonzero(np.abs(x * cos) <= reach + np.abs(y * sin).max())
        rows = np.flatnonzero(np.abs(y * sin) <= reach + np.abs(x * cos).max())
        along = x[:, :columns] * cos + y[rows] * sin
        along *= np.pi * sigma_m
        np.square(along, out=along)
        along *= -2
        gain = np.exp(along, out=along)
        gain[gain < NO_GAIN] = 0
        ridge = np.zeros((self.shape[0], columns), np.complex64)
        ridge[rows] = self.values[rows, :columns] * gain
        # One axis after the other, so that rows that are cut off are not transformed.
        count = int(row.max(initial=-1)) + 1
        of_rows = fft.ifft(ridge, axis=0, overwrite_x=True)[:count]
        values = np.empty(len(row), np.float32)
        for begin in range(0, count, ROWS_AT_ONCE):
            image = fft.irfft(of_rows[begin : begin + ROWS_AT_ONCE], self.shape[1], axis=1)
            part = slice(*np.searchsorted(row, [begin, begin + ROWS_AT_ONCE]))
            values[part] = image[row[part] - begin, column[part]]
        return values


def compute_spectrum(occupied: BoolArray, resolution_m: float, parameters: SpectrumParameters) -> Spectrum:
    """Transform the occupied cells of the explored part of a map.

    The canvas is padded by twice the length of the structure filter so that nothing wraps around, and the
    cells are blurred by `wall_sigma_m`, so that a wall that wobbles by a cell still is one straight line;
    thick walls and furniture count no more than a thin wall does.
    """
    margin = int(np.ceil(2 * parameters.structure_length_m / resolution_m))
    shape = tuple(fft.next_fast_len(side + margin, real=True) for side in occupied.shape)
    sigma = max(parameters.wall_sigma_m / resolution_m, parameters.wall_sigma_min_cells)
    walls = _walls_of_one_thickness(occupied, sigma)
    # One axis after the other, so that rows of zeros are not transformed.
    values = fft.fft(fft.rfft(walls, shape[1], axis=1), shape[0], axis=0)
    frequency_x = fft.rfftfreq(shape[1], resolution_m).astype(np.float32)[None, :]
    frequency_y = fft.fftfreq(shape[0], resolution_m).astype(np.float32)[:, None]
    return Spectrum(values, frequency_x, frequency_y, (shape[0], shape[1]))


def spectrum_picture(spectrum: Spectrum, parameters: SpectrumParameters) -> NDArray[np.uint8]:
    """Draw the spectrum for people: the logarithm of its magnitude around frequency zero.

    Returns
    -------
    picture : (S, S) uint8
        S is `PICTURE_SIDE`. Columns are x, rows y frequencies from `-1 / shortest_wave_m` to as much above 0,
        the waves that directions are looked for in; 0 is the median of the magnitudes, 255 the greatest.
    """
    step_x, step_y = float(spectrum.frequency_x[0, 1]), float(spectrum.frequency_y[1, 0])
    height, width = spectrum.values.shape
    columns = min(max(round(1 / parameters.shortest_wave_m / step_x), 1), width)
    rows = min(max(round(1 / parameters.shortest_wave_m / step_y), 1), height // 2)
    # The transform holds the half of positive x; a real map's spectrum is the same turned by half a circle.
    part = np.concatenate([spectrum.values[-rows:, :columns], spectrum.values[:rows, :columns]])
    half = cv2.resize(np.abs(part), (PICTURE_SIDE // 2, PICTURE_SIDE), interpolation=cv2.INTER_AREA)
    logarithm = np.log1p(np.concatenate([half[::-1, ::-1], half], axis=1))
    low, high = float(np.median(logarithm)), float(logarithm.max())
    if high <= low:
        return np.zeros(logarithm.shape, np.uint8)
    shown: NDArray[np.uint8] = (255 * np.clip((logarithm - low) / (high - low), 0, 1)).astype(np.uint8)
    return shown


def _walls_of_one_thickness(occupied: BoolArray, sigma: float) -> NDArray[np.float32]:
    """Blur the occupied cells, scaled so that a straight wall one cell thick is 1 and cut off there."""
    walls: NDArray[np.float32] = occupied.astype(np.float32)
    cv2.GaussianBlur(walls, (0, 0), sigma, dst=walls, borderType=cv2.BORDER_CONSTANT)
    walls /= np.float32(1 / (np.sqrt(2 * np.pi) * sigma))
    return np.minimum(walls, 1, out=walls)


def angular_energy(spectrum: Spectrum, parameters: SpectrumParameters) -> FloatArray:
    """Sum the spectrum's magnitude over the direction of the walls that cause it.

    A wall along direction t has its energy on the frequencies perpendicular to t. The magnitude is unfolded
    to polar coordinates and summed over the radius, so weighted that each point of the plane counts the same.

    Returns
    -------
    energy : (B,) float
        Bin b is centered on the wall direction b * pi / B.
    """
    bins = round(np.pi / parameters.angle_step_rad)
    step_x, step_y = float(spectrum.frequency_x[0, 1]), float(spectrum.frequency_y[1, 0])
    lowest = 1 / parameters.longest_wave_m
    highest = min(
        1 / parameters.shortest_wave_m, float(spectrum.frequency_x.max()), float(spectrum.frequency_y.max())
    )
    if highest <= lowest:
        return np.zeros(bins)
    radius = np.arange(lowest, highest, min(step_x, step_y))
    across = np.arange(bins) * np.pi / bins - np.pi / 2
    height, width = spectrum.values.shape
    middle = height // 2
    # Only so much of the plane is looked at; what lies beyond stays empty.
    columns, rows = (int(highest / step) + 2 for step in (step_x, step_y))
    below, above = min(rows, middle), min(rows, height - middle)
    magnitude = np.zeros((height, min(columns, width)), np.float32)
    magnitude[middle - below : middle] = np.abs(spectrum.values[height - below :, :columns])
    magnitude[middle : middle + above] = np.abs(spectrum.values[:above, :columns])
    polar = cv2.remap(
        magnitude,
        (np.outer(np.cos(across), radius) / step_x).astype(np.float32),
        (np.outer(np.sin(across), radius) / step_y + middle).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    energy: FloatArray = ndimage.gaussian_filter1d(
        polar.astype(float) @ radius, parameters.angle_sigma_rad / np.pi * bins, mode="wrap"
    )
    return energy


def dominant_directions(energy: FloatArray, parameters: SpectrumParameters) -> tuple[FloatArray, FloatArray]:
    """Peaks of the angular energy, refined below a bin by a parabola.

    Returns
    -------
    directions_rad : (D,) float
        Wall directions in [0, pi), strongest first.
    strengths : (D,) float
        Height of each peak above the floor, as a share of the energy's range.
    """
    span = float(np.ptp(energy))
    if span <= 0:
        return np.zeros(0), np.zeros(0)
    bins = len(energy)
    heights = (energy - energy.min()) / span
    gap = round(parameters.direction_min_gap_rad / np.pi * bins)
    peaks = circular_peaks(heights, gap, parameters.peak_min_prominence)
    left, center, right = heights[peaks - 1], heights[peaks], heights[(peaks + 1) % bins]
    curvature = left - 2 * center + right
    shift = np.divide(left - right, 2 * curvature, out=np.zeros(len(peaks)), where=curvature < 0)
    step = np.rint((peaks + shift) / bins * DIRECTION_STEPS) % DIRECTION_STEPS
    directions, strengths = (
        step * (np.pi / DIRECTION_STEPS),
        np.rint(center * STRENGTH_STEPS) / STRENGTH_STEPS,
    )
    order = np.lexsort((directions, -strengths))
    return directions[order], strengths[order]
