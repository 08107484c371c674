"""The tracks of one run's cases against the true tracks."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.cases import Case, Truth
from rose2_logs.evaluation.scores import score_against
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

    Where maps of the run have two truths, the tracks are compared with those of all first truths and with
    those of all second ones (the first where a map has no other): a true room must not change its shape from
    map to map because another drawing counts. What gives the found rooms the higher IDF1 counts.

    Attributes
    ----------
    found : TrackScores
        Of the rooms that the method found.
    back_projected : TrackScores
        Of the rooms of the run's last map, carried over to the maps before it.
    back_projected_iou_sym : float
        Mean overlap, in percent, of these rooms with the true ones, see `Scores`; on each map with the
        truth that agrees better.
    true_rooms : TrackScores
        Of the true rooms, given to the tracker without their numbers: what it reaches where the segmentation
        is right.
    truth : {"rooms", "rooms_other"}
        The truth that counts.
    """

    found: TrackScores
    back_projected: TrackScores
    back_projected_iou_sym: float
    true_rooms: TrackScores
    truth: Truth = "rooms"


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
        run.add(result.case, np.ascontiguousarray(np.flipud(result.labels)))

    def scores(self) -> dict[str, RunTrackScores]:
        """Figures of each group, in the order in which the groups came."""
        return {group: run.scores() for group, run in self._runs.items()}


@dataclass(frozen=True)
class _Past:
    """What is kept of a map until the run is over; the map itself is read again then."""

    case: Case
    geometry: GridGeometry
    motion: RigidMotion | None

    def snapshot(self) -> OccupancySnapshot:
        return dataclasses.replace(self.case.snapshot(), geometry=self.geometry)


class _TrueTracks:
    """True rooms along a run in one of their drawings, and how the found tracks agree with them."""

    def __init__(self, parameters: Parameters) -> None:
        self._linker = TruthLinker()
        self._tracker = RoomTracker(parameters.tracking, parameters.occupancy)
        self.found, self.true_rooms = TrackComparison(), TrackComparison()
        self.of_labels: list[NDArray[np.int32]] = []
        """For each map so far, the true track of each label."""

    def add(
        self,
        snapshot: OccupancySnapshot,
        motion: RigidMotion | None,
        truth: NDArray[np.int32],
        found: NDArray[np.int32],
        tracks: NDArray[np.int64],
    ) -> None:
        true_track = self._linker.update(truth, snapshot.geometry, motion)
        _compare(self.found, truth, true_track, found, tracks)
        again, _ = self._tracker.update(snapshot, RoomMap.from_labels(truth, snapshot.geometry))
        _compare(self.true_rooms, truth, true_track, truth, np.array(again, np.int64))
        self.of_labels.append(true_track)


class _Run:
    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._before: OccupancySnapshot | None = None
        self._aligner = MapAligner(parameters.tracking, parameters.occupancy)
        self._tracker = RoomTracker(parameters.tracking, parameters.occupancy)
        self._true: dict[Truth, _TrueTracks] = {"rooms": _TrueTracks(parameters)}
        self._past: list[_Past] = []
        self._last_labels: NDArray[np.int32]

    def add(self, case: Case, found: NDArray[np.int32]) -> None:
        snapshot = case.snapshot()
        if self._before is not None and case.origin_xy_m is None:
            snapshot = placed(snapshot, self._before, self._parameters.occupancy)
        self._before = snapshot
        geometry, motion = snapshot.geometry, self._aligner.update(snapshot)
        tracks, _ = self._tracker.update(snapshot, RoomMap.from_labels(found, geometry))
        truths = _true_labels(case)
        if "rooms_other" in truths and "rooms_other" not in self._true:
            # Up to here the two drawings of the run were one.
            self._true["rooms_other"] = copy.deepcopy(self._true["rooms"])
        for name, true in self._true.items():
            truth = truths.get(name, truths["rooms"])
            true.add(snapshot, motion, truth, found, np.array(tracks, np.int64))
        self._past.append(_Past(case, geometry, motion))
        self._last_labels = found

    def scores(self) -> RunTrackScores:
        truth = max(self._true, key=lambda name: self._true[name].found.scores().idf1)
        true = self._true[truth]
        back_projected = self._back_projected(truth)
        return RunTrackScores(true.found.scores(), *back_projected, true.true_rooms.scores(), truth)

    def _back_projected(self, name: Truth) -> tuple[TrackScores, float]:
        parameters, last = self._parameters, self._past[-1]
        rooms = RoomMap.from_labels(self._last_labels, last.geometry)
        projector = BackProjector(last.snapshot(), rooms, parameters.tracking, parameters.occupancy)
        comparison, overlaps = TrackComparison(), []
        motions = motions_to_last([past.motion for past in self._past])
        true_tracks = self._true[name].of_labels
        for past, motion, true_track in zip(self._past, motions, true_tracks, strict=True):
            truths = _true_labels(past.case)
            labels = projector.rooms(past.snapshot(), motion).labels
            truth = truths.get(name, truths["rooms"])
            _compare(comparison, truth, true_track, labels, np.arange(1, len(rooms) + 1))
            overlaps.append(score_against(truths, labels)[1].iou_sym)
        return comparison.scores(), float(np.mean(overlaps))


def _true_labels(case: Case) -> dict[Truth, NDArray[np.int32]]:
    """Each truth with row 0 at the bottom, as a map has it."""
    truths = case.truths().items()
    return {name: np.ascontiguousarray(np.flipud(labels)).astype(np.int32) for name, labels in truths}


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
