"""Names that logs give are text in all that is written: never markup, never a path, never a program."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import ezdxf
import pyarrow.parquet as pq
import pytest
import yaml
from faulty_logs import SEEN, START_NS, grid, room, write_mcap
from finished_runs import SAMPLE_LOGS
from mcap.reader import make_reader

from rose2_logs.errors import OutputError
from rose2_logs.outputs.exports.formats import FORMATS
from rose2_logs.outputs.report.page import write_report
from rose2_logs.runs.run import Run
from rose2_logs.workflows.analyze import NAMELESS, RunOptions, analyze_log, log_stem
from rose2_logs.workflows.figure import export_plan, write_figure

MAPS = 2
HARMLESS = "map"
NAMES = {
    "a script": "<script>alert(1)</script>",
    "an attribute": '" onload="alert(1)" x=\'',
    "the end of CDATA": "]]><b>&amp;&#x41;<!--",
    "a folder above": "../../../../etc/passwd",
    "a place": "/etc/passwd",
    "an address": "javascript:alert(1)",
    "a template": "{{ 7 * 7 }}{% raw %}${7}",
    "an object of YAML": "!!python/object/apply:os.system [true]\n- &a *a",
    "markup of a terminal": "[bold]\x1b[2J\x07\r\n[/bold]",
    "characters that XML cannot hold": "a\x01\x0b\ufffe\ud7ff\x85\u2028\u202e",
    "a picture in Markdown": "![x](//tracker/x.png) `a` | b",
    "what ends a line of DXF": "a\n0\nEOF\n%%d\\P{\\H9;}^J",
    "a long one": "x" * 1000,
    "nothing": "",
}
LONGEST = 120


class Tags(HTMLParser):
    """What a browser takes a page for: tags with the names of their attributes, and its text."""

    def __init__(self, page: Path) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, tuple[str, ...]]] = []
        self.addresses: list[str] = []
        self.text = ""
        self.feed(page.read_text(encoding="utf-8"))
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, tuple(name for name, _ in attrs)))
        self.addresses += [value for name, value in attrs if name in ("href", "src", "action", "data")]

    def handle_data(self, data):
        self.text += data


def elements(picture: Path) -> list[tuple[str, tuple[str, ...]]]:
    return [(each.tag, tuple(sorted(each.attrib))) for each in ET.parse(picture).iter()]


def made_of(name: str, folder: Path) -> Path:
    """Analyze a log whose topic, frame, file and results are called so; return the folder of results."""
    file_name = name.replace("/", "\u2215").replace("\0", "") or HARMLESS
    file_name = file_name.encode()[:LONGEST].decode(errors="ignore")
    logged = [(f"/{name}", START_NS + k * 10**9, grid(room(SEEN[k + 2], k), frame=name)) for k in range(MAPS)]
    log = write_mcap(folder / f"{file_name}.mcap", logged)
    out = folder / "some" / "where" / file_name
    return analyze_log(log, out, RunOptions(topic=f"/{name}", recording=False, bag=True)).folder


@pytest.fixture(scope="module")
def harmless(tmp_path_factory) -> Path:
    folder = made_of(HARMLESS, tmp_path_factory.mktemp("harmless"))
    write_report(folder)
    write_figure(folder, folder / "figure.svg")
    return folder


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_a_name_is_text_in_all_that_is_written(name: str, harmless: Path, tmp_path: Path):
    """Every file is read back as programs do and holds what it holds for a harmless name, and the name."""
    folder = made_of(name, tmp_path)
    page = write_report(folder)
    figure = write_figure(folder, folder / "figure.svg")
    exports = {path.name.removeprefix(folder.name): path for path in export_plan(folder, list(FORMATS))}

    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["topic"] == f"/{name}"
    frames = pq.read_table(folder / "snapshots.parquet")["frame_id"].to_pylist()
    assert frames == [name] * MAPS

    told, wanted = Tags(page), Tags(harmless / "report.html")
    assert told.tags == wanted.tags
    assert all(
        address.startswith(("#", "data:")) or (folder / unquote(address)).is_file()
        for address in told.addresses
    )
    assert " ".join(f"/{name} in frame {name}".split()) in " ".join(told.text.split())
    assert elements(figure) == elements(harmless / "figure.svg")

    assert ET.parse(exports[".floor_plan.svg"]).getroot().tag.endswith("svg")
    assert json.loads(exports[".floor_plan.geojson"].read_text("utf-8"))["map_frame"]["frame_id"] == name
    assert json.loads(exports[".graph.json"].read_text("utf-8"))["nodes"]
    document = ezdxf.readfile(exports[".floor_plan.dxf"])
    assert not document.audit().errors
    about = yaml.safe_load(exports[".rooms.yaml"].read_text("utf-8"))
    assert folder / about["image"] == exports[".rooms.pgm"]
    assert yaml.safe_load(exports[".rooms.list.yaml"].read_text("utf-8"))["frame_id"] == name

    (layout,), (rviz,) = folder.glob("*.foxglove.json"), folder.glob("*.rviz")
    panel = json.loads(layout.read_text("utf-8"))["configById"]["3D!rooms"]
    assert panel["followTf"] == name
    assert f"/{name}" in panel["topics"]
    shown = yaml.safe_load(rviz.read_text("utf-8"))["Visualization Manager"]
    assert shown["Global Options"]["Fixed Frame"] == name
    assert shown["Displays"][0]["Topic"]["Value"] == f"/{name}"
    (copy,) = folder.glob("*.rose2.mcap")
    bag = yaml.safe_load((folder / "metadata.yaml").read_text("utf-8"))["rosbag2_bagfile_information"]
    assert bag["relative_file_paths"] == [copy.name]
    with copy.open("rb") as file:
        assert f"/{name}" in {channel.topic for channel in make_reader(file).get_summary().channels.values()}

    inside = {tmp_path / "some", tmp_path / "some" / "where", folder, *folder.iterdir()}
    assert set(tmp_path.rglob("*")) - inside == set(tmp_path.glob("*.mcap"))


@pytest.mark.parametrize("name", ["..mcap", "...mcap", "....bag", ".mcap"])
def test_a_log_called_dots_has_results_of_its_own(name: str, tmp_path: Path):
    """Not in the folder above, as its name says."""
    log = tmp_path / "logs" / name
    log.parent.mkdir()
    write_mcap(log, [("/map", START_NS, grid(room(90)))])
    assert log_stem(log) == NAMELESS


def test_a_log_whose_name_looks_like_a_pattern_keeps_it(tmp_path: Path):
    log = write_mcap(tmp_path / "run[1].mcap", [("/map", START_NS, grid(room(90)))])
    assert log_stem(log) == "run[1]"
    assert log_stem(tmp_path / "run?.mcap") == tmp_path.name


@pytest.mark.skipif(sys.platform in ("darwin", "win32"), reason="its file systems know Unicode only")
def test_a_name_that_is_not_utf8_is_refused_in_one_line(tmp_path: Path):
    """Before anything is made: nothing that is written could hold it."""
    log = Path(os.fsdecode(os.fsencode(tmp_path) + b"/run\xff.mcap"))
    write_mcap(log, [("/map", START_NS, grid(room(90)))])
    with pytest.raises(OutputError, match=r"is not valid UTF-8.*rename it"):
        analyze_log(log, tmp_path / "out", RunOptions())
    plain = log.rename(tmp_path / "run.mcap")
    with pytest.raises(OutputError, match=r"is not valid UTF-8.*rename it"):
        analyze_log(plain, log.with_suffix(""), RunOptions())
    assert list(tmp_path.iterdir()) == [plain]
    with pytest.raises(OutputError, match=r"is not valid UTF-8.*rename it"):
        Run(log.with_suffix(""))


def test_a_name_too_long_for_its_results_is_told_and_leaves_nothing(tmp_path: Path):
    """The file system takes the log's name, but not that of its results."""
    log = write_mcap(tmp_path / f"{'x' * 245}.mcap", [("/map", START_NS, grid(room(90)))])
    with pytest.raises(OutputError, match=r"longer than 246 bytes; give the log a shorter name"):
        analyze_log(log, tmp_path / "out", RunOptions())
    assert list(tmp_path.iterdir()) == [log]


@pytest.mark.skipif(sys.platform in ("darwin", "win32"), reason="its file systems know Unicode only")
def test_a_batch_goes_on_beside_a_log_whose_name_is_not_utf8(tmp_path: Path):
    """It is one failed log with a line that shows its name; run again, the others stand as they are."""
    logs, out = tmp_path / "logs", tmp_path / "out"
    logs.mkdir()
    write_mcap(logs / "good.mcap", [("/map", START_NS, grid(room(90)))])
    write_mcap(Path(os.fsdecode(os.fsencode(logs) + b"/caf\xe9.mcap")), [("/map", START_NS, grid(room(90)))])
    command = [
        sys.executable,
        "-m",
        "rose2_logs",
        "batch",
        str(logs),
        "-o",
        str(out),
        "--no-rrd",
        "--no-mcap",
    ]
    for good in ("done", "up to date"):
        ran = subprocess.run(command, capture_output=True, text=True, check=False)
        errors = [line for line in ran.stderr.splitlines() if line.startswith("error:")]
        assert ran.returncode == 2
        assert len(errors) == 1
        assert r"caf\xe9.mcap: its name is not valid UTF-8" in errors[0]
        assert f"1 {good}, 1 failed" in ran.stdout
        with (out / "summary.csv").open(encoding="utf-8", newline="") as file:
            rows = {row["log"]: row for row in csv.DictReader(file)}
        assert rows["good"]["status"] == "done"
        assert rows["caf"]["source"].endswith(r"caf\xe9.mcap")
    assert sorted(folder.name for folder in (out / "logs").iterdir()) == ["good"]


@pytest.mark.skipif(sys.platform in ("darwin", "win32"), reason="its file systems know Unicode only")
def test_a_file_in_a_bag_whose_name_is_not_utf8_is_no_trouble(tmp_path: Path):
    """It only stands in the list of the log's files."""
    bag = tmp_path / "bag"
    shutil.copytree(SAMPLE_LOGS / "ring", bag)
    Path(os.fsdecode(os.fsencode(bag) + b"/caf\xe9.txt")).write_text("")
    out = tmp_path / "out"
    options = RunOptions(max_snapshots=1, recording=False, annotated_log=False)
    analyze_log(bag, out, options)
    names = [file["name"] for file in json.loads((out / "summary.json").read_text())["input"]["files"]]
    assert r"caf\xe9.txt" in names
