"""What the numbers of arrays mean is decided by the rule of logs, and told; explicit thresholds win."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from drawn_maps import office

import rose2_logs as rl

RESOLUTION_M = 0.05
CELLS = office()[0]
ROOMS = rl.segment(CELLS, resolution_m=RESOLUTION_M).labels
OF_KIND = {
    "probabilities": np.select(
        [CELLS == 0, CELLS == 100], [np.where(np.eye(*CELLS.shape) > 0, 12, 30), 80], -1
    ),
    "0 and 1": np.select([CELLS == 0, CELLS == 100], [0, 1], -1),
    "costs": np.select([CELLS == 0, CELLS == 100], [0, 254], 255),
    "50": np.select([CELLS == 0, CELLS == 100], [0, 100], 50),
}


def snapshot(cells: np.ndarray, index: int = 0) -> rl.OccupancySnapshot:
    geometry = rl.GridGeometry(RESOLUTION_M, (0.0, 0.0), 0.0, "map", cells.shape)
    return rl.OccupancySnapshot(index, index * 10**9, 0, "/own", cells, geometry)


@pytest.mark.parametrize("kind", OF_KIND)
def test_an_array_of_any_kind_has_the_rooms_of_its_percent_and_it_is_told(kind: str, caplog):
    assert np.array_equal(rl.segment(OF_KIND[kind], resolution_m=RESOLUTION_M).labels, ROOMS)
    assert "occupancy.values=stored reads them as they are" in caplog.text


def test_usual_percent_are_taken_silently(caplog):
    rl.segment(CELLS, resolution_m=RESOLUTION_M)
    rl.segment(np.ma.masked_equal(CELLS, -1), resolution_m=RESOLUTION_M)
    assert not caplog.records


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_a_matrix_is_an_array():
    assert np.array_equal(rl.segment(np.matrix(CELLS), resolution_m=RESOLUTION_M).labels, ROOMS)


@pytest.mark.parametrize(
    "parameters", [{"occupancy.values": "stored"}, {"occupancy.occupied_min_percent": 65}]
)
def test_explicit_thresholds_win(parameters, caplog):
    cells = OF_KIND["0 and 1"]
    found = rl.segment(cells, resolution_m=RESOLUTION_M, parameters=parameters)
    assert len(found.rooms) == 1
    assert "are read" not in caplog.text


def test_a_named_kind_is_taken_without_a_word(caplog):
    parameters = {"occupancy.values": "zero_one"}
    found = rl.segment(OF_KIND["0 and 1"], resolution_m=RESOLUTION_M, parameters=parameters)
    assert np.array_equal(found.labels, ROOMS)
    assert not caplog.records


def test_the_grays_of_an_image_are_no_costs():
    grays = np.select([CELLS == 0, CELLS == 100], [254, 0], 205)
    with pytest.raises(rl.InvalidMapError, match="of an image of grays, save it"):
        rl.segment(grays, resolution_m=RESOLUTION_M)


@pytest.mark.parametrize("as_given", [list, iter], ids=["list", "iterator"])
@pytest.mark.parametrize("kind", ["probabilities", "0 and 1", "50"])
def test_all_maps_that_are_tracked_are_read_alike(kind: str, as_given, caplog):
    caplog.set_level(logging.WARNING)
    columns = CELLS.shape[1]
    unknown = 50 if kind == "50" else -1
    maps = [
        snapshot(np.where(np.arange(columns) < seen, OF_KIND[kind], unknown), number)
        for number, seen in enumerate((columns // 2, columns))
    ]
    steps = list(rl.track(as_given(maps)))
    assert np.array_equal(steps[-1].analysis.labels, ROOMS)
    assert caplog.text.count("occupancy.values=stored") == 1


def test_a_snapshot_of_a_reader_is_percent_already(caplog):
    with rl.open_log("sample_logs/office.mcap") as reader:
        last = reader.last()
    assert last.is_percent
    assert not caplog.records
