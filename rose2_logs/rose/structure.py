"""What stage A returns: dominant directions, structure score, clean map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import BoolArray, CellValues, FloatArray


@dataclass(frozen=True, eq=False)
class Structure:
    """The regular structure of one map (paper, section III-A).

    Attributes
    ----------
    directions_rad : (D,) float
        Directions of walls in [0, pi), world frame, strongest first.
    strengths : (D,) float
        Share of the spectrum's energy that each direction holds.
    threshold : float
        Cells with at least this score make the clean map.
    scores, clean_cells : CellValues
        What `score` and `clean` hold, of the occupied cells alone.
    spectrum : (S, S) uint8
        Picture of the spectrum in the grid's frame, see `rose.spectrum.spectrum_picture`.
    """

    directions_rad: FloatArray
    strengths: FloatArray
    threshold: float
    scores: CellValues[np.float32]
    clean_cells: CellValues[np.bool_]
    spectrum: NDArray[np.uint8]

    @property
    def score(self) -> NDArray[np.float32]:
        """Structure score (H, W) of each occupied cell in [0, 1]; 0 elsewhere."""
        return self.scores.whole()

    @property
    def clean(self) -> BoolArray:
        """The clean map (H, W): occupied cells that belong to the structure."""
        return self.clean_cells.whole()
