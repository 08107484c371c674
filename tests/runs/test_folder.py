"""Results read back from their folder say what was found."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import shapely
from finished_runs import SAMPLE_LOGS, run_of
from rose2_logs.runs.folder import RunResults, find_results
from rose2_logs.runs.maps import labels_of_segmented
from saved_maps import save_run

from rose2_logs.errors import LogError, OutputError, ParameterError
from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.model.room_plan import PlanRoom
from rose2_logs.workflows.figure import export_plan


def saved_maps_run(folder: Path) -> Path:
    return run_of(save_run(folder / "maps"), folder / "out")


RUNS = {
    "MCAP": lambda folder: run_of(SAMPLE_LOGS / "office.mcap", folder, 4),
    "ROS 1 bag": lambda folder: run_of(SAMPLE_LOGS / "wing.bag", folder, 3),
    "ROS 2 bag": lambda folder: run_of(SAMPLE_LOGS / "ring", folder, 3),
    "saved maps": saved_maps_run,
}


@pytest.mark.parametrize("kind", RUNS)
def test_every_plan_is_as_the_tables_say(tmp_path: Path, kind: str):
    """The cells of each room have its area, walls and doorways their number, points on their cells."""
    results = RunResults(RUNS[kind](tmp_path))
    with results.open_maps() as maps:
        for number in results.snapshots["snapshot"].tolist():
            row, plan = results.row(number), results.plan(number, maps, with_walls=True)
            labels, cell_m2 = plan.map.labels, plan.map.geometry.cell_area_m2
            for room in plan.rooms:
                assert (labels == room.number).sum() * cell_m2 == pytest.approx(room.area_m2)
                row_of, column = plan.map.geometry.world_to_cell(np.array(room.label_point_m))
                assert labels[row_of, column] == room.number
            assert set(np.unique(labels)) <= {0, *(room.number for room in plan.rooms)}
            assert (len(plan.rooms), len(plan.doorways)) == (row["rooms"], row["doorways"])
            assert len(plan.walls_m) == row["wall_segments"]
            free = (plan.map.cells >= 0) & (plan.map.cells < 20)
            assert free.sum() * cell_m2 == pytest.approx(row["free_area_m2"])


def test_rooms_of_one_value_are_told_apart():
    """Tracks 98 apart share a value in the segmented map."""
    geometry = GridGeometry(1.0, (0.0, 0.0), 0.3, "map", (6, 12))

    def room(number, x0, x1):
        shape = shapely.transform(shapely.box(x0, 0, x1, 6), geometry.grid_to_world)
        return PlanRoom(number, shape, 0.0, None, ())

    true = np.zeros((6, 12), np.int32)
    true[:, :3], true[:, 4:7], true[:, 9:] = 5, 103, 12
    segmented = np.where(true > 0, 1 + (true - 1) % 98, 0).astype(np.int8)
    segmented[0, 3], segmented[0, 8] = 100, -1
    rooms = [room(5, 0, 3), room(103, 4, 6), room(12, 9, 12)]
    assert np.array_equal(labels_of_segmented(segmented, geometry, rooms), true)


def test_a_map_is_chosen_by_number_coverage_or_as_the_last(office_results: Path):
    results = RunResults(office_results)
    coverage = results.snapshots["coverage"]
    assert results.choose() == results.choose(coverage=1.0) == 5
    assert results.choose(2) == 2
    half = results.choose(coverage=0.5)
    assert coverage[half] >= 0.5 > coverage[half - 1]
    assert results.choose(coverage=float(coverage[2])) == 2
    with pytest.raises(ParameterError, match="from 0 to 5"):
        results.choose(6)
    with pytest.raises(ParameterError, match=r"half is 0\.5"):
        results.choose(coverage=50)


def test_without_the_annotated_log_shapes_remain(office_results: Path, tmp_path: Path):
    """Then there is no map to draw; what needs one says so."""
    folder = shutil.copytree(office_results, tmp_path / "bare")
    next(folder.glob("*.rose2.mcap")).unlink()
    results = RunResults(folder)
    with results.open_maps() as maps:
        plan = results.plan(5, maps, with_walls=True)
    assert plan.map is None
    assert len(plan.rooms) > 10
    with pytest.raises(OutputError, match="annotated_log=False"):
        export_plan(folder, ["map_server"], tmp_path / "out")
    assert export_plan(folder, ["dxf", "geojson", "svg", "graph"], tmp_path / "out")


def test_folders_of_results_are_found(office_results: Path, tmp_path: Path):
    assert find_results(office_results) == [office_results]
    for name in ("b/one", "a", ".batch/unfinished/x"):
        shutil.copytree(office_results, tmp_path / name)
    assert find_results(tmp_path) == [tmp_path / "a", tmp_path / "b" / "one"]


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (lambda folder: (folder / "summary.json").write_text("{"), "summary.json"),
        (lambda folder: (folder / "summary.json").write_text("[1]"), "is not the summary of a run"),
        (lambda folder: (folder / "summary.json").unlink(), "holds no summary.json"),
        (lambda folder: (folder / "rooms.parquet").write_bytes(b"PAR1"), "rooms.parquet"),
        (lambda folder: (folder / "doorways.parquet").unlink(), "doorways.parquet"),
        (lambda folder: next(folder.glob("*.mcap")).write_bytes(b"nothing"), "rose2.mcap"),
    ],
)
def test_what_cannot_be_read_is_named(office_results: Path, tmp_path: Path, damage, told: str):
    folder = shutil.copytree(office_results, tmp_path / "damaged")
    damage(folder)
    with pytest.raises(LogError, match=told):
        export_plan(folder, ["geojson"], tmp_path / "out")
    assert not (tmp_path / "out").exists()
