"""Which maps of a log are taken, and what becomes of patches and repeats."""

import dataclasses
import datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reader_logs import START_NS, Map, Update, growing_maps, write_bag, write_mcap, write_rosbag2

from rose2_logs.config.selection import Selection
from rose2_logs.errors import LogError, ParameterError
from rose2_logs.io import open_log
from rose2_logs.io.grids import Grid
from rose2_logs.io.map_stream import known_area_change_m2
from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.system.warnings import collect_warnings

SECOND = 10**9
WRITERS = {
    "bag": lambda path, log: write_bag(path / "run.bag", log),
    "mcap": lambda path, log: write_mcap(path / "run.mcap", log),
    "unchunked": lambda path, log: write_mcap(path / "run.mcap", log, use_chunking=False),
    "db3": lambda path, log: write_rosbag2(path / "run", log),
}
every_writer = pytest.mark.parametrize("write", WRITERS.values(), ids=list(WRITERS))


def read(path, selection=None):
    with open_log(path, selection=selection or Selection()) as log:
        snapshots = list(log.snapshots())
        counts = log.counts
    accounted = len(snapshots) + counts.repeats + counts.skipped + counts.damaged + counts.invalid
    assert counts.messages == accounted, f"{counts} and {len(snapshots)} snapshots"
    return snapshots, counts


def seconds(snapshots):
    return [(each.log_time_ns - START_NS) / SECOND for each in snapshots]


def log_at(times, maps=None):
    maps = maps or growing_maps(len(times))
    return [("/map", START_NS + round(t * SECOND), each) for t, each in zip(times, maps, strict=True)]


@every_writer
@pytest.mark.parametrize(
    ("selection", "expected"),
    [
        (Selection(), [0, 1, 2, 3.5, 7, 8, 20]),
        (Selection(start_ns=START_NS + SECOND), [1, 2, 3.5, 7, 8, 20]),
        (Selection(end_ns=START_NS + 7 * SECOND), [0, 1, 2, 3.5, 7]),
        (Selection(start_ns=START_NS + SECOND + 1, end_ns=START_NS + 8 * SECOND - 1), [2, 3.5, 7]),
        (Selection(every_s=2), [0, 2, 7, 20]),
        (Selection(every_s=0), [0, 1, 2, 3.5, 7, 8, 20]),
        (Selection(every_s=100), [0]),
        (Selection(max_snapshots=1), [20]),
        (Selection(max_snapshots=2), [0, 20]),
        (Selection(max_snapshots=4), [0, 2, 7, 20]),
        (Selection(max_snapshots=50), [0, 1, 2, 3.5, 7, 8, 20]),
        (Selection(start_ns=START_NS + SECOND, every_s=1.5, max_snapshots=3), [1, 7, 20]),
    ],
)
def test_a_selection_takes_the_same_maps_from_every_format(write, selection, expected, tmp_path):
    path = write(tmp_path, log_at([0, 1, 2, 3.5, 7, 8, 20]))
    snapshots, _counts = read(path, selection)
    assert seconds(snapshots) == expected
    assert [each.index for each in snapshots] == list(range(len(expected)))
    with open_log(path, selection=selection) as log:
        assert log.first().log_time_ns == min(
            t for t in (START_NS + round(s * SECOND) for s in (0, 1, 2, 3.5, 7, 8, 20))
            if selection.start_ns is None or t >= selection.start_ns
        )  # fmt: skip


@given(
    times=st.lists(st.integers(0, 10**6), min_size=1, unique=True).map(sorted),
    most=st.integers(1, 40),
    every_s=st.none() | st.floats(0, 1e-3),
)
def test_thinning_keeps_times_that_are_there_with_first_and_last_and_no_more_than_asked(times, most, every_s):
    times = np.array(times)
    thinned = Selection(every_s=every_s).thin(times)
    assert thinned[0] == times[0]
    assert len(thinned) == 1 or np.diff(thinned).min() >= round((every_s or 0) * SECOND)
    chosen = Selection(every_s=every_s, max_snapshots=most).thin(times)
    assert len(chosen) == min(most, len(thinned))
    assert np.isin(chosen, thinned).all()
    assert (np.diff(chosen) > 0).all()
    assert chosen[-1] == thinned[-1]
    assert most == 1 or chosen[0] == thinned[0]


@pytest.mark.parametrize("every_s", [1e10, 1e300])
def test_a_longer_time_between_maps_than_a_log_can_last_takes_the_first_one(every_s):
    times = np.array([5, 2**62, 2**63 - 1])
    assert Selection(every_s=every_s).thin(times).tolist() == [5]
    assert Selection(every_s=every_s).thin(times[:1]).tolist() == [5]


@pytest.mark.parametrize(
    "wrong",
    [
        {"every_s": -1.0},
        {"every_s": float("nan")},
        {"min_change_m2": -0.1},
        {"max_snapshots": 0},
        {"start_ns": 2, "end_ns": 1},
        {"start_ns": "0"},
        {"start_ns": True},
        {"start_ns": 1.5},
        {"start_ns": datetime.datetime(2024, 1, 1)},
        {"start_ns": -1},
        {"end_ns": float("nan")},
        {"end_ns": 2**63},
        {"end_ns": []},
        {"start_s": 1e300},
        {"end_s": 10**400},
        {"every_s": 10**400},
        {"min_change_m2": True},
    ],
)
def test_a_selection_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong)) if len(wrong) == 1 else "time range"):
        Selection(**wrong)


def test_a_time_range_may_reach_beyond_the_last_time_that_there_can_be(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", log_at([0, 1]))
    snapshots, _ = read(path, Selection(start_ns=np.int64(START_NS), end_s=2**63 / 1e9))
    assert len(snapshots) == 2


def test_a_time_range_without_maps_is_an_error_that_tells_when_there_are_some(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", log_at([0, 1]))
    with open_log(path, selection=Selection(end_ns=5)) as log:
        for reading in (lambda: next(log.snapshots()), log.first, log.last):
            with pytest.raises(LogError, match=r"0\.0 to 1\.0 s after the start of the log"):
                reading()


@every_writer
def test_repeats_are_dropped_and_counted_with_the_next_map(write, tmp_path):
    one, two = growing_maps(2)
    again = dataclasses.replace(one, stamp_ns=one.stamp_ns + SECOND)
    snapshots, counts = read(write(tmp_path, log_at(range(6), [one, again, one, two, two, one])))
    assert seconds(snapshots) == [0, 3, 5]
    assert [each.repeats_before for each in snapshots] == [0, 2, 1]
    assert counts.repeats == 3


def test_a_map_that_differs_only_in_its_place_is_no_repeat(tmp_path):
    one = growing_maps(1)[0]
    moved = dataclasses.replace(one, origin=(3.0, 2.0))
    turned = dataclasses.replace(one, yaw=0.1)
    snapshots, _ = read(write_mcap(tmp_path / "run.mcap", log_at(range(3), [one, moved, turned])))
    assert len(snapshots) == 3


@every_writer
def test_grids_without_cells_are_skipped(write, tmp_path):
    one, two = growing_maps(2)
    nothing = Map(np.zeros((0, 0)), resolution=0.0)
    path = write(tmp_path, log_at(range(4), [nothing, one, two, nothing]))
    snapshots, counts = read(path)
    assert seconds(snapshots) == [1, 2]
    assert counts.skipped == 2
    with open_log(path) as log:
        assert seconds([log.first(), log.last()]) == [1, 2]


@every_writer
def test_of_maps_of_one_log_time_the_last_is_the_last(write, tmp_path):
    """As in a log whose times are all zero: the run's coverage is counted against it."""
    maps = growing_maps(3)
    path = write(tmp_path, log_at([1, 1, 1], maps))
    with open_log(path) as log:
        np.testing.assert_array_equal(log.first().cells, maps[0].cells)
        np.testing.assert_array_equal(log.last().cells, maps[-1].cells)


def square(known, shape=(40, 40)):
    cells = np.full(shape, -1, np.int8)
    cells[:known, :20] = 0
    return cells


def test_min_change_takes_a_map_once_enough_became_known_since_the_last_taken_one(tmp_path):
    # 20 cells of 0.05 m a row: each row is 0.05 m2.
    maps = [Map(square(known)) for known in (1, 2, 3, 4, 5, 9, 7, 7)]
    path = write_mcap(tmp_path / "run.mcap", log_at(range(8), maps))
    snapshots, counts = read(path, Selection(min_change_m2=0.1))
    assert seconds(snapshots) == [0, 2, 4, 5, 6]
    assert (counts.skipped, counts.repeats) == (2, 1)


def test_min_change_looks_at_cells_in_the_world_not_in_the_array():
    def grid(cells, **place):
        place = {"resolution_m": 0.05, "origin_xy_m": (0.0, 0.0), "yaw_rad": 0.3, "frame_id": "map"} | place
        return Grid(0, GridGeometry(shape=cells.shape, **place), cells)

    small = grid(square(10))
    grown = np.full((60, 70), -1, np.int8)
    grown[15:55, 25:65] = square(10)
    origin = tuple(small.geometry.grid_to_world(np.array([-25, -15]) * 0.05))
    assert known_area_change_m2(small, grid(grown, origin_xy_m=origin)) == 0
    assert known_area_change_m2(grid(grown, origin_xy_m=origin), small) == 0
    # As an array nothing changed, in the world all 200 cells moved away.
    far = grid(square(10), origin_xy_m=(100.0, 0.0))
    assert known_area_change_m2(small, far) == pytest.approx(400 * 0.05**2)
    # As many cells are known, but half of them elsewhere.
    other = square(5)
    other[20:25, :20] = 0
    assert known_area_change_m2(small, grid(other)) == pytest.approx(200 * 0.05**2)
    assert known_area_change_m2(small, grid(square(10), yaw_rad=0.4)) == float("inf")


def patched_log():
    """A log of grids and patches, and the map that holds after each message."""
    rng = np.random.default_rng(3)
    state, log, states = None, [], []
    for k, kind in enumerate("pgppgppppgp"):
        if kind == "g":
            state = rng.integers(-1, 101, (6, 8)).astype(np.int8)
            message = Map(state, stamp_ns=START_NS + k)
        else:
            row, column = rng.integers(0, 4), rng.integers(0, 5)
            patch = rng.integers(-1, 101, (2, 3)).astype(np.int8)
            message = Update(int(column), int(row), patch, stamp_ns=START_NS + k)
            if state is not None:
                state = state.copy()
                state[row : row + 2, column : column + 3] = patch
        log.append(("/map" if kind == "g" else "/map_updates", START_NS + k * SECOND, message))
        states.append(state)
    return log, states


@every_writer
def test_each_patch_gives_the_map_it_makes_and_older_maps_stay_as_they_were(write, tmp_path):
    log, states = patched_log()
    snapshots, counts = read(write(tmp_path, log))
    assert seconds(snapshots) == list(range(1, 11)), "the patch before any grid makes no map"
    for snapshot, state in zip(snapshots, states[1:], strict=True):
        np.testing.assert_array_equal(snapshot.cells, state)
        assert snapshot.geometry.origin_xy_m == (-1.0, 2.0)
    assert [each.stamp_ns - START_NS for each in snapshots] == list(range(1, 11))
    assert (counts.messages, counts.updates_applied, counts.skipped) == (11, 7, 1)


@every_writer
@pytest.mark.parametrize(
    ("selection", "expected"),
    [
        (Selection(every_s=3), [3, 6, 9]),  # 0 is taken, but makes no map
        (Selection(max_snapshots=3), [5, 10]),
        (Selection(start_ns=START_NS + 3 * SECOND, end_ns=START_NS + 8 * SECOND), [3, 4, 5, 6, 7, 8]),
        (Selection(start_ns=START_NS + 6 * SECOND, every_s=2), [6, 8, 10]),
    ],
)
def test_a_selection_takes_maps_as_all_patches_before_made_them(write, selection, expected, tmp_path):
    log, states = patched_log()
    path = write(tmp_path, log)
    snapshots, _ = read(path, selection)
    assert seconds(snapshots) == expected
    for snapshot, k in zip(snapshots, expected, strict=True):
        np.testing.assert_array_equal(snapshot.cells, states[k])
    with open_log(path, selection=Selection(end_ns=selection.end_ns)) as reader:
        last = 8 if selection.end_ns else 10
        np.testing.assert_array_equal(reader.last().cells, states[last])
        np.testing.assert_array_equal(reader.first().cells, states[1])


def test_a_patch_that_changes_nothing_is_a_repeat(tmp_path):
    cells = growing_maps(1)[0].cells
    log = [
        ("/map", START_NS, Map(cells)),
        ("/map_updates", START_NS + 1, Update(2, 1, cells[1:5, 2:9])),
        ("/map_updates", START_NS + 2, Update(2, 1, np.full((1, 1), 5))),
    ]
    snapshots, counts = read(write_mcap(tmp_path / "run.mcap", log))
    assert (len(snapshots), counts.repeats, counts.updates_applied) == (2, 1, 2)


@pytest.mark.parametrize("place", [(-1, 0), (0, -1), (7, 0), (0, 6)])
def test_a_patch_that_reaches_out_of_the_map_is_left_out_and_told(place, tmp_path):
    log = [
        ("/map", START_NS, Map(np.zeros((6, 8)))),
        ("/map_updates", START_NS + 1, Update(*place, np.zeros((1, 2)))),
    ]
    path = write_bag(tmp_path / "run.bag", log)
    with collect_warnings() as warning_log:
        snapshots, counts = read(path)
    assert (len(snapshots), counts.invalid) == (1, 1)
    assert not snapshots[0].cells.any()
    text = warning_log.kinds["invalid_map"].first[0]["message"]
    assert "message 1 of 1 on /map_updates: the patch of 2 x 1 cells" in text
    assert "extends beyond the map of 8 x 6" in text


def test_patches_of_another_topic_are_not_applied(tmp_path):
    one = growing_maps(1)[0]
    log = [("/map", START_NS, one), ("/costmap_updates", START_NS + 1, Update(0, 0, np.full((2, 2), 9)))]
    snapshots, counts = read(write_mcap(tmp_path / "run.mcap", log))
    assert (len(snapshots), counts.messages) == (1, 1)


@every_writer
def test_reading_twice_gives_the_same_and_stopping_early_is_no_harm(write, tmp_path):
    with open_log(write(tmp_path, log_at(range(5)))) as log:
        first = next(iter(log.snapshots()))
        twice = [[each.cells.tobytes() for each in log.snapshots()] for _ in range(2)]
    assert twice[0] == twice[1]
    assert first.cells.tobytes() == twice[0][0]
    assert len(twice[0]) == 5


@pytest.mark.parametrize("name", ["mcap", "bag", "db3"])
def test_memory_holds_a_few_maps_however_many_the_log_has(name, tmp_path):
    import tracemalloc

    rng = np.random.default_rng(0)
    maps = [Map(rng.integers(-1, 101, (500, 600)).astype(np.int8)) for _ in range(3)]
    path = WRITERS[name](tmp_path, log_at(range(40), [maps[k % 3] for k in range(40)]))
    tracemalloc.start()
    try:
        with open_log(path) as log:
            assert sum(1 for _ in log.snapshots()) == 40
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 12 * maps[0].cells.size
