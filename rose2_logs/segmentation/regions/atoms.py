"""Atoms of the floor: faces of a generous clean map, crossed with basins of the clearance."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import label
from skimage.segmentation import watershed

from rose2_logs.config.regions import RegionParameters
from rose2_logs.model.labels import contacts
from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.regions.plan_frame import Labels, PlanFrame, grown_labels, without_specks

BASIN_REACH_M = 0.2
"""Cells of the map that no basin of the plan frame covers belong to one this near: two plan cells."""
CLEARANCE_STEPS = 64
"""The clearance is told in this many steps per plan cell: its summits are found without rounding errors."""
ABSORBING_ROUNDS = 4
"""After this many rounds of absorbing, what is still small has no neighbor: it is loose."""


def cut_atoms(
    free: BoolArray,
    occupied: BoolArray,
    faces: Labels,
    frame: PlanFrame,
    resolution_m: float,
    parameters: RegionParameters,
) -> Labels:
    """Cut the floor into pieces too small rather than too large, so that all that is left to do is to join.

    Parameters
    ----------
    free, occupied : (H, W) bool
    faces : (H, W) int32
        Face of each cell.
    frame : PlanFrame
        Frame on which the basins are found, so that they turn with the map.
    resolution_m : float
    parameters : RegionParameters

    Returns
    -------
    atoms : (H, W) int32
        1.. on the free cells, 0 elsewhere and on loose cells.
    """
    walls = without_specks(occupied, parameters.speck_max_m / resolution_m)
    solid, open_cells = frame.shares(walls, free) > 0
    open_cells &= ~solid
    basins = grown_labels(
        clearance_basins(open_cells, solid, frame.cell_m, parameters), BASIN_REACH_M / frame.cell_m
    )
    basin = frame.back(basins, (free.shape[0], free.shape[1]))
    key = np.where(free, faces.astype(np.int64) * (int(basin.max(initial=0)) + 1) + basin + 1, 0)
    pieces = label(key, connectivity=1, background=0).astype(np.int32)  # type: ignore[no-untyped-call]
    return absorb_small(pieces, parameters.atom_min_m2 / resolution_m**2)


def clearance_basins(
    free: BoolArray, blocked: BoolArray, cell_m: float, parameters: RegionParameters
) -> Labels:
    """Basins (H, W) of the clearance on the free cells: each belongs to one summit."""
    distance = cv2.distanceTransform((~blocked).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
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
    for _ in range(ABSORBING_ROUNDS):
        count = int(pieces.max(initial=0)) + 1
        size = np.bincount(pieces.ravel(), minlength=count)
        small = size < min_cells
        small[0] = False
        if not small.any():
            break
        meet = contacts(pieces)
        meet = meet.chosen(meet.low > 0)
        one, other = meet.low.astype(np.int64), meet.high.astype(np.int64)
        key, contact = np.unique(
            np.concatenate([one * count + other, other * count + one]), return_counts=True
        )
        one, other = np.divmod(key, count)
        # Towards the larger, and the higher number at equal size, so that nothing goes round in a circle.
        up = small[one] & ((size[other] > size[one]) | ((size[other] == size[one]) & (other > one)))
        one, other, contact = one[up], other[up], contact[up]
        order = np.lexsort((size[other], contact))
        target = np.arange(count)
        target[one[order]] = other[order]
        if np.array_equal(target, np.arange(count)):
            break
        while not np.array_equal(above := target[target], target):
            target = above
        pieces = target[pieces].astype(np.int32)
    size = np.bincount(pieces.ravel())
    size[0] = 0
    kept = np.flatnonzero(size >= min_cells)
    renumbered = np.zeros(len(size), np.int32)
    renumbered[kept] = np.arange(1, len(kept) + 1)
    return renumbered[pieces]
