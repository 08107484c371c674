"""Tracks of rooms against true tracks, as multi-object tracking defines its figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.model.occupancy import FloatArray, GridGeometry
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.matching import RegionShape, assign, cut_out_rooms
from rose2_logs.tracking.registration import RigidMotion

MATCH_IOU = 0.5
"""A found and a true room are the same from this overlap on: the gate of the MOTChallenge benchmarks."""


@dataclass(frozen=True)
class TrackScores:
    """Figures of the tracks of a run; shares in percent.

    The definitions are those of py-motmetrics: ID figures after Ristani et al. (2016), switches and
    fragmentations after CLEAR MOT (Bernardin and Stiefelhagen, 2008).

    Attributes
    ----------
    idf1 : float
        Each true track has one found track at most, and the other way round, so that they agree in as many
        rooms as possible; twice these over the number of true and of found rooms, all maps together.
    idp, idr : float
        The same rooms over the number of found, and of true rooms.
    idf1_bound : float
        What `idf1` would be if every room that agrees with a true one had the right track: it is limited by
        the segmentation.
    id_switches : int
        How often a true room is found under another track than the time before.
    fragmentations : int
        How often a true room is not found any more, and found again later.
    tracks, true_tracks : int
        Number of tracks of the run.
    """

    idf1: float
    idp: float
    idr: float
    idf1_bound: float
    id_switches: int
    fragmentations: int
    tracks: int
    true_tracks: int


class TrackComparison:
    """Collects the maps of a run, and gives its `TrackScores`.

    Parameters
    ----------
    match_iou : float
        Rooms with less overlap are not the same.
    """

    def __init__(self, match_iou: float = MATCH_IOU) -> None:
        self._match_iou = match_iou
        self._agreements: dict[tuple[int, int], int] = {}
        self._true_rooms: dict[int, int] = {}
        self._found_rooms: dict[int, int] = {}
        self._matched = 0
        self._track_of: dict[int, int] = {}
        self._missed: set[int] = set()
        self._switches = self._fragmentations = 0

    def add(self, true_tracks: NDArray[np.integer], tracks: NDArray[np.integer], iou: FloatArray) -> None:
        """Take the next map.

        Parameters
        ----------
        true_tracks : (T,) int
            Track of each true room.
        tracks : (R,) int
            Track of each found room.
        iou : (T, R) float
            Their overlap.
        """
        true_ids, found_ids = true_tracks.tolist(), tracks.tolist()
        agrees = (iou >= self._match_iou) & (iou > 0)
        for counts, ids in ((self._true_rooms, true_ids), (self._found_rooms, found_ids)):
            counts.update({track: counts.get(track, 0) + 1 for track in ids})
        for row, column in zip(*np.nonzero(agrees), strict=True):
            pair = true_ids[row], found_ids[column]
            self._agreements[pair] = self._agreements.get(pair, 0) + 1
        self._matched += len(_most_pairs(iou, agrees))
        self._follow(true_ids, found_ids, iou, agrees)

    def _follow(
        self, true_ids: list[int], found_ids: list[int], iou: FloatArray, agrees: NDArray[np.bool_]
    ) -> None:
        """Match the rooms of a map: those that were matched before stay so, the others as well as may be."""
        column_of = {track: column for column, track in enumerate(found_ids)}
        free = agrees.copy()
        matched = set()
        for row, true_id in enumerate(true_ids):
            kept = column_of.get(self._track_of.get(true_id, -1))
            if kept is not None and free[row, kept]:
                free[row], free[:, kept] = False, False
                matched.add(true_id)
        for row, column in _most_pairs(iou, free):
            true_id, track = true_ids[row], found_ids[column]
            self._switches += true_id in self._track_of
            self._track_of[true_id] = track
            matched.add(true_id)
        self._fragmentations += len(matched & self._missed)
        self._missed -= matched
        self._missed |= {true_id for true_id in true_ids if true_id in self._track_of} - matched

    def scores(self) -> TrackScores:
        """Figures of the maps so far; the shares are zero where there is no room at all."""
        true_index = {track: row for row, track in enumerate(self._true_rooms)}
        index = {track: column for column, track in enumerate(self._found_rooms)}
        table = np.zeros((len(true_index), len(index)))
        for (true_id, track), count in self._agreements.items():
            table[true_index[true_id], index[track]] = count
        agreed = sum(table[pair] for pair in _most_pairs(table, table > 0, count_first=False))
        true_rooms, rooms = sum(self._true_rooms.values()), sum(self._found_rooms.values())
        return TrackScores(
            idf1=_percent(2 * agreed, true_rooms + rooms),
            idp=_percent(agreed, rooms),
            idr=_percent(agreed, true_rooms),
            idf1_bound=_percent(2 * self._matched, true_rooms + rooms),
            id_switches=self._switches,
            fragmentations=self._fragmentations,
            tracks=len(index),
            true_tracks=len(true_index),
        )


def _percent(part: float, whole: float) -> float:
    return 100 * float(part) / whole if whole else 0.0


def _most_pairs(
    weight: FloatArray, allowed: NDArray[np.bool_], count_first: bool = True
) -> list[tuple[int, int]]:
    """Pair rows with columns: as many allowed pairs as can be, of the greatest weight, or by weight alone."""
    # One more pair outweighs whatever the others may lose.
    bonus = min(weight.shape) * float(weight.max(initial=0.0)) if count_first else 0.0
    return assign(weight + bonus, allowed)


SAME_MIN_SHARE = 0.5
"""A true room is an earlier one when one of the two holds most of the other: rooms grow as they are seen."""


class TruthLinker:
    """Numbers true rooms over a run.

    The rooms of each map and the last shapes of all true rooms so far, also of those that later maps do not
    show, are paired by the greatest sum of intersection over union, as far as one of the two holds at least
    `SAME_MIN_SHARE` of the other; what is left gets a new number.
    """

    def __init__(self) -> None:
        self._last: dict[int, RegionShape] = {}

    def update(
        self, labels: NDArray[np.int32], geometry: GridGeometry, motion: RigidMotion | None
    ) -> NDArray[np.int32]:
        """Take the true rooms of the next map.

        Parameters
        ----------
        labels : (H, W) int32
            True rooms, 0 = none, row 0 at the grid's origin.
        geometry : GridGeometry
            Where the map lies.
        motion : RigidMotion, optional
            How the map moved since the one before.

        Returns
        -------
        (L + 1,) int32
            Number of each label up to the greatest, L; 0 for a label that does not occur.
        """
        if motion is not None:
            self._last = {number: shape.moved(motion) for number, shape in self._last.items()}
        shapes = cut_out_rooms(RoomMap.from_labels(labels, geometry))
        areas = np.array([0.0 if shape is None else shape.area_m2 for shape in shapes])
        before = np.array([shape.area_m2 for shape in self._last.values()])[:, None]
        common = np.zeros((len(before), len(areas)))
        for row, last in enumerate(self._last.values()):
            common[row] = last.common_area_m2(labels, geometry, len(areas))
        same = (common > 0) & (common >= SAME_MIN_SHARE * np.minimum(before, areas))
        numbers = np.zeros(len(areas) + 1, np.int32)
        known = list(self._last)
        for row, column in assign(common / np.maximum(before + areas - common, common), same):
            numbers[column + 1] = known[row]
        for label, shape in enumerate(shapes, start=1):
            if shape is not None:
                numbers[label] = numbers[label] or len(self._last) + 1
                self._last[int(numbers[label])] = shape
        return numbers
