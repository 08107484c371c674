"""Every parameter: absurd values get one clear line, and the extremes that are allowed are worked with."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from saved_maps import save_run, two_rooms
from scan_logs import Move, Scan, ranges_in_box, write_scans

import rose2_logs as rl
from rose2_logs.config.parameters import describe_parameters, load_parameters
from rose2_logs.errors import ParameterError

ROWS = {f"{row['block']}.{row['name']}": row for row in describe_parameters()}
NEVER = (
    "inf", "-inf", "nan", "1e300", "-1e300", "-1e6", "9" * 400, "9" * 5000, "true", '"text"', "[1]", "{a=1}",
    "1979-05-27", "[" * 5000, "''", "",
)  # fmt: skip
"""Values, as they are written after ``--set NAME=``, that no parameter can have."""
MOST_CPU_S = 20.0
"""Of a map of 12 m by 6 m, which takes a fraction of a second: far less than a hang."""


@pytest.mark.parametrize("value", NEVER, ids=lambda value: value[:12])
def test_no_parameter_takes_an_absurd_value(value: str):
    for name in ROWS:
        with pytest.raises(ParameterError) as raised:
            load_parameters(settings=[f"{name}={value}"])
        line = str(raised.value)
        assert name in line, line
        assert ("\n" in line, len(line) < 300) == (False, True), line


def test_zero_is_taken_where_it_means_something():
    for name, row in ROWS.items():
        if "low" in row and row["low"] > 0:
            with pytest.raises(ParameterError, match=f"^{name} is 0.*; it must lie between "):
                load_parameters(settings=[f"{name}=0"])


def test_lengths_are_bounded_by_what_a_slip_of_the_unit_gives():
    """Centimeters or millimeters taken for meters are refused, unless they are still those of a building."""
    for name, row in ROWS.items():
        if row["unit"] == "m" and row["default"] * 100 > 100:
            with pytest.raises(ParameterError, match=f"^{name} is "):
                load_parameters(settings=[f"{name}={row['default'] * 100}"])
    for name in ("floor_plan.wall_tolerance_m", "spectrum.wall_sigma_m", "floor_plan.shape_gap_m"):
        assert ROWS[name]["high"] <= 4.0


PAIRS = [
    ("spectrum.threshold_min=1", "spectrum.threshold_max=0", "spectrum.threshold_max"),
    ("spectrum.shortest_wave_m=5", "spectrum.longest_wave_m=1", "spectrum.longest_wave_m"),
    ("occupancy.free_max_percent=50", "occupancy.occupied_min_percent=40", "occupancy.occupied_min_percent"),
    ("morphological.room_min_area_m2=50", "morphological.room_max_area_m2=5", "room_max_area_m2"),
    ("distance.room_min_area_m2=50", "distance.room_max_area_m2=5", "room_max_area_m2"),
    ("voronoi.room_min_area_m2=50", "voronoi.room_max_area_m2=5", "room_max_area_m2"),
    ("regions.surroundings_rest_min_edge=0.5", "regions.surroundings_min_edge=0.2", "surroundings_min_edge"),
    ("tracking.fit_gate_4_m=0.19", "tracking.fit_gate_3_m=0.15", "tracking.fit_gate_3_m"),
    ("tracking.fit_min_points=60", "tracking.fit_points=50", "tracking.fit_points"),
    ("tracking.fit_neighbors=60", "tracking.fit_min_points=55", "tracking.fit_min_points"),
    ("tracking.shift_search_m=10", "tracking.search_step_m=0.1", "40 times tracking.search_step_m"),
    ("comparison.pair_min_iou=0.9", "comparison.same_room_min_iou=0.5", "comparison.same_room_min_iou"),
]


@pytest.mark.parametrize(("one", "other", "partner"), PAIRS, ids=lambda each: each)
@pytest.mark.parametrize("turned", [False, True])
def test_a_value_is_checked_with_its_partner(
    tmp_path: Path, one: str, other: str, partner: str, turned: bool
):
    """In whatever order, and from a file as from settings."""
    path = tmp_path / "config.toml"
    block, name = one.partition("=")[0].split(".")
    path.write_text(f"[{block}]\n" + f"{one}\n{other}\n".replace(f"{block}.", ""), encoding="utf-8")
    for given in ({"settings": [one, other][:: -1 if turned else 1]}, {"config": path}):
        with pytest.raises(ParameterError, match="must not be above") as raised:
            load_parameters(**given)
        assert partner in str(raised.value)
        assert name in str(raised.value)


def drive(folder: Path) -> Path:
    """A robot that stands in a room and scans it twice."""
    bearings = np.linspace(-math.pi, math.pi, 181)[:-1]
    ranges = ranges_in_box(np.zeros((len(bearings), 2)), bearings, (-2.0, -1.5), (3.0, 2.5))
    logged: list[tuple[str, Scan | Move]] = [("/tf", Move(k / 2, "map", "laser")) for k in range(6)]
    logged += [("/scan", Scan(k + 0.5, ranges, bearings)) for k in range(2)]
    return write_scans(folder / "drive.mcap", logged)


@pytest.fixture(scope="module")
def worked_with(tmp_path_factory) -> Callable[[str, Any], object]:
    """Return a function that does what a parameter is for."""
    folder = tmp_path_factory.mktemp("extremes")
    with rl.open_log(save_run(folder / "maps", (180, 240))) as reader:
        maps = list(reader.snapshots())
    log, plan = drive(folder), folder / "plan"
    rl.analyze(folder / "maps", plan, recording=False, annotated_log=False)
    last = two_rooms()[..., ::-1]
    cells = np.select([last == 0, last == 254], [100, 0], -1).astype(np.int8)

    def work(name: str, value: Any) -> None:
        block, changed = name.partition(".")[0], {name: value}
        if block == "comparison":
            rl.compare(plan, plan, parameters=changed)
        elif block == "mapping":
            with rl.open_log(log, map_from="/scan", parameters=changed) as reader:
                list(reader.snapshots())
        elif block in ("tracking", "quality", "reading"):
            list(rl.track(maps, parameters=changed))
        elif block in ("morphological", "distance", "voronoi", "voronoi_merge"):
            method = block.removesuffix("_merge")
            rl.segment(cells, resolution_m=0.05, parameters=changed, method=method)
        else:
            groupings = ("fitted", "walls") if block in ("floor_plan", "topology") else ("fitted",)
            for grouping in groupings:
                given = {"floor_plan.grouping": grouping} | changed
                rl.segment(cells, resolution_m=0.05, parameters=given)

    return work


@pytest.mark.parametrize("end", ["low", "high"])
@pytest.mark.parametrize("block", sorted({row["block"] for row in ROWS.values()}))
def test_the_least_and_the_greatest_value_are_worked_with(worked_with, block: str, end: str):
    """Or refused in one line, as with a partner that they contradict; never an internal error or a hang."""
    told: dict[str, str] = {}
    for name, row in ROWS.items():
        if row["block"] != block or end not in row:
            continue
        start = time.process_time()
        try:
            worked_with(name, type(row["default"])(row[end]))
        except rl.Rose2LogsError as error:
            told[name] = str(error)
        assert time.process_time() - start < MOST_CPU_S, name
    assert not {name: line for name, line in told.items() if "\n" in line or "internal" in line}
