"""Parameters that were set in vain are told, and those that are told have no effect."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from saved_maps import save_map, save_run, two_rooms

import rose2_logs as rl
from rose2_logs.config.baselines import METHODS
from rose2_logs.config.parameters import Parameters, describe_parameters
from rose2_logs.errors import ParameterError
from rose2_logs.workflows.without_effect import (
    COMPARING,
    OF_EVERY_METHOD,
    OF_METHOD,
    WHERE,
    tell_without_effect,
)

BLOCKS = {each.name for each in dataclasses.fields(Parameters)}


def changed(row: dict[str, object]) -> Parameters:
    """Change one parameter, to a value that it may have beside the others."""
    name, default = f"{row['block']}.{row['name']}", row["default"]
    values = row.get("choices") or [0.9 * default, 1.1 * default, default - 1, default + 1, row["high"]]
    for value in values:
        given = int(value) if isinstance(default, int) else value
        with suppress(ParameterError):
            if given != default:
                return Parameters.from_any({name: given})
    raise AssertionError(name)


def told(caplog, call: Callable[[], object]) -> set[str]:
    """Parameters that are said to have no effect here."""
    caplog.clear()
    call()
    split = (
        each.message.split(" has no effect here; ") for each in caplog.records if each.kind == "no_effect"
    )
    return {each[0] for each in split if len(each) == 2}


def test_every_block_counts_somewhere():
    assert set(WHERE) == BLOCKS
    assert set(OF_METHOD) == set(METHODS)


@pytest.mark.parametrize(
    ("read", "method"), [(("reading",), "rose2"), (("reading", "tracking"), "voronoi"), (COMPARING, None)]
)
def test_each_parameter_is_told_where_nothing_asks_for_its_block(caplog, read, method):
    asked = {*read, *(() if method is None else (*OF_EVERY_METHOD, *OF_METHOD[method]))}
    for row in describe_parameters():
        name = f"{row['block']}.{row['name']}"
        of_rose2 = method == "voronoi" and row["name"] in getattr(Parameters(), row["block"]).groupings
        wanted = set() if row["block"] in asked and not of_rose2 else {name}
        assert told(caplog, lambda row=row: tell_without_effect(changed(row), *read, method=method)) == wanted


@pytest.mark.parametrize("method", METHODS[1:])
def test_what_is_told_of_a_method_has_no_effect(caplog, tmp_path: Path, method: str):
    path = save_map(tmp_path, "flat", two_rooms())
    wanted = rl.segment(path, method=method)
    vain = [row for row in describe_parameters() if row["block"] in {*OF_METHOD["rose2"], "mapping", "kinds"}]
    parameters = Parameters()
    for row in vain:
        given = getattr(getattr(changed(row), row["block"]), row["name"])
        with suppress(ParameterError):  # of two that belong together, one is enough
            parameters = parameters.replaced({f"{row['block']}.{row['name']}": given})
    found = []
    names = told(caplog, lambda: found.append(rl.segment(path, method=method, parameters=parameters)))
    assert len(names) > 0.9 * len(vain)
    assert np.array_equal(found[0].labels, wanted.labels)


def test_each_command_tells_what_it_never_reads(caplog, tmp_path: Path, office_results: Path):
    log, path = save_run(tmp_path / "maps"), save_map(tmp_path, "flat", two_rooms())
    for name, call in {
        "mapping.resolution_m": lambda given: rl.analyze(log, max_snapshots=1, parameters=given),
        "mapping.map_every_s": lambda given: list(rl.track(log, parameters=given)),
        "regions.detail": lambda given: rl.compare(office_results, office_results, parameters=given),
        "walls.extension_m": lambda given: rl.compare(office_results, office_results, parameters=given),
        "tracking.match_min_iou": lambda given: rl.segment(path, parameters=given),
        "comparison.pair_min_iou": lambda given: rl.analyze(log, max_snapshots=1, parameters=given),
    }.items():
        row = next(each for each in describe_parameters() if f"{each['block']}.{each['name']}" == name)
        assert told(caplog, lambda call=call, row=row: call(changed(row))) == {name}
