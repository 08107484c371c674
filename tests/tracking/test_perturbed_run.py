"""A simulated run with its true rooms, disturbed on purpose: identity must come through."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from moved_maps import motion_about, moved
from numpy.typing import NDArray
from PIL import Image

from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.evaluation.tracks import TrackComparison, TrackScores
from rose2_logs.io import open_log
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.matching import resample_labels
from rose2_logs.tracking.overlap import overlap_of
from rose2_logs.tracking.tracker import RoomTracker

SAMPLES = Path(__file__).parents[2] / "sample_logs"
MIN_ROOM_CELLS = 200
"""Rooms of which a map knows fewer cells are left out, as in the benchmark."""

Map = tuple[OccupancySnapshot, NDArray[np.int32]]


@pytest.fixture(scope="module")
def run() -> list[Map]:
    """Every third map of a sample log with the true rooms of its free cells, by their numbers."""
    about = json.loads((SAMPLES / "office.rooms.json").read_text())
    with Image.open(SAMPLES / "office.rooms.png") as image:
        truth = np.ascontiguousarray(np.flipud(np.asarray(image))).astype(np.int32)
    where = GridGeometry(about["resolution_m"], tuple(about["origin_xy_m"]), 0.0, "map", truth.shape)
    maps = []
    with open_log(SAMPLES / "office.mcap") as reader:
        for snapshot in reader.snapshots():
            if snapshot.index % 3 == 0:
                labels = resample_labels(truth, where, snapshot.geometry)
                labels[snapshot.cells != 0] = 0
                small = np.bincount(labels.ravel()) < MIN_ROOM_CELLS
                maps.append((snapshot, np.where(small[labels], 0, labels).astype(np.int32)))
    return maps


def followed(maps: list[Map], found: list[NDArray[np.int32]]) -> TrackScores:
    """Figures of the tracks of found rooms against the true numbers."""
    tracker, comparison = RoomTracker(TrackingParameters()), TrackComparison()
    for (snapshot, truth), labels in zip(maps, found, strict=True):
        tracks, _ = tracker.update(snapshot, RoomMap.from_labels(labels, snapshot.geometry))
        overlap = overlap_of(truth, labels)
        comparison.add(overlap.first_ids, np.array(tracks, int)[overlap.second_ids - 1], overlap.iou)
    return comparison.scores()


def renumber_in_place(labels: NDArray[np.int32], seed: int) -> NDArray[np.int32]:
    """The same rooms under other numbers, 1, 2, ... in any order: nothing tells who is who."""
    occurring = np.unique(labels[labels > 0])
    number = np.zeros(int(labels.max(initial=0)) + 1, np.int32)
    number[occurring] = 1 + np.random.default_rng(seed).permutation(len(occurring))
    return number[labels]


def test_rooms_keep_their_numbers_while_they_come_to_light(run):
    """Half-seen rooms on a growing canvas: no room has two numbers, no number two rooms."""
    scores = followed(run, [renumber_in_place(truth, seed) for seed, (_, truth) in enumerate(run)])
    assert (scores.idf1, scores.id_switches) == (100, 0)
    assert scores.tracks == scores.true_tracks > 10


def test_rooms_keep_their_numbers_when_the_map_leaps_and_turns(run):
    """Every other map lies elsewhere, by up to 1.5 meters and 3 degrees, and a room in four is not found."""
    rng = np.random.default_rng(3)
    maps, found = [], []
    for number, (snapshot, truth) in enumerate(run):
        shift = rng.uniform(-1, 1, 2) if number % 2 else np.zeros(2)
        motion = motion_about(snapshot, (float(shift[0]), float(shift[1])), float(rng.uniform(-3, 3)))
        maps.append(moved(snapshot, truth, motion))
        seen = np.where(rng.random(truth.max() + 1)[maps[-1][1]] < 0.75, maps[-1][1], 0)
        found.append(renumber_in_place(seen.astype(np.int32), number))
    scores = followed(maps, found)
    assert (scores.idf1, scores.id_switches) == (scores.idf1_bound, 0)
    assert scores.tracks == scores.true_tracks


def test_rooms_get_their_numbers_back_after_merges_and_splits(run):
    """The corridor takes in a room for two maps, again and again, and another room falls in two.

    Which part of a room is the room cannot be known where it was never seen whole: one map may be wrong.
    """
    found = []
    largest, *others = np.argsort(-np.bincount(run[-1][1].ravel())[1:], kind="stable") + 1
    for number, (_, truth) in enumerate(run):
        labels = truth.copy()
        if number % 4 in (2, 3):
            labels[truth == others[0]] = largest
        if number % 3 == 2 and (truth == others[1]).any():
            rows, columns = np.nonzero(truth == others[1])
            upper = rows > np.quantile(rows, 0.6)
            labels[rows[upper], columns[upper]] = labels.max() + 1
        found.append(renumber_in_place(labels, number))
    scores = followed(run, found)
    assert scores.idf1_bound < 99
    assert scores.idf1 >= scores.idf1_bound - 1
    assert scores.tracks <= scores.true_tracks + 2
