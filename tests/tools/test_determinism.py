"""The same maps give the same labels and tables: in any format of log, with any workers and hash seed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from saved_maps import FREE, WALL, two_rooms

from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.runs.tables import TABLES

PROGRAM = """
import sys
from pathlib import Path
from rose2_logs.workflows.analyze import RunOptions, analyze_log
if __name__ == "__main__":
    log, folder, workers = sys.argv[1:]
    analyze_log(Path(log), Path(folder), RunOptions(recording=False, workers=int(workers)))
"""
LABELS = "/rose2/segmented_map"


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> list[Path]:
    """The same maps as MCAP, ROS 1 bag and ROS 2 bag."""
    from log_writing import robot_log

    folder = tmp_path_factory.mktemp("logs")
    paths = [folder / name for name in ("run.mcap", "run.bag", "run")]
    geometry = GridGeometry(0.05, (1.0, 2.0), 0.1, "map", (120, 240))
    for path in paths:
        with robot_log(path, 10**18, {"origin": "drawn"}) as log:
            for number, seen in enumerate((115, 150, 180, 240)):
                image = two_rooms(seen)
                cells = np.select([image == FREE, image == WALL], [0, 100], -1).astype(np.int8)
                log.write_map(float(number), cells, geometry)
    return paths


def test_labels_and_tables_depend_on_nothing_but_the_maps(logs: list[Path], tmp_path: Path):
    runs = [(logs[0], 1, "0"), (logs[0], 2, "1"), (logs[1], 1, "2"), (logs[2], 1, "random")]
    found = []
    for number, (log, workers, seed) in enumerate(runs):
        folder = tmp_path / str(number)
        command = [sys.executable, "-c", PROGRAM, str(log), str(folder), str(workers)]
        subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": seed})
        with next(folder.glob("*.mcap")).open("rb") as file:
            labels = [message.data for _, _, message in make_reader(file).iter_messages(topics=[LABELS])]
        assert len(labels) == 4
        tables = {name: (folder / f"{name}.parquet").read_bytes() for name in TABLES}
        found.append((labels, tables))
    assert pq.read_metadata(folder / "rooms.parquet").num_rows > 4
    assert all(each == found[0] for each in found[1:])
