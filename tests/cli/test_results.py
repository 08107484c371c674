"""report, figure and export from the command line."""

from __future__ import annotations

import json
import re
import shutil
import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from PIL import Image
from saved_maps import save_map, two_rooms

import rose2_logs as rl


def test_report_writes_a_page(cli, office_results: Path, tmp_path: Path):
    code, out, _ = cli("report", office_results, "-o", tmp_path / "page.html", "--panels", 2)
    assert (code, str(tmp_path / "page.html") in out.replace("\n", "")) == (0, True)
    assert (tmp_path / "page.html").read_text().startswith("<!DOCTYPE html>")


def test_figures_are_png_and_svg(cli, office_results: Path, tmp_path: Path):
    """Of any map; a PNG as wide as asked for."""
    png, svg = tmp_path / "half.png", tmp_path / "two.svg"
    assert cli("figure", office_results, "--coverage", 0.5, "-o", png, "--width", 640)[0] == 0
    assert cli("figure", office_results, "--snapshot", 2, "-o", svg)[0] == 0
    with Image.open(png) as image:
        assert (image.format, image.size[0]) == ("PNG", 640)
    assert "snapshot 2" in ET.parse(svg).getroot().get("aria-label")


def test_exports_name_the_map_unless_it_is_the_last(cli, office_results: Path, tmp_path: Path):
    assert cli("export", office_results, "-f", "dxf", "-f", "map_server", "-o", tmp_path)[0] == 0
    assert cli("export", office_results, "--format", "graph", "--snapshot", 1, "-o", tmp_path)[0] == 0
    assert {file.name for file in tmp_path.iterdir()} == {
        "office.floor_plan.dxf",
        "office.rooms.pgm",
        "office.rooms.yaml",
        "office.rooms.list.yaml",
        "office.rooms.labels.png",
        "office.snapshot1.graph.json",
    }


def test_segment_writes_the_same_formats(cli, tmp_path: Path):
    path = save_map(tmp_path, "flat", two_rooms())
    formats = [
        word for name in ("dxf", "svg", "graph", "map_server", "geojson") for word in ("--format", name)
    ]
    assert cli("segment", path, "-o", tmp_path / "out", *formats)[0] == 0
    endings = {file.name.removeprefix("flat.") for file in (tmp_path / "out").iterdir()}
    assert endings >= {"floor_plan.dxf", "floor_plan.svg", "graph.json", "rooms.pgm", "floor_plan.geojson"}


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["report", "nowhere"], "nowhere"),
        (["figure", "RESULTS", "-o", "x.pdf"], "x.pdf"),
        (["figure", "RESULTS", "--snapshot", "99"], "snapshot 99"),
        (["figure", "RESULTS", "--coverage", "50"], "half is 0.5"),
        (["figure", "RESULTS", "--coverage", "0.5", "--last"], "exclude each other"),
        (["export", "RESULTS", "--format", "pdf"], "choose one of geojson"),
        (["export", "nowhere", "--format", "dxf"], "nowhere"),
    ],
)
def test_what_cannot_be_done_is_one_line(cli, office_results: Path, arguments: list[str], told: str):
    arguments = [str(office_results) if word == "RESULTS" else word for word in arguments]
    code, out, err = cli(*arguments)
    assert (code, out) == (2, "")
    assert told in err
    assert err.startswith("error:")
    assert err.count("\n") == 1


def test_nothing_is_replaced_unasked(cli, office_results: Path, tmp_path: Path):
    for verb, options, name in (
        ("report", ["--panels", 1], "page.html"),
        ("figure", [], "page.png"),
        ("export", ["-f", "graph"], "plans"),
    ):
        arguments = [verb, office_results, *options, "-o", tmp_path / name]
        assert cli(*arguments)[0] == 0
        code, _, err = cli(*arguments)
        assert (code, "--overwrite" in err) == (2, True)
        assert cli(*arguments, "--overwrite")[0] == 0


def _without_key(folder: Path) -> str:
    path = folder / "summary.json"
    summary = json.loads(path.read_text())
    del summary["results"]["coverage_last"]
    path.write_text(json.dumps(summary))
    return "its results.coverage_last is missing"


def _without_file(folder: Path) -> str:
    (folder / "lines.parquet").unlink()
    return "lines.parquet: there is no such file"


def _of_another_type(folder: Path) -> str:
    path = folder / "events.parquet"
    table = pq.read_table(path, partitioning=None)
    place = table.schema.get_field_index("track")
    pq.write_table(table.set_column(place, "track", table["track"].cast("string")), path)
    return "events.parquet: its column track is of type string, not int32"


def _of_one_row(name: str, folder: Path) -> str:
    path = folder / f"{name}.parquet"
    table = pq.read_table(path, partitioning=None)
    pq.write_table(table.slice(0, 1), path)
    return f"{name}.parquet: holds 1 row, not {len(table)} as summary.json says"


@pytest.mark.parametrize(
    "damage",
    [
        _without_key,
        _without_file,
        _of_another_type,
        *(partial(_of_one_row, name) for name in ("snapshots", "maps", "tracks", "events")),
    ],
)
def test_every_command_names_what_damaged_results_lack(cli, office_results: Path, tmp_path: Path, damage):
    """Whether it needs it or not: a folder is checked as a whole when it is opened. Nothing is written."""
    folder = shutil.copytree(office_results, tmp_path / "damaged")
    lack = damage(folder)
    before = sorted(path.name for path in folder.iterdir())
    for command in (
        ("report", folder), ("figure", folder), ("export", folder, "--format", "geojson"),
        ("compare", office_results, folder, "-o", tmp_path / "compared"),
        ("compare", folder, office_results, "-o", tmp_path / "compared"),
    ):  # fmt: skip
        code, _, err = cli(*command)
        assert (code, lack in err, len(err.splitlines())) == (2, True, 1), (command, err)
    with pytest.raises(rl.ResultsError, match=re.escape(lack)):
        rl.load(folder)
    assert sorted(path.name for path in folder.iterdir()) == before
    assert not (tmp_path / "compared").exists()
