"""Critical lines: cuts across the free space at its narrow places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.baselines.regions import cells_on_lines

NEAREST_ASKED = 32
"""Boundary cells looked at first for a line's second end; doubled until one fits."""
SAME = 1e-9
"""Angles and lengths that differ by rounding only are the same."""


@dataclass(frozen=True, eq=False)
class CriticalLines:
    """Lines from a boundary cell over a critical point to a boundary cell on another side.

    Attributes
    ----------
    points, first, second : (N, 2) int
        Row and column of the critical point and of the two ends.
    angle_rad : (N,) float
        Between the two halves, at the critical point; pi where the line is straight.
    length : (N,) float
        Of both halves together, cells.
    clearance : (N,) float
        Distance of the critical point from obstacles, cells.
    """

    points: NDArray[np.intp]
    first: NDArray[np.intp]
    second: NDArray[np.intp]
    angle_rad: FloatArray
    length: FloatArray
    clearance: FloatArray

    def cells(self, which: BoolArray, middle: FloatArray) -> NDArray[np.intp]:
        """Row and column (M, 2) of the cells on some of the lines; `middle` as for `nearest_cells`."""
        points = self.points[which].astype(float)
        ends = [end[which].astype(float) for end in (self.first, self.second)]
        return np.concatenate([cells_on_lines(points, end, middle) for end in ends])


def critical_lines(
    points: NDArray[np.intp],
    boundary: NDArray[np.intp],
    distance: NDArray[np.float32],
    middle: FloatArray,
) -> CriticalLines:
    """Join critical points with the boundary on two sides.

    A line's first end is the nearest boundary cell. The second is the nearest one that is farther from the
    point than the first, and farther from the first than the point's distance from obstacles. Of equally near
    cells the one nearest to the middle of the map counts, so that lines turn with the map.

    Parameters
    ----------
    points : (K, 2) int
        Row and column of the critical points.
    boundary : (B, 2) int
        Row and column of the boundary cells.
    distance : (H, W) float32
        Distance from obstacles in cells.
    middle : (2,) float
        Row and column of the middle of the map.

    Returns
    -------
    CriticalLines
        Of the points for which there are two ends.
    """
    clearance = distance[points[:, 0], points[:, 1]].astype(float)
    tree = cKDTree(boundary)
    from_middle = np.linalg.norm(boundary - middle, axis=1)
    first = np.zeros(len(points), np.intp)
    second = np.full(len(points), -1, np.intp)
    open_points = np.arange(len(points))
    asked = min(NEAREST_ASKED, len(boundary))
    while len(open_points) and asked:
        far, index = tree.query(points[open_points], k=np.arange(1, asked + 1))
        order = np.lexsort((from_middle[index], far))
        far, index = np.take_along_axis(far, order, 1), np.take_along_axis(index, order, 1)
        one = index[:, :1]
        between = np.linalg.norm(boundary[index] - boundary[one], axis=-1)
        fits = (far > far[:, :1]) & (between > clearance[open_points, None])
        hit = fits.argmax(1)
        has = fits[np.arange(len(hit)), hit]
        first[open_points] = one[:, 0]
        second[open_points[has]] = index[np.arange(len(hit)), hit][has]
        open_points = open_points[~has]
        if asked == len(boundary):
            break
        asked = min(2 * asked, len(boundary))
    has = second >= 0
    points, clearance = points[has], clearance[has]
    ends = boundary[first[has]], boundary[second[has]]
    halves = [(end - points).astype(float) for end in ends]
    lengths = [np.hypot(half[:, 0], half[:, 1]) for half in halves]
    cosine = np.einsum("ij,ij->i", *halves) / np.maximum(lengths[0] * lengths[1], 1e-12)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    return CriticalLines(points, *ends, angle, lengths[0] + lengths[1], clearance)


def best_lines(lines: CriticalLines, min_gap: float) -> BoolArray:
    """Find which lines have no better one close by.

    A better line has the larger angle or, where that is the same, the shorter length. Lines that are as good
    as each other stay both, whatever their order.

    Parameters
    ----------
    lines : CriticalLines
    min_gap : float
        Critical points closer than this times the distance from obstacles compete.

    Returns
    -------
    best : (N,) bool
    """
    best = np.ones(len(lines.points), bool)
    reach = min_gap * lines.clearance
    pairs = cKDTree(lines.points).query_pairs(reach.max(initial=0.0), output_type="ndarray")
    gap = np.linalg.norm(lines.points[pairs[:, 0]] - lines.points[pairs[:, 1]], axis=1)
    for one, other in (pairs.T, pairs.T[::-1]):
        straighter = lines.angle_rad[other] - lines.angle_rad[one]
        shorter = lines.length[one] - lines.length[other]
        beaten = (straighter > SAME) | ((straighter > -SAME) & (shorter > SAME))
        best[one[beaten & (gap < reach[one])]] = False
    return best
