"""What the numbers of arrays mean is decided by the rule of logs, and told; explicit thresholds win."""

from __future__ import annotations

import dataclasses
import logging
from pathlib import Path

import numpy as np
import pytest
from drawn_maps import office
from reader_logs import START_NS, Map, McapLog

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


def test_unsigned_bytes_of_a_message_are_its_cells(caplog):
    """255 is -1 then, without a word: there is nothing between it and percent."""
    for cells in (CELLS.view(np.uint8), CELLS.view(np.uint8).astype(np.int64)):
        assert np.array_equal(rl.segment(cells, resolution_m=RESOLUTION_M).labels, ROOMS)
    assert not caplog.records


def test_an_image_of_two_grays_is_no_map_in_percent():
    with pytest.raises(rl.InvalidMapError, match="of an image of grays, save it"):
        rl.segment(np.where(CELLS == 0, 255, 0), resolution_m=RESOLUTION_M)


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


@pytest.fixture(scope="module")
def faint_log(tmp_path_factory) -> Path:
    """A map of probabilities, most of whose free cells are above the usual threshold."""
    log = McapLog(tmp_path_factory.mktemp("faint") / "faint.mcap")
    log.add("/map", START_NS, Map(OF_KIND["probabilities"].astype(np.int8)))
    return log.close()


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"occupancy.values": "stored"}, "occupancy.values='stored'"),
        ({"occupancy.free_max_percent": 40}, "occupancy.free_max_percent=40.0"),
        ({"reading.map_max_cells": 1000}, "reading.map_max_cells=1000"),
        ({"mapping.resolution_m": 0.1}, "mapping.resolution_m=0.1"),
    ],
)
def test_an_open_log_is_not_read_again_by_other_parameters(faint_log: Path, parameters, named: str):
    with rl.open_log(faint_log) as reader, pytest.raises(rl.ParameterError) as error:
        rl.track(reader, parameters=parameters)
    assert str(error.value).startswith(f"{named}: {faint_log} is open already")
    assert "give this parameter to open_log" in str(error.value)


@pytest.mark.parametrize("parameters", [{"occupancy.values": "stored"}, {"occupancy.free_max_percent": 40}])
def test_maps_of_a_reader_are_not_read_again_by_other_parameters(faint_log: Path, parameters):
    """Whether alone, as a list or one after the other."""
    with rl.open_log(faint_log) as reader:
        maps = list(reader.snapshots())
    for call in (
        lambda: rl.segment(maps[0], parameters=parameters),
        lambda: rl.track(maps, parameters=parameters),
        lambda: list(rl.track(iter(maps), parameters=parameters)),
        lambda: list(rl.track([snapshot(CELLS), *maps], parameters=parameters)),
    ):
        with pytest.raises(rl.ParameterError, match="was read already, by"):
            call()


def test_what_a_log_was_opened_with_counts_where_its_maps_are_analyzed(faint_log: Path):
    """Given once or twice, it is as if the path were given."""
    for parameters in ({"occupancy.free_max_percent": 40}, {"occupancy.values": "stored"}):
        by_path = [each.analysis.labels for each in rl.track(faint_log, parameters=parameters)]
        with rl.open_log(faint_log, parameters=parameters) as reader:
            maps = list(reader.snapshots())
            found = {
                "reader": rl.track(reader),
                "reader, again": rl.track(reader, parameters=parameters),
                "list": rl.track(maps),
                "iterator": rl.track(iter(maps)),
                "snapshot": [rl.segment(maps[-1])],
            }
            for name, steps in found.items():
                *_, last = steps
                labels = getattr(last, "analysis", last).labels
                assert np.array_equal(labels, by_path[-1]), (name, parameters)
        assert bool(by_path[-1].any()) == ("occupancy.values" not in parameters)


def test_parameters_of_the_analysis_are_given_where_it_is_made(faint_log: Path):
    coarse = {"occupancy.working_resolution_m": 0.1}
    with rl.open_log(faint_log) as reader:
        (step,) = rl.track(reader, parameters=coarse)
        found = rl.segment(reader.last(), parameters=coarse)
    assert step.analysis.resolution_m == found.resolution_m == 0.1


def test_thresholds_apply_to_own_maps_in_percent_and_other_numbers_do_not():
    own = dataclasses.replace(snapshot(OF_KIND["probabilities"]), is_percent=True)
    assert not rl.segment(own).labels.any()
    assert np.array_equal(rl.segment(own, parameters={"occupancy.free_max_percent": 40}).labels, ROOMS)
    for call in (rl.segment, lambda given, **about: list(rl.track([given], **about))):
        with pytest.raises(rl.ParameterError, match="says that its cells are percent"):
            call(own, parameters={"occupancy.values": "zero_one"})


def test_parameters_of_reading_are_told_to_have_no_effect_without_a_log(caplog):
    vain = {"mapping.resolution_m": 0.1}
    for call in (
        lambda: rl.segment(CELLS, resolution_m=RESOLUTION_M, parameters=vain),
        lambda: rl.segment(snapshot(CELLS), parameters=vain),
        lambda: list(rl.track([snapshot(CELLS)], parameters=vain)),
    ):
        caplog.clear()
        call()
        assert caplog.text.count("mapping.resolution_m has no effect here") == 1


@pytest.mark.parametrize("resolution_m", [0.1, -1])
def test_a_snapshot_has_its_resolution(resolution_m: float):
    with pytest.raises(rl.ParameterError, match=f"leave out resolution_m={resolution_m}"):
        rl.segment(snapshot(CELLS), resolution_m=resolution_m)


def test_the_topic_is_chosen_where_the_log_is_opened():
    with (
        rl.open_log("sample_logs/office.mcap") as reader,
        pytest.raises(rl.ParameterError, match=r"topic='/nosuch': .* give it to open_log"),
    ):
        rl.track(reader, topic="/nosuch")
    with pytest.raises(rl.ParameterError, match="topic='/nosuch'"):
        rl.track([snapshot(CELLS)], topic="/nosuch")
