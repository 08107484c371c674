"""Back projection: how much of each room of a run's last map every earlier map shows.

What a single map shows of a half seen building is often wrong. Once the run is over, its last map says
which rooms there are, and an earlier map how much of each had been seen.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.model.labels import equal_pieces, known_window, label_sizes, labels_near
from rose2_logs.model.occupancy import BoolArray, FloatArray, GridGeometry, OccupancySnapshot, classify
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.registration import RigidMotion, WallFit, wall_faces
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot, map_motion


@dataclass(frozen=True, eq=False)
class BackProjectedRooms:
    """How much of the rooms of the run's last map another map shows.

    Attributes
    ----------
    labels : (H, W) int32
        On the map's canvas: 0 = no room, 1..R = the rooms of the last map.
    areas_m2 : (R,) float
        Area of each.
    """

    labels: NDArray[np.int32]
    areas_m2: FloatArray


class BackProjector:
    """Carries the rooms of a run's last map over to the maps before it.

    A map is laid over the last one: first as it moved from map to map, then by its walls. Each of its free
    cells takes the room that is there in the end; the nearest, where the last map shows no free space.
    Pieces of a room smaller than `back_projected_min_area_m2` join the room next to them.

    Parameters
    ----------
    last : OccupancySnapshot
        The last map.
    rooms : RoomMap
        Its rooms.
    tracking : TrackingParameters
        The least piece of a room, and how walls are fitted.
    occupancy : OccupancyParameters, optional
        Which cells are free, which are walls.
    """

    def __init__(
        self,
        last: OccupancySnapshot,
        rooms: RoomMap,
        tracking: TrackingParameters,
        occupancy: OccupancyParameters | None = None,
    ) -> None:
        self._tracking = tracking
        self._occupancy = occupancy or OccupancyParameters()
        self._window = known_window(last.cells >= 0)
        self._geometry, self._count = rooms.geometry, len(rooms)
        labels = rooms.labels[self._window]
        free, occupied = classify(last.cells, self._occupancy)
        not_free = ~free[self._window]
        self._nearest = labels.copy()
        self._nearest[not_free] = labels_near(labels, np.flatnonzero(not_free), np.inf)
        points = wall_faces(free, occupied, last.geometry)
        enough = len(points) >= tracking.fit_min_points
        self._fit = WallFit(points, last.geometry.resolution_m, tracking) if enough else None

    def rooms(self, snapshot: OccupancySnapshot, motion: RigidMotion) -> BackProjectedRooms:
        """Find the rooms of the last map on another one.

        Parameters
        ----------
        snapshot : OccupancySnapshot
            The map.
        motion : RigidMotion
            How the whole map moved from then to the end, see `motions_to_last`.
        """
        labels = np.zeros(snapshot.geometry.shape, np.int32)
        window = known_window(snapshot.cells >= 0)
        all_free, occupied = classify(snapshot.cells, self._occupancy)
        free = all_free[window]
        row, column = np.nonzero(free)
        if self._count == 0 or len(row) == 0:
            return BackProjectedRooms(labels, np.zeros(self._count))
        corner = np.array([window[0].start, window[1].start])
        centers = snapshot.geometry.cell_centers(row + corner[0], column + corner[1])
        laid_over = self._laid_over(all_free, occupied, snapshot.geometry, motion)
        cells = self._geometry.world_to_cell(laid_over.points(centers))
        cells -= (self._window[0].start, self._window[1].start)
        np.clip(cells, 0, np.array(self._nearest.shape) - 1, out=cells)
        part = labels[window]
        part[row, column] = self._nearest[cells[:, 0], cells[:, 1]]
        cell_m2 = snapshot.geometry.cell_area_m2
        _join_small_pieces(part, free, self._tracking.back_projected_min_area_m2 / cell_m2)
        return BackProjectedRooms(labels, label_sizes(part, self._count)[1:].astype(float) * cell_m2)

    def _laid_over(
        self, free: BoolArray, occupied: BoolArray, geometry: GridGeometry, motion: RigidMotion
    ) -> RigidMotion:
        """Fit a map's walls to those of the last one, where that brings more of them together."""
        points = wall_faces(free, occupied, geometry)
        fit = self._fit
        if fit is None or len(points) < self._tracking.fit_min_points:
            return motion
        walls = WallFit(points, geometry.resolution_m, self._tracking).sample()
        center = walls.points.mean(axis=0)
        start = RigidMotion.moving(center, motion.points(center), motion.turn_rad)
        fitted = fit.settled(walls, start)
        return max(start, fitted, key=lambda each: fit.share(walls.points, each))


def motions_to_last(motions: Sequence[RigidMotion | None]) -> list[RigidMotion]:
    """How the whole map moved from each map of a run to the last.

    Parameters
    ----------
    motions : sequence
        How it moved to each from the one before; None where it stayed.
    """
    to_last = [RigidMotion.none()]
    for motion in reversed(motions[1:]):
        to_last.append(to_last[-1] if motion is None else motion.then(to_last[-1]))
    return to_last[: len(motions)][::-1]


def _join_small_pieces(labels: NDArray[np.int32], free: NDArray[np.bool_], min_cells: float) -> None:
    """Give the cells (H, W) of pieces smaller than so many to the nearest larger piece, if there is one."""
    piece = equal_pieces(labels > 0, labels)
    small = np.bincount(piece.ravel()) < min_cells
    small[0] = False
    kept = np.where(small[piece], 0, labels)
    if small.any() and kept.any():
        joining = small[piece] & free
        labels[joining] = labels_near(kept, np.flatnonzero(joining), np.inf)


@dataclass(frozen=True, eq=False)
class BackProjectedSnapshot:
    """One map of a run with what it shows of the rooms of the last one.

    Attributes
    ----------
    snapshot : OccupancySnapshot
        The map.
    coverage : float
        As of `TrackedSnapshot`.
    rooms : BackProjectedRooms
        How much it shows of the last map's rooms.
    last_rooms : RoomMap
        The rooms of the last map.
    track_ids : tuple of R int
        Their tracks.
    to_last : RigidMotion
        How the whole map moved from then to the end.
    part : int, optional
        As of `TrackedSnapshot`: of a run in parts, the last map is that of the part.
    """

    snapshot: OccupancySnapshot
    coverage: float
    rooms: BackProjectedRooms
    last_rooms: RoomMap
    track_ids: tuple[int, ...]
    to_last: RigidMotion
    part: int | None = None


class RunBackProjection:
    """Keeps what the second pass needs along the run, some numbers a map, and makes that pass.

    Parameters
    ----------
    parameters : Parameters
        Of the run.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        # By part, None in a run without parts.
        self._last: dict[int | None, TrackedSnapshot] = {}
        self._motions: dict[int | None, dict[int, RigidMotion | None]] = {}
        self._coverages: dict[int, float] = {}

    def add(self, step: TrackedSnapshot) -> None:
        """Take the next map of the run."""
        self._last[step.part] = step
        self._motions.setdefault(step.part, {})[step.snapshot.index] = map_motion(step.events)
        self._coverages[step.snapshot.index] = step.coverage

    def back_projected(self, snapshots: Iterable[OccupancySnapshot]) -> Iterator[BackProjectedSnapshot]:
        """Yield the maps with the rooms of the last one of their part; one map at a time is held.

        Parameters
        ----------
        snapshots : iterable of OccupancySnapshot
            The maps of the run again. Those that were not taken before are left out.
        """
        part_of = {index: part for part, motions in self._motions.items() for index in motions}
        taken = (snapshot for snapshot in snapshots if snapshot.index in part_of)
        for part, of_part in groupby(taken, lambda snapshot: part_of[snapshot.index]):
            last, motions = self._last[part], self._motions[part]
            rooms, parameters = last.analysis.rooms, self._parameters
            projector = BackProjector(last.snapshot, rooms, parameters.tracking, parameters.occupancy)
            to_last = dict(zip(motions, motions_to_last(list(motions.values())), strict=True))
            for snapshot in of_part:
                motion = to_last[snapshot.index]
                shown = projector.rooms(snapshot, motion)
                coverage = self._coverages[snapshot.index]
                yield BackProjectedSnapshot(snapshot, coverage, shown, rooms, last.track_ids, motion, part)
