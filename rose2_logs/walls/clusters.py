"""Wall clusters: segments of one direction that belong to one wall (paper, III-B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import DBSCAN

from rose2_logs.occupancy import FloatArray
from rose2_logs.parameters import WallParameters
from rose2_logs.walls.segments import Segments


@dataclass(frozen=True, eq=False)
class WallClusters:
    """Walls as intervals along a direction. Metres, grid frame.

    Attributes
    ----------
    direction : (C,) int32
        Index of the direction.
    offset : (C,) float
        Distance of the wall's line from the origin, along the direction turned by a quarter.
    start, end : (C,) float
        Where along the direction the wall begins and ends.
    covered : (C,) float
        Length of the wall that segments cover.
    of_segment : (N,) int32
        Cluster of each segment.
    """

    direction: NDArray[np.int32]
    offset: FloatArray
    start: FloatArray
    end: FloatArray
    covered: FloatArray
    of_segment: NDArray[np.int32]


def cluster_segments(segments: Segments, parameters: WallParameters) -> WallClusters:
    """Join the segments of one direction that are close to each other by DBSCAN.

    Distance is lateral offset over `cluster_lateral_m` or gap along the wall over `cluster_gap_m`, the larger
    of the two. Each cluster lies at the median offset of its segments, weighted by their length.
    """
    direction, offset, start, end = segments.direction, segments.offset, segments.start, segments.end
    of_segment = np.full(len(offset), -1, np.int32)
    count = 0
    for index in range(len(segments.directions_rad)):
        chosen = np.flatnonzero(direction == index)
        if len(chosen):
            labels = _dbscan_intervals(offset[chosen], start[chosen], end[chosen], parameters)
            of_segment[chosen] = count + labels
            count += int(labels.max()) + 1
    length = np.maximum(end - start, 1e-9)
    first = np.full(count, np.inf)
    last = np.full(count, -np.inf)
    np.minimum.at(first, of_segment, start)
    np.maximum.at(last, of_segment, end)
    cluster_direction = np.zeros(count, np.int32)
    cluster_direction[of_segment] = direction
    return WallClusters(
        cluster_direction,
        weighted_median(offset, length, of_segment, count),
        first,
        last,
        covered_length(start, end, of_segment, count),
        of_segment,
    )


def _dbscan_intervals(
    offset: FloatArray, start: FloatArray, end: FloatArray, parameters: WallParameters
) -> NDArray[np.int32]:
    """Label intervals: DBSCAN over points set along them more densely than the gap that it bridges."""
    gap = parameters.cluster_gap_m
    pieces = np.maximum(np.ceil((end - start) / (gap / 2)).astype(np.int64), 1)
    owner = np.repeat(np.arange(len(offset)), pieces + 1)
    position = np.arange(len(owner)) - np.repeat(np.cumsum(pieces + 1) - (pieces + 1), pieces + 1)
    along = start[owner] + (end - start)[owner] * position / pieces[owner]
    points = np.column_stack([offset[owner] / parameters.cluster_lateral_m, along / gap])
    labels = DBSCAN(eps=1.0, min_samples=1, metric="chebyshev").fit_predict(points)
    first = np.cumsum(pieces + 1) - (pieces + 1)
    of_interval: NDArray[np.int32] = labels[first].astype(np.int32)
    return of_interval


def weighted_median(
    values: FloatArray, weights: FloatArray, group: NDArray[np.int32], count: int
) -> FloatArray:
    """Weighted median (count,) of the values of each group."""
    order = np.lexsort((values, group))
    ordered_group, total = group[order], np.bincount(group, weights=weights, minlength=count)
    running = np.cumsum(weights[order])
    before = np.concatenate([[0.0], np.cumsum(total)[:-1]])
    reached = running - before[ordered_group] >= total[ordered_group] / 2 - 1e-12
    first = np.full(count, len(values))
    np.minimum.at(first, ordered_group[reached], np.flatnonzero(reached))
    median: FloatArray = values[order][first]
    return median


def covered_length(start: FloatArray, end: FloatArray, group: NDArray[np.int32], count: int) -> FloatArray:
    """Length (count,) of the union of the intervals of each group."""
    order = np.lexsort((start, group))
    group, start, end = group[order], start[order], end[order]
    # Groups are laid out one after the other on one axis, so that a single running maximum serves all.
    span = float(np.ptp(np.concatenate([start, end]))) + 1.0 if len(start) else 1.0
    shift = group * span - (start.min() if len(start) else 0.0)
    reach = np.maximum.accumulate(end + shift)
    before = np.concatenate([[-np.inf], reach[:-1]])
    added = np.maximum(end + shift - np.maximum(start + shift, before), 0)
    return np.bincount(group, weights=added, minlength=count).astype(float)
