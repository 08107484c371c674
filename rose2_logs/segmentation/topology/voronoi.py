"""The Voronoi graph of each room's free space, and the parts between its passages (paper, III-D)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import skeletonize
from skimage.segmentation import watershed

from rose2_logs.config.topology import TopologyParameters
from rose2_logs.model.labels import LabelRuns, contacts, distance_from, label_sizes, straight_runs
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.model.regions import RegionGraph, best_first

DRAWN_BLOCK = 2
"""The graph is drawn by every so many cells: a passage of 30 cm is three of 10 cm wide."""
ROUNDED_UP = 1 + 1e-6
"""Numerical: more than single precision rounds off."""


def parts_of_room(
    inside: BoolArray, clear: NDArray[np.float32], resolution_m: float, parameters: TopologyParameters
) -> NDArray[np.int32] | None:
    """Find the parts of a room that only narrow passages connect.

    A passage is a point of the Voronoi graph where the clearance, the distance from walls, is least between
    two summits: a saddle. Two parts are one where the clearance of the passage is at least
    `passage_min_ratio` of that of the less open part; what is too small or too narrow joins what it opens to
    most.

    Parameters
    ----------
    inside : (H, W) bool
        The cells of the room.
    clear : (H, W) float32
        Distance from walls in meters, see `clearance_m`; clutter makes no passage.

    Returns
    -------
    part : (H, W) int32, optional
        Parts 1.., 0 outside the room. Pieces too small for a part need not have a number of their own. None
        if the room has only one part.
    """
    if _is_one_part(inside, clear, parameters):
        return None
    height: NDArray[np.float32] = np.asarray(cv2.copyTo(clear, inside.view(np.uint8)), np.float32)
    if _will_join(inside, height, resolution_m, parameters):
        return None
    basin = _basins(inside, height, resolution_m, parameters.summit_reach_m)
    runs = LabelRuns.of(basin)
    highest = int(runs.label.max())
    summit = runs.greatest(height, highest).astype(float)
    area = runs.sizes(highest).astype(float) * resolution_m**2
    root = _join_basins(_passages(basin, height), summit, area, parameters)
    number = np.zeros(highest + 1, np.int32)
    number[1:] = np.unique(root[1:], return_inverse=True)[1] + 1
    return runs.renumbered(number)


def _is_one_part(inside: BoolArray, clear: NDArray[np.float32], parameters: TopologyParameters) -> bool:
    """Check quickly whether a room has only one part, as most have.

    The summits of two parts lie in its cells that are as clear as a part must be. Where these hang together,
    and those that are clearer than a narrow passage can be do too, some way between the two is no passage.
    """
    least = parameters.split_min_clearance_m
    widest = cv2.minMaxLoc(clear, inside.view(np.uint8))[1]
    for level in {least, max(least, parameters.passage_min_ratio * widest)}:
        pieces, _ = cv2.connectedComponents((inside & (clear >= level)).view(np.uint8), connectivity=8)
        if pieces > 2:
            return False
    return True


def _will_join(
    inside: BoolArray, height: NDArray[np.float32], resolution_m: float, parameters: TopologyParameters
) -> bool:
    """Check whether a room has only one part that is large enough, without dividing it into basins.

    It is so if from each summit some way leads to a higher one that is nowhere too narrow a passage for the
    lower of the two. For if two large parts were left, such a way would lead from the highest summit of the
    less open one to a neighbor that it can be joined with. Most rooms pass, and basins take long.

    The height (H, W) is the clearance inside the room, and 0 outside.
    """
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    place = np.flatnonzero(inside & (height == cv2.dilate(height, cross)))
    high = height.ravel()[place]
    order = np.argsort(-high, kind="stable")
    place, high = place[order], high[order]
    pieces, image = cv2.connectedComponents(inside.view(np.uint8), connectivity=4)
    piece = image.ravel().astype(np.int32, copy=False)
    for corner in (inside.shape[1] - 1, inside.shape[1] + 1):
        # Cells of one height that touch by a corner are one summit, and so may hold two pieces together.
        other = np.minimum(place + corner, inside.size - 1)
        touch = (piece[other] > 0) & (piece[other] != piece[place]) & (height.ravel()[other] == high)
        if touch.any():
            return False
    # The first has none to join, nor have those of pieces too small for a part.
    large = label_sizes(piece, pieces - 1) * resolution_m**2 >= parameters.split_min_area_m2
    waiting = large[piece[place]]
    waiting[: int(waiting.argmax()) + 1] = False
    while waiting.any():
        first = int(waiting.argmax())
        is_niche = high[first] < parameters.split_min_clearance_m
        narrowest = 0.0 if is_niche else parameters.passage_min_ratio * float(high[first]) * ROUNDED_UP
        wide = (inside & (height >= narrowest)).view(np.uint8)
        group = cv2.connectedComponents(wide, connectivity=4)[1].ravel()[place]
        highest = np.zeros(int(group.max()) + 1, np.intp)
        highest[group[::-1]] = np.arange(len(group))[::-1]  # the first of each group stays
        is_highest = (group == 0) | (highest[group] == np.arange(len(group)))
        if is_highest[first]:
            return False
        waiting &= is_highest
    return True


def voronoi_lines(
    inside: BoolArray, walls: BoolArray, resolution_m: float, parameters: TopologyParameters
) -> FloatArray:
    """Draw the Voronoi graph of a map as straight lines between the middles of its cells.

    Of every block of `DRAWN_BLOCK` by `DRAWN_BLOCK` cells one is looked at: enough for the eye.

    Parameters
    ----------
    inside : (H, W) bool
        The cells of all rooms.
    walls : (H, W) bool
        Wall cells.
    resolution_m : float
        Side of a cell.
    parameters : TopologyParameters
        Points nearer to a wall than half the narrowest doorway are left out, and with them what only they
        connect.

    Returns
    -------
    (N, 4) float
        x0, y0, x1, y1 in meters, in the frame of the cells.
    """
    clearance = clearance_m(distance_from(walls), resolution_m, parameters.clearance_blur_cells)
    clear = inside & (clearance >= parameters.doorway_min_width_m / 2)
    skeleton = np.pad(skeletonize(clear[::DRAWN_BLOCK, ::DRAWN_BLOCK]), 1)  # type: ignore[no-untyped-call]
    row, column = np.nonzero(skeleton)
    lines = []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        linked = skeleton[row + down, column + right]
        if down and right:
            # Where a cell at the corner links the two already, a diagonal would close a triangle.
            linked = linked & ~skeleton[row + down, column] & ~skeleton[row, column + right]
        first, last = straight_runs(row[linked], column[linked], (down, right))
        lines.append(np.concatenate([first, last + np.array([down, right])], axis=1))
    # The frame of padding is one cell wide; each cell stands for the middle of the first of its block.
    cells = (np.concatenate(lines) - 1) * float(DRAWN_BLOCK) + 0.5
    return cells[:, [1, 0, 3, 2]] * resolution_m


def clearance_m(distance: NDArray[np.float32], resolution_m: float, blur_cells: float) -> NDArray[np.float32]:
    """Turn the distance (H, W) from the nearest wall cell into meters, blurred by a number of cells."""
    clear: NDArray[np.float32] = np.asarray(cv2.GaussianBlur(distance, (0, 0), blur_cells), np.float32)
    clear *= np.float32(resolution_m)
    return clear


def _basins(
    inside: BoolArray, height: NDArray[np.float32], resolution_m: float, reach_m: float
) -> NDArray[np.int32]:
    """Divide a room (H, W) at the valleys between the summits of its clearance; basins 1.., 0 outside."""
    # The watershed makes larger copies of what it is given, so that nothing else shall hold on to it.
    basin: NDArray[np.int32] = watershed(  # type: ignore[no-untyped-call]
        -height, _summits(inside, height, resolution_m, reach_m), mask=inside
    )
    return basin


def _summits(
    inside: BoolArray, height: NDArray[np.float32], resolution_m: float, reach_m: float
) -> NDArray[np.int32]:
    """Number (H, W) from 1 the cells that are the clearest of their room as far as `reach_m`."""
    width = 2 * max(1, round(reach_m / resolution_m)) + 1
    summits = inside & (height == cv2.dilate(height, np.ones((width, width), np.uint8)))
    markers: NDArray[np.int32] = ndimage.label(summits, np.ones((3, 3)))[0]
    return markers


def _passages(basin: NDArray[np.int32], height: NDArray[np.float32]) -> dict[tuple[int, int], float]:
    """Clearance in meters of the widest passage between each two neighboring basins."""
    meet = contacts(basin)
    meet = meet.chosen(meet.low > 0)
    pairs, pair = meet.pairs()
    widest = np.zeros(len(pairs))
    narrow = np.minimum(height.take(meet.first), height.take(meet.second))
    np.maximum.at(widest, pair, narrow.astype(float))
    return dict(zip(pairs, widest.tolist(), strict=True))


def _join_basins(
    passages: dict[tuple[int, int], float],
    summit: FloatArray,
    area: FloatArray,
    parameters: TopologyParameters,
) -> NDArray[np.intp]:
    """Join the two basins with the widest passage, again and again; return the part of each basin."""
    basins = RegionGraph(len(summit), passages, max)

    def narrowest_last(pair: tuple[int, int]) -> float | None:
        """Width of the passage for the less open side; what is no part by itself comes first."""
        a, b = pair
        width = basins.borders[a].get(b)
        if width is None:
            return None
        ratio = width / max(min(summit[a], summit[b]), 1e-9)
        is_part = (
            min(area[a], area[b]) >= parameters.split_min_area_m2
            and min(summit[a], summit[b]) >= parameters.split_min_clearance_m
        )
        openness = float(ratio if is_part else 1 + ratio)
        return -openness if openness >= parameters.passage_min_ratio else None

    def join(pair: tuple[int, int]) -> list[tuple[int, int]]:
        target, basin = pair
        summit[target] = max(summit[target], summit[basin])
        area[target] += area[basin]
        basins.join(basin, target)
        return [(min(target, c), max(target, c)) for c in basins.borders[target]]

    best_first(passages, narrowest_last, join)
    return basins.holders()
