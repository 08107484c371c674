"""``figure``, ``export`` and ``compare`` of one part of a log in which the map was begun anew."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from reader_logs import START_NS, Map, McapLog

import rose2_logs as rl
from rose2_logs.runs.run import Run

SECOND_LEFT_M = 30.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A building, and another one that the robot was carried to."""
    place = tmp_path_factory.mktemp("parts")
    log = McapLog(place / "run.mcap")
    maps = [(columns, left) for left in (0.0, SECOND_LEFT_M) for columns in (60, 110, 170)]
    for k, (columns, left) in enumerate(maps):
        cells = np.full((100, 200), -1, np.int8)
        cells[9:91, 5:columns] = 100
        cells[10:90, 6:columns] = 0
        cells[10:90, 85] = np.where(np.abs(np.arange(10, 90) - 50) < 9, 0, 100) if columns > 85 else -1
        log.add("/map", START_NS + k * 10**9, Map(cells, origin=(left, 0.0)))
    return rl.analyze(log.close(), place / "run", recording=False, annotated_log=False).folder


def test_pictures_plans_and_comparisons_are_of_the_part_that_is_named(cli, folder: Path, tmp_path: Path):
    """The maps of the second part lie 30 m from those of the first."""

    def names(*arguments) -> list[str]:
        code, out, err = cli(*arguments)
        assert (code, err) == (0, "")
        return [Path(line.split()[0]).name for line in out.splitlines() if line]

    assert names("figure", folder, "--part", "1", "-o", tmp_path / "a.svg") == ["a.svg"]
    drawn = Run(folder, part=1).figure().save(tmp_path / "b.svg")
    assert (tmp_path / "a.svg").read_bytes() == drawn.read_bytes()
    plan = ("export", folder, "-f", "geojson", "-o", tmp_path)
    assert names(*plan) == ["run.floor_plan.geojson"]
    assert names(*plan, "--part", "1") == ["run.part1.floor_plan.geojson"]
    assert names(*plan, "--part", "1", "--snapshot", "0") == ["run.part1.snapshot0.floor_plan.geojson"]
    for name, left in (("run", 30), ("run.part1", 0)):
        shapes = json.loads((tmp_path / f"{name}.floor_plan.geojson").read_text("utf-8"))["features"]
        low = min(shapely.from_geojson(json.dumps(each["geometry"])).bounds[0] for each in shapes)
        assert low == pytest.approx(left, abs=0.5)
    assert cli("export", folder, "-f", "geojson", "-o", tmp_path, "--part", "1", "--snapshot", "5")[0] == 2
    assert cli("figure", folder, "--part", "3")[::2] == (2, f"error: {folder}: no part 3; it has 1, 2\n")
    compared = (
        "compare",
        folder,
        folder,
        "-o",
        tmp_path / "same",
        "--no-rrd",
        "--part-a",
        "1",
        "--part-b",
        "2",
    )
    assert cli(*compared)[0] == 0
    found = json.loads((tmp_path / "same" / "comparison.json").read_text("utf-8"))
    assert [(found[each]["part"], found[each]["name"]) for each in "ab"] == [
        (1, "run, part 1"),
        (2, "run, part 2"),
    ]
    assert found["b_in_a"]["x_m"] == pytest.approx(-30, abs=0.5)
    in_python = rl.compare(rl.load(folder, part=1), rl.load(folder, part=2), tmp_path / "again")
    assert in_python.placement.motion.pose[0] == found["b_in_a"]["x_m"]
    again = json.loads((tmp_path / "again" / "comparison.json").read_text("utf-8"))
    assert again == found
