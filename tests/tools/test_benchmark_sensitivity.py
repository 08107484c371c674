"""Sensitivity: variants, buildings, and the choice without a building."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from benchmarking.sensitivity import (
    Sensitivity,
    Variant,
    buildings_of,
    left_out,
    make_variants,
    sensitivity_report,
)
from test_benchmark import PROJECT, write_cases

from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import ParameterError
from rose2_logs.evaluation.cases import Case


def case(group: str, name: str) -> Case:
    return Case(group, name, Path("map.png"), Path("rooms.png"), 0.05)


def test_each_number_goes_a_step_down_and_up_within_its_bounds():
    names = [variant.name for variant in make_variants(Parameters(), ["topology.max_rounds", "walls.line_*"])]
    assert names[0] == "defaults"
    assert "topology.max_rounds = 4" in names
    assert "topology.max_rounds = 6" in names
    assert "walls.line_min_weight = 0.08" in names
    assert "walls.line_min_weight = 0.125" in names
    # A share stays below one.
    pure = make_variants(Parameters(), ["topology.split_min_purity"])
    assert [variant.parameters.topology.split_min_purity for variant in pure] == [0.98, 0.784, 1.0]


def test_every_number_of_the_stages_has_its_variants():
    changed = {variant.name.split(" = ")[0] for variant in make_variants(Parameters())[1:]}
    assert "spectrum.structure_length_m" in changed
    assert "floor_plan.join_min_openness" in changed
    assert not any(name.startswith(("tracking", "voronoi", "occupancy")) for name in changed)


def test_a_parameter_that_does_not_exist_is_refused():
    with pytest.raises(ParameterError, match=r"walls\.nothing"):
        make_variants(Parameters(), ["walls.nothing"])


def test_maps_of_one_building_belong_together(tmp_path: Path):
    path = tmp_path / "buildings.toml"
    path.write_text('[[building]]\nname = "house"\nmaps = ["run/*", "*/house*"]\n')
    cases = [case("run", "map01"), case("full", "house_b"), case("full", "barn")]
    assert buildings_of(cases, path) == ("house", "house", "full/barn")
    path.write_text("[[building]]\nmaps = 3\n")
    with pytest.raises(ParameterError, match=r"buildings\.toml"):
        buildings_of(cases, path)


def test_the_choice_for_a_building_does_not_know_it():
    """A variant that is best on one building only is not chosen for it."""
    variants = tuple(Variant(name, Parameters()) for name in ("defaults", "a", "b"))
    cases = tuple(case("g", name) for name in ("one", "two", "two again", "three"))
    figures = np.array([[50.0, 50, 50, 50], [40, 90, 90, 40], [60, 40, 40, 55]])
    measured = Sensitivity(cases, ("one", "two", "two", "three"), variants, figures)
    names, means = measured.building_means()
    assert names == ("one", "two", "three")
    np.testing.assert_allclose(means[1], [40, 90, 40])
    assert left_out(measured) == [
        ("one", 50.0, "a", 40.0),
        ("two", 50.0, "b", 40.0),
        ("three", 50.0, "a", 40.0),
    ]
    assert "| two | 50.0 | b | 40.0 |" in sensitivity_report(measured)


def test_command_writes_a_report(tmp_path: Path):
    """The real command on two tiny maps and one parameter."""
    cases, out = write_cases(tmp_path / "cases"), tmp_path / "out"
    command = [sys.executable, PROJECT / "tools" / "benchmark.py", "sensitivity", "--cases", cases, "-o", out]
    command += ["--parameters", "floor_plan.room_min_area_m2"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, str(out / "report.md")), done.stderr
    assert "floor_plan.room_min_area_m2 = 2.4" in (out / "report.md").read_text()
