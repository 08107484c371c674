"""Changes of a map under which its rooms stay the same, applied to cells and room labels alike."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import UNKNOWN, OccupancySnapshot

Cells = NDArray[np.int8]
Labels = NDArray[np.int32]

PADDING_CELLS = ((37, 11), (53, 20))
"""Cells added before and after the rows and the columns: odd and even, no multiple of anything."""
UPSAMPLING = 2
ROTATION_RAD = np.pi / 6
"""As far as can be from the axes and from the diagonals that walls may follow."""
REMOVED_SHARE = 0.01
REMOVED_SEED = 0


@dataclass(frozen=True)
class Transform:
    """One change of a map.

    Attributes
    ----------
    name : str
        Heading of its column.
    sentence : str
        What is done to the map.
    change : callable
        From cells and labels (H, W) to those of the changed map; both are treated alike.
    resolution_factor : float
        The changed map's resolution over that of the map.
    """

    name: str
    sentence: str
    change: Callable[[Cells, Labels], tuple[Cells, Labels]]
    resolution_factor: float = 1.0

    def __call__(self, snapshot: OccupancySnapshot, labels: Labels) -> tuple[OccupancySnapshot, Labels]:
        """Return the changed map and the labels on it."""
        cells, changed = self.change(snapshot.cells, labels)
        geometry = dataclasses.replace(
            snapshot.geometry,
            resolution_m=snapshot.geometry.resolution_m * self.resolution_factor,
            shape=cells.shape,
        )
        cells = np.ascontiguousarray(cells)
        return dataclasses.replace(snapshot, cells=cells, geometry=geometry), np.ascontiguousarray(changed)


def _padded(cells: Cells, labels: Labels) -> tuple[Cells, Labels]:
    return np.pad(cells, PADDING_CELLS, constant_values=UNKNOWN), np.pad(labels, PADDING_CELLS)


def _upsampled(cells: Cells, labels: Labels) -> tuple[Cells, Labels]:
    return (
        cells.repeat(UPSAMPLING, axis=0).repeat(UPSAMPLING, axis=1),
        labels.repeat(UPSAMPLING, axis=0).repeat(UPSAMPLING, axis=1),
    )


def _rotated(cells: Cells, labels: Labels) -> tuple[Cells, Labels]:
    """Turn about the center onto a canvas that holds all; each cell takes the value at its center."""
    cosine, sine = np.cos(ROTATION_RAD), np.sin(ROTATION_RAD)
    height, width = cells.shape
    rows = int(np.ceil(height * abs(cosine) + width * abs(sine)))
    columns = int(np.ceil(height * abs(sine) + width * abs(cosine)))
    y, x = np.mgrid[:rows, :columns] + 0.5 - np.reshape([rows / 2, columns / 2], (2, 1, 1))
    source_row = np.floor(cosine * y - sine * x + height / 2).astype(np.intp)
    source_column = np.floor(sine * y + cosine * x + width / 2).astype(np.intp)
    inside = (source_row >= 0) & (source_row < height) & (source_column >= 0) & (source_column < width)
    source = source_row[inside], source_column[inside]
    turned_cells = np.full((rows, columns), UNKNOWN, cells.dtype)
    turned_labels = np.zeros((rows, columns), labels.dtype)
    turned_cells[inside], turned_labels[inside] = cells[source], labels[source]
    return turned_cells, turned_labels


def _thinned(cells: Cells, labels: Labels) -> tuple[Cells, Labels]:
    known = np.flatnonzero(cells >= 0)
    count = round(REMOVED_SHARE * len(known))
    removed = np.random.default_rng(REMOVED_SEED).choice(known, count, replace=False)
    cells, labels = cells.copy(), labels.copy()
    cells.flat[removed], labels.flat[removed] = UNKNOWN, 0
    return cells, labels


TRANSFORMS = (
    Transform(
        "quarter turn", "Turned by 90 degrees.", lambda cells, labels: (np.rot90(cells), np.rot90(labels))
    ),
    Transform("mirror", "Left and right swapped.", lambda cells, labels: (cells[:, ::-1], labels[:, ::-1])),
    Transform("padding", "Unknown cells added on every side, so that the map moves on its canvas.", _padded),
    Transform(
        f"{UPSAMPLING}x finer",
        f"Each cell becomes {UPSAMPLING} x {UPSAMPLING} cells of the same value.",
        _upsampled,
        1 / UPSAMPLING,
    ),
    Transform(
        f"turned by {np.degrees(ROTATION_RAD):.0f} degrees",
        "Turned by the nearest cell, which also breaks thin walls.",
        _rotated,
    ),
    Transform(
        f"{REMOVED_SHARE:.0%} unknown".replace("%", " %"),
        f"{100 * REMOVED_SHARE:g} % of the known cells, drawn at random, become unknown.",
        _thinned,
    ),
)
