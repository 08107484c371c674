"""What a run has stored, read back from its folder, says what was found; what cannot be read is named."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from finished_runs import SAMPLE_LOGS, run_of
from saved_maps import save_run

from rose2_logs.errors import ParameterError, ResultsError
from rose2_logs.runs.stored_run import StoredRun, find_results
from rose2_logs.runs.summary_schema import Summary
from rose2_logs.runs.table_schemas import SCHEMAS
from rose2_logs.runs.tables import TABLES, pack_image
from rose2_logs.workflows.figure import export_plan


def saved_maps_run(folder: Path) -> Path:
    return run_of(save_run(folder / "maps"), folder / "out", annotated_log=False)


RUNS = {
    "MCAP": lambda folder: run_of(SAMPLE_LOGS / "office.mcap", folder, 4, annotated_log=False),
    "ROS 1 bag": lambda folder: run_of(SAMPLE_LOGS / "wing.bag", folder, 3, annotated_log=False),
    "ROS 2 bag": lambda folder: run_of(SAMPLE_LOGS / "ring", folder, 3, annotated_log=False),
    "saved maps": saved_maps_run,
}


@pytest.mark.parametrize("kind", RUNS)
def test_every_plan_is_as_the_tables_say(tmp_path: Path, kind: str):
    """The cells of each room have its area, walls and doorways their number, points on their cells."""
    results = StoredRun(RUNS[kind](tmp_path))
    for number in results.columns["snapshot"].tolist():
        row, plan = results.row(number), results.plan(number, with_walls=True)
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


def test_a_map_is_chosen_by_number_coverage_or_as_the_last(office_results: Path):
    results = StoredRun(office_results)
    coverage = results.columns["coverage"]
    assert results.choose() == results.choose(coverage=1.0) == 5
    assert results.choose(2) == 2
    half = results.choose(coverage=0.5)
    assert coverage[half] >= 0.5 > coverage[half - 1]
    assert results.choose(coverage=float(coverage[2])) == 2
    with pytest.raises(ParameterError, match="from 0 to 5"):
        results.choose(6)
    with pytest.raises(ParameterError, match=r"half is 0\.5"):
        results.choose(coverage=50)


def test_folders_of_results_are_found(office_results: Path, tmp_path: Path):
    assert find_results(office_results) == [office_results]
    for name in ("b/one", "a", ".batch/unfinished/x"):
        shutil.copytree(office_results, tmp_path / name)
    assert find_results(tmp_path) == [tmp_path / "a", tmp_path / "b" / "one"]


def test_a_table_that_no_run_has_is_named(office_results: Path):
    with pytest.raises(ParameterError, match="no table 'walls_m'; there are snapshots, rooms"):
        StoredRun(office_results).table("walls_m")


@pytest.fixture
def copied(office_results: Path, tmp_path: Path) -> Path:
    """Results that a test may damage."""
    return shutil.copytree(office_results, tmp_path / "damaged")


def told(act: Callable[[], object], file: Path) -> str:
    """The one line about a file of results that cannot be used."""
    with pytest.raises(ResultsError) as error:
        act()
    assert error.value.file == str(file)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"{file}: ")
    return str(error.value)


def change_summary(folder: Path, **values: object) -> None:
    path = folder / "summary.json"
    summary = json.loads(path.read_text()) | values
    path.write_text(json.dumps({name: value for name, value in summary.items() if value is not None}))


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda folder: (folder / "summary.json").write_text("{"), "cannot be read"),
        (lambda folder: (folder / "summary.json").write_bytes(b'"\xff"'), "cannot be read"),
        (lambda folder: (folder / "summary.json").write_text("[1]"), "is not the summary of a run"),
        (lambda folder: change_summary(folder, topic=None), "its topic is missing"),
        (lambda folder: (folder / "summary.json").write_text('{"a": 1}'), "is not the summary of a run"),
        (
            lambda folder: change_summary(folder, layout=3),
            "its layout is damaged: expected `object`, got `int`",
        ),
        (lambda folder: change_summary(folder, messages=None), "its messages is missing"),
    ],
)
def test_a_damaged_summary_is_named(copied: Path, damage: Callable[[Path], object], said: str):
    damage(copied)
    assert said in told(lambda: StoredRun(copied), copied / "summary.json")


def whole_summary(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text())


def keys_of(block: dict, above: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Path of every key, also of those in objects and in the first entry of a list."""
    found = []
    for name, value in block.items():
        found.append((*above, name))
        if isinstance(value, dict):
            found += keys_of(value, (*above, name))
    return found


FREE = {("selection",), ("decided",), ("versions",), ("results", "events"), ("warnings", "kinds"),
        ("seconds", "stages"), ("seconds", "stages_max")}  # fmt: skip
"""Objects whose keys differ from run to run."""
OTHER_TYPE = {str: 7, int: "seven", float: "half", dict: [1], list: {"a": 1}, type(None): [1]}


def test_every_key_of_a_summary_is_required_when_it_is_opened(copied: Path):
    """Missing, renamed or of another type: one line names the key; not only when it is used."""
    path, whole = copied / "summary.json", whole_summary(copied)
    # Others are of sinks. Without the number of the format, the results are of another version.
    not_required = ("results_format", "parts", "names")
    known = {name: whole[name] for name in Summary.__annotations__ if name not in not_required}
    keys = [key for key in keys_of(known) if not any(key[:depth] in FREE for depth in range(1, len(key)))]
    assert len(keys) > 200
    for key in keys:
        for change in ("missing", "renamed", "retyped"):
            summary = json.loads(json.dumps(whole))
            block = summary
            for each in key[:-1]:
                block = block[each]
            value = block.pop(key[-1])
            if change == "renamed":
                block[f"{key[-1]}_"] = value
            elif change == "retyped":
                block[key[-1]] = OTHER_TYPE[type(value)]
            path.write_text(json.dumps(summary))
            line = told(lambda: StoredRun(copied), path)
            assert key[-1] in line, (key, change, line)
    path.write_text(json.dumps(whole))
    assert StoredRun(copied).summary == whole


@pytest.mark.parametrize("key", ["results", "parameters"])
def test_an_empty_part_of_a_summary_is_named(copied: Path, key: str):
    change_summary(copied, **{key: {}})
    assert f"its {key}" in told(lambda: StoredRun(copied), copied / "summary.json")


def test_a_layout_that_was_never_final_is_no_damage(copied: Path):
    change_summary(copied, layout=whole_summary(copied)["layout"] | {"final_since": None})
    assert StoredRun(copied).summary["layout"]["final_since"] is None


def test_a_folder_without_a_summary_is_named(copied: Path):
    """And the folder below it that has one."""
    assert f"did you mean {copied}?" in told(lambda: StoredRun(copied.parent), copied.parent)
    (copied / "summary.json").unlink()
    assert "holds no summary.json" in told(lambda: StoredRun(copied), copied)


@pytest.mark.parametrize(
    ("versions", "by"),
    [({"rose2-logs": "0.1.0"}, "rose2-logs 0.1.0"), ({}, "another version"), ("damaged", "another version")],
)
def test_results_of_version_0_1_are_refused_with_the_remedy(copied: Path, versions: object, by: str):
    """They have no number of their format, nor walls and maps."""
    change_summary(copied, results_format=None, versions=versions, log="logs/office.mcap")
    with pytest.raises(ResultsError) as error:
        StoredRun(copied)
    line = str(error.value)
    assert line.startswith(f"{copied}: was written by {by}, whose results this version cannot read")
    assert "analyze the log again (logs/office.mcap) to another folder, or overwrite this one" in line
    assert "\n" not in line


def test_parameters_of_another_version_are_named(copied: Path):
    parameters = whole_summary(copied)["parameters"] | {"walls": {"of_old": 1}}
    change_summary(copied, parameters=parameters)
    assert "is of another version" in told(lambda: StoredRun(copied), copied / "summary.json")


def table_of(folder: Path, name: str) -> pa.Table:
    return pq.read_table(folder / f"{name}.parquet", partitioning=None)


def without(column: str) -> Callable[[pa.Table], pa.Table]:
    return lambda table: table.drop_columns([column])


def as_structure(column: str) -> Callable[[pa.Table], pa.Table]:
    def changed(table: pa.Table) -> pa.Table:
        place = table.schema.get_field_index(column)
        return table.set_column(place, column, pa.array([{"other": 1}] * table.num_rows))

    return changed


def renamed(column: str) -> Callable[[pa.Table], pa.Table]:
    return lambda table: table.rename_columns({column: f"{column}_"})


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize(
    ("change", "said"), [(without, "is missing"), (renamed, "is missing"), (as_structure, "is of type ")]
)
def test_columns_that_are_missing_or_of_another_type_are_named(
    copied: Path, name: str, change: Callable[[str], Callable[[pa.Table], pa.Table]], said: str
):
    """When the folder is opened, and when a table is read of a folder that changed since."""
    file = copied / f"{name}.parquet"
    whole, opened = table_of(copied, name), StoredRun(copied)
    for column in SCHEMAS[name].names:
        pq.write_table(change(column)(whole), file)
        for act in (lambda: StoredRun(copied), lambda: opened.table(name)):
            assert f"its column {column} {said}" in told(act, file)


@pytest.mark.parametrize("name", TABLES)
def test_values_that_are_missing_are_named(copied: Path, name: str):
    """Where the schema wants some in each row."""
    file, whole = copied / f"{name}.parquet", table_of(copied, name)
    for field in SCHEMAS[name]:
        if not field.nullable and whole.num_rows:
            nothing = pa.nulls(whole.num_rows, field.type)
            place = whole.schema.get_field_index(field.name)
            pq.write_table(whole.set_column(place, field.name, nothing), file)
            assert f"its column {field.name} lacks values" in told(
                lambda: StoredRun(copied).table(name), file
            )


@pytest.mark.parametrize("name", TABLES)
def test_files_that_are_gone_or_cut_are_named(copied: Path, name: str):
    """Whoever needs the table says so, and writes nothing."""
    file = copied / f"{name}.parquet"
    whole = file.read_bytes()
    for damage in (lambda: file.write_bytes(b"PAR1"), lambda: file.write_bytes(whole[:-20]), file.unlink):
        damage()
        line = told(lambda: StoredRun(copied), file)
        assert ("cannot be read" if file.is_file() else "there is no such file") in line
    out = copied.parent / "out"
    told(lambda: export_plan(copied, ["geojson", "map_server"], out), file)
    assert not out.exists()


def changed_maps(folder: Path, **values: object) -> None:
    """Change the row of every map."""
    table = table_of(folder, "maps")
    rows = [row | values for row in table.to_pylist()]
    pq.write_table(pa.Table.from_pylist(rows, table.schema), folder / "maps.parquet")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"cells_zstd": b""}, "it does not hold"),
        ({"cells_zstd": b"no frame"}, "cannot be read"),
        ({"labels_zstd": pack_image(np.zeros((3, 3), "<i4"))}, "it does not hold"),
        ({"labels_zstd": pack_image(np.zeros((900, 900), "<i4"))}, "it does not hold"),
        ({"first_row": -1}, "does not fit its grid"),
        ({"first_column": 2**31 - 1}, "does not fit its grid"),
        ({"rows": 100_000}, "does not fit its grid"),
        ({"snapshot": 7}, "holds no map 5"),
    ],
    ids=str,
)
def test_damaged_images_are_named(copied: Path, values: dict[str, object], said: str):
    changed_maps(copied, **values)
    assert said in told(lambda: StoredRun(copied).map(5), copied / "maps.parquet")
    told(lambda: export_plan(copied, ["geojson"], copied.parent / "out"), copied / "maps.parquet")
    assert not (copied.parent / "out").exists()


@pytest.mark.parametrize("shape", [b"", b"\x01", b"\x01\x03\x00\x00\x00\xff\xff\xff\xff"])
def test_damaged_shapes_are_named(copied: Path, shape: bytes):
    table = table_of(copied, "rooms")
    rows = [row | {"polygon_wkb": shape} for row in table.to_pylist()]
    pq.write_table(pa.Table.from_pylist(rows, table.schema), copied / "rooms.parquet")
    assert "polygon_wkb" in told(lambda: StoredRun(copied).plan(5), copied / "rooms.parquet")


def test_a_run_without_a_map_is_named(copied: Path):
    pq.write_table(table_of(copied, "snapshots").slice(0, 0), copied / "snapshots.parquet")
    assert "holds no map" in told(lambda: StoredRun(copied).choose(), copied / "snapshots.parquet")
