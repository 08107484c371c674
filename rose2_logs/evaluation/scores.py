"""Figures of a segmentation against ground truth, as room segmentation benchmarks define them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rose2_logs.tracking.overlap import overlap_of

Name = TypeVar("Name", bound=str)

FIGURES = ("precision", "recall", "iou_seg", "iou_gt", "iou_sym", "pq")
MATCH_IOU = 0.5
"""Panoptic quality counts pairs above one half: no room can have two such partners."""


@dataclass(frozen=True)
class Scores:
    """Figures of one map, or their means over maps, in percent.

    The partner of a segmented room is the true room that it overlaps most, and the other way round; partners
    are not one-to-one.

    Attributes
    ----------
    precision : float
        Mean over segmented rooms of overlap with the partner over own size.
    recall : float
        Mean over true rooms of overlap with the partner over own size.
    iou_seg : float
        Mean over segmented rooms of intersection over union with the partner. It forgives merged rooms.
    iou_gt : float
        Mean over true rooms of intersection over union with the partner. It punishes merged rooms.
    iou_sym : float
        Mean of the two.
    pq : float
        Panoptic quality: sum of intersection over union of the pairs above one half over the mean number of
        rooms.
    rooms_seg, rooms_gt : float
        Number of segmented and of true rooms.
    """

    precision: float
    recall: float
    iou_seg: float
    iou_gt: float
    iou_sym: float
    pq: float
    rooms_seg: float
    rooms_gt: float


def score(truth: NDArray[np.integer], segmented: NDArray[np.integer]) -> Scores:
    """Compare two label images of one map.

    Parameters
    ----------
    truth, segmented : (H, W) int
        Labels, 0 = no room.

    Returns
    -------
    Scores
        All zero where one of the two holds no room.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    table = overlap_of(segmented, truth)
    rooms_seg, rooms_gt = len(table.first_ids), len(table.second_ids)
    if rooms_seg == 0 or rooms_gt == 0:
        return Scores(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, rooms_seg, rooms_gt)
    iou = table.iou
    every_seg, every_gt = np.arange(rooms_seg), np.arange(rooms_gt)
    partner_of_seg, partner_of_gt = table.common.argmax(1), table.common.argmax(0)
    precision = np.mean(table.common[every_seg, partner_of_seg] / table.first_size)
    recall = np.mean(table.common[partner_of_gt, every_gt] / table.second_size)
    iou_seg = np.mean(iou[every_seg, partner_of_seg])
    iou_gt = np.mean(iou[partner_of_gt, every_gt])
    pq = iou[iou > MATCH_IOU].sum() / ((rooms_seg + rooms_gt) / 2)
    return Scores(
        precision=100 * float(precision),
        recall=100 * float(recall),
        iou_seg=100 * float(iou_seg),
        iou_gt=100 * float(iou_gt),
        iou_sym=50 * float(iou_seg + iou_gt),
        pq=100 * float(pq),
        rooms_seg=rooms_seg,
        rooms_gt=rooms_gt,
    )


def score_against(
    truths: Mapping[Name, NDArray[np.integer]], segmented: NDArray[np.integer]
) -> tuple[Name, Scores]:
    """Compare a label image with every truth of its map; the one of the greatest `iou_sym` counts.

    Parameters
    ----------
    truths : mapping of str to (H, W) int
        At least one label image by its name, 0 = no room.
    segmented : (H, W) int
        Labels, 0 = no room.

    Returns
    -------
    name : str
        The truth that counts; of equal ones the first.
    scores : Scores
        The figures against it.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    found = ((name, score(truth, segmented)) for name, truth in truths.items())
    return max(found, key=lambda named: named[1].iou_sym)


def mean_scores(scores: Iterable[Scores]) -> Scores:
    """Mean of each figure over maps; every map counts the same.

    Raises
    ------
    ValueError
        If there is no map.
    """
    rows = np.array([(*(getattr(s, name) for name in FIGURES), s.rooms_seg, s.rooms_gt) for s in scores])
    if len(rows) == 0:
        raise ValueError("no scores to take the mean of")
    return Scores(*rows.mean(axis=0).tolist())
