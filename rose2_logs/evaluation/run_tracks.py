"""The tracks of one run's cases against the true tracks."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.cases import Case
from rose2_logs.evaluation.scores import score
from rose2_logs.evaluation.tracks import TrackComparison, TrackScores, TruthLinker
from rose2_logs.model.occupancy import FloatArray, GridGeometry, OccupancySnapshot, classify
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.back_projection import BackProjector, motions_to_last
from rose2_logs.tracking.overlap import overlap_of
from rose2_logs.tracking.registration import MapAligner, RigidMotion
from rose2_logs.tracking.tracker import RoomTracker


@dataclass(frozen=True)
class RunTrackScores:
    """Figures of the tracks of a run.

    Attributes
    ----------
    found : TrackScores
        Of the rooms that the method found.
    back_projected : TrackScores
        Of the rooms of the run's last map, carried over to the maps before it.
    back_projected_iou_sym : float
        Mean overlap, in percent, of these rooms with the true ones, see `Scores`.
    true_rooms : TrackScores
        Of the true rooms, given to the tracker without their numbers: what it reaches where the segmentation
        is right.
    """

    found: TrackScores
    back_projected: TrackScores
    back_projected_iou_sym: float
    true_rooms: TrackScores


class RunTracks:
    """Follows the rooms of each group's cases, which come in their order, as those of one run.

    Maps lie at their cases' origins. Where these are not known, a map of the size of the one before is taken
    to have its origin, and one of another size is laid over it.

    Parameters
    ----------
    parameters : Parameters
        Of the tracker, and which cells are walls.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._runs: dict[str, _Run] = {}

    def add(self, result: CaseResult) -> None:
        """Take the next case, with its labels.

        Raises
        ------
        CasesError
            If an image of the case cannot be read any more.
        """
        run = self._runs.setdefault(result.case.group, _Run(self._parameters))
        truth = _true_labels(result.case)
        found = np.ascontiguousarray(np.flipud(result.labels))
        run.add(result.case, truth, found)

    def scores(self) -> dict[str, RunTrackScores]:
        """Figures of each group, in the order in which the groups came."""
        return {group: run.scores() for group, run in self._runs.items()}


@dataclass(frozen=True)
class _Past:
    """What is kept of a map until the run is over; the map itself is read again then."""

    case: Case
    geometry: GridGeometry
    motion: RigidMotion | None
    true_track: NDArray[np.int32]

    def snapshot(self) -> OccupancySnapshot:
        return dataclasses.replace(self.case.snapshot(), geometry=self.geometry)


class _Run:
    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._before: OccupancySnapshot | None = None
        self._aligner = MapAligner(parameters.tracking, parameters.occupancy)
        self._linker = TruthLinker()
        self._sides = tuple(
            (RoomTracker(parameters.tracking, parameters.occupancy), TrackComparison()) for _ in range(2)
        )
        self._past: list[_Past] = []
        self._last_labels: NDArray[np.int32]

    def add(self, case: Case, truth: NDArray[np.int32], found: NDArray[np.int32]) -> None:
        snapshot = case.snapshot()
        if self._before is not None and case.origin_xy_m is None:
            snapshot = placed(snapshot, self._before, self._parameters.occupancy)
        self._before = snapshot
        geometry, motion = snapshot.geometry, self._aligner.update(snapshot)
        true_track = self._linker.update(truth, geometry, motion)
        for labels, (tracker, comparison) in zip((found, truth), self._sides, strict=True):
            tracks, _ = tracker.update(snapshot, RoomMap.from_labels(labels, geometry))
            _compare(comparison, truth, true_track, labels, np.array(tracks, np.int64))
        self._past.append(_Past(case, geometry, motion, true_track))
        self._last_labels = found

    def scores(self) -> RunTrackScores:
        found, true_rooms = (comparison.scores() for _, comparison in self._sides)
        return RunTrackScores(found, *self._back_projected(), true_rooms)

    def _back_projected(self) -> tuple[TrackScores, float]:
        parameters, last = self._parameters, self._past[-1]
        rooms = RoomMap.from_labels(self._last_labels, last.geometry)
        projector = BackProjector(last.snapshot(), rooms, parameters.tracking, parameters.occupancy)
        comparison, overlaps = TrackComparison(), []
        motions = motions_to_last([past.motion for past in self._past])
        for past, motion in zip(self._past, motions, strict=True):
            truth = _true_labels(past.case)
            labels = projector.rooms(past.snapshot(), motion).labels
            _compare(comparison, truth, past.true_track, labels, np.arange(1, len(rooms) + 1))
            overlaps.append(score(truth, labels).iou_sym)
        return comparison.scores(), float(np.mean(overlaps))


def _true_labels(case: Case) -> NDArray[np.int32]:
    """True rooms with row 0 at the bottom, as a map has it."""
    return np.ascontiguousarray(np.flipud(case.truth())).astype(np.int32)


def _compare(
    comparison: TrackComparison,
    truth: NDArray[np.int32],
    true_track: NDArray[np.int32],
    labels: NDArray[np.int32],
    tracks: NDArray[np.int64],
) -> None:
    overlap = overlap_of(truth, labels)
    comparison.add(true_track[overlap.first_ids], tracks[overlap.second_ids - 1], overlap.iou)


def run_tracks_as_json(runs: Mapping[str, RunTrackScores]) -> dict[str, dict[str, Any]]:
    """Return the figures of each run as JSON values."""
    return {group: dataclasses.asdict(scores) for group, scores in runs.items()}


WALL_SIGMA_CELLS = 2.0
"""Walls are blurred by this much, so that maps still correlate where they moved or turned a little."""


def placed(
    snapshot: OccupancySnapshot, before: OccupancySnapshot, parameters: OccupancyParameters
) -> OccupancySnapshot:
    """Give a map the origin at which it lies over the one before.

    Canvases of one size are taken to be the same canvas. One that grew is laid where its walls and those of
    the map before correlate most, in whole cells.

    Parameters
    ----------
    snapshot : OccupancySnapshot
        The map, of the same resolution as the one before.
    before : OccupancySnapshot
        The one before, where it lies.
    parameters : OccupancyParameters
        Which cells are walls.
    """
    origin = np.asarray(before.geometry.origin_xy_m)
    if snapshot.geometry.shape != before.geometry.shape:
        rows, columns = _offset(_walls(before, parameters), _walls(snapshot, parameters))
        origin = origin - np.array([columns, rows]) * snapshot.geometry.resolution_m
    x, y = origin.tolist()
    return dataclasses.replace(snapshot, geometry=dataclasses.replace(snapshot.geometry, origin_xy_m=(x, y)))


def _walls(snapshot: OccupancySnapshot, parameters: OccupancyParameters) -> FloatArray:
    """Blurred occupied cells (H, W)."""
    from scipy.ndimage import gaussian_filter

    _, occupied = classify(snapshot.cells, parameters)
    blurred: FloatArray = gaussian_filter(occupied.astype(np.float64), WALL_SIGMA_CELLS)
    return blurred


def _offset(first: FloatArray, second: FloatArray) -> tuple[int, int]:
    """Rows and columns by which to move the first image so that it correlates best with the second."""
    from scipy import fft

    shape = [fft.next_fast_len(a + b, real=True) for a, b in zip(first.shape, second.shape, strict=True)]
    product = np.conj(fft.rfft2(first, shape)) * fft.rfft2(second, shape)
    correlation = fft.irfft2(product, shape)
    rows, columns = (int(at) for at in np.unravel_index(correlation.argmax(), correlation.shape))
    # Moves up and left are at the far ends.
    return (
        rows - shape[0] if rows >= second.shape[0] else rows,
        columns - shape[1] if columns >= second.shape[1] else columns,
    )
