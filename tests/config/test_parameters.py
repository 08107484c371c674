"""Parameters check themselves, say what is wrong in one line, and are made of what is at hand."""

from __future__ import annotations

import dataclasses
import math
import pickle
from typing import Any

import numpy as np
import pytest
from drawn_maps import office, snapshot

from rose2_logs.config.comparison import ComparisonParameters
from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.config.parameters import (
    OccupancyParameters,
    Parameters,
    SpectrumParameters,
    WallParameters,
    describe_parameters,
    load_parameters,
)
from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.errors import ParameterError
from rose2_logs.segmentation.pipeline import analyze


def test_every_number_has_finite_bounds_that_hold_its_default():
    for row in describe_parameters():
        if "low" in row:
            assert math.isfinite(row["low"]), row
            assert math.isfinite(row["high"]), row
            assert row["low"] <= row["default"] <= row["high"], row


def test_every_parameter_says_its_unit_and_its_reason():
    for row in describe_parameters():
        assert row["unit"], row
        assert row["why"].endswith("."), row


def test_numbers_beyond_their_bounds_are_refused():
    for row in describe_parameters():
        if "low" in row:
            for value in (row["low"] - 1, row["high"] + 1):
                name = f"{row['block']}.{row['name']}"
                with pytest.raises(ParameterError, match=rf"^{name} is .*; it must lie between "):
                    Parameters.from_any({name: type(row["default"])(value)})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: WallParameters(segment_min_length_m=-5.0),
            "walls.segment_min_length_m is -5.0; it must lie between 0.01 and 8.0",
        ),
        (
            lambda: FloorPlanParameters(grouping="dbscann"),
            "floor_plan.grouping is 'dbscann'; it must be one of fitted, walls, dbscan",
        ),
        (
            lambda: WallParameters(extension_m=math.nan),
            "walls.extension_m is nan; it must lie between 0.0 and 100.0",
        ),
        (
            lambda: WallParameters(extension_m=math.inf),
            "walls.extension_m is inf; it must lie between 0.0 and 100.0",
        ),
        (lambda: WallParameters(extension_m="6"), "walls.extension_m must be of type float, not '6'"),
        (lambda: WallParameters(extension_m=True), "walls.extension_m must be of type float, not True"),
        (lambda: TrackingParameters(lost_kept=2.0), "tracking.lost_kept must be of type int, not 2.0"),
        (lambda: FloorPlanParameters(grouping=3), "floor_plan.grouping must be of type str, not 3"),
        (lambda: Parameters(walls=4), "walls must be WallParameters, not 4"),
        (
            lambda: SpectrumParameters(threshold_min=0.9),
            "spectrum.threshold_min is 0.9; it must not be above spectrum.threshold_max, which is 0.85",
        ),
        (
            lambda: OccupancyParameters(free_max_percent=70),
            "occupancy.free_max_percent is 70.0; it must not be above occupancy.occupied_min_percent, "
            "which is 65.0",
        ),
        (
            lambda: TrackingParameters(fit_gate_2_m=0.7),
            "tracking.fit_gate_2_m is 0.7; it must not be above tracking.fit_gate_1_m, which is 0.5",
        ),
        (
            lambda: dataclasses.replace(ComparisonParameters(), turns_max=0),
            "comparison.turns_max is 0; it must",
        ),
    ],
)
def test_a_block_refuses_what_cannot_be_used_when_it_is_built(make, message: str):
    with pytest.raises(ParameterError) as raised:
        make()
    assert str(raised.value).startswith(message)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("value", [6, 6.0, np.float32(6), np.float64(6), np.int16(6)])
def test_any_number_is_taken_for_a_float(value: Any):
    found = WallParameters(extension_m=value).extension_m
    assert type(found) is float
    assert found == 6.0


@pytest.mark.parametrize(
    "value",
    [
        {"walls.extension_m": 6, "floor_plan.grouping": "dbscan"},
        {"walls": {"extension_m": 6}, "floor_plan": {"grouping": "dbscan"}},
        {"walls": {"extension_m": 6.0}, "floor_plan.grouping": "dbscan"},
        Parameters(walls=WallParameters(extension_m=6), floor_plan=FloorPlanParameters(grouping="dbscan")),
    ],
)
def test_parameters_are_made_of_objects_and_of_names(value: Any):
    found = Parameters.from_any(value)
    assert (found.walls.extension_m, found.floor_plan.grouping) == (6.0, "dbscan")
    assert found.tracking == TrackingParameters()


def test_nothing_gives_the_defaults():
    assert Parameters.from_any(None) == Parameters.from_any({}) == Parameters.from_any() == Parameters()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (3, "parameters must be Parameters or a dict of values, not 3"),
        (
            "walls.extension_m=6",
            "parameters must be Parameters or a dict of values, not 'walls.extension_m=6'",
        ),
        ({"walls": 3}, "'walls' must be a table of parameters, not 3"),
        ({"wals.extension_m": 6}, "no parameter block 'wals'; did you mean walls.extension_m?"),
        (
            {"walls.extension": 6},
            "no parameter walls.extension; did you mean walls.extension_m?",
        ),
        (
            {"extension_m": 6},
            "no parameter block 'extension_m'; did you mean walls.extension_m?",
        ),
        ({"parameters": {"walls": {}}}, "no parameter block 'parameters'; did you mean walls?"),
    ],
)
def test_what_names_no_parameter_is_refused_with_the_next_name(value: Any, message: str):
    with pytest.raises(ParameterError) as raised:
        Parameters.from_any(value)
    assert str(raised.value) == message


def test_resolved_parameters_make_the_same_again():
    changed = Parameters.from_any({"walls.extension_m": 6, "comparison.turns_max": 4})
    assert Parameters.from_any(changed.resolved()) == changed
    assert pickle.loads(pickle.dumps(changed)) == changed


def test_the_text_of_parameters_shows_what_differs_from_the_defaults():
    assert repr(Parameters()) == "Parameters()"
    changed = Parameters.from_any({"walls.extension_m": 6})
    assert repr(changed) == "Parameters(walls=WallParameters(extension_m=6.0))"
    assert repr(WallParameters()) == "WallParameters()"


@pytest.mark.parametrize("setting", ["walls", "walls.extension_m=", "=3", "walls.extension_m=1e", "walls=3"])
def test_a_setting_that_is_none_is_refused_without_naming_a_flag(setting: str):
    with pytest.raises(ParameterError) as raised:
        load_parameters(settings=[setting])
    assert "--" not in str(raised.value)


def test_a_file_and_settings_are_read_settings_last(tmp_path):
    path = tmp_path / "config.toml"
    path.write_text("[walls]\nextension_m = 6\nlocal_extension_m = 2\n", encoding="utf-8")
    found = load_parameters(path, ["walls.extension_m=5", "floor_plan.grouping=dbscan"])
    assert (found.walls.extension_m, found.walls.local_extension_m) == (5.0, 2.0)
    assert found.floor_plan.grouping == "dbscan"


def test_a_file_that_is_no_toml_is_refused(tmp_path):
    path = tmp_path / "config.toml"
    path.write_text("[walls", encoding="utf-8")
    with pytest.raises(ParameterError, match="cannot be read as TOML"):
        load_parameters(path)


@pytest.mark.parametrize("grouping", ["fitted", "walls"])
def test_what_is_said_to_have_no_effect_has_none_and_is_told(grouping):
    drawn = snapshot(office(clutter=25)[0])
    defaults = {"floor_plan.grouping": grouping}
    wanted = analyze(drawn, defaults)
    for block in (Parameters().floor_plan, Parameters().topology, Parameters().regions):
        for name, groupings in block.groupings.items():
            if grouping in groupings:
                continue
            declared = next(each for each in dataclasses.fields(block) if each.name == name)
            given = declared.default
            other = given + 1 if isinstance(given, int) else 0.5 * given or 0.2
            changed = Parameters.from_any(defaults | {f"{block.block}.{name}": other})
            (told,) = changed.without_effect()
            assert told.startswith(f"{block.block}.{name} has no effect with floor_plan.grouping={grouping};")
            assert np.array_equal(analyze(drawn, changed).rooms.labels, wanted.rooms.labels)


def test_a_parameter_that_counts_elsewhere_is_named():
    (told,) = Parameters.from_any({"floor_plan.room_min_area_m2": 8}).without_effect()
    assert told.endswith("; regions.room_min_area_m2 has")
    assert not Parameters.from_any({"regions.room_min_area_m2": 8, "walls.extension_m": 6}).without_effect()
