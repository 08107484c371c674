"""What stage A returns: dominant directions, structure score, clean map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Structure:
    """The regular structure of one map (paper, section III-A).

    Attributes
    ----------
    directions_rad : (D,) float
        Directions of walls in [0, pi), world frame, strongest first.
    strengths : (D,) float
        Share of the spectrum's energy that each direction holds.
    score : (H, W) float32
        Structure score of each occupied cell in [0, 1]; 0 elsewhere.
    threshold : float
        Cells with at least this score make the clean map.
    clean : (H, W) bool
        The clean map: occupied cells that belong to the structure.
    """

    directions_rad: FloatArray
    strengths: FloatArray
    score: NDArray[np.float32]
    threshold: float
    clean: BoolArray
