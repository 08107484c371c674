"""The plan frame: a raster of 0.1 m along the strongest dominant direction, on which regions are judged."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import BoolArray

Labels = NDArray[np.int32]

PLAN_CELL_M = 0.1
"""Side of a plan cell, meters. The network and the trees were fitted on cells of this size."""


@dataclass(frozen=True, eq=False)
class PlanFrame:
    """Where the cells of a plan raster lie on the map.

    Attributes
    ----------
    shape : (int, int)
        Rows and columns.
    cell_m : float
        Side of a plan cell.
    to_map : (2, 3) float
        Center of a plan cell (column, row) to (column, row) of the map.
    """

    shape: tuple[int, int]
    cell_m: float
    to_map: NDArray[np.float64]

    @classmethod
    def of(
        cls, known: BoolArray, direction_rad: float, resolution_m: float, cell_m: float = PLAN_CELL_M
    ) -> PlanFrame:
        """Frame around the known cells (H, W), turned by the direction; one cell where none is known."""
        cos, sin = np.cos(direction_rad), np.sin(direction_rad)
        turned = np.array([[cos, sin], [-sin, cos]])
        rows = np.flatnonzero(known.any(1))
        if len(rows) == 0:
            return cls((1, 1), cell_m, np.column_stack([np.eye(2), np.zeros(2)]))
        # The extreme cells of each row hold the corners of the frame.
        first, last = known[rows].argmax(1), known.shape[1] - 1 - known[rows, ::-1].argmax(1)
        column, row = np.concatenate([first, last]), np.concatenate([rows, rows])
        points = turned @ np.stack([column + 0.5, row + 0.5]) * resolution_m
        low = np.floor(points.min(1) / cell_m) * cell_m - cell_m
        size = np.ceil((points.max(1) - low) / cell_m).astype(int) + 1
        scale = cell_m / resolution_m
        linear = turned.T * scale
        offset = turned.T @ (low / resolution_m + scale / 2) - 0.5
        return cls((int(size[1]), int(size[0])), cell_m, np.column_stack([linear, offset]))

    def sampled(self, image: Labels) -> Labels:
        """Value of the map's cell below the center of each plan cell, 0 beside the map; labels below 2^24."""
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        warped = cv2.warpAffine(image.astype(np.float32), self.to_map, self.shape[::-1], flags=flags)
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


def grown_labels(labels: Labels, reach_cells: float) -> Labels:
    """Labels also on the cells without one, from the nearest that has one, up to a distance."""
    if not labels.any():
        return labels
    distance, nearest = cv2.distanceTransformWithLabels(
        (labels == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_nearest = np.zeros(int(nearest.max()) + 1, np.int32)
    of_nearest[nearest[labels > 0]] = labels[labels > 0]
    return np.where(distance <= reach_cells, of_nearest[nearest], 0).astype(np.int32)


def without_specks(occupied: BoolArray, shortest_cells: float) -> BoolArray:
    """Occupied cells without the pieces whose longer side is less than `shortest_cells`."""
    _, piece, stats, _ = cv2.connectedComponentsWithStats(occupied.astype(np.uint8), connectivity=8)
    longest = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT])
    keep = longest >= shortest_cells
    keep[0] = False
    kept: BoolArray = keep[piece]
    return kept
