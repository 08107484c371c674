"""Wall clusters: segments of one direction that belong to one wall (paper, III-B)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import WallParameters
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.model.regions import connected
from rose2_logs.segmentation.walls.segments import Segments


@dataclass(frozen=True, eq=False)
class WallClusters:
    """Walls as intervals along a direction. Meters, grid frame.

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
    """Join the segments of one direction that are close to each other, see `group_segments`.

    Each cluster is at the median offset of its segments, weighted by their length.
    """
    direction, offset, start, end = segments.direction, segments.offset, segments.start, segments.end
    count, of_segment = group_segments(segments, parameters)
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


def group_segments(segments: Segments, parameters: WallParameters) -> tuple[int, NDArray[np.int32]]:
    """Number the clusters of segments of one direction that are close to each other, as DBSCAN finds them.

    With min_samples of 1 no segment is noise, and the clusters of DBSCAN are the connected components of the
    segments nearer than 1 to each other. Importing DBSCAN from scikit-learn would take a second in every
    process, several times as long as a usual map.

    Distance is lateral offset over `cluster_lateral_m` or gap along the wall over `cluster_gap_m`, the larger
    of the two.

    Returns
    -------
    count : int
        Number of clusters.
    of_segment : (N,) int32
        Cluster of each segment, by their first segments.
    """
    count = len(segments.offset)
    one, other = _near_intervals(segments, parameters)
    return connected(count, one, other)


def _near_intervals(
    segments: Segments, parameters: WallParameters
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of segments of one direction that are close enough both across and along."""
    start, end, direction = segments.start, segments.end, segments.direction
    order = np.lexsort((segments.offset, direction))
    offset = segments.offset[order]
    count = np.empty(len(order), np.intp)
    bounds = np.searchsorted(direction[order], np.arange(len(segments.directions_rad) + 1))
    for low, high in itertools.pairwise(bounds.tolist()):
        own = offset[low:high]
        reach = np.searchsorted(own, own + parameters.cluster_lateral_m, side="right")
        count[low:high] = reach - np.arange(1, len(own) + 1)
    first = np.repeat(np.arange(len(order)), count)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
    one, other = order[first], order[second]
    gap = np.maximum(start[one], start[other]) - np.minimum(end[one], end[other])
    near = gap <= parameters.cluster_gap_m
    return one.compress(near), other.compress(near)


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
