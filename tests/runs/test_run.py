"""A run as people use it: what it gives is what was found, map by map."""

from __future__ import annotations

import gc
import re
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from finished_runs import SAMPLE_LOGS
from saved_maps import save_run

import rose2_logs as rl
from rose2_logs.errors import LogError, MissingPackageError, ParameterError
from rose2_logs.model.occupancy import classify
from rose2_logs.runs.table_schemas import SCHEMAS
from rose2_logs.system.text import counted

INTEL = Path(__file__).parents[3] / "shared" / "bags" / "intel.ros2_mcap"


class KeptSteps(rl.Sink):
    """Holds every step, to be compared with what was stored of it."""

    def __init__(self) -> None:
        self.steps: list[rl.TrackedSnapshot] = []

    def write(self, step: rl.TrackedSnapshot) -> None:
        self.steps.append(step)


def analyzed(log: Path, **options) -> tuple[rl.Run, list[rl.TrackedSnapshot]]:
    kept = KeptSteps()
    return rl.analyze(log, sinks=[kept], **options), kept.steps


@pytest.fixture(scope="module")
def office() -> tuple[rl.Run, list[rl.TrackedSnapshot]]:
    return analyzed(SAMPLE_LOGS / "office.mcap", max_snapshots=5, back_project=True)


@pytest.fixture(scope="module")
def run(office) -> rl.Run:
    return office[0]


def assert_stored_as_found(run: rl.Run, steps: list[rl.TrackedSnapshot]) -> None:
    """Label images, classes, geometry, walls, lines and doorways of every map."""
    assert len(run) == len(steps)
    for stored, step in zip(run, steps, strict=True):
        analysis = step.analysis
        assert stored.geometry == analysis.geometry
        assert stored.coverage == step.coverage
        assert stored.log_time_ns == step.snapshot.log_time_ns
        tracks = np.array([0, *step.track_ids], np.int32)
        assert stored.labels.dtype == np.int32
        assert np.array_equal(stored.labels, tracks[analysis.rooms.labels])
        free, occupied = classify(step.snapshot.cells, run.parameters.occupancy)
        between = ~free & ~occupied & (step.snapshot.cells != -1)
        assert stored.cells.dtype == np.int8
        assert np.array_equal(stored.cells, np.select([free, occupied, between], [0, 100, 50], -1))
        assert stored.walls.arrow.num_rows == len(analysis.walls.segments_m)
        walls = run.found_walls(stored.number)
        for name in ("segments_m", "segment_direction", "segment_cluster", "lines_m", "line_direction"):
            assert np.array_equal(getattr(walls, name), getattr(analysis.walls, name)), name
        assert np.array_equal(walls.line_weight, analysis.walls.line_weight)
        assert stored.rooms.arrow["track"].to_pylist() == sorted(step.track_ids)
        assert stored.doorways.arrow.num_rows == len(analysis.rooms.doorways)
        plan = stored.plan()
        assert {room.number for room in plan.rooms} == set(step.track_ids)
        assert np.array_equal(plan.walls_m, analysis.walls.segments_m.reshape(-1, 2, 2))


def test_every_map_is_stored_as_it_was_found(office):
    assert_stored_as_found(*office)


def test_thresholds_decide_the_classes_that_are_stored():
    """Cells between the thresholds keep a class of their own."""
    parameters = {"occupancy.free_max_percent": 10.0, "occupancy.occupied_min_percent": 80.0}
    stored, steps = analyzed(SAMPLE_LOGS / "ring", max_snapshots=2, parameters=parameters)
    assert_stored_as_found(stored, steps)


@pytest.mark.skipif(not INTEL.exists(), reason="the shared logs are not beside the project")
def test_maps_whose_canvas_moves_and_grows_are_stored_as_they_were_found():
    stored, steps = analyzed(INTEL, max_snapshots=5)
    assert len({step.analysis.geometry.shape for step in steps}) > 1
    assert len({step.analysis.geometry.origin_xy_m for step in steps}) > 1
    assert_stored_as_found(stored, steps)


def test_a_method_without_walls_stores_none():
    stored, _ = analyzed(SAMPLE_LOGS / "office.mcap", max_snapshots=2, method="voronoi")
    assert stored.found_walls(1) is None
    assert len(stored.walls) == len(stored.lines) == 0
    assert stored[-1].plan().walls_m is None


TABLES = ("snapshots", "rooms", "tracks", "events", "doorways", "walls", "lines", "back_projected")


@pytest.mark.parametrize("name", TABLES)
def test_tables_are_arrow_and_dataframes(run: rl.Run, name: str):
    """With the columns of their schemas, each with what it means."""
    table = getattr(run, name)
    more = ["in_last_map"] if name == "rooms" else []
    assert isinstance(table.arrow, pa.Table)
    assert table.arrow.column_names == [*SCHEMAS[name].names, *more] == list(table.columns)
    assert all(table.columns.values())
    assert len(table) == table.arrow.num_rows == len(table.pandas) > 0
    assert list(table) == table.arrow.to_pylist()
    assert table.query("snapshot == 4" if "snapshot" in table.columns else "track == 1").equals(
        table.pandas.query("snapshot == 4" if "snapshot" in table.columns else "track == 1")
    )
    assert repr(table) == f"<Table {name}: {counted(len(table), 'row')}, {len(table.columns)} columns>"
    assert getattr(run, name).arrow is table.arrow


def test_rooms_of_the_last_map_are_found_by_a_query(run: rl.Run):
    """Rows of every map, of the tracks that the last map shows."""
    found = run.rooms.query("in_last_map")
    assert isinstance(found, pd.DataFrame)
    assert set(found.track) == set(run[-1].rooms["track"])
    assert set(found.snapshot) == set(range(5))
    gone = set(run.rooms["track"]) - set(found.track)
    assert gone == set(run.tracks.query("not in_last_map").track)
    assert run.rooms["area_m2"].sum() == pytest.approx(sum(row["area_m2"] for row in run.rooms))


def test_a_run_without_back_projection_has_no_table_of_it():
    assert rl.analyze(SAMPLE_LOGS / "office.mcap", max_snapshots=1).back_projected is None


def test_a_run_is_a_sequence_of_its_maps(run: rl.Run):
    assert len(run) == 5
    assert [each.number for each in run] == [0, 1, 2, 3, 4]
    assert (run[0].number, run[-1].number, run[-5].number) == (0, 4, 0)
    assert [each.number for each in run[1:4:2]] == [1, 3]
    assert [each.number for each in reversed(run)] == [4, 3, 2, 1, 0]
    assert run[np.int64(2)].number == 2
    for index in (5, -6):
        with pytest.raises(IndexError, match=f"^run office has 5 maps; none has index {index}$"):
            run[index]


def test_a_map_of_a_run_is_found_in_it(run: rl.Run):
    """As in any sequence, also when the run was opened twice."""
    again = rl.load(run.folder)
    assert run[0] in run
    assert run.index(run[2]) == again.index(run[2]) == 2
    assert run.count(run[-1]) == 1
    assert len({*run, *again}) == len(run)
    assert run[0] != run[1]
    assert run[0] != 0


def test_maps_of_other_runs_are_other_maps(run: rl.Run):
    other = rl.analyze(SAMPLE_LOGS / "office.mcap", max_snapshots=1)
    assert other[0] not in run


@pytest.mark.parametrize("index", [True, None, "x", 1.0, [0, 1], (0, 1), np.array([True] * 5)], ids=repr)
def test_what_is_no_index_of_a_map_is_refused_in_a_line(run: rl.Run, index: object):
    with pytest.raises(TypeError) as refused:
        run[index]
    assert "whole numbers" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_map_is_found_by_number_coverage_and_as_the_last(run: rl.Run):
    assert run.at(snapshot=2).number == 2
    assert run.at().number == 4
    half = run.at_coverage(0.5)
    assert half.number == run.at(coverage=0.5).number
    assert half.coverage >= 0.5 > run[half.number - 1].coverage
    assert half.time_s == run.snapshots["time_s"][half.number]
    assert run.figure(snapshot=None, coverage=None).svg() == run.figure().svg()


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"snapshot": 9}, "no snapshot 9; they go from 0 to 4"),
        ({"snapshot": True}, "the snapshot is a whole number, not True"),
        ({"snapshot": "x"}, "the snapshot is a whole number, not 'x'"),
        ({"coverage": 50}, "half is 0.5"),
        ({"coverage": -0.1}, "half is 0.5"),
        ({"coverage": float("nan")}, "half is 0.5"),
        ({"coverage": "x"}, "the coverage is a number from 0 to 1, not 'x'"),
        ({"coverage": True}, "the coverage is a number from 0 to 1, not True"),
        ({"snapshot": 1, "coverage": 0.5}, "give only one of them"),
    ],
)
def test_a_map_that_cannot_be_chosen_is_told(run: rl.Run, wrong: dict[str, object], told: str):
    """By whatever asks for it."""
    for ask in (run.at, run.figure, run.plot):
        with pytest.raises(ParameterError) as refused:
            ask(**wrong)
        assert told in str(refused.value)


def test_what_there_is_one_of_is_shown_so():
    """A run of one map, with the one room that it shows."""
    grid = np.full((60, 60), 100, np.int8)
    grid[2:-2, 2:-2] = 0
    found = rl.segment(grid, resolution_m=0.1)
    assert "(1 room, 0 doorways, " in repr(found)
    one = np.zeros((1, 4))
    walls = rl.Walls(one, np.zeros(1, int), np.zeros(1, int), one, np.zeros(1, int), np.ones(1))
    assert repr(walls) == "Walls(1 segment, 1 line)"
    assert repr(rl.analyze(SAMPLE_LOGS / "office.mcap", max_snapshots=1)).startswith("<Run office: 1 map, 1")


class KeptFacts(rl.Sink):
    """Holds what a run tells of itself."""

    def begin(self, info: rl.RunInfo) -> None:
        self.info = info

    def write(self, step: rl.TrackedSnapshot) -> None:
        pass

    def finish(self, summary: rl.RunSummary) -> None:
        self.summary = summary


def test_what_is_known_of_runs_is_shown_in_a_line():
    """By what tells one from another."""
    kept = KeptFacts()
    run = rl.analyze(SAMPLE_LOGS / "office.mcap", max_snapshots=3, sinks=[kept])
    found, size = rl.compare(run, run), r"\d+ x \d+ cells of 0\.05 m"
    assert repr(kept.info) == "RunInfo('office.mcap', topic='/map', method='rose2')"
    assert re.fullmatch(
        r"RunSummary\(3 maps, 18 rooms at the end, \d+ tracks, \d+ events\)", repr(kept.summary)
    )
    assert repr(found) == "LayoutComparison('office', 'office', rooms: 18 same)"
    assert re.fullmatch(rf"FinalLayout\('office', 18 rooms, {size}\)", repr(found.a))
    assert re.fullmatch(rf"PlacedMap\({size}, \d+ wall points\)", repr(found.a.map))
    with rl.open_log(SAMPLE_LOGS / "office.mcap") as reader:
        assert repr(reader) == "LogReader('office.mcap', MCAP, topic='/map')"


def test_options_are_shown_by_what_differs_from_the_defaults():
    assert (repr(rl.RunOptions()), repr(rl.Selection())) == ("RunOptions()", "Selection()")
    assert repr(rl.Selection(every_s=2.0)) == "Selection(every_s=2.0)"
    parameters = rl.Parameters.from_any({"walls.extension_m": 6})
    assert repr(rl.RunOptions(method="voronoi", layers="all", parameters=parameters)) == (
        "RunOptions(method='voronoi', parameters=Parameters(walls=WallParameters(extension_m=6.0)))"
    )


def test_runs_and_their_parts_are_shown_small(run: rl.Run):
    """Whatever the size of a run; a notebook shows tables."""
    rooms = len(run[-1].rooms)
    assert repr(run) == f"<Run office: 5 maps, {rooms} rooms at the end>"
    assert repr(run[-1]) == f"<RunSnapshot 4 of office: coverage 100%, {rooms} rooms>"
    html = run.rooms._repr_html_()
    assert "<table" in html
    assert "area_m2" in html


def test_a_temporary_run_leaves_nothing_behind(tmp_path: Path, monkeypatch):
    """The folder goes with the last that reads from it, without a word."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    log = save_run(tmp_path / "maps")
    made = rl.analyze(log)
    folder, last = made.folder, made[-1]
    assert (folder / "summary.json").is_file()
    assert folder.is_relative_to(tmp_path)
    assert not [path for path in folder.rglob("*") if path.suffix in (".rrd", ".mcap")]
    rooms = made.rooms
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        del made
        gc.collect()
        assert len(last.labels) == 120
        del last
        gc.collect()
    assert not [warning for warning in told if issubclass(warning.category, ResourceWarning)]
    assert [path.name for path in tmp_path.iterdir()] == ["maps"]
    assert len(rooms) > 3  # what was read stays


def test_a_run_that_fails_leaves_no_temporary_folder(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(LogError):
        rl.analyze(tmp_path / "nowhere.mcap")
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_was_kept_is_loaded_again(tmp_path: Path):
    out = tmp_path / "out"
    options = {"recording": False, "annotated_log": False}
    made = rl.analyze(str(save_run(tmp_path / "maps")), str(out), **options)
    loaded = rl.load(str(out))
    assert loaded.folder == made.folder == out
    assert loaded.rooms.arrow.equals(made.rooms.arrow)
    del made
    gc.collect()
    assert (out / "summary.json").exists()


def test_without_pandas_there_is_arrow(run: rl.Run, monkeypatch):
    """And a line that says how to have more."""
    monkeypatch.setitem(sys.modules, "pandas", None)
    table = rl.Table("rooms", run.rooms.arrow)
    assert len(list(table)) == len(table) == table.arrow.num_rows
    assert repr(table).startswith("<Table rooms: ")
    assert "<th>area_m2</th>" in table._repr_html_()
    for use in (lambda: table.query("in_last_map"), lambda: table["track"], lambda: table.pandas):
        with pytest.raises(MissingPackageError, match=r"install rose2-logs\[notebook\]"):
            use()


def test_a_run_is_made_without_pandas_and_matplotlib(tmp_path: Path):
    """They are no dependencies: from the log to the figure nothing imports them."""
    program = (
        "import sys\n"
        "class Missing:\n"
        "    def find_spec(name, path=None, target=None):\n"
        "        if name.split('.')[0] in ('pandas', 'matplotlib'):\n"
        "            raise ModuleNotFoundError(name)\n"
        "sys.meta_path.insert(0, Missing)\n"
        "import rose2_logs as rl\n"
        f"run = rl.analyze({str(save_run(tmp_path / 'maps'))!r})\n"
        "print(run, run.figure() is not None, sum(row['in_last_map'] for row in run.rooms))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("<Run maps: 3 maps, 2 rooms at the end> True ")


def test_a_run_and_its_maps_are_drawn(run: rl.Run, tmp_path: Path):
    """The map that was chosen, in the colors of the tracks; a notebook shows a run with its last map."""
    drawing = run.figure(coverage=0.5)
    half = run.at_coverage(0.5)
    assert drawing.svg() == half.figure().svg()
    assert drawing.svg() != run.figure().svg()
    assert drawing.svg() != run.figure(coverage=0.5, back_projected=True).svg()
    assert half._repr_svg_() == half.figure()._repr_svg_()
    for name in ("half.svg", "half.png"):
        assert drawing.save(tmp_path / name).stat().st_size > 1000
    html = run._repr_html_()
    assert html.count("<svg") == 1
    assert run[-1]._repr_svg_() in html
    assert "office.mcap" in html


@pytest.mark.parametrize(("snapshot", "said"), [(0, "51% coverage"), (-1, "not reached")])
def test_a_layout_that_was_final_in_the_last_map_alone_is_not_told_as_final(run, snapshot, said, monkeypatch):
    final = {"snapshot": run[snapshot].number, "coverage": 0.51}
    monkeypatch.setitem(run.summary["layout"], "final_since", final)
    assert f"<th>layout final from</th><td>{said}</td>" in run._repr_html_()


def test_what_a_log_is_called_is_no_html(tmp_path: Path):
    log = save_run(tmp_path / "<b>maps&")
    html = rl.analyze(log)._repr_html_()
    assert "<b>" not in html
    assert "&lt;b&gt;maps&amp;" in html


def test_maps_are_plotted_into_axes(run: rl.Run):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2)
    try:
        assert run.plot(left, coverage=0.5) is left
        assert run[-1].plot(right) is right
        assert len(left.patches) < len(right.patches)
    finally:
        pyplot.close(figure)
