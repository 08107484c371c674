"""The baselines from the command line: the same files as from ROSE2."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image
from saved_maps import RESOLUTION_M, save_map, save_run, two_rooms

from rose2_logs.cli.main import main
from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.segmentation.pipeline import METHODS

FILES = {
    "maps.rrd",
    "maps.rose2.mcap",
    "snapshots.parquet",
    "rooms.parquet",
    "events.parquet",
    "doorways.parquet",
    "summary.json",
}
baselines = pytest.mark.parametrize("method", [method for method in METHODS if method != "rose2"])


@pytest.fixture
def cli(monkeypatch):
    """Run the command line; returns the exit code."""

    def run(*arguments: object) -> int:
        monkeypatch.setattr(sys, "argv", ["rose2-logs", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0)

    return run


@baselines
def test_analyze_writes_all_files(cli, tmp_path: Path, method: str):
    """Recording, annotated log and tables hold the rooms; what the method does not find is missing there."""
    log = save_run(tmp_path / "maps")
    assert cli("analyze", log, "-o", tmp_path / "out", "--method", method) == 0
    folder = tmp_path / "out" / "maps"
    assert {file.name for file in folder.iterdir()} >= FILES - {"maps.rose2.mcap"}
    assert json.loads((folder / "summary.json").read_text())["method"] == method
    snapshots = pq.read_table(folder / "snapshots.parquet").to_pylist()
    assert [row["wall_segments"] for row in snapshots] == [0, 0, 0]
    assert snapshots[-1]["rooms"] == len(
        [row for row in pq.read_table(folder / "rooms.parquet").to_pylist() if row["snapshot"] == 2]
    )
    assert snapshots[-1]["rooms"] > 0


@baselines
def test_segment_writes_labels_plan_and_picture(cli, tmp_path: Path, method: str):
    """Rooms and doorways stand in the plan, walls and lines do not."""
    path = save_map(tmp_path, "flat", two_rooms())
    assert cli("segment", path, "-o", tmp_path / "out", "--method", method) == 0
    with Image.open(tmp_path / "out" / "flat.labels.png") as image:
        labels = np.asarray(image)
    assert ((labels > 0) == (two_rooms() == 254)).all()
    plan = json.loads((tmp_path / "out" / "flat.floor_plan.geojson").read_text())
    kinds = {feature["properties"]["kind"] for feature in plan["features"]}
    assert "room" in kinds <= {"room", "doorway"}
    assert (tmp_path / "out" / "flat.rooms.png").exists()


@baselines
def test_evaluate_scores_the_method(cli, tmp_path: Path, method: str):
    """The figures say by which method, and with its parameters."""
    save_map(tmp_path, "flat", two_rooms())
    write_label_image(tmp_path / "rooms.png", np.where(two_rooms() == 254, 1 + (np.arange(240) >= 117), 0))
    case = {"group": "drawn", "name": "flat", "map": "flat.png", "rooms": "rooms.png"}
    cases = tmp_path / "cases.json"
    cases.write_text(json.dumps({"cases": [case | {"resolution_m": RESOLUTION_M}]}))
    setting = "morphological.room_max_area_m2=22.0"
    arguments = (cases, "--json", tmp_path / "f.json", "--method", method, "--set", setting)
    assert cli("evaluate", *arguments) == 0
    figures = json.loads((tmp_path / "f.json").read_text())
    assert figures["method"] == method
    assert figures["parameters"]["morphological"]["room_max_area_m2"] == 22.0
    assert figures["groups"]["drawn"]["iou_sym"] > 95
