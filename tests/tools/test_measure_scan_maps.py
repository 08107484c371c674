"""Maps from scans against recorded ones, on a run of half a minute."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from carmen_lines import robot_laser

import rose2_logs as rl


@pytest.fixture(scope="module")
def table(tmp_path_factory) -> tuple[list[str], Path]:
    """Cells of the only row, and the folder with the log."""
    from measure_scan_maps import measure_simulated

    folder = tmp_path_factory.mktemp("scans")
    return list(measure_simulated(6, "flat", folder, 20).cells), folder


def test_the_built_map_of_a_short_run_is_that_of_the_mapper(table):
    name, duration, agree, walls, known, *_ = table[0]
    assert name == "flat, seed 6"
    assert 20 <= float(duration) < 25
    assert float(agree) > 98
    assert float(walls) > 95
    assert float(known) > 95


def test_its_log_holds_scans_transforms_and_maps(table):
    with rl.open_log(table[1] / "flat_6.mcap") as reader:
        counts = {topic.name: topic.message_count for topic in reader.info.topics}
    assert counts["/map"] == 2
    assert 150 < counts["/scan"] < 250
    assert counts["/tf"] == counts["/odom"] == pytest.approx(2 * counts["/scan"], abs=3)


def test_a_map_that_is_shifted_does_not_agree(table):
    from dataclasses import replace

    from measure_scan_maps import agreement

    with rl.open_log(table[1] / "flat_6.mcap") as reader:
        recorded = reader.last()
        way = reader.robot_path("map").until(recorded.log_time_ns)[:, :2]
    same = agreement(recorded, recorded, way)
    assert (same.agree, same.walls, same.known, same.rooms.iou_sym, same.entered.iou_sym) == (100,) * 5
    assert 0 < same.entered.rooms_gt < same.rooms.rooms_gt
    x, y = recorded.geometry.origin_xy_m
    moved = replace(recorded, geometry=replace(recorded.geometry, origin_xy_m=(x + 0.3, y)))
    assert agreement(recorded, moved, way).agree < 98
    assert agreement(recorded, moved, way).walls < 80


def test_carmen_logs_have_a_row_without_agreement(tmp_path, capsys):
    from measure_scan_maps import main

    log = tmp_path / "a.log"
    ranges = np.full(181, 3.0)
    log.write_text("".join(robot_laser(100 + t, 0, ranges) for t in range(20)))
    assert main(["--carmen", str(log)]) == 0
    *_, row = capsys.readouterr().out.splitlines()
    cells = [each.strip() for each in row.strip("|").split("|")]
    assert cells[:5] == ["a.log", "19", "", "", ""]
    assert float(cells[-1]) > 0
