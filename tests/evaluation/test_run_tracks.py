"""True rooms linked over a run, canvases without an origin, and the figures of a whole run."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from drawn_maps import office, snapshot
from drawn_rooms import rows
from moved_maps import motion_about
from PIL import Image

from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.cases import Case, load_cases
from rose2_logs.evaluation.run_tracks import RunTracks, placed, run_tracks_as_json
from rose2_logs.evaluation.scores import score, score_against
from rose2_logs.evaluation.tracks import TruthLinker
from rose2_logs.model.occupancy import GridGeometry

BENCHMARK = Path(__file__).parents[3] / "shared" / "benchmark"


def linked(*maps) -> list[list[int]]:
    """Numbers of the true rooms 1, 2, ... of each map; a map is labels or (labels, origin)."""
    linker = TruthLinker()
    numbers = []
    for map_ in maps:
        labels, origin = map_ if isinstance(map_, tuple) else (map_, (0.0, 0.0))
        found = linker.update(labels, GridGeometry(1.0, origin, 0.0, "map", labels.shape), None)
        numbers.append(found[1:].tolist())
    return numbers


def test_true_rooms_keep_their_number_while_they_grow():
    """Labels change, the canvas moves, a room grows from a tenth: the same rooms."""
    first, second = rows("1222......"), rows("2222211111")
    assert linked(first, second) == [[1, 2], [3, 2]]
    assert linked(rows("1122"), (rows("...2211"), (-3.0, 0.0))) == [[1, 2], [2, 1]]


def test_a_true_room_that_is_not_annotated_for_a_while_comes_back():
    """Also when another one covers its place meanwhile."""
    assert linked(rows("111122"), rows("111111"), rows("222211")) == [[1, 2], [1], [2, 1]]


def test_a_label_that_does_not_occur_has_no_number():
    """A gap among the labels is no room."""
    assert linked(rows("1133")) == [[1, 0, 2]]


def test_true_rooms_move_with_the_map():
    """Rooms a meter wide are told apart after a shift by a meter when the motion is known."""
    labels = rows("1234", "1234")
    linker = TruthLinker()
    before = snapshot(np.zeros((2, 4)), 1.0)
    motion = motion_about(before, (1.0, 0.0), 0.0)
    linker.update(labels, before.geometry, None)
    after = GridGeometry(1.0, (1.0, 0.0), 0.0, "map", labels.shape)
    assert linker.update(labels, after, motion).tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("pad", [(0, 40), (17, 0), (8, 30)])
def test_a_canvas_that_grew_is_laid_over_the_one_before(pad: tuple[int, int]):
    """To the cell, on whatever side it grew."""
    cells, _ = office()
    one = snapshot(cells, origin_xy_m=(3.0, -2.0))
    wider = np.pad(cells, ((pad[0], 5), (pad[1], 0)), constant_values=-1)
    found = placed(snapshot(wider), one, OccupancyParameters())
    expected = (3.0 - 0.05 * pad[1], -2.0 - 0.05 * pad[0])
    assert found.geometry.origin_xy_m == pytest.approx(expected)
    cut = placed(one, found, OccupancyParameters())
    assert cut.geometry.origin_xy_m == pytest.approx((3.0, -2.0))


def case_result(folder: Path, name: str, cells, truth, labels, other=None) -> CaseResult:
    """A case as images in a folder, maybe with a second truth, and rooms found in it."""
    gray = np.select([cells == 0, cells == 100], [254, 0], 205).astype(np.uint8)
    Image.fromarray(np.flipud(gray)).save(folder / f"{name}.png")
    write_label_image(folder / f"{name}.rooms.png", np.flipud(truth))
    case = Case("run", name, folder / f"{name}.png", folder / f"{name}.rooms.png", 0.05)
    if other is not None:
        write_label_image(folder / f"{name}.other.png", np.flipud(other))
        case = dataclasses.replace(case, rooms_other_path=folder / f"{name}.other.png")
    found = np.flipud(labels).astype(np.int32)
    name, scores = score_against(case.truths(), found)
    return CaseResult(case, found, scores, 1.0, 0.0, name)


def test_a_run_is_scored_over_growing_canvases_without_origins(tmp_path: Path):
    """One of three rooms is missed in one map of three, and found again under its number."""
    cells, rooms = office()
    missed = np.where(rooms == 2, 0, rooms)
    tracks = RunTracks(Parameters())
    for number, found in enumerate((rooms, missed, rooms)):
        pad = ((0, 0), (30 * number, 0))
        grown = np.pad(cells, pad, constant_values=-1), np.pad(rooms, pad), np.pad(found, pad)
        tracks.add(case_result(tmp_path, f"m{number}", *grown))
    scores = tracks.scores()["run"]
    assert scores.true_rooms.idf1 == 100
    assert scores.found.idf1 == scores.found.idf1_bound == pytest.approx(100 * 2 * 8 / (9 + 8))
    assert (scores.found.id_switches, scores.found.fragmentations) == (0, 1)
    assert (scores.found.tracks, scores.found.true_tracks) == (3, 3)
    assert scores.back_projected.idf1 == 100  # the last map has the missed room
    assert scores.back_projected_iou_sym == pytest.approx(100)
    assert run_tracks_as_json({"run": scores})["run"]["found"]["idf1"] == scores.found.idf1


@pytest.mark.parametrize("are_three", [True, False])
def test_one_drawing_of_the_rooms_counts_for_the_tracks_of_a_whole_run(tmp_path: Path, are_three: bool):
    """The three rooms may be one, on all maps but the first: what was found decides once, not map by map."""
    cells, three = office()
    one = np.minimum(three, 1)
    tracks = RunTracks(Parameters())
    often, once = (three, one) if are_three else (one, three)
    for number in range(5):
        other = None if number == 0 else one
        tracks.add(case_result(tmp_path, f"m{number}", cells, three, once if number == 2 else often, other))
    scores = tracks.scores()["run"]
    assert scores.truth == run_tracks_as_json({"run": scores})["run"]["truth"]
    if are_three:
        assert scores.truth == "rooms"
        assert scores.found.idf1 == pytest.approx(100 * 2 * 12 / (15 + 13))
        assert scores.back_projected_iou_sym == pytest.approx(100)
    else:
        # The first map is drawn in one way only: a third of the one room that is found there, three times.
        assert scores.truth == "rooms_other"
        assert scores.found.idf1_bound == pytest.approx(100 * 2 * 3 / (7 + 7))
        assert scores.back_projected_iou_sym == pytest.approx(100 * (1 / 3 + 4) / 5, abs=0.5)
    assert scores.found.true_tracks == 3


@pytest.mark.skipif(not BENCHMARK.exists(), reason="the benchmark is not beside the project")
@pytest.mark.parametrize("group", ["incremental_fr79", "incremental_intel"])
def test_true_rooms_of_a_real_run_keep_their_tracks(group: str):
    """Where the segmentation is right, identity is right: canvases grow, maps jump, annotations flicker."""
    tracks = RunTracks(Parameters())
    for case in load_cases(BENCHMARK / "cases.json", group):
        truth = case.truth().astype(np.int32)
        tracks.add(CaseResult(case, truth, score(truth, truth), 1.0, 0.0))
    scores = tracks.scores()[group].true_rooms
    assert scores.idf1 >= 97
    assert scores.id_switches == 0
