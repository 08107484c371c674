"""Where the canvas of a map lies against that of the map before, when nobody wrote down its origin."""

from __future__ import annotations

import dataclasses

import numpy as np

from rose2_logs.occupancy import FloatArray, OccupancySnapshot, classify
from rose2_logs.parameters import OccupancyParameters

WALL_SIGMA_CELLS = 2.0
"""Walls are blurred by this much, so that maps still correlate where they moved or turned a little."""


def placed(
    snapshot: OccupancySnapshot, before: OccupancySnapshot, parameters: OccupancyParameters
) -> OccupancySnapshot:
    """Give a map the origin at which it lies over the one before.

    Canvases of one size are taken to be the same canvas. One that grew is laid where its walls and those of
    the map before correlate most, in whole cells.

    Parameters
    ----------
    snapshot : OccupancySnapshot
        The map, of the same resolution as the one before.
    before : OccupancySnapshot
        The one before, where it lies.
    parameters : OccupancyParameters
        Which cells are walls.
    """
    origin = np.asarray(before.geometry.origin_xy_m)
    if snapshot.geometry.shape != before.geometry.shape:
        rows, columns = _offset(_walls(before, parameters), _walls(snapshot, parameters))
        origin = origin - np.array([columns, rows]) * snapshot.geometry.resolution_m
    x, y = origin.tolist()
    return dataclasses.replace(snapshot, geometry=dataclasses.replace(snapshot.geometry, origin_xy_m=(x, y)))


def _walls(snapshot: OccupancySnapshot, parameters: OccupancyParameters) -> FloatArray:
    """Blurred occupied cells (H, W)."""
    from scipy.ndimage import gaussian_filter

    _, occupied = classify(snapshot.cells, parameters)
    blurred: FloatArray = gaussian_filter(occupied.astype(np.float64), WALL_SIGMA_CELLS)
    return blurred


def _offset(first: FloatArray, second: FloatArray) -> tuple[int, int]:
    """Rows and columns that the first image is moved by to lie best over the second: their correlation."""
    from scipy import fft

    shape = [fft.next_fast_len(a + b, real=True) for a, b in zip(first.shape, second.shape, strict=True)]
    product = np.conj(fft.rfft2(first, shape)) * fft.rfft2(second, shape)
    correlation = fft.irfft2(product, shape)
    rows, columns = (int(at) for at in np.unravel_index(correlation.argmax(), correlation.shape))
    # Moves up and left stand at the far ends.
    return (
        rows - shape[0] if rows >= second.shape[0] else rows,
        columns - shape[1] if columns >= second.shape[1] else columns,
    )
