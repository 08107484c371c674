"""The tracks of one run's cases against the true tracks."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.canvas import placed
from rose2_logs.evaluation.tracks import TrackComparison, TrackScores
from rose2_logs.evaluation.truth_tracks import TruthLinker
from rose2_logs.occupancy import OccupancySnapshot
from rose2_logs.parameters import Parameters
from rose2_logs.rooms import RoomMap
from rose2_logs.tracking.alignment import MapAligner
from rose2_logs.tracking.overlap import overlap_of
from rose2_logs.tracking.tracker import RoomTracker


@dataclass(frozen=True)
class RunTrackScores:
    """Figures of the tracks of a run.

    Attributes
    ----------
    found : TrackScores
        Of the rooms that the method found.
    true_rooms : TrackScores
        Of the true rooms, given to the tracker without their numbers: what it reaches where the segmentation
        is right.
    """

    found: TrackScores
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
        truth = np.ascontiguousarray(np.flipud(result.case.truth())).astype(np.int32)
        found = np.ascontiguousarray(np.flipud(result.labels))
        run.add(result.case.snapshot(), truth, found, origin_known=result.case.origin_xy_m is not None)

    def scores(self) -> dict[str, RunTrackScores]:
        """Figures of each group, in the order in which the groups came."""
        return {group: run.scores() for group, run in self._runs.items()}


class _Run:
    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._before: OccupancySnapshot | None = None
        self._aligner = MapAligner(parameters.tracking, parameters.occupancy)
        self._linker = TruthLinker()
        self._sides = tuple(
            (RoomTracker(parameters.tracking, parameters.occupancy), TrackComparison()) for _ in range(2)
        )

    def add(
        self,
        snapshot: OccupancySnapshot,
        truth: NDArray[np.int32],
        found: NDArray[np.int32],
        *,
        origin_known: bool,
    ) -> None:
        if self._before is not None and not origin_known:
            snapshot = placed(snapshot, self._before, self._parameters.occupancy)
        self._before = snapshot
        geometry = snapshot.geometry
        true_track = self._linker.update(truth, geometry, self._aligner.update(snapshot))
        for labels, (tracker, comparison) in zip((found, truth), self._sides, strict=True):
            tracks, _ = tracker.update(snapshot, RoomMap.from_labels(labels, geometry))
            overlap = overlap_of(truth, labels)
            comparison.add(
                true_track[overlap.first_ids], np.array(tracks, np.int64)[overlap.second_ids - 1], overlap.iou
            )

    def scores(self) -> RunTrackScores:
        found, true_rooms = (comparison.scores() for _, comparison in self._sides)
        return RunTrackScores(found, true_rooms)


def run_tracks_as_json(runs: Mapping[str, RunTrackScores]) -> dict[str, dict[str, Any]]:
    """Return the figures of each run as JSON values."""
    return {group: dataclasses.asdict(scores) for group, scores in runs.items()}
