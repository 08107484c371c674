"""Alignment of two maps with any turn and any shift between them, from their walls and free space.

Turns are tried where the spectra's directions fit, shifts by correlation of all places at once, and the best
starts are fitted wall to wall.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage
from scipy.spatial import cKDTree

from rose2_logs.config.comparison import ComparisonParameters
from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.model.explored import ExploredPart
from rose2_logs.model.labels import distance_from, known_window
from rose2_logs.model.occupancy import UNKNOWN, BoolArray, FloatArray, OccupancySnapshot, classify
from rose2_logs.segmentation.circular_peaks import circular_peaks
from rose2_logs.segmentation.rose.spectrum import angular_energy, compute_spectrum
from rose2_logs.system.text import counted
from rose2_logs.tracking.registration import RigidMotion, WallFit, evenly, wall_faces


@dataclass(frozen=True)
class Placement:
    """Position of a map relative to another.

    Attributes
    ----------
    motion : RigidMotion
        Brings points of the map's frame into the other's.
    agreement : float
        Share of the walls of both maps, where the other one is explored, that lie on a wall of it.
    common_share : float
        Share of the walls of the map with fewer of them that lies where the other one is explored.
    score : float
        Walls of a map that agree less half of those that contradict, over the walls of the map with fewer;
        the worse of both maps, at most 1. The placement was chosen by it.
    runner_up_score : float
        That of the best other placement, as of a building that looks the same turned by half a circle.
    """

    motion: RigidMotion
    agreement: float
    common_share: float
    score: float
    runner_up_score: float


class PlacedMap:
    """What placing needs of a map.

    Parameters
    ----------
    snapshot : OccupancySnapshot
        The map.
    occupancy : OccupancyParameters
        Which cells are walls.
    parameters : Parameters, optional
        Of the comparison, the same for both maps: its blocks spectrum, tracking and comparison are used.
    """

    def __init__(
        self,
        snapshot: OccupancySnapshot,
        occupancy: OccupancyParameters,
        parameters: Parameters | None = None,
    ) -> None:
        self.parameters = parameters or Parameters()
        comparison = self.parameters.comparison
        self.snapshot = snapshot
        self.free, self.occupied = classify(snapshot.cells, occupancy)
        self._occupancy = occupancy
        occupied_m = snapshot.geometry.cell_centers(*np.nonzero(self.occupied))
        self.tree = cKDTree(occupied_m)
        self.reach_m = max(comparison.wall_reach_m, comparison.wall_reach_min_cells * self.resolution_m)
        faces_m = wall_faces(self.free, self.occupied, snapshot.geometry)
        least = max(self.parameters.tracking.fit_min_points, comparison.faces_min_share * len(occupied_m))
        self.walls = faces_m if len(faces_m) >= least else occupied_m

    def __repr__(self) -> str:
        points = counted(len(self.walls), "wall point")
        return f"PlacedMap({self.snapshot.geometry.size_text}, {points})"

    def scaled(self, scale: float) -> PlacedMap:
        """Return the same map with cells so many times larger."""
        geometry = self.snapshot.geometry
        larger = dataclasses.replace(geometry, resolution_m=geometry.resolution_m * scale)
        snapshot = dataclasses.replace(self.snapshot, geometry=larger)
        return PlacedMap(snapshot, self._occupancy, self.parameters)

    @property
    def resolution_m(self) -> float:
        """Side of a cell."""
        return self.snapshot.geometry.resolution_m

    @property
    def side_m(self) -> float:
        """Longer side of the part that is free or occupied, which may reach far beyond the walls."""
        sides = (along.stop - along.start for along in known_window(self.free | self.occupied))
        return float(max(sides) * self.resolution_m)

    @property
    def can_be_placed(self) -> bool:
        """Whether there are enough walls to align the map."""
        return len(self.walls) >= self.parameters.tracking.fit_min_points

    def on_wall(self, points_m: FloatArray, reach_m: float) -> BoolArray:
        """Which points (..., 2) of this map's frame have an occupied cell within reach."""
        distance, _ = self.tree.query(points_m, distance_upper_bound=reach_m)
        near: BoolArray = np.isfinite(distance)
        return near

    def is_free(self, points_m: FloatArray) -> BoolArray:
        """Which points (..., 2) of this map's frame are in a free cell."""
        return self._looked_up(self.free, points_m)

    def is_known(self, points_m: FloatArray) -> BoolArray:
        """Which points (..., 2) of this map's frame are in a cell that was seen."""
        return self._looked_up(self.snapshot.cells != UNKNOWN, points_m)

    def _looked_up(self, mask: BoolArray, points_m: FloatArray) -> BoolArray:
        cells = self.snapshot.geometry.world_to_cell(points_m)
        rows, columns = cells[..., 0], cells[..., 1]
        height, width = mask.shape
        inside = (rows >= 0) & (columns >= 0) & (rows < height) & (columns < width)
        values: BoolArray = mask[rows.clip(0, height - 1), columns.clip(0, width - 1)] & inside
        return values

    def energy(self) -> FloatArray:
        """Angular energy (B,) of the map's spectrum, over half a circle of its frame."""
        spectrum = self.parameters.spectrum
        part = ExploredPart.of(self.snapshot.cells, self.snapshot.geometry, self._occupancy)
        energy = angular_energy(compute_spectrum(part.occupied, part.resolution_m, spectrum), spectrum)
        bins = self.snapshot.geometry.yaw_rad / np.pi * len(energy)
        shifted: FloatArray = ndimage.shift(energy, bins, order=1, mode="grid-wrap")
        return shifted

    def free_points(self, cell_m: float) -> FloatArray:
        """Centers (K, 2) of free space, about one for every square of a side, meters."""
        step = max(1, round(cell_m / self.resolution_m))
        offset = step // 2
        rows, columns = np.nonzero(self.free[offset::step, offset::step])
        return self.snapshot.geometry.cell_centers(rows * step + offset, columns * step + offset)


def place(moving: PlacedMap, fixed: PlacedMap) -> Placement | None:
    """Find the position of a map relative to another, wherever their frames are.

    Returns
    -------
    Placement or None
        None where a map has too few walls.
    """
    if not (moving.can_be_placed and fixed.can_be_placed):
        return None
    parameters = fixed.parameters
    fit = WallFit(fixed.walls, fixed.resolution_m, parameters.tracking)
    walls = WallFit(moving.walls, moving.resolution_m, parameters.tracking).sample()
    settled = [fit.settled(walls, start) for start in _starts(moving, fixed)]
    counter = _Agreement(moving, fixed)
    scored = sorted(((counter.of(motion), motion) for motion in settled), key=lambda each: -each[0][2])
    (agreement, common, score), motion = scored[0]
    center = moving.walls.mean(axis=0)
    others = [
        figures[2]
        for figures, other in scored[1:]
        if not _is_same(motion, other, center, parameters.comparison)
    ]
    return Placement(motion, agreement, common, score, max(others, default=0.0))


def fits(placement: Placement, parameters: ComparisonParameters) -> bool:
    """Whether two placed maps seem to show the same building."""
    in_parts = (
        placement.agreement >= parameters.parts_min_agreement
        and placement.common_share >= parameters.parts_min_common_share
    )
    return placement.score >= parameters.same_building_min_score or in_parts


def is_ambiguous(placement: Placement, parameters: ComparisonParameters) -> bool:
    """Whether two maps fit about as well in another way, as buildings do that look the same when turned."""
    return placement.runner_up_score >= parameters.ambiguous_share * placement.score


def placement_by(moving: PlacedMap, fixed: PlacedMap, motion: RigidMotion) -> Placement:
    """Measure how far two maps agree that a motion brings together."""
    agreement, common_share, score = _Agreement(moving, fixed).of(motion)
    return Placement(motion, agreement, common_share, score, 0.0)


def _is_same(
    one: RigidMotion, other: RigidMotion, center_m: FloatArray, parameters: ComparisonParameters
) -> bool:
    turn = math.remainder(one.turn_rad - other.turn_rad, 2 * math.pi)
    apart = float(np.linalg.norm(one.points(center_m) - other.points(center_m)))
    return abs(turn) < parameters.same_turn_rad and apart < parameters.same_place_m


class _Agreement:
    """Counts how far the walls of two maps agree."""

    def __init__(self, moving: PlacedMap, fixed: PlacedMap) -> None:
        self._maps = moving, fixed
        parameters = fixed.parameters.comparison
        self._points = tuple(evenly(each.walls, parameters.points_max) for each in self._maps)
        self._contradiction = parameters.contradiction
        self._reach_m = max(moving.reach_m, fixed.reach_m)

    def of(self, motion: RigidMotion) -> tuple[float, float, float]:
        """Agreement, common share and score of a placement."""
        moving, fixed = self._maps
        counts = []
        for points, back, onto, own in (
            (self._points[0], motion, fixed, moving),
            (self._points[1], motion.inverse(), moving, fixed),
        ):
            placed = back.points(points)
            on = onto.on_wall(placed, self._reach_m)
            against = onto.is_free(placed) & ~on
            weight = len(own.walls) * own.resolution_m / len(points)
            counts.append((weight * on.sum(), weight * against.sum(), weight * len(points)))
        agreeing, contrary, wall = np.array(counts).T
        common = agreeing + contrary
        least = int(wall.argmin())
        agreement = float(agreeing.sum() / max(common.sum(), 1e-9))
        score = float((agreeing - self._contradiction * contrary).min() / wall[least])
        return agreement, float(common[least] / wall[least]), min(score, 1.0)


def _starts(moving: PlacedMap, fixed: PlacedMap) -> list[RigidMotion]:
    """Places to fit from, the most promising first."""
    parameters = fixed.parameters.comparison
    sides_m = (each.side_m / parameters.raster_max_cells for each in (moving, fixed))
    search = _ShiftSearch(moving, fixed, max(parameters.raster_m, *sides_m))
    starts = [start for turn in _turns(moving, fixed) for start in search.best(turn)]
    starts.sort(key=lambda each: -each[0])
    return [motion for _, motion in starts[: parameters.starts_fitted]]


def _turns(moving: PlacedMap, fixed: PlacedMap) -> list[float]:
    """Turns that bring the directions of a map's walls onto those of another, best first, each both ways."""
    parameters = fixed.parameters.comparison
    profiles = []
    for each in (fixed, moving):
        energy = each.energy()
        profiles.append((energy - energy.mean()) / max(float(energy.std()), 1e-12))
    bins = len(profiles[0])
    match = fft.irfft(fft.rfft(profiles[0]) * np.conj(fft.rfft(profiles[1])), n=bins)
    peaks = circular_peaks(match, round(parameters.turn_min_gap_rad / np.pi * bins))
    peaks = peaks[np.argsort(-match[peaks], kind="stable")][: parameters.turns_max]
    if len(peaks) == 0:
        peaks = np.array([0])
    turns = peaks * np.pi / bins
    return [turn + half for turn in turns.tolist() for half in (0.0, np.pi)]


class _ShiftSearch:
    """Correlates a turned map with a fixed one for all shifts at once.

    Walls on walls count, walls of either on free space of the other count against.
    """

    def __init__(self, moving: PlacedMap, fixed: PlacedMap, cell_m: float) -> None:
        self._cell_m = cell_m
        self._parameters = fixed.parameters.comparison
        contradiction = self._parameters.contradiction
        self._walls, self._space = moving.walls, moving.free_points(cell_m)
        self._center = moving.walls.mean(axis=0)
        reach = np.linalg.norm(np.concatenate([self._walls, self._space]) - self._center, axis=1).max()
        self._side = 2 * int(np.ceil(reach / cell_m)) + 3
        space = fixed.free_points(cell_m)
        everything = np.concatenate([fixed.walls, space])
        self._low = everything.min(axis=0) - cell_m
        size = np.ceil((everything.max(axis=0) - self._low) / cell_m).astype(int) + 2
        self._shape = (int(size[1]), int(size[0]))
        # Room for every shift at which the two still touch.
        self._padded = tuple(fft.next_fast_len(side + self._side, real=True) for side in self._shape)
        wall = self._raster(fixed.walls - self._low, self._shape)
        near = self._nearness(wall)
        free = self._raster(space - self._low, self._shape) * (near == 0)
        self._for_walls = fft.rfft2(near - contradiction * free, s=self._padded)
        self._for_space = fft.rfft2(-contradiction * wall, s=self._padded)

    def _raster(self, points_m: FloatArray, shape: tuple[int, int]) -> NDArray[np.float32]:
        columns, rows = np.floor(points_m / self._cell_m).astype(np.intp).T
        image = np.zeros(shape, np.float32)
        image[rows, columns] = 1
        return image

    def best(self, turn_rad: float) -> list[tuple[float, RigidMotion]]:
        """Best places of the map at a turn, with their scores."""
        half = self._side * self._cell_m / 2
        turned = RigidMotion.moving(self._center, np.full(2, half), turn_rad)
        shape = (self._side, self._side)
        wall = self._raster(turned.points(self._walls), shape)
        free = self._raster(turned.points(self._space), shape) * (self._nearness(wall) == 0)
        product = self._for_walls * np.conj(fft.rfft2(wall, s=self._padded))
        product += self._for_space * np.conj(fft.rfft2(free, s=self._padded))
        scores = fft.irfft2(product, s=self._padded)
        starts = []
        gap = max(1, round(self._parameters.start_min_gap_m / self._cell_m))
        for _ in range(self._parameters.starts_per_turn):
            row, column = np.unravel_index(int(scores.argmax()), scores.shape)
            score = float(scores[row, column])
            shift = np.array(
                [
                    at - size if at >= size - self._side else at
                    for at, size in ((column, self._padded[1]), (row, self._padded[0]))
                ]
            )
            target = self._low + shift * self._cell_m + half
            starts.append((score, RigidMotion.moving(self._center, target, turn_rad)))
            rows, columns = (
                np.arange(at - gap, at + gap + 1) % size
                for at, size in ((row, self._padded[0]), (column, self._padded[1]))
            )
            scores[np.ix_(rows, columns)] = -np.inf
        return starts

    def _nearness(self, wall: NDArray[np.float32]) -> NDArray[np.float32]:
        """1 at walls, 0 from `wall_blur_m` on."""
        per_cell = np.float32(self._cell_m / self._parameters.wall_blur_m)
        near: NDArray[np.float32] = np.maximum(0, 1 - distance_from(wall != 0) * per_cell)
        return near


def fitting_scale(moving: PlacedMap, fixed: PlacedMap) -> float | None:
    """Find how many times larger a map has to be to fit another.

    The lengths and the widths of the two, along the strongest direction of their walls and across it, give
    the scales that are tried.

    Parameters
    ----------
    moving, fixed : PlacedMap

    Returns
    -------
    float or None
        The scale of the best placement, None where none is good enough.
    """
    ratios = _extents_m(fixed) / np.maximum(_extents_m(moving), moving.resolution_m)
    parameters = fixed.parameters.comparison
    best_score, best_scale = parameters.scaled_min_score, None
    for scale in sorted({*ratios.tolist(), math.sqrt(float(ratios.prod()))}):
        if abs(scale - 1) < parameters.scale_min_change:
            continue
        placement = place(moving.scaled(scale), fixed)
        if placement is not None and placement.score >= best_score:
            best_score, best_scale = placement.score, scale
    return best_scale


def _extents_m(map_: PlacedMap) -> FloatArray:
    """Length and width (2,) of what a map's walls enclose, the longer first."""
    outside = map_.parameters.comparison.outside_share
    energy = map_.energy()
    turn = float(energy.argmax()) * math.pi / len(energy)
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    low, high = np.quantile(map_.walls @ axes.T, (outside, 1 - outside), axis=0)
    extents: FloatArray = np.sort(high - low)[::-1]
    return extents
