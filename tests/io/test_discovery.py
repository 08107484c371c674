"""Which files of a folder make up logs, by their names."""

from __future__ import annotations

import pytest

from rose2_logs.io.discovery import logs_among


@pytest.mark.parametrize(
    ("files", "logs"),
    [
        (["a.mcap", "b.BAG", "sub/deep/c.db3"], ["a.mcap", "b.BAG", "sub/deep/c.db3"]),
        (["bag/metadata.yaml", "bag/bag_0.mcap", "bag/bag_1.mcap"], ["bag"]),
        (["bag/metadata.yaml", "bag/bag_0.db3.zstd"], ["bag"]),
        (["bag/metadata.yaml", "bag/sub/more.mcap"], ["bag/sub/more.mcap"]),
        (["died.bag.active"], ["died.bag.active"]),
        (["crashed/crashed_0.mcap", "crashed/crashed_1.mcap"], ["crashed"]),
        (["packed/packed_0.db3.zstd", "packed/packed_1.db3"], ["packed"]),
        (["robot/robot_1.mcap", "robot/robot_2.mcap"], ["robot/robot_1.mcap", "robot/robot_2.mcap"]),
        (["maps/m1.yaml", "maps/m1.pgm", "maps/m2.yaml", "maps/m2.pgm"], ["maps"]),
        (["run.mcap", "map.yaml", "map.pgm"], ["run.mcap"]),
        (["run.mcap", "run.rose2.mcap", ".run.mcap", ".hidden/x.bag"], ["run.mcap"]),
        (["parameters.yaml", "notes.txt", "summary.json"], []),
        (["metadata.yaml", "top_0.mcap", "copies/top_0.mcap"], [""]),
    ],
)
def test_logs_are_told_by_names(files: list[str], logs: list[str]):
    """Bags and folders of maps are one log each; files of bags and results of ours are none."""
    assert logs_among(files, "top") == logs
    assert logs_among(reversed(files), "top") == logs


def test_the_folder_itself_may_be_the_log():
    """As a bag that was not closed, by its own name, or as the maps of a run."""
    assert logs_among(["run_0.mcap"], "run") == [""]
    assert logs_among(["run_0.mcap"], "other") == ["run_0.mcap"]
    assert logs_among(["m.yaml", "m.png"], "maps") == [""]
