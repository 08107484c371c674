"""Labels of cells from rooms of atoms."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fit_grouping.atoms import BoolArray, Labels

LOOSE_REACH_M = 0.5
"""Free cells of pieces that are too small for an atom belong to the room this near."""


def room_labels(
    atoms: Labels, room_of_atom: NDArray[np.integer], free: BoolArray, resolution_m: float
) -> Labels:
    """Room 1.. of each free cell (H, W), 0 for none.

    Parameters
    ----------
    atoms : (H, W) int32
        Atom 1..A of each cell, 0 for none.
    room_of_atom : (A,) int
        Room 1.. of each atom, 0 for those outside.
    free : (H, W) bool
    """
    labels = np.concatenate([[0], room_of_atom])[atoms].astype(np.int32)
    loose = free & (atoms == 0)
    if not loose.any() or not labels.any():
        return labels
    distance, nearest = cv2.distanceTransformWithLabels(
        (labels == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_nearest = np.zeros(int(nearest.max()) + 1, np.int32)
    of_nearest[nearest[labels > 0]] = labels[labels > 0]
    near = loose & (distance * resolution_m <= LOOSE_REACH_M)
    labels[near] = of_nearest[nearest[near]]
    return labels
