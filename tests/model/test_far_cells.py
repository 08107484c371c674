"""Stray specks and rays far from a building are left out, told of, and cost next to nothing."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from reader_logs import START_NS, Map, McapLog
from saved_maps import FREE, WALL, two_rooms
from scipy import ndimage

import rose2_logs as rl
from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.io import open_log
from rose2_logs.model.far_cells import BLOCK_CELLS, find_far_cells
from rose2_logs.model.labels import known_window
from rose2_logs.system.warnings import StrictError, collect_warnings

USUAL = OccupancyParameters()
RESOLUTION_M = 0.05


def house() -> np.ndarray:
    """Two rooms with their walls, 12 x 6 m."""
    image = two_rooms()
    return np.select([image == WALL, image == FREE], [100, 0], -1).astype(np.int8)


def on_canvas(cells: np.ndarray, away_m: float) -> np.ndarray:
    """The map with unknown cells beyond its last row and column."""
    away = round(away_m / RESOLUTION_M)
    return np.pad(cells, ((0, away), (0, away)), constant_values=-1)


def with_speck(cells: np.ndarray, away_m: float, size: int = 1, value: int = 0) -> np.ndarray:
    canvas = on_canvas(cells, away_m)
    canvas[-size:, -size:] = value
    return canvas


def with_rays(cells: np.ndarray, length_m: float) -> np.ndarray:
    """Thin rays that leave the map at its right side and spread."""
    away = round(length_m / RESOLUTION_M)
    canvas = np.pad(cells, ((0, 0), (0, away)), constant_values=-1)
    middle, begin = cells.shape[0] // 2, cells.shape[1] - 2
    along = np.arange(away)
    for slope in np.linspace(-0.02, 0.02, 5):
        canvas[middle + np.round(slope * along).astype(int), begin + along] = 0
    return canvas


@pytest.mark.parametrize(
    ("size", "value"), [(1, 0), (1, 100), (4, 0)], ids=["free cell", "wall cell", "a few cells"]
)
def test_a_far_speck_is_left_out_and_the_rest_stays_whole(size: int, value: int):
    cells = house()
    canvas = with_speck(cells, 100.0, size, value)
    found = find_far_cells(canvas, RESOLUTION_M, USUAL)
    assert found is not None
    assert found.count == size**2
    assert found.farthest_m == pytest.approx(
        np.hypot(*np.subtract(canvas.shape, cells.shape)) * 0.05, rel=0.1
    )
    rows, columns = known_window(cells >= 0)
    assert np.array_equal(canvas[found.window][rows, columns], cells[rows, columns])


def test_rays_through_a_window_are_left_out_beyond_the_margin():
    cells = house()
    canvas = with_rays(cells, 100.0)
    found = find_far_cells(canvas, RESOLUTION_M, USUAL)
    assert found is not None
    assert found.window[1].stop < cells.shape[1] + 12 / RESOLUTION_M
    assert found.window[1].stop >= cells.shape[1] + 5 / RESOLUTION_M


def test_another_room_stays_however_far_it_is():
    canvas = on_canvas(house(), 100.0)
    canvas[-60:, -60:] = 0
    assert find_far_cells(canvas, RESOLUTION_M, USUAL) is None


def test_near_specks_stay():
    assert find_far_cells(with_speck(house(), 2.0), RESOLUTION_M, USUAL) is None


@pytest.mark.parametrize("cells", [np.full((50, 50), -1), np.zeros((0, 0)), np.eye(300) - 1], ids=str)
def test_a_map_without_explored_floor_is_taken_as_it_is(cells: np.ndarray):
    assert find_far_cells(cells.astype(np.int8), RESOLUTION_M, USUAL) is None


def test_what_stays_has_nothing_far_in_it():
    canvas = with_speck(with_rays(house(), 60.0), 40.0)
    found = find_far_cells(canvas, RESOLUTION_M, USUAL)
    assert found is not None
    assert find_far_cells(canvas[found.window], RESOLUTION_M, USUAL) is None


@settings(deadline=None, max_examples=150)
@given(
    arrays(np.bool_, (9, 14), elements=st.booleans()),
    st.sampled_from([0.02, 0.05, 0.1]),
    st.sampled_from([1.0, 1.1, 1.5, 3.0]),
)
def test_what_stays_is_around_the_pieces_that_could_be_a_room(blocks: np.ndarray, side_m: float, gain: float):
    """As labels of all blocks say, also where a few of them settle that nothing is left out."""
    used = OccupancyParameters(far_min_gain=gain, far_margin_m=0.0)
    cells = np.where(np.kron(blocks, np.ones((BLOCK_CELLS, BLOCK_CELLS), bool)), 0, -1).astype(np.int8)
    piece, count = ndimage.label(blocks, np.ones((3, 3)))
    areas_m2 = np.bincount(piece.ravel(), minlength=count + 1)[1:] * (BLOCK_CELLS * side_m) ** 2
    rooms = np.isin(piece, 1 + np.flatnonzero(areas_m2 >= used.far_min_area_m2))
    found = find_far_cells(cells, side_m, used)
    if not rooms.any():
        assert found is None
        return
    # A block more on each side, within the canvas.
    stays = tuple(
        slice(max(along.start - 1, 0) * BLOCK_CELLS, min(along.stop + 1, count) * BLOCK_CELLS)
        for along, count in zip(known_window(rooms), blocks.shape, strict=True)
    )
    spans = [along.stop - along.start for along in known_window(cells >= 0)]
    is_worth = np.prod([along.stop - along.start for along in stays]) * gain <= np.prod(spans)
    is_sparse = np.count_nonzero(cells >= 0) * gain <= np.prod(spans)
    assert (None if found is None else found.window) == (stays if is_worth and is_sparse else None)


def test_they_can_be_kept():
    canvas = with_speck(house(), 30.0)
    assert find_far_cells(canvas, RESOLUTION_M, USUAL) is not None
    assert find_far_cells(canvas, RESOLUTION_M, replace(USUAL, far_cells="keep")) is None


def test_the_rooms_of_an_array_are_those_without_the_speck_and_labels_keep_their_size(caplog):
    cells = house()
    plain = rl.segment(cells, resolution_m=RESOLUTION_M)
    assert not caplog.records
    canvas = with_speck(cells, 60.0)
    found = rl.segment(canvas, resolution_m=RESOLUTION_M)
    assert "1 known cell" in caplog.text
    assert found.labels.shape == canvas.shape
    height, width = cells.shape
    assert np.array_equal(found.labels[:height, :width], plain.labels)
    assert np.count_nonzero(found.labels) == np.count_nonzero(plain.labels)


def log_of(path, maps):
    log = McapLog(path)
    for number, cells in enumerate(maps):
        log.add("/map", START_NS + number * 10**9, Map(cells))
    return log.close()


def test_maps_of_a_log_are_read_without_them_and_it_is_told_once(tmp_path):
    cells = house()
    maps = [np.where(np.arange(cells.shape[1]) < seen, cells, -1) for seen in (60, 90, cells.shape[1])]
    path = log_of(tmp_path / "run.mcap", [with_speck(each, 60.0) for each in maps])
    with collect_warnings() as told, open_log(path) as reader:
        read = list(reader.snapshots())
    assert told.kinds["far_cells"].count == 1
    for snapshot, each in zip(read, maps, strict=True):
        assert snapshot.cells.size < 4 * cells.size + (20 / RESOLUTION_M) ** 2
        assert np.count_nonzero(snapshot.cells >= 0) == np.count_nonzero(each >= 0)
    with (
        pytest.raises(StrictError, match="left out"),
        collect_warnings(strict=True),
        open_log(path) as reader,
    ):
        list(reader.snapshots())


def test_a_far_speck_takes_no_memory_but_that_of_the_message(tmp_path):
    def peak(path) -> int:
        tracemalloc.start()
        with collect_warnings(), open_log(path) as reader:
            for snapshot in reader.snapshots():
                rl.segment(snapshot)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    cells = house()
    plain, canvas = log_of(tmp_path / "plain.mcap", [cells]), with_speck(cells, 150.0)
    rl.segment(cells, resolution_m=RESOLUTION_M)  # what is imported is not counted
    # The message is decompressed, and twice in memory while its chunk is read.
    assert peak(log_of(tmp_path / "far.mcap", [canvas])) < peak(plain) + 3 * canvas.size
