"""Benchmark cases: what is read, and what is said where it cannot be."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.saved_maps import RESOLUTION_M, save_map, two_rooms

from rose2_logs.config.parameters import Parameters
from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.errors import CasesError, OutputError
from rose2_logs.evaluation.benchmark import evaluate_case, figures
from rose2_logs.evaluation.cases import Case, load_cases
from rose2_logs.workflows.evaluation_files import check_files


@pytest.fixture
def cases_file(tmp_path: Path) -> Path:
    Image.fromarray(np.array([[254, 205, 0], [206, 89, 90]], np.uint8)).save(tmp_path / "map.png")
    write_label_image(tmp_path / "rooms.png", np.array([[300, 0, 0], [0, 0, 2]]))
    case = {"group": "g", "name": "n", "map": "map.png", "rooms": "rooms.png", "resolution_m": 0.1}
    path = tmp_path / "cases.json"
    path.write_text(json.dumps({"cases": [case, case | {"group": "h"}]}))
    return path


def test_a_case_is_read_as_a_grid_with_row_0_at_the_bottom(cases_file: Path):
    """White is free, black occupied, 205 unknown; the image's last row becomes the grid's row 0."""
    snapshot = load_cases(cases_file)[0].snapshot()
    assert snapshot.cells.tolist() == [[0, 100, -1], [0, -1, 100]]
    assert snapshot.geometry.resolution_m == 0.1


def test_a_case_may_say_where_it_lies(cases_file: Path):
    """The origin goes into the grid; without one it is (0, 0), and known not to be known."""
    listed = json.loads(cases_file.read_text())["cases"]
    listed[0]["origin_xy_m"] = [-3, 4.5]
    cases_file.write_text(json.dumps({"cases": listed}))
    told, silent = load_cases(cases_file)
    assert told.snapshot().geometry.origin_xy_m == told.origin_xy_m == (-3.0, 4.5)
    assert silent.snapshot().geometry.origin_xy_m == (0.0, 0.0)
    assert silent.origin_xy_m is None
    listed[0]["origin_xy_m"] = [1]
    cases_file.write_text(json.dumps({"cases": listed}))
    with pytest.raises(CasesError, match="case 0"):
        load_cases(cases_file)


def test_truth_keeps_image_orientation_and_16_bit_labels(cases_file: Path):
    """Labels above 255 survive the way through a PNG."""
    assert load_cases(cases_file)[0].truth().tolist() == [[300, 0, 0], [0, 0, 2]]


def test_a_group_is_chosen_and_a_wrong_one_is_answered_with_the_list(cases_file: Path):
    """--group takes its cases only."""
    assert [case.group for case in load_cases(cases_file, "h")] == ["h"]
    with pytest.raises(CasesError, match=r"no group 'x'; there are: g, h"):
        load_cases(cases_file, "x")


@pytest.mark.parametrize(
    ("text", "message"),
    [("{", "JSON"), ("[]", '"cases"'), ('{"cases": [{}]}', "case 0"), ('{"cases": []}', "no cases")],
)
def test_a_bad_list_of_cases_is_one_clear_line(tmp_path: Path, text: str, message: str):
    """The file and what it lacks are named."""
    path = tmp_path / "cases.json"
    path.write_text(text)
    with pytest.raises(CasesError, match=message) as caught:
        load_cases(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_image_that_is_missing_is_named(cases_file: Path):
    """A case whose image is gone fails when it is read, with the path."""
    (cases_file.parent / "map.png").unlink()
    with pytest.raises(CasesError, match=r"map\.png"):
        load_cases(cases_file)[0].snapshot()


@pytest.mark.parametrize("group", ["g", "h"])
def test_two_cases_of_one_name_are_refused_where_their_images_would_be_one(
    cases_file: Path, tmp_path: Path, group: str
):
    listed = json.loads(cases_file.read_text())["cases"]
    cases_file.write_text(json.dumps({"cases": [*listed, listed[0]]}))
    chosen = load_cases(cases_file, group)
    given = {"pictures": None, "json_file": None, "along": False, "overwrite": False}
    check_files(cases_file, chosen, predictions=None, **given)
    if group == "h":
        check_files(cases_file, chosen, predictions=tmp_path / "out", **given)
    else:
        with pytest.raises(OutputError, match="the cases of a group names of their own"):
            check_files(cases_file, chosen, predictions=tmp_path / "out", **given)


@pytest.mark.parametrize(
    ("group", "name"), [("g", "../../x"), ("g", "/x"), ("..", "x"), ("/g", "x"), ("g", "\0"), ("g", "\ud800")]
)
def test_an_image_of_a_case_stays_in_its_folder(cases_file: Path, tmp_path: Path, group: str, name: str):
    case = load_cases(cases_file)[0]
    assert case.image_in(tmp_path) == tmp_path / "g" / "n.png"
    with pytest.raises(CasesError, match="its image would have no place in"):
        dataclasses.replace(case, group=group, name=name).image_in(tmp_path)


def with_other(cases_file: Path, other: object) -> Case:
    """The first case of a file, with a second truth."""
    listed = json.loads(cases_file.read_text())["cases"]
    listed[0]["rooms_other"] = other
    cases_file.write_text(json.dumps({"cases": listed}))
    return load_cases(cases_file)[0]


def test_a_case_may_have_a_second_truth(cases_file: Path):
    """Both are read, the first one first; a case without one has only the first."""
    second = np.array([[0, 7, 0], [0, 0, 0]])
    write_label_image(cases_file.parent / "other.png", second)
    case = with_other(cases_file, "other.png")
    assert list(case.truths()) == ["rooms", "rooms_other"]
    assert case.truth("rooms_other").tolist() == case.truths()["rooms_other"].tolist() == second.tolist()
    assert case.truth().tolist() == [[300, 0, 0], [0, 0, 2]]
    assert list(load_cases(cases_file)[1].truths()) == ["rooms"]
    assert list(with_other(cases_file, None).truths()) == ["rooms"]


@pytest.mark.parametrize(
    ("drawn", "message"),
    [
        (None, r"other\.png: cannot be read as an image"),
        (np.ones((3, 3), int), r"other\.png: of shape \(3, 3\), but .*rooms\.png is \(2, 3\)"),
        (np.ones((2, 3, 3), np.uint8), r"other\.png: the rooms must be a single-channel label image"),
    ],
)
def test_a_bad_second_truth_is_one_clear_line(cases_file: Path, drawn: np.ndarray | None, message: str):
    """A file that is missing, of another size, or in color."""
    if drawn is not None:
        Image.fromarray(drawn.astype(np.uint8)).save(cases_file.parent / "other.png")
    with pytest.raises(CasesError, match=message) as caught:
        evaluate_case(with_other(cases_file, "other.png"), "rose2", Parameters())
    assert "\n" not in str(caught.value)


def test_a_second_truth_that_is_no_path_is_one_clear_line(cases_file: Path):
    """The case is named, and what it may hold."""
    with pytest.raises(CasesError, match=r"case 0 needs .* may have rooms_other") as caught:
        with_other(cases_file, 3)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("found_is", ["rooms", "rooms_other"])
def test_the_truth_that_agrees_better_counts(tmp_path: Path, found_is: str):
    """One drawing has the two rooms, the other says that they are one: the first fits what is found."""
    save_map(tmp_path, "flat", two_rooms())
    free = two_rooms() == 254
    drawings = {"two": np.where(free, 1 + (np.arange(240) >= 117)[None], 0), "one": free.astype(int)}
    for name, labels in drawings.items():
        write_label_image(tmp_path / f"{name}.png", labels)
    other = "rooms_other" if found_is == "rooms" else "rooms"
    paths = {found_is: tmp_path / "two.png", other: tmp_path / "one.png"}
    case = Case("g", "n", tmp_path / "flat.png", paths["rooms"], RESOLUTION_M, None, paths["rooms_other"])
    result = evaluate_case(case, "rose2", Parameters())
    assert (result.truth, result.scores.rooms_gt) == (found_is, 2)
    assert result.scores.iou_sym > 90
    (row,) = figures([result])["maps"]
    assert (row["truth"], row["rooms_gt"]) == (found_is, 2)


def test_label_images_are_8_bit_where_they_can_be(tmp_path: Path):
    """Up to 255 labels make an 8-bit image; more than 65535 are refused and leave no file."""
    write_label_image(tmp_path / "a.png", np.array([[255, 0]]))
    with Image.open(tmp_path / "a.png") as image:
        assert image.mode == "L"
    with pytest.raises(OutputError, match="65536"):
        write_label_image(tmp_path / "b.png", np.array([[65536]]))
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
