"""Representative lines: what the wall clusters say of how the map is divided (paper, III-B)."""

from __future__ import annotations

from bisect import bisect
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import WallParameters
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.segmentation.walls.clusters import WallClusters
from rose2_logs.segmentation.walls.segments import line_ends


@dataclass(frozen=True, eq=False)
class RepresentativeLines:
    """Lines that divide the plane. Meters, grid frame.

    Attributes
    ----------
    ends_m : (L, 4) float
        x0, y0, x1, y1: the evidence and as far beyond as a wall may go on unseen.
    direction : (L,) int32
        Index of each line's direction, as of the segments.
    weight : (L,) float
        Share of the line that segments cover.
    of_cluster : (C,) int32
        Line of each wall cluster; -1 for none.
    """

    ends_m: FloatArray
    direction: NDArray[np.int32]
    weight: FloatArray
    of_cluster: NDArray[np.int32]


def representative_lines(
    clusters: WallClusters,
    directions_rad: FloatArray,
    dominant_count: int,
    parameters: WallParameters,
) -> RepresentativeLines:
    """Join collinear clusters and extend each wall to a line.

    Clusters of one direction closer across than `line_lateral_m` share one offset, that of the one with most
    wall. Along an offset, clusters whose extensions touch make one line. A line reaches `extension_m` (or
    `local_extension_m` where its direction is only local) beyond its evidence, and is kept if
    segments cover at least `line_min_weight` of it.
    """
    count = len(clusters.offset)
    reach = np.where(
        clusters.direction < dominant_count, parameters.extension_m, parameters.local_extension_m
    )
    # A short wall says little about what is far from it.
    reach = np.minimum(reach, parameters.extension_per_length * clusters.covered)
    offset = _shared_offsets(clusters, parameters.line_lateral_m)
    order = np.lexsort((clusters.start - reach, offset, clusters.direction))
    start, end = (clusters.start - reach)[order], (clusters.end + reach)[order]
    same = np.zeros(count, bool)
    same[1:] = (np.diff(clusters.direction[order]) == 0) & (np.diff(offset[order]) == 0)
    line = np.zeros(count, np.int32)
    number, furthest = -1, -np.inf
    for k in range(count):
        if not same[k] or start[k] > furthest:
            number, furthest = number + 1, -np.inf
        furthest = max(furthest, end[k])
        line[k] = number
    lines = number + 1
    of_cluster = np.zeros(count, np.int32)
    of_cluster[order] = line
    first, last = np.full(lines, np.inf), np.full(lines, -np.inf)
    np.minimum.at(first, line, start)
    np.maximum.at(last, line, end)
    covered = np.bincount(line, weights=clusters.covered[order], minlength=lines)
    direction = np.zeros(lines, np.int32)
    direction[of_cluster] = clusters.direction
    line_offset = np.zeros(lines)
    line_offset[of_cluster] = offset
    weight = covered / np.maximum(last - first, 1e-9)
    keep = weight >= parameters.line_min_weight
    renumber = np.where(keep, np.cumsum(keep) - 1, -1).astype(np.int32)
    return RepresentativeLines(
        line_ends(directions_rad[direction], line_offset, first, last)[keep],
        direction[keep],
        np.minimum(weight[keep], 1.0),
        renumber[of_cluster],
    )


def _shared_offsets(clusters: WallClusters, lateral_m: float) -> FloatArray:
    """Offset of each cluster's line: clusters take the offset of the heaviest one near them."""
    shared = clusters.offset.copy()
    for index in np.unique(clusters.direction):
        members = np.flatnonzero(clusters.direction == index)
        members = members[np.lexsort((clusters.offset[members], -clusters.covered[members]))]
        taken: list[float] = []  # ascending: the nearest is one of two neighbors
        for member, value in zip(members.tolist(), clusters.offset[members].tolist(), strict=True):
            at = bisect(taken, value)
            nearest = min(
                taken[max(at - 1, 0) : at + 1], key=lambda offset: abs(offset - value), default=np.inf
            )
            if abs(nearest - value) <= lateral_m:
                shared[member] = nearest
            else:
                taken.insert(at, value)
    return shared
