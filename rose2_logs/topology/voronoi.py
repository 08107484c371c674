"""The Voronoi graph of each room's free space (paper, III-D)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.morphology import skeletonize

from rose2_logs.occupancy import BoolArray


def clear_parts(
    labels: NDArray[np.int32], walls: BoolArray, resolution_m: float, min_clearance_m: float
) -> NDArray[np.int32]:
    """Find the connected parts of each room's free space that keeps clear of walls.

    They are the connected parts of the room's Voronoi graph as far as a robot of that half width can follow
    it: thinning to the graph keeps what is connected.

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
    part : (H, W) int32
        Parts 1.., 0 elsewhere; no part spans two rooms.
    """
    return _parts_within_rooms(labels, _clear_space(labels, walls, resolution_m, min_clearance_m))


def voronoi_graph(
    labels: NDArray[np.int32], walls: BoolArray, resolution_m: float, min_clearance_m: float
) -> NDArray[np.int32]:
    """Row and column (K, 2) of the cells of the Voronoi graph: the skeleton of the clear free space."""
    clear = _clear_space(labels, walls, resolution_m, min_clearance_m)
    skeleton = skeletonize(clear)  # type: ignore[no-untyped-call]
    return np.argwhere(skeleton).astype(np.int32)


def _clear_space(
    labels: NDArray[np.int32], walls: BoolArray, resolution_m: float, min_clearance_m: float
) -> BoolArray:
    distance = cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    clear: BoolArray = (labels > 0) & (distance * resolution_m >= min_clearance_m)
    return clear


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
