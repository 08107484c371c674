"""Maps from anywhere, followed one by one, are found to be what a whole analysis finds."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest
from finished_runs import SAMPLE_LOGS
from saved_maps import save_run

import rose2_logs as rl
from rose2_logs.errors import LogError, ParameterError

LOG = SAMPLE_LOGS / "office.mcap"
MAPS = 4


@pytest.fixture(scope="module")
def run() -> rl.Run:
    return rl.analyze(LOG, max_snapshots=MAPS)


@pytest.fixture(scope="module")
def snapshots() -> list[rl.OccupancySnapshot]:
    with rl.open_log(LOG, max_snapshots=MAPS) as reader:
        return list(reader.snapshots())


def assert_as_stored(steps: Iterable[rl.TrackedSnapshot], run: rl.Run, *, has_coverage: bool = True) -> None:
    events = run.events.arrow.to_pylist()
    count = 0
    for step, stored in zip(steps, run, strict=True):
        assert step.snapshot.index == stored.number
        tracks = np.array([0, *step.track_ids])
        assert np.array_equal(tracks[step.rooms.labels], stored.labels)
        areas = dict(zip(step.track_ids, step.rooms.areas_m2.tolist(), strict=True))
        assert areas == dict(zip(stored.rooms["track"], stored.rooms["area_m2"], strict=True))
        told = [(row["kind"], row["track"]) for row in events if row["snapshot"] == stored.number]
        assert [(event.kind, event.track) for event in step.events] == told
        assert step.coverage == stored.coverage if has_coverage else math.isnan(step.coverage)
        count += 1
    assert count == len(run)


def test_a_list_of_maps_has_a_last_one(snapshots, run: rl.Run):
    assert_as_stored(rl.track(snapshots), run)


def test_the_last_map_of_a_generator_is_not_known(snapshots, run: rl.Run):
    """So neither is the coverage; all else is the same."""
    assert_as_stored(rl.track(snapshot for snapshot in snapshots), run, has_coverage=False)


@pytest.mark.parametrize("workers", [1, 2])
def test_an_open_log_is_followed(run: rl.Run, workers: int):
    with rl.open_log(LOG, max_snapshots=MAPS) as reader:
        assert_as_stored(rl.track(reader, workers=workers), run)


def test_a_log_is_followed_by_its_path(tmp_path):
    log = save_run(tmp_path / "maps")
    stored = rl.analyze(log)
    assert_as_stored(rl.track(log), stored)
    assert_as_stored(rl.track(str(log), topic="/map"), stored)


def test_maps_are_taken_as_they_are_asked_for(snapshots):
    """As long as the robot drives, its next map is not there yet."""
    taken = []

    def driving():
        for snapshot in snapshots:
            taken.append(snapshot.index)
            yield snapshot

    steps = rl.track(driving())
    for number in range(MAPS):
        assert next(steps).snapshot.index == number
        assert taken == list(range(number + 1))


def test_parameters_and_method_are_those_of_the_analysis(snapshots):
    (step,) = rl.track(snapshots[-1:], method="voronoi", parameters={"voronoi.room_max_area_m2": 20})
    assert step.analysis.walls is None
    with pytest.raises(ParameterError):
        next(rl.track(snapshots, method="none"))
    with pytest.raises(ParameterError):
        next(rl.track(snapshots, workers=0))
    with pytest.raises(LogError):
        next(rl.track("nowhere.mcap"))


def test_of_no_map_nothing_comes():
    assert list(rl.track([])) == []
