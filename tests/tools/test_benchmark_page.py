"""Tables of the accuracy page: ranges over buildings, methods from a list, rooms that others have found."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from test_benchmark import PROJECT, write_cases

from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.errors import CasesError, ParameterError


def test_the_range_is_over_buildings_and_not_over_maps():
    """Many maps of one building make the mean no surer; one building has no range at all."""
    from benchmarking.bootstrap import bootstrap_interval

    one_each = bootstrap_interval(["a", "b", "c", "d"], np.array([50.0, 60, 70, 80]))
    copies = bootstrap_interval(["a", "b", "c", "d"] * 20, np.array([50.0, 60, 70, 80] * 20))
    assert copies == pytest.approx(one_each)
    as_buildings = [f"{building}{k}" for k in range(20) for building in "abcd"]
    low, high = bootstrap_interval(as_buildings, np.array([50.0, 60, 70, 80] * 20))
    assert one_each[0] + 3 < low < 65 < high < one_each[1] - 3
    assert bootstrap_interval(["a", "a"], np.array([50.0, 60])) == (55, 55)


def test_groups_count_the_same_however_many_maps_they_have():
    """The mean of groups 0 and 100 is about 50, with nine maps to one; the mean over maps is about 10."""
    from benchmarking.bootstrap import bootstrap_interval

    buildings, groups = [str(k) for k in range(40)], ["many"] * 36 + ["few"] * 4
    scores = np.array([0.0] * 36 + [100.0] * 4)
    assert bootstrap_interval(buildings, scores, groups) == pytest.approx((50, 50))
    low, high = bootstrap_interval(buildings, scores)
    assert 0 <= low < 10 < high < 25


def test_the_list_beside_the_tool_can_be_used():
    """The method's own rooms first; each name once."""
    from benchmarking.page import load_methods

    methods = load_methods()
    assert methods[0].name.startswith("rose2")
    assert {"rose2", "morphological", "distance", "voronoi"} == {each.method for each in methods}
    assert len({str(each.parameters) + each.method for each in methods}) == len(methods)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "method"),
        ("[[method]]", "name"),
        ('[[method]]\nname = "a"\nmethod = "magic"', "'a' is of no method"),
        ('[[method]]\nname = "a"\n[[method]]\nname = "a"', "no two of one name"),
        ('[[method]]\nname = "a"\nset = ["walls.nothing = 1"]', "nothing"),
    ],
)
def test_a_bad_list_of_methods_is_one_line(tmp_path: Path, text: str, message: str):
    from benchmarking.page import load_methods

    path = tmp_path / "methods.toml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=message) as caught:
        load_methods(path)
    assert "\n" not in str(caught.value)


@pytest.fixture
def found(tmp_path: Path) -> Path:
    """A list of one method, rooms that something else has found, in which nothing is right, and two cases."""
    cases = write_cases(tmp_path / "cases", "drawn")
    for name in ("half", "whole"):
        with Image.open(tmp_path / "cases" / f"{name}.rooms.png") as image:
            labels = np.zeros(np.asarray(image).shape, int)
        labels[0, 0] = 1
        write_label_image(tmp_path / "elsewhere" / "drawn" / f"{name}.png", labels)
    (tmp_path / "methods.toml").write_text(
        '[[method]]\nname = "ours"\n[[method]]\nname = "theirs"\npredictions = "elsewhere"\n'
    )
    return cases


def test_the_command_writes_the_tables(found: Path, tmp_path: Path):
    """The real command on two tiny maps of two buildings: every table, and the same as numbers."""
    command = [sys.executable, PROJECT / "tools" / "benchmark.py", "tables", "--cases", found]
    command += ["--methods", tmp_path / "methods.toml", "--sample", "1", "-o", tmp_path / "out"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, str(tmp_path / "out" / "tables.md")), done.stderr
    text = (tmp_path / "out" / "tables.md").read_text()
    numbers = json.loads((tmp_path / "out" / "tables.json").read_text())
    ours, theirs = numbers["methods"]
    assert [row["building"] for row in ours["maps"]] == ["drawn/half", "drawn/whole"]
    assert all(row["iou_sym"] > 90 and row["truth"] == "rooms" for row in ours["maps"])
    assert [row["iou_sym"] for row in theirs["maps"]] == [0, 0]
    assert (len(ours["robustness"]), theirs["robustness"]) == (1, [])
    assert "| method | drawn (2) | mean of groups | mean of buildings |" in text
    assert "| theirs | 0.0 (0.0 to 0.0) | 0.0 (0.0 to 0.0) | 0.0 (0.0 to 0.0) |" in text
    assert f"| drawn/half | 1 | {ours['maps'][0]['iou_sym']:.1f} | 0.0 |" in text
    assert "### ours" in text
    assert "### theirs" not in text


@pytest.mark.parametrize("is_there", [True, False])
def test_rooms_of_others_that_cannot_be_used_are_named(found: Path, tmp_path: Path, is_there: bool):
    """A label image that is missing, or of another size than the map's."""
    from benchmarking.page import load_methods, measure_page

    path = tmp_path / "elsewhere" / "drawn" / "whole.png"
    path.unlink()
    if is_there:
        write_label_image(path, np.ones((3, 4), int))
    theirs = load_methods(tmp_path / "methods.toml")[1:]
    with pytest.raises(CasesError, match=r"elsewhere.drawn.whole\.png"):
        measure_page([found], theirs, sample=0)
