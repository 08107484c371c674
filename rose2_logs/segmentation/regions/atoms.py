"""Atoms of the floor: faces of a generous clean map, crossed with basins of the clearance."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.segmentation import watershed

from rose2_logs.config.regions import RegionParameters
from rose2_logs.model.labels import contacts, distance_from, equal_pieces, label_sizes
from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.regions.plan_frame import Labels, PlanFrame, grown_labels

BASIN_REACH_M = 0.2
"""Cells of the map that no basin of the plan frame covers belong to one this near: two plan cells."""
CLEARANCE_STEPS = 64
"""The clearance is told in this many steps per plan cell: its summits are found without rounding errors."""
ABSORBING_ROUNDS = 4
"""After this many rounds of absorbing, what is still small has no neighbor: it is loose."""


def cut_atoms(
    free: BoolArray,
    faces: Labels,
    solid: BoolArray,
    open_cells: BoolArray,
    frame: PlanFrame,
    resolution_m: float,
    parameters: RegionParameters,
) -> Labels:
    """Cut the floor into pieces too small rather than too large, so that all that is left to do is to join.

    Parameters
    ----------
    free : (H, W) bool
    faces : (H, W) int32
        Face of each cell.
    solid, open_cells : (P, Q) bool
        Plan cells that hold walls, and those that hold free cells.
    frame : PlanFrame
        Frame on which the basins are found, so that they turn with the map.
    resolution_m : float
    parameters : RegionParameters

    Returns
    -------
    atoms : (H, W) int32
        1.. on the free cells, 0 elsewhere and on loose cells.
    """
    basins = grown_labels(
        clearance_basins(open_cells & ~solid, solid, frame.cell_m, parameters), BASIN_REACH_M / frame.cell_m
    )
    basin = frame.back(basins, (free.shape[0], free.shape[1]))
    pieces = equal_pieces(free, faces, basin)
    return absorb_small(pieces, parameters.atom_min_m2 / resolution_m**2)


def clearance_basins(
    free: BoolArray, blocked: BoolArray, cell_m: float, parameters: RegionParameters
) -> Labels:
    """Basins (H, W) of the clearance on the free cells: each belongs to one summit."""
    distance = distance_from(blocked)
    # No clearance is larger than what 16 bits tell.
    steps = np.rint(np.minimum(distance, np.iinfo(np.uint16).max // CLEARANCE_STEPS) * CLEARANCE_STEPS)
    sigma = parameters.clearance_blur_m / cell_m
    smooth = cv2.GaussianBlur(steps.astype(np.uint16), (0, 0), sigma).astype(np.int32)
    height = np.where(free, smooth, -1).astype(np.float32)
    width = 2 * max(1, round(parameters.summit_reach_m / cell_m)) + 1
    summits = free & (height == cv2.dilate(height, np.ones((width, width), np.uint8)))
    markers, _ = ndimage.label(summits, np.ones((3, 3)))
    basins: NDArray[np.int32] = watershed(-smooth, markers, mask=free)  # type: ignore[no-untyped-call]
    return basins.astype(np.int32)


def absorb_small(pieces: Labels, min_cells: float) -> Labels:
    """Give pieces under `min_cells` to the larger neighbor with the longest contact; loose ones get 0."""
    count = int(pieces.max(initial=0)) + 1
    size = label_sizes(pieces, count - 1)
    loose = size < min_cells
    loose[0] = False
    # Pieces only grow: what takes part later touches a small piece now.
    meet = contacts(pieces)
    meet = meet.chosen((meet.low > 0) & (loose[meet.low] | loose[meet.high]))
    one, other, contact = meet.low.astype(np.int64), meet.high.astype(np.int64), np.ones(len(meet.low), int)
    piece = np.arange(count)
    for _ in range(ABSORBING_ROUNDS):
        small = size < min_cells
        small[0] = False
        apart = one != other
        key, index = np.unique(
            np.concatenate([(one * count + other)[apart], (other * count + one)[apart]]), return_inverse=True
        )
        contact = np.bincount(index, np.tile(contact[apart], 2), minlength=len(key)).astype(np.int64)
        one, other = np.divmod(key, count)
        # Towards the larger, and the higher number at equal size, so that nothing goes round in a circle.
        up = small[one] & ((size[other] > size[one]) | ((size[other] == size[one]) & (other > one)))
        order = np.flatnonzero(up)[np.lexsort((size[other[up]], contact[up]))]
        target = np.arange(count)
        target[one[order]] = other[order]
        if len(order) == 0:
            break
        while not np.array_equal(above := target[target], target):
            target = above
        piece = target[piece]
        size = np.bincount(target, size, minlength=count).astype(np.int64)
        once = one < other
        one, other, contact = target[one[once]], target[other[once]], contact[once]
    size[0] = 0
    kept = size >= min_cells
    kept[0] = False
    number = np.where(kept, np.cumsum(kept), 0).astype(np.int32)
    return number[piece].take(pieces)
