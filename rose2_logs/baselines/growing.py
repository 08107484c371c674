"""Region growing: seeds spread over the free cells, one cell further with each round."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.baselines.regions import SQUARE
from rose2_logs.occupancy import BoolArray


def grow(seeds: NDArray[np.int32], free: BoolArray) -> NDArray[np.int32]:
    """Let every free cell take the label of the seed from which the fewest steps lead to it.

    A step leads to any of the eight neighbours. Of several seeds that are as near, the one with more cells
    takes the cell, which does not depend on how the map lies; of seeds of the same size the one with the
    lower label. Free cells that no seed reaches stay without a label.

    Parameters
    ----------
    seeds : (H, W) int32
        Labels 1.. of the seeds, 0 elsewhere.
    free : (H, W) bool
        Cells that labels may spread over.

    Returns
    -------
    labels : (H, W) int32
        0 outside the free cells.
    """
    framed = np.pad(np.where(free, seeds, 0), 1)
    width = framed.shape[1]
    steps = np.array([-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1])
    size = np.bincount(framed.ravel())
    size[0] = 0
    by_size = np.argsort(-size, kind="stable")
    # While they spread, seeds are called by their rank: of two ranks the lower one wins.
    rank_of_label = np.empty(len(size), np.int32)
    rank_of_label[by_size] = np.arange(len(size))
    rank = rank_of_label[framed].ravel()
    is_open = np.pad(free, 1).ravel() & (framed.ravel() == 0)
    nobody = np.int32(len(size))
    rank[is_open] = nobody
    turn = np.zeros(len(rank), np.intp)
    near_open = cv2.dilate(is_open.reshape(framed.shape).astype(np.uint8), SQUARE).ravel() > 0
    front = np.flatnonzero(near_open & (framed.ravel() > 0))
    while len(front):
        reached = (front[:, None] + steps).ravel()
        by = np.repeat(rank[front], len(steps))
        fresh = is_open[reached]
        reached, by = reached[fresh], by[fresh]
        np.minimum.at(rank, reached, by)
        # Each cell goes on once, however many neighbours reached it.
        turn[reached] = np.arange(len(reached))
        front = reached[turn[reached] == np.arange(len(reached))]
        is_open[front] = False
    rank[is_open] = rank_of_label[0]
    labels: NDArray[np.int32] = by_size.astype(np.int32)[rank].reshape(framed.shape)
    return labels[1:-1, 1:-1]
