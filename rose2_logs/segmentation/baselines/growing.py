"""Region growing: seeds spread over the free cells, one cell further with each round."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.baselines.regions import SQUARE, ranks_by_size


def grow(seeds: NDArray[np.int32], free: BoolArray) -> NDArray[np.int32]:
    """Let every free cell take the label of the seed from which the fewest steps lead to it.

    A step leads to any of the eight neighbors. Of several seeds that are as near, the one with more cells
    takes the cell, and then the one nearer to the middle of all: `ranks_by_size`. Free cells that no seed
    reaches stay without a label.

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
    # While they spread, seeds are called by their rank: of two ranks the lower one wins.
    rank_of_label = ranks_by_size(framed)
    rank = rank_of_label[framed].ravel()
    is_open = np.pad(free, 1).ravel() & (framed.ravel() == 0)
    nobody = len(rank_of_label)
    rank[is_open] = nobody
    visit = np.zeros(len(rank), np.intp)
    near_open = cv2.dilate(is_open.reshape(framed.shape).astype(np.uint8), SQUARE).ravel() > 0
    front = np.flatnonzero(near_open & (framed.ravel() > 0))
    while len(front):
        reached = (front[:, None] + steps).ravel()
        by = np.repeat(rank[front], len(steps))
        fresh = is_open[reached]
        reached, by = reached[fresh], by[fresh]
        np.minimum.at(rank, reached, by)
        # Each cell goes on once, however many neighbors reached it.
        visit[reached] = np.arange(len(reached))
        front = reached[visit[reached] == np.arange(len(reached))]
        is_open[front] = False
    rank[is_open] = rank_of_label[0]
    label_of_rank = np.argsort(rank_of_label).astype(np.int32)
    labels: NDArray[np.int32] = label_of_rank[rank].reshape(framed.shape)
    return labels[1:-1, 1:-1]
