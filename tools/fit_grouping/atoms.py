"""Atoms of the floor: faces of a generous clean map, crossed with basins of the clearance."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import label
from skimage.segmentation import watershed

from rose2_logs.config.fields import number
from rose2_logs.config.parameters import Parameters
from rose2_logs.segmentation.floor_plan.faces import build_faces, label_faces
from rose2_logs.segmentation.floor_plan.stage import frame_along
from rose2_logs.segmentation.rose.clean_map import attached_cells, structure_score, supported_cells
from rose2_logs.segmentation.rose.spectrum import angular_energy, compute_spectrum, dominant_directions
from rose2_logs.segmentation.walls.stage import find_walls

BoolArray = NDArray[np.bool_]
Labels = NDArray[np.int32]
NEIGHBOR_SLICES = ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]))
"""Each cell and the one to its right; each cell and the one above it."""


@dataclass(frozen=True)
class AtomParameters:
    """How the floor is cut before anything is joined."""

    clean_min_score: float = number(
        0.35, "score", "Clean map of the faces: a wall that goes on for a third of a room's side.", 0, 1
    )
    plan_cell_m: float = number(0.1, "m", "Cells of the turned map on which regions are judged.", 0.01)
    speck_max_m: float = number(0.25, "m", "Occupied pieces below bound no basin: legs, noise.", 0.0)
    summit_reach_m: float = number(0.5, "m", "Summits of the clearance are this far apart at least.", 0.0)
    smoothing_m: float = number(0.05, "m", "The clearance is smoothed by a cell of 5 cm.", 0.0)
    atom_min_m2: float = number(0.15, "m2", "Smaller pieces go to the neighbor that they touch most.", 0.0)
    pipeline: Parameters = field(default_factory=Parameters)


@dataclass(frozen=True, eq=False)
class Structure:
    """Stages A and B of a map with a clean map that keeps every wall.

    Attributes
    ----------
    direction_rad : float
        Strongest dominant direction, 0 without any.
    score : (H, W) float32
        Structure score of the occupied cells.
    walls : (H, W) bool
    faces : (H, W) int32
        Face 1.. of each cell.
    """

    direction_rad: float
    score: NDArray[np.float32]
    walls: BoolArray
    faces: Labels


def find_generous_structure(
    free: BoolArray, occupied: BoolArray, resolution_m: float, parameters: AtomParameters
) -> Structure:
    """Directions, walls and faces from a clean map of one low threshold.

    Where faces are no rooms but what rooms are joined from, a wall too many does no harm: the threshold needs
    no search, and no budget of walls.
    """
    pipeline = parameters.pipeline
    spectrum = compute_spectrum(occupied, resolution_m, pipeline.spectrum)
    directions, _ = dominant_directions(angular_energy(spectrum, pipeline.spectrum), pipeline.spectrum)
    score = structure_score(spectrum, occupied, directions, pipeline.spectrum)
    del spectrum
    supported = supported_cells(score, occupied, resolution_m, pipeline.spectrum)
    clean = supported & (score >= parameters.clean_min_score)
    low = pipeline.spectrum.attached_share * parameters.clean_min_score
    attached = attached_cells(clean, supported & (score >= low))
    walls = find_walls(supported, clean, attached, directions, resolution_m, pipeline.walls)
    direction = float(directions[0]) if len(directions) else 0.0
    margin = pipeline.floor_plan.frame_margin_m
    frame = frame_along(free | walls.walls, direction, resolution_m, margin)
    graph = build_faces(walls.lines.ends_m, frame)
    shape = (free.shape[0], free.shape[1])
    return Structure(direction, score, walls.walls, label_faces(graph, shape, resolution_m))


@dataclass(frozen=True, eq=False)
class PlanFrame:
    """A raster along the strongest dominant direction, of coarser cells than the map's.

    Attributes
    ----------
    shape : (int, int)
        Rows and columns.
    cell_m : float
    to_map : (2, 3) float
        Center of a plan cell (column, row) to (column, row) of the map.
    """

    shape: tuple[int, int]
    cell_m: float
    to_map: NDArray[np.float64]

    @classmethod
    def of(cls, known: BoolArray, direction_rad: float, resolution_m: float, cell_m: float) -> PlanFrame:
        """Frame around the known cells (H, W), turned by the direction."""
        turned = np.array(
            [
                [np.cos(direction_rad), np.sin(direction_rad)],
                [-np.sin(direction_rad), np.cos(direction_rad)],
            ]
        )
        row, column = np.nonzero(known)
        points = turned @ np.stack([column + 0.5, row + 0.5]) * resolution_m
        low = np.floor(points.min(1) / cell_m) * cell_m - cell_m
        size = np.ceil((points.max(1) - low) / cell_m).astype(int) + 1
        scale = cell_m / resolution_m
        linear = turned.T * scale
        offset = turned.T @ (low / resolution_m + scale / 2) - 0.5
        return cls((int(size[1]), int(size[0])), cell_m, np.column_stack([linear, offset]))

    def sampled(self, image: Labels, outside: int = 0) -> Labels:
        """Value of the map's cell below the center of each plan cell; labels below 2^24."""
        exact = image.astype(np.float32)
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        warped = cv2.warpAffine(exact, self.to_map, self.shape[::-1], flags=flags, borderValue=float(outside))
        return warped.astype(np.int32)

    def share(self, mask: BoolArray, per_side: int = 3) -> NDArray[np.float32]:
        """Share of each plan cell that a mask of the map covers, of `per_side` squared points."""
        step = np.array([[1 / per_side, 0], [0, 1 / per_side]])
        linear = self.to_map[:, :2] @ step
        offset = self.to_map[:, 2] + self.to_map[:, :2] @ np.full(2, (1 / per_side - 1) / 2)
        size = (self.shape[1] * per_side, self.shape[0] * per_side)
        fine = cv2.warpAffine(
            mask.astype(np.uint8),
            np.column_stack([linear, offset]),
            size,
            flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
        )
        share = cv2.resize(fine.astype(np.float32), self.shape[::-1], interpolation=cv2.INTER_AREA)
        return share.astype(np.float32)

    def back(self, image: Labels, shape: tuple[int, int]) -> Labels:
        """Plan labels below 2^24 at the cells of the map (H, W)."""
        warped = cv2.warpAffine(image.astype(np.float32), self.to_map, shape[::-1], flags=cv2.INTER_NEAREST)
        return warped.astype(np.int32)


def without_specks(occupied: BoolArray, resolution_m: float, speck_max_m: float) -> BoolArray:
    """Occupied cells without the pieces that are shorter than `speck_max_m` both ways."""
    _, piece, stats, _ = cv2.connectedComponentsWithStats(occupied.astype(np.uint8), connectivity=8)
    longest = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT])
    keep = longest * resolution_m >= speck_max_m
    keep[0] = False
    kept: BoolArray = keep[piece]
    return kept


def clearance_basins(
    free: BoolArray, blocked: BoolArray, cell_m: float, parameters: AtomParameters
) -> tuple[Labels, NDArray[np.float32]]:
    """Basins (H, W) of the clearance on the free cells, and the clearance in meters."""
    distance = cv2.distanceTransform((~blocked).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    smooth = cv2.GaussianBlur(distance, (0, 0), parameters.smoothing_m / cell_m) * cell_m
    height = np.where(free, smooth, -1).astype(np.float32)
    width = 2 * max(1, round(parameters.summit_reach_m / cell_m)) + 1
    summits = free & (height == cv2.dilate(height, np.ones((width, width), np.uint8)))
    markers, _ = ndimage.label(summits, np.ones((3, 3)))
    basins = watershed(-smooth, markers, mask=free)  # type: ignore[no-untyped-call]
    return basins.astype(np.int32), smooth.astype(np.float32)


def cut_atoms(
    free: BoolArray,
    occupied: BoolArray,
    faces: Labels,
    frame: PlanFrame,
    resolution_m: float,
    parameters: AtomParameters,
) -> Labels:
    """Atoms (H, W), 1.. on the free cells of the map, 0 elsewhere and on loose cells."""
    solid = frame.share(without_specks(occupied, resolution_m, parameters.speck_max_m)) > 0
    open_cells = (frame.share(free) > 0) & ~solid
    basins, _ = clearance_basins(open_cells, solid, frame.cell_m, parameters)
    basins = _grown(basins, 0.2 / frame.cell_m)
    basin = frame.back(basins, (free.shape[0], free.shape[1]))
    key = np.where(free, faces.astype(np.int64) * (int(basin.max()) + 1) + basin + 1, 0)
    pieces = label(key, connectivity=1, background=0).astype(np.int32)  # type: ignore[no-untyped-call]
    return absorb_small(pieces, parameters.atom_min_m2 / resolution_m**2)


def _grown(labels: Labels, reach_cells: float) -> Labels:
    """Labels over the cells without one, from the nearest that has one, up to a distance."""
    if not labels.any():
        return labels
    distance, nearest = cv2.distanceTransformWithLabels(
        (labels == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_nearest = np.zeros(int(nearest.max()) + 1, np.int32)
    of_nearest[nearest[labels > 0]] = labels[labels > 0]
    return np.where(distance <= reach_cells, of_nearest[nearest], 0).astype(np.int32)


def absorb_small(pieces: Labels, min_cells: float, rounds: int = 4) -> Labels:
    """Give pieces under `min_cells` to the larger neighbor with the longest contact; loose ones get 0."""
    for _ in range(rounds):
        count = int(pieces.max(initial=0)) + 1
        size = np.bincount(pieces.ravel(), minlength=count)
        small = size < min_cells
        small[0] = False
        if not small.any():
            break
        keys = []
        for one, other in NEIGHBOR_SLICES:
            a, b = pieces[one], pieces[other]
            meet = (a != b) & (a > 0) & (b > 0)
            a, b = a[meet].astype(np.int64), b[meet].astype(np.int64)
            keys += [a * count + b, b * count + a]
        key, contact = np.unique(np.concatenate(keys), return_counts=True)
        a, b = np.divmod(key, count)
        # Towards the larger, and the higher number at equal size, so that nothing goes round in a circle.
        up = small[a] & ((size[b] > size[a]) | ((size[b] == size[a]) & (b > a)))
        a, b, contact = a[up], b[up], contact[up]
        order = np.lexsort((size[b], contact))
        target = np.arange(count)
        target[a[order]] = b[order]
        if np.array_equal(target, np.arange(count)):
            break
        while not np.array_equal(above := target[target], target):
            target = above
        pieces = target[pieces].astype(np.int32)
    size = np.bincount(pieces.ravel())
    size[0] = 0
    kept = np.flatnonzero(size >= min_cells)
    renumbered = np.zeros(len(size), np.int32)
    renumbered[kept] = np.arange(1, len(kept) + 1)
    return renumbered[pieces]
