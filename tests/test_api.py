"""The functions for scripts and notebooks: what they take, and what they say of what they do not take."""

from __future__ import annotations

import copy
import gc
import json
import pickle
import shutil
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from drawn_maps import office, snapshot
from finished_runs import SAMPLE_LOGS
from PIL import Image
from saved_maps import WALL, save_map, save_run, two_rooms

import rose2_logs as rl
from rose2_logs.errors import (
    CasesError,
    InvalidMapError,
    LogError,
    NoMapTopicError,
    ParameterError,
    ResultsError,
    Rose2LogsError,
)


@pytest.fixture(scope="module")
def cells() -> np.ndarray:
    return office()[0]


def test_an_array_a_map_and_a_file_are_segmented_alike(tmp_path: Path):
    """Whatever is given, the rooms are the same; a picture has its first row at the top."""
    image = two_rooms()
    path = save_map(tmp_path, "map", image)
    stored = rl.read_map(path)
    by_path, by_map = rl.segment(path), rl.segment(stored)
    by_text = rl.segment(str(path))
    by_array = rl.segment(stored.cells, resolution_m=0.05)
    by_list = rl.segment(stored.cells.tolist(), resolution_m=0.05)
    by_picture = rl.segment(path.with_suffix(".png"))
    for found in (by_map, by_text, by_array, by_list, by_picture):
        assert np.array_equal(found.labels, by_path.labels)
    assert len(by_path.rooms) == 2
    assert by_path.rooms.geometry.origin_xy_m == (1.0, 2.0)
    assert by_array.rooms.geometry.origin_xy_m == (0.0, 0.0)
    assert (image[::-1][by_path.labels > 0] != WALL).all()


@pytest.mark.parametrize("dtype", [np.int8, np.int16, np.int64])
def test_arrays_of_any_integers_are_taken_if_they_hold_occupancy(cells: np.ndarray, dtype: type):
    found = rl.segment(cells.astype(dtype), resolution_m=0.05)
    assert np.array_equal(found.labels, rl.segment(snapshot(cells)).labels)


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((3, 3, 3), np.int8),
        np.zeros(9, np.int8),
        np.full((3, 3), 101),
        np.full((3, 3), -2),
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
        [["wall"]],
        [[1, 2], [3]],
    ],
    ids=["3-D", "1-D", "over 100", "below -1", "float", "NaN", "text", "ragged"],
)
def test_what_is_no_occupancy_is_refused_in_a_line(wrong: object):
    with pytest.raises(Rose2LogsError) as error:
        rl.segment(wrong, resolution_m=0.05)
    assert isinstance(error.value, InvalidMapError | ParameterError)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("resolution_m", [0, -0.05, float("nan"), float("inf")])
def test_a_resolution_that_is_none_is_refused(cells: np.ndarray, resolution_m: float):
    with pytest.raises(Rose2LogsError, match="resolution"):
        rl.segment(cells, resolution_m=resolution_m)


def test_a_resolution_is_any_number(cells: np.ndarray, tmp_path: Path):
    """As a map and as an image; one that no float can hold is refused."""
    image = save_map(tmp_path, "map", two_rooms())
    image.unlink()
    picture = image.with_suffix(".png")
    for resolution_m in (Fraction(1, 20), np.float64(0.05)):
        assert rl.segment(cells, resolution_m=resolution_m).rooms.geometry.resolution_m == 0.05
        assert rl.read_map(picture, resolution_m).geometry.resolution_m == 0.05
    for call in (rl.segment, rl.read_map):
        with pytest.raises(Rose2LogsError, match="resolution"):
            call(picture, resolution_m=10**400)
    with pytest.raises(Rose2LogsError, match="resolution"):
        rl.segment(cells, resolution_m=10**400)


def test_an_array_needs_its_resolution(cells: np.ndarray):
    with pytest.raises(ParameterError, match="give resolution_m in meters"):
        rl.segment(cells)


def test_methods_and_parameters_are_chosen_by_name(cells: np.ndarray):
    """Parameters whole, or a mapping of dotted names."""
    few = {"regions.room_min_area_m2": 12.0}
    found = [
        rl.segment(cells, resolution_m=0.05, parameters=given)
        for given in (few, rl.Parameters().replaced({"regions": {"room_min_area_m2": 12.0}}))
    ]
    assert np.array_equal(found[0].labels, found[1].labels)
    assert rl.segment(cells, resolution_m=0.05, method="voronoi").walls is None
    with pytest.raises(ParameterError, match="rose2, morphological, distance, voronoi"):
        rl.segment(cells, resolution_m=0.05, method="best")
    with pytest.raises(ParameterError, match=r"no parameter floor_plan\.of_old"):
        rl.segment(cells, resolution_m=0.05, parameters={"floor_plan.of_old": 1})


def test_what_was_found_in_a_map_is_drawn(cells: np.ndarray, tmp_path: Path):
    """In a notebook, into a file; its rooms are those of the label image."""
    found = rl.segment(cells, resolution_m=0.05)
    plan = found.plan()
    assert {room.number for room in plan.rooms} == set(np.unique(found.labels)) - {0}
    assert found._repr_svg_() == found.figure()._repr_svg_()
    assert found.figure().save(tmp_path / "rooms.png").stat().st_size > 1000
    assert len(repr(found)) < 200


def test_a_log_is_opened_with_a_selection(tmp_path: Path):
    log = save_run(tmp_path / "maps")
    with rl.open_log(log, max_snapshots=2) as reader:
        assert len(list(reader.snapshots())) == 2
    maps = sorted(log.glob("*.yaml"))
    with rl.open_log([str(each) for each in maps]) as reader:
        assert len(list(reader.snapshots())) == 3
    with pytest.raises(NoMapTopicError):
        rl.open_log(log, topic="/nothing")
    with pytest.raises(LogError):
        rl.open_log(tmp_path / "nowhere")


def test_an_option_that_there_is_not_is_named(tmp_path: Path):
    """As one keyword among the others, and with what was meant."""
    for call in (
        lambda: rl.analyze(tmp_path, worker=2),
        lambda: rl.analyze(tmp_path, workers=0),
        lambda: rl.analyze(tmp_path, method="best"),
        lambda: rl.open_log(tmp_path, max_snapshot=2),
    ):
        with pytest.raises((ParameterError, TypeError)) as error:
            call()
        assert "--" not in str(error.value)
    with pytest.raises(ParameterError, match="workers"):
        rl.analyze(tmp_path, worker=2)


def test_maps_with_known_rooms_are_evaluated(tmp_path: Path):
    """One map whose rooms are found: figures of the map and means of its group."""
    path = save_map(tmp_path, "map", two_rooms())
    Image.fromarray(np.flipud(rl.segment(path).labels).astype(np.uint8)).save(tmp_path / "rooms.png")
    case = {"name": "one", "group": "drawn", "map": "map.png", "rooms": "rooms.png", "resolution_m": 0.05}
    (tmp_path / "cases.json").write_text(json.dumps({"cases": [case]}))
    found = rl.evaluate(tmp_path / "cases.json")
    assert repr(found) == "Evaluation(method='rose2', 1 map, 1 group)"
    assert repr(found.maps[0]) == "CaseResult('drawn/one', 2 rooms, iou_sym=100.0)"
    assert [each.case.name for each in found.maps] == ["one"]
    assert found.groups["drawn"].iou_sym == pytest.approx(100)
    assert found.method == "rose2"
    with pytest.raises(CasesError):
        rl.evaluate(tmp_path / "none.json")


def test_a_run_in_a_temporary_folder_is_copied_but_not_sent_away():
    run = rl.analyze(SAMPLE_LOGS / "office.mcap", max_snapshots=2)
    rooms = run.rooms.arrow
    copies = copy.copy(run), copy.deepcopy(run)
    with pytest.raises(ResultsError, match=r"to hand it to another process, analyze with out=\.\.\."):
        pickle.dumps(run)
    folder = Path(run.folder)
    del run
    gc.collect()
    assert all(each.rooms.arrow.equals(rooms) for each in copies)
    del copies
    gc.collect()
    assert not folder.exists()


def test_a_parameter_without_effect_is_told_wherever_maps_are_segmented(cells, caplog, tmp_path):
    vain = {"floor_plan.known_power": 1.0}
    with rl.open_log(SAMPLE_LOGS / "office.mcap", max_snapshots=2) as reader:
        maps = list(reader.snapshots())
    calls = {
        "segment": lambda: rl.segment(cells, resolution_m=0.05, parameters=vain),
        "track": lambda: list(rl.track(maps, parameters=vain)),
        "analyze": lambda: rl.analyze(SAMPLE_LOGS / "office.mcap", max_snapshots=1, parameters=vain),
    }
    for name, call in calls.items():
        caplog.clear()
        call()
        told = [
            each.message for each in caplog.records if "floor_plan.known_power has no effect" in each.message
        ]
        assert len(told) == 1, name


def test_paths_begin_in_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What is read and what is written; nothing is made in a folder named as the sign for it."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    (tmp_path / "work").mkdir()
    shutil.copy(SAMPLE_LOGS / "office.mcap", tmp_path / "office.mcap")
    (tmp_path / "names.csv").write_text("name,track\nHall,1\n")
    monkeypatch.chdir(tmp_path / "work")
    about = {"names": "~/names.csv", "max_snapshots": 1, "recording": False, "annotated_log": False}
    run = rl.analyze("~/office.mcap", "~/runs/office", **about)
    assert Path(run.folder) == tmp_path / "runs" / "office"
    assert run.figure().save("~/plan.svg") == tmp_path / "plan.svg"
    for again in (rl.load("~/runs/office"), rl.Run("~/runs/office")):
        again.rename("~/names.csv")
        assert len(again) == 1
    with rl.open_log(["~/office.mcap"]) as reader:
        assert reader.first().index == 0
    assert not list((tmp_path / "work").iterdir())
