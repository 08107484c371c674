"""``analyze --map-from`` on a small log of scans: from the error's hint to results and annotated MCAP."""

import json

import numpy as np
import pytest
from mcap.reader import make_reader
from scan_logs import Move, Scan, ranges_in_box, turned, write_scans

import rose2_logs as rl


@pytest.fixture
def log(tmp_path):
    """Two minutes of a robot that drives through a room of 8 by 5 m."""
    bearings = np.linspace(-np.pi, np.pi, 181)[:-1]
    logged = [("/tf_static", Move(0.0, "base_link", "laser", (0.1, 0.0, 0.2)))]
    for k in range(120):
        x, yaw = 1.0 + 0.05 * k, 0.1 * k
        logged.append(("/tf", Move(float(k), "map", "base_link", (x, 2.5, 0.0), turned(yaw))))
        starts = np.tile([x + 0.1 * np.cos(yaw), 2.5 + 0.1 * np.sin(yaw)], (len(bearings), 1))
        ranges = ranges_in_box(starts, yaw + bearings, (0.0, 0.0), (8.0, 5.0))
        logged.append(("/scan", Scan(float(k), ranges, bearings)))
    return write_scans(tmp_path / "scans.mcap", logged)


def test_the_error_and_info_offer_it(cli, log, tmp_path):
    code, _, err = cli("analyze", log, "-o", tmp_path / "out")
    assert code == 2
    assert "--map-from '/scan' builds maps from its laser scans" in err
    code, out, _ = cli("info", log)
    assert code == 0
    assert "analyze --map-from /scan builds maps from its laser scans" in out
    assert json.loads(cli("info", log, "--json")[1])["map_from"] == ["/scan"]


def test_what_scans_lack_is_told(cli, tmp_path):
    bearings = np.linspace(-1.0, 1.0, 9)
    scans = [("/scan", Scan(float(k), np.ones(9), bearings)) for k in range(3)]
    alone = write_scans(tmp_path / "alone.mcap", scans)
    told = "/scan holds laser scans, but no transforms (/tf) tell where they were taken"
    code, _, err = cli("analyze", alone, "-o", tmp_path / "out")
    assert code == 2
    assert f"{told}; record the mapping node's topic too, usually /map, or the transforms" in err
    code, out, _ = cli("info", alone)
    assert code == 0
    assert f"no occupancy grids; {told}: analyze cannot use this log" in out


def test_rooms_are_found_in_built_maps_and_these_are_in_the_annotated_log(cli, log, tmp_path):
    settings = ("--every", "30", "--set", "mapping.usable_range_m=6")
    code, _, err = cli("analyze", log, "-o", tmp_path / "out", "--map-from", "/scan", *settings, "--no-rrd")
    assert (code, err) == (0, "")
    run = rl.load(tmp_path / "out" / "scans")
    assert len(run.snapshots) == 3
    assert run.snapshots.arrow["rooms"].to_pylist()[-1] == 1
    summary = json.loads((tmp_path / "out" / "scans" / "summary.json").read_text())
    assert summary["topic"] == "/scan/map"
    with (tmp_path / "out" / "scans" / "scans.rose2.mcap").open("rb") as stream:
        counts = {}
        for _, channel, _ in make_reader(stream).iter_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
    assert (counts["/scan"], counts["/tf"], counts["/scan/map"]) == (120, 120, 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--map-from", "/scan", "--topic", "/map"), "--topic '/map' reads recorded maps"),
        (("--map-frame", "map"), "--map-frame 'map' is for maps built from scans"),
        (("--map-from", "/scan", "--map-frame", "world"), "no transforms lead from world"),
        (("--map-from", "/lidar"), "/lidar is not a topic with laser scans; its scan topics are /scan"),
    ],
)
def test_what_makes_no_sense_is_one_line(cli, log, tmp_path, arguments, message):
    code, _, err = cli("analyze", log, "-o", tmp_path / "out", *arguments)
    assert code == 2
    assert message in err
    assert err.count("\n") == 1
