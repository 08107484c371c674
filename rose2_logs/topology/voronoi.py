"""The Voronoi graph of each room's free space (paper, III-D)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.morphology import skeletonize

from rose2_logs.occupancy import BoolArray


def voronoi_cells(
    labels: NDArray[np.int32], walls: BoolArray, resolution_m: float, min_clearance_m: float
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Skeleton of the free space that keeps clear of walls, and the part of its room's graph it belongs to.

    Parameters
    ----------
    labels : (H, W) int32
        The segmented map.
    walls : (H, W) bool
        Cells of the clean map; clutter does not cut a room in two.
    min_clearance_m : float
        The graph keeps this far from walls.

    Returns
    -------
    skeleton : (K, 2) int32
        Row and column of the cells of the Voronoi graph.
    part : (H, W) int32
        Connected parts of the clear free space of all rooms, 1.., 0 elsewhere; parts never span two rooms.
    """
    distance = cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    clear = (labels > 0) & (distance * resolution_m >= min_clearance_m)
    part = _parts_within_rooms(labels, clear)
    skeleton = np.argwhere(skeletonize(clear)).astype(np.int32)  # type: ignore[no-untyped-call]
    return skeleton, part


def _parts_within_rooms(labels: NDArray[np.int32], clear: BoolArray) -> NDArray[np.int32]:
    """Connected parts of the clear cells of each room: parts that a passage joins stay apart by room."""
    # Rooms are separated by cutting every cell whose lower or right neighbour lies in another room.
    cut = clear.copy()
    cut[:, :-1] &= (labels[:, :-1] == labels[:, 1:]) | ~clear[:, 1:]
    cut[:-1] &= (labels[:-1] == labels[1:]) | ~clear[1:]
    cut[:-1, :-1] &= (labels[:-1, :-1] == labels[1:, 1:]) | ~clear[1:, 1:]
    cut[:-1, 1:] &= (labels[:-1, 1:] == labels[1:, :-1]) | ~clear[1:, :-1]
    _, part = cv2.connectedComponents(cut.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)
    return np.asarray(part, np.int32)
