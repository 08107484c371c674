"""How far the whole map moved from one snapshot to the next, as loop closures and resets of SLAM move it."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.model.labels import distance_from
from rose2_logs.model.occupancy import BoolArray, FloatArray, GridGeometry, OccupancySnapshot, classify

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

SIDES = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.uint8)
"""The cells that share a side with the one in the middle."""


@dataclass(frozen=True)
class RigidMotion:
    """A shift and turn of the plane, as the whole map makes it within its frame.

    Attributes
    ----------
    center_xy_m : (float, float)
        The middle of the walls, before.
    shift_xy_m : (float, float)
        How far that point moved.
    turn_rad : float
        Turn about that point, counter-clockwise.
    """

    center_xy_m: tuple[float, float]
    shift_xy_m: tuple[float, float]
    turn_rad: float

    @classmethod
    def moving(cls, center_m: FloatArray, to_m: FloatArray, turn_rad: float) -> RigidMotion:
        """Motion that brings a point (2,) to another and turns about it."""
        (x, y), (dx, dy) = center_m.tolist(), (to_m - center_m).tolist()
        return cls((x, y), (dx, dy), float(turn_rad))

    @classmethod
    def none(cls) -> RigidMotion:
        """Return the motion that leaves everything where it is."""
        return cls((0.0, 0.0), (0.0, 0.0), 0.0)

    @property
    def pose(self) -> tuple[float, float, float]:
        """Where the frame's origin comes to lie, x and y in meters, and the turn in radians."""
        x, y = self.points(np.zeros(2)).tolist()
        return x, y, self.turn_rad

    def then(self, later: RigidMotion) -> RigidMotion:
        """Return the motion of both, about the frame's origin; `later` is applied after this one."""
        origin = np.zeros(2)
        return RigidMotion.moving(origin, later.points(self.points(origin)), self.turn_rad + later.turn_rad)

    def inverse(self) -> RigidMotion:
        """Return the motion that takes this one back."""
        center, shift = np.asarray(self.center_xy_m), np.asarray(self.shift_xy_m)
        return RigidMotion.moving(center + shift, center, -self.turn_rad)

    def points(self, xy_m: FloatArray) -> FloatArray:
        """Where points (..., 2) come to lie, meters."""
        c, s = np.cos(self.turn_rad), np.sin(self.turn_rad)
        center = np.asarray(self.center_xy_m)
        moved: FloatArray = (
            (xy_m - center) @ np.array([[c, s], [-s, c]]) + center + np.asarray(self.shift_xy_m)
        )
        return moved

    def grid(self, geometry: GridGeometry) -> GridGeometry:
        """Where a grid comes to lie."""
        x, y = self.points(np.asarray(geometry.origin_xy_m)).tolist()
        return dataclasses.replace(geometry, origin_xy_m=(x, y), yaw_rad=geometry.yaw_rad + self.turn_rad)


class MapAligner:
    """Finds how each of successive maps moved relative to the one before, by their walls.

    Parameters
    ----------
    tracking : TrackingParameters
        The least motion that counts, and how far is searched.
    occupancy : OccupancyParameters, optional
        Which cells are walls.
    """

    def __init__(self, tracking: TrackingParameters, occupancy: OccupancyParameters | None = None) -> None:
        self._tracking = tracking
        self._occupancy = occupancy or OccupancyParameters()
        self._before: WallFit | None = None

    def update(self, snapshot: OccupancySnapshot) -> RigidMotion | None:
        """Take the next map of the run.

        Parameters
        ----------
        snapshot : OccupancySnapshot
            The map.

        Returns
        -------
        RigidMotion or None
            The motion, in the world frame, of what both maps show; None where it is less than `shift_min_m`
            on average, or the walls do not determine it.
        """
        geometry = snapshot.geometry
        row, column = _face_cells(*classify(snapshot.cells, self._occupancy))
        before, self._before = self._before, None
        if len(row) < self._tracking.fit_min_points:
            return None
        points = geometry.cell_centers(row, column)
        fit = self._before = WallFit(points, geometry.resolution_m, self._tracking)
        if before is None:
            return None
        is_wall = np.zeros(geometry.shape, bool)
        is_wall[row, column] = True
        if fit.is_sure_of(_share_on(is_wall, geometry, before.chosen)):
            motion = _staying(before.chosen)
        else:
            motion = fit.best(before.sample())
        moved = np.linalg.norm(motion.points(before.chosen) - before.chosen, axis=1).mean()
        return motion if moved >= self._tracking.shift_min_m else None


def wall_faces(free: BoolArray, occupied: BoolArray, geometry: GridGeometry) -> FloatArray:
    """World centers (N, 2) of the occupied cells (H, W) next to free ones: the faces of walls."""
    return geometry.cell_centers(*_face_cells(free, occupied))


def _face_cells(free: BoolArray, occupied: BoolArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Row and column (N,) of the occupied cells that share a side with a free one."""
    import cv2

    framed = np.pad(free.astype(np.uint8), 1)  # OpenCV takes no empty image
    is_face = cv2.dilate(framed, SIDES)[1:-1, 1:-1] > 0
    is_face &= occupied
    row, column = np.divmod(np.flatnonzero(is_face), occupied.shape[1])
    return row, column


def _share_on(mask: BoolArray, geometry: GridGeometry, points: FloatArray) -> float:
    """Share of world points (N, 2) that lie in cells of a mask (H, W)."""
    row, column = geometry.world_to_cell(points).T
    inside = (row >= 0) & (row < mask.shape[0]) & (column >= 0) & (column < mask.shape[1])
    return np.count_nonzero(mask[row[inside], column[inside]]) / len(points)


def _staying(points: FloatArray) -> RigidMotion:
    """No motion of some points (N, 2)."""
    center = points.mean(axis=0)
    return RigidMotion.moving(center, center, 0.0)


def evenly(points: FloatArray, most: int) -> FloatArray:
    """Take at most so many points (N, 2), evenly."""
    if len(points) <= most:
        return points
    return points[np.linspace(0, len(points) - 1, most).astype(np.intp)]


@dataclass(frozen=True, eq=False)
class WallSample:
    """Points (N, 2) of walls in world meters, and a unit vector (N, 2) across the wall at each."""

    points: FloatArray
    across: FloatArray


class WallFit:
    """The walls of a map, which those of another are laid over.

    Parameters
    ----------
    points : (N, 2) float
        Points of the walls, world meters.
    resolution_m : float
        Side of the map's cells.
    parameters : TrackingParameters
        How walls are fitted and how far is searched.
    """

    def __init__(self, points: FloatArray, resolution_m: float, parameters: TrackingParameters) -> None:
        self._points = points
        self._parameters = parameters
        self._resolution_m = resolution_m
        least = parameters.fit_gate_min_cells * resolution_m
        gates_m = (getattr(parameters, f"fit_gate_{step}_m") for step in (1, 2, 3, 4))
        self._gates = tuple(max(gate, least) for gate in gates_m)

    @cached_property
    def _tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(self._points)

    @property
    def chosen(self) -> FloatArray:
        """Some points (N, 2) of the walls."""
        return evenly(self._points, self._parameters.fit_points)

    def is_sure_of(self, share: float) -> bool:
        """Whether walls stay of which a share lies in wall cells here: no motion could bring many more there.

        In most maps of a run that decides, without a search for the nearest walls.
        """
        half_diagonal_m = self._resolution_m * math.sqrt(0.5)
        return self._gates[-1] > half_diagonal_m and share + self._parameters.fit_better_share > 1

    def sample(self) -> WallSample:
        """Some of the walls, to be laid over those of the next map."""
        points = self.chosen
        _, nearest = self._tree.query(points, k=self._parameters.fit_neighbors)
        around = self._points[nearest] - self._points[nearest].mean(axis=1, keepdims=True)
        x, y = around[..., 0], around[..., 1]
        # The direction of the greatest spread is that of the wall.
        along = np.arctan2(2 * (x * y).sum(axis=1), (x * x - y * y).sum(axis=1)) / 2
        return WallSample(points, np.stack([-np.sin(along), np.cos(along)], axis=1))

    def best(self, walls: WallSample) -> RigidMotion:
        """Motion of walls that brings most of them to walls; staying unless another is better."""
        points, parameters = walls.points, self._parameters
        center = points.mean(axis=0)
        staying = _staying(points)
        least = max(self.share(points, staying) + parameters.fit_better_share, parameters.shift_min_share)
        if least > 1:
            return staying
        fitted = self.settled(walls, staying)
        share = self.share(points, fitted)
        if share < parameters.fit_sure_share:
            for start in self._search(points, center):
                other = self.settled(walls, start)
                if (its_share := self.share(points, other)) > share:
                    fitted, share = other, its_share
        return fitted if share >= least else staying

    def share(self, points: FloatArray, motion: RigidMotion) -> float:
        """Share of points that a motion brings to a wall."""
        distance, _ = self._tree.query(motion.points(points), distance_upper_bound=self._gates[-1])
        return float(np.isfinite(distance).mean())

    def settled(self, walls: WallSample, motion: RigidMotion) -> RigidMotion:
        """Fit wall to nearest wall in turns (ICP), the far ones with little weight (Tukey's biweight).

        Only the distance across the wall counts: along a wall, cells match at every step of the raster.
        """
        parameters = self._parameters
        center = np.asarray(motion.center_xy_m)
        radius = float(np.linalg.norm(walls.points - center, axis=1).max())
        for gate in self._gates:
            for _ in range(parameters.fit_max_rounds):
                placed = motion.points(walls.points)
                distance, nearest = self._tree.query(placed, distance_upper_bound=gate)
                near = np.isfinite(distance)
                if np.count_nonzero(near) < parameters.fit_min_points:
                    return motion
                weight = (1 - (distance[near] / gate) ** 2) ** 2
                to = motion.points(center)
                across = motion.points(walls.across[near] + center) - to
                gaps = self._points[nearest[near]] - placed[near]
                shift, turn = _step(placed[near] - to, gaps, across, weight, radius, parameters.fit_damping)
                motion = RigidMotion.moving(center, to + shift, motion.turn_rad + turn)
                if np.hypot(*shift) + abs(turn) * radius < parameters.fit_settled_m:
                    break
        return motion

    def _search(self, points: FloatArray, center: FloatArray) -> list[RigidMotion]:
        """Best starts among all shifts and turns within reach: correlation with the distance to walls."""
        parameters = self._parameters
        step_m = parameters.search_step_m
        nearness, low = self._nearness(parameters.shift_search_m)
        chosen = evenly(points, parameters.search_points)
        radius = max(float(np.linalg.norm(chosen - center, axis=1).max()), step_m)
        shifts = _steps(parameters.shift_search_m, step_m)
        turns = _steps(parameters.shift_search_rad, step_m / radius)
        offset = np.stack(np.meshgrid(shifts, shifts, indexing="ij"), -1).reshape(-1, 2)
        height, width = nearness.shape
        scores = np.zeros((len(turns), len(offset)))
        for number, turn in enumerate(turns):
            placed = RigidMotion.moving(center, center, turn).points(chosen) - low
            cells = np.floor((placed[:, None] + offset) / parameters.search_raster_m).astype(np.intp)
            x, y = cells[..., 0], cells[..., 1]
            inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
            scores[number] = (nearness[y.clip(0, height - 1), x.clip(0, width - 1)] * inside).sum(axis=0)
        best = np.argsort(-scores, axis=None, kind="stable")[: parameters.search_candidates]
        return [
            RigidMotion.moving(center, center + offset[at % len(offset)], turns[at // len(offset)])
            for at in best.tolist()
        ]

    def _nearness(self, margin_m: float) -> tuple[FloatArray, FloatArray]:
        """Raster (H, W): 1 at walls, 0 from the first gate on; and the world position (2,) of its corner."""
        cell_m = self._parameters.search_raster_m
        low = self._points.min(axis=0) - margin_m
        cells = np.floor((self._points - low) / cell_m).astype(np.intp)
        margin = int(np.ceil(margin_m / cell_m)) + 1
        width, height = (cells.max(axis=0) + margin).tolist()
        wall = np.zeros((height, width), bool)
        wall[cells[:, 1], cells[:, 0]] = True
        distance = distance_from(wall) * cell_m
        return np.maximum(0.0, 1.0 - distance / self._gates[0]).astype(np.float64), low


def _steps(reach: float, step: float) -> FloatArray:
    """Values from -reach to reach, zero among them, about a step apart."""
    count = int(np.ceil(reach / step))
    return np.linspace(-reach, reach, 2 * count + 1)


def _step(
    points: FloatArray,
    gaps: FloatArray,
    across: FloatArray,
    weight: FloatArray,
    radius_m: float,
    damping_share: float,
) -> tuple[FloatArray, float]:
    """Shift (2,) and turn about the origin that close gaps (N, 2) across walls with the least squares.

    What the walls do not determine, such as the shift along a single corridor, stays as it is.
    """
    turned = np.stack([-points[:, 1], points[:, 0]], axis=1) / radius_m
    rows = np.column_stack([across, (across * turned).sum(axis=1)])
    weighted = rows * weight[:, None]
    damping = damping_share * weight.sum() * np.eye(3)
    solved = np.linalg.solve(weighted.T @ rows + damping, weighted.T @ (across * gaps).sum(axis=1))
    return solved[:2], float(solved[2]) / radius_m
