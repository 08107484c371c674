"""The command line as a user meets it: every verb on real files, and one line for every known error."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from finished_runs import SAMPLE_LOGS
from PIL import Image
from saved_maps import RESOLUTION_M, save_map, save_run, two_rooms

from rose2_logs import __version__
from rose2_logs.drawing.image_files import write_label_image

VERBS = (
    "info", "analyze", "batch", "view", "serve",
    "report", "figure", "export", "compare", "segment", "evaluate",
)  # fmt: skip


@pytest.fixture
def maps(tmp_path: Path) -> Path:
    return save_run(tmp_path / "maps")


def analyze(cli, *arguments: object) -> tuple[int, str, str]:
    return cli("analyze", *arguments, "--no-rrd", "--no-mcap")


@pytest.mark.parametrize("verb", VERBS)
def test_help_shows_an_example(cli, verb: str):
    """Each verb's --help can be copied from."""
    code, out, _ = cli(verb, "--help")
    assert code == 0
    assert f"rose2-logs {verb}" in out.split("Example:")[1]


def test_the_module_runs_and_help_is_fast():
    """`python -m rose2_logs` is the command; help imports nothing heavy."""
    heavy = ("numpy", "cv2", "sklearn", "pyarrow", "rerun", "rosbags", "shapely")
    program = (
        "import sys, runpy; sys.argv = ['rose2-logs', 'analyze', '--help']\n"
        "try: runpy.run_module('rose2_logs', run_name='__main__')\n"
        f"except SystemExit: print('HEAVY', [name for name in {heavy!r} if name in sys.modules])"
    )
    start = time.process_time()
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "HEAVY []" in done.stdout
    assert time.process_time() - start < 1


def test_version(cli):
    """The version is that of the package."""
    assert cli("--version")[:2] == (0, f"rose2-logs {__version__}\n")


def test_info_shows_topics_and_maps(cli, maps: Path):
    """Sizes, resolution and where coverage starts; the same as JSON."""
    code, out, _ = cli("info", maps)
    assert code == 0
    assert "240 x 120 cells of 0.05 m" in out
    code, out, _ = cli("info", maps, "--json")
    facts = json.loads(out)
    assert facts["maps"][0]["last"]["shape"] == [120, 240]
    assert 0.4 < facts["maps"][0]["coverage_first"] < 0.6


def test_a_name_is_shown_as_it_is_in_one_line(cli, maps: Path, tmp_path: Path):
    """Without what would steer a terminal, and with no pictures in place of words between colons."""
    log = tmp_path / "run:dog:\x1b[2J\n2"
    shutil.copytree(maps, log)
    code, out, _ = cli("info", log)
    assert (code, out.splitlines()[0]) == (0, f"{tmp_path}/run:dog:\ufffd[2J 2")
    _, out, _ = cli("analyze", log, "-o", tmp_path / "out", "--no-rrd", "--no-mcap")
    assert f"results in {tmp_path}/out/run:dog:\ufffd[2J 2\n" in out


def test_analyze_writes_a_folder_named_after_the_log(cli, maps: Path, tmp_path: Path):
    """It ends with a short table and the place of the results."""
    code, out, _ = analyze(cli, maps, "-o", tmp_path / "out", "--set", "tracking.match_min_iou=0.3")
    assert code == 0
    assert "results in" in out
    assert "2 (2 over the run)" in out
    summary = json.loads((tmp_path / "out" / "maps" / "summary.json").read_text())
    assert summary["parameters"]["tracking"]["match_min_iou"] == 0.3


def test_a_layout_may_be_final_before_the_last_of_maps_without_times(cli, tmp_path: Path):
    """All maps of a folder of saved ones have the same time."""
    save_run(tmp_path / "maps", (115, 200, 210, 219))
    code, out, _ = cli("analyze", tmp_path / "maps", "-o", tmp_path / "out", "--no-rrd", "--no-mcap")
    assert code == 0
    assert re.search(r"layout final +from 9\d\.\d% coverage on", out)


def test_detail_gives_more_or_fewer_rooms(cli, tmp_path: Path):
    """The option is the parameter, and wins over it."""
    log = SAMPLE_LOGS / "office.mcap"
    rooms = {}
    for detail in ("-20", "0", "20"):
        options = ("--max-snapshots", 1, "--no-rrd", "--no-mcap", "--set", "regions.detail=3")
        code, _, _ = cli("analyze", log, "-o", tmp_path / detail, "--detail", detail, *options)
        assert code == 0
        summary = json.loads((tmp_path / detail / "office" / "summary.json").read_text())
        assert summary["parameters"]["regions"]["detail"] == float(detail)
        rooms[detail] = summary["results"]["rooms_last"]
    assert rooms["-20"] < rooms["0"] < rooms["20"]


def test_a_detail_that_the_method_does_not_have_is_refused(cli, maps: Path, tmp_path: Path):
    code, _, err = cli("analyze", maps, "-o", tmp_path, "--detail", 1, "--method", "voronoi")
    assert code == 2
    assert "--detail" in err
    assert len(err.splitlines()) == 1


def test_what_was_left_out_as_outside_is_told_once(cli, maps: Path, tmp_path: Path):
    """With the remedy; here all of every map is taken to be outside."""
    outside = ("--set", "regions.room_min_log_odds=20", "--set", "regions.outside_max_share=1")
    code, _, err = cli("analyze", maps, "-o", tmp_path / "out", "--no-rrd", "--no-mcap", *outside)
    assert code == 0
    assert err.count("outside the building") == 1
    assert "regions.outside_max_share=0" in err
    summary = json.loads((tmp_path / "out" / "maps" / "summary.json").read_text())
    free_m2 = pq.read_table(tmp_path / "out" / "maps" / "snapshots.parquet")["free_area_m2"].to_pylist()[-1]
    assert summary["results"]["outside_m2_last"] == pytest.approx(free_m2)
    assert summary["warnings"]["count"] == 1


def test_analyze_goes_on_after_a_bad_log_and_ends_non_zero(cli, maps: Path, tmp_path: Path):
    """One line names the bad log; the good one after it is done."""
    (tmp_path / "bad.mcap").write_bytes(b"\x89MCAP0\r\n")
    code, _, err = analyze(cli, tmp_path / "bad.mcap", maps, "-o", tmp_path / "out")
    assert code == 2
    errors = [line for line in err.splitlines() if "error:" in line]
    assert len(errors) == 1
    assert "bad.mcap" in errors[0]
    assert (tmp_path / "out" / "maps" / "summary.json").exists()
    assert not (tmp_path / "out" / "bad").exists()


def test_time_options_are_seconds_into_the_log(cli, maps: Path, tmp_path: Path):
    """--start 1 leaves out the first of three maps, which are a second apart."""
    assert analyze(cli, maps, "-o", tmp_path / "out", "--start", "1", "--end", "1.5")[0] == 0
    summary = json.loads((tmp_path / "out" / "maps" / "summary.json").read_text())
    assert summary["results"]["snapshots"] == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["info", "nowhere.mcap"], "nowhere.mcap"),
        (["analyze", "nowhere.mcap", "-o", "out"], "nowhere.mcap"),
        (["analyze", "x.bag", "-o", "out", "--set", "walls.nothing=1"], "walls.nothing"),
        (["analyze", "x.bag", "-o", "out", "--set", "walls.cluster_gap_m=wide"], "of type float, not 'wide'"),
        (["analyze", "x.bag", "-o", "out", "--set", "walls.extension_m=4,5"], "its value is a number as 4.5"),
        (["analyze", "x.bag", "-o", "out", "--config", "no.toml"], "no.toml: cannot be read: No such file"),
        (["analyze", "x.bag", "-o", "out", "--set", "walls.cluster_gap_m"], "write it as block.name=value"),
        (["analyze", "x.bag", "-o", "out", "--set", "floor_plan.grouping=x"], "it must be one of"),
        (["analyze", "x.bag", "-o", "out", "--set", "floor_plan.grouping=dbscan"], "x.bag"),
        (
            ["analyze", SAMPLE_LOGS / "office.mcap", "-o", "out", "--start", "nan"],
            "--start nan: it must be a number",
        ),
        (["segment", SAMPLE_LOGS / "office.mcap", "-o", "out"], "is a log, not a saved map"),
        (["analyze", "x.bag", "-o", "out", "--method", "magic"], "--method 'magic': it must be one of rose2"),
        (["analyze", "a/x.bag", "b/x.mcap", "-o", "out"], "several logs are named x"),
        (["batch", "nowhere*.mcap", "-o", "out"], "nowhere*.mcap: no log there"),
        (
            ["batch", "x.bag", "-o", "http://bucket/out"],
            "http://bucket/out: results go to a folder or to an object store",
        ),
        (["batch", "x.bag", "-o", "s3://"], "s3://: names no place; write s3://BUCKET/FOLDER"),
        (["batch", "gs://", "-o", "out"], "gs://: names no place"),
        (["analyze", "x.bag", "-o", "s3://bucket/out"], "s3://bucket/out: is a URL, where a local path"),
        (["analyze", "s3://bucket/x.bag", "-o", "out"], "s3://bucket/x.bag: is a URL"),
        (["info", "s3://bucket/x.bag"], "s3://bucket/x.bag: is a URL"),
        (["figure", "out", "-o", "s3://"], "s3://: is a URL"),
        (
            ["batch", "x.bag", "-o", "out", "--scheduler", "a:1", "--workers", "2"],
            "--workers 2 is for this machine",
        ),
        (["analyze", "x.bag", "-o", "out", "--layers", "walls"], "--layers 'walls': there is no such"),
        (
            ["analyze", "x.bag", "-o", "out", "--bag", "--no-mcap"],
            "annotated MCAP, which --no-mcap leaves out",
        ),
        (["view", "nowhere.rrd"], "nowhere.rrd"),
        (["view", "."], "holds no recording"),
        (["view", SAMPLE_LOGS / "office.mcap"], "office.mcap: is no recording of Rerun"),
        (["analyze", "x.bag", "-o", "out", "--set", "walls=6"], "which of its parameters?"),
        (["serve", "nowhere"], "nowhere: holds no recording"),
        (["evaluate", "nowhere.json"], "nowhere.json"),
        (["segment", "nowhere.png", "-o", "out"], "nowhere.png"),
    ],
)
def test_known_errors_are_one_line_and_exit_code_2(cli, arguments: list[str], message: str):
    """On stderr, naming what is wrong; nothing on stdout."""
    code, out, err = cli(*arguments)
    assert code == 2
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert err.startswith("error: ")
    assert message in err


def test_debug_shows_the_traceback(cli):
    """Before the line."""
    _, _, err = cli("info", "nowhere.mcap", "--debug")
    assert "Traceback" in err
    assert err.strip().splitlines()[-1].startswith("error: ")


def test_segment_writes_labels_plan_and_picture(cli, tmp_path: Path):
    """The label image has the map's size and orientation; the plan lies at the map's origin, in meters."""
    path = save_map(tmp_path, "flat", two_rooms())
    code, out, _ = cli("segment", path, "-o", tmp_path / "out")
    assert code == 0
    assert "results in" in out
    with Image.open(tmp_path / "out" / "flat.labels.png") as image:
        labels = np.asarray(image)
    assert labels.shape == two_rooms().shape
    assert set(np.unique(labels[30:90, 20:100])) == {labels[60, 50]} != {0}
    plan = json.loads((tmp_path / "out" / "flat.floor_plan.geojson").read_text())
    rooms = [feature for feature in plan["features"] if feature["properties"]["kind"] == "room"]
    assert len(rooms) == 2
    corners = np.array([point for room in rooms for point in room["geometry"]["coordinates"][0]])
    assert corners.min(0) == pytest.approx([1 + 0.5, 2 + 0.4], abs=0.3)
    assert corners.max(0) == pytest.approx([1 + 11.2, 2 + 5.6], abs=0.3)
    with Image.open(tmp_path / "out" / "flat.rooms.png") as image:
        picture = np.asarray(image)
    # A wide map: the plain one above, gray; the rooms below, in two colors.
    above, below = picture[: len(picture) // 2 - 10], picture[len(picture) // 2 + 10 :]
    assert np.ptp(above.astype(int), axis=2).max() == 0
    height, width = below.shape[:2]
    left, right = below[height // 4, width // 4].astype(int), below[height // 4, 3 * width // 4].astype(int)
    assert np.ptp(left) > 20
    assert np.ptp(right) > 20
    assert np.abs(left - right).max() > 20


def test_segment_needs_the_resolution_of_a_bare_image(cli, tmp_path: Path):
    """Without a .yaml the option is asked for, and then enough."""
    Image.fromarray(two_rooms()).save(tmp_path / "bare.png")
    code, _, err = cli("segment", tmp_path / "bare.png", "-o", tmp_path / "out")
    assert (code, "--resolution" in err) == (2, True)
    assert cli("segment", tmp_path / "bare.png", "-o", tmp_path / "out", "--resolution", RESOLUTION_M)[0] == 0
    assert (tmp_path / "out" / "bare.labels.png").exists()


@pytest.mark.parametrize("ending", [".png", ".pgm", ".bmp", ".tif", ".TIFF"])
def test_segment_reads_images_that_keep_grays(cli, tmp_path: Path, ending: str):
    Image.fromarray(two_rooms()).save(tmp_path / f"bare{ending}")
    given = ("segment", tmp_path / f"bare{ending}", "-o", tmp_path / "out")
    assert cli(*given, "--resolution", RESOLUTION_M)[0] == 0
    with Image.open(tmp_path / "out" / "bare.labels.png") as labels:
        assert np.asarray(labels).max() == 2
    (tmp_path / "bare.yml").write_text(f"image: bare{ending}\nresolution: 0.05\norigin: [0, 0, 0]\n")
    assert cli(*given, "--overwrite")[0] == 0
    code, _, err = cli(*given, "--overwrite", "--resolution", RESOLUTION_M)
    assert (code, "its .yaml gives the resolution; leave out --resolution 0.05" in err) == (2, True)


def test_segment_says_of_other_files_what_they_are(cli, tmp_path: Path):
    """With a resolution and without: neither answer leads to the other one."""
    shutil.copy(SAMPLE_LOGS / "office.mcap", tmp_path / "office.mcap")
    Image.fromarray(two_rooms()).save(tmp_path / "map.jpg")
    (tmp_path / "map.txt").write_text("no map")
    for name, told in {
        "office.mcap": "is a log, not a saved map",
        "map.jpg": "does not keep the grays of a map exactly; save the map as .png",
        "map.txt": "is not a supported kind of log",
    }.items():
        for more in ((), ("--resolution", 0.05)):
            code, _, err = cli("segment", tmp_path / name, "-o", tmp_path / "out", *more)
            assert (code, told in err) == (2, True), err
        if name == "office.mcap":
            assert "and tells its resolution itself" in err


def test_segment_does_not_replace_unasked(cli, tmp_path: Path):
    """A second run needs --overwrite."""
    path = save_map(tmp_path, "flat", two_rooms())
    assert cli("segment", path, "-o", tmp_path)[0] == 0
    code, _, err = cli("segment", path, "-o", tmp_path)
    assert (code, "--overwrite" in err) == (2, True)
    assert cli("segment", path, "-o", tmp_path, "--overwrite")[0] == 0


@pytest.fixture
def cases(tmp_path: Path) -> Path:
    """Two maps of a run through two drawn rooms, with their true rooms."""
    listed = []
    for name, seen in (("half", 180), ("flat", 240)):
        save_map(tmp_path, name, two_rooms(seen))
        truth = np.where(two_rooms(seen) == 254, 1 + (np.arange(240) >= 117)[None, :], 0)
        write_label_image(tmp_path / f"{name}.rooms.png", truth)
        files = {"map": f"{name}.png", "rooms": f"{name}.rooms.png"}
        listed.append({"group": "drawn", "name": name, "resolution_m": RESOLUTION_M} | files)
    path = tmp_path / "cases.json"
    path.write_text(json.dumps({"cases": listed}))
    return path


def test_evaluate_writes_predictions_and_figures(cli, cases: Path, tmp_path: Path):
    """Two drawn rooms are found as they are; JSON and label images are where they were asked for."""
    code, out, _ = cli(
        "evaluate", cases, "--predictions", tmp_path / "p", "--json", tmp_path / "f.json", "--method", "rose2"
    )
    assert code == 0
    assert "drawn" in out
    figures = json.loads((tmp_path / "f.json").read_text())
    assert figures["groups"]["drawn"]["iou_sym"] > 90
    assert [row["rooms_seg"] for row in figures["maps"]] == [2, 2]
    assert "along" not in figures
    with Image.open(tmp_path / "p" / "drawn" / "flat.png") as image:
        assert image.size == (240, 120)


def test_evaluate_draws_each_case_and_a_sheet(cli, cases: Path, tmp_path: Path):
    """A picture for each map and a contact sheet of the group."""
    assert cli("evaluate", cases, "--pictures", tmp_path / "p")[0] == 0
    names = sorted(path.relative_to(tmp_path / "p").as_posix() for path in (tmp_path / "p").rglob("*.png"))
    assert names == ["drawn.sheet_1.png", "drawn/flat.png", "drawn/half.png"]


def test_evaluate_does_not_replace_unasked(cli, cases: Path, tmp_path: Path):
    """Neither label images nor figures nor pictures, sheets and curves; another run needs --overwrite."""
    for written in (
        ("--predictions", tmp_path / "p"),
        ("--json", tmp_path / "f.json"),
        ("--pictures", tmp_path / "q", "--along"),
    ):
        given = ("evaluate", cases, "--method", "distance", *written)
        assert cli(*given)[0] == 0
        kept = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.*")}
        code, _, err = cli(*given)
        assert (code, "already exists" in err, "(--overwrite)" in err) == (2, True, True)
        assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.*")} == kept
        assert cli(*given, "--overwrite")[0] == 0
    for drawn in (tmp_path / "q" / "drawn").iterdir():
        drawn.unlink()
    for left in ("drawn.sheet_1.png", "drawn.along.png"):
        code, _, err = cli(*given)
        assert (code, f"{left}: already exists" in err) == (2, True)
        (tmp_path / "q" / left).unlink()
    assert cli(*given)[0] == 0


def test_evaluate_never_writes_over_what_it_reads(cli, cases: Path, tmp_path: Path):
    """Not even where files may be replaced, nor through a link, nor what only cases of other groups read."""
    (tmp_path / "drawn").mkdir()
    listed = json.loads(cases.read_text())["cases"]
    (tmp_path / "half.rooms.png").rename(tmp_path / "drawn" / "half.png")
    listed[0] |= {"rooms": "drawn/half.png", "group": "other"}
    listed[1] |= {"name": "half"}
    cases.write_text(json.dumps({"cases": listed}))
    (tmp_path / "link").symlink_to(tmp_path)
    held = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}
    for where in (
        ("--predictions", tmp_path),
        ("--pictures", tmp_path / "link"),
        ("--json", cases),
        ("--json", tmp_path / "link" / "half.png"),
    ):
        code, _, err = cli("evaluate", cases, *where, "--group", "drawn", "--overwrite")
        assert (code, "the evaluation reads this file; write its results to another place" in err) == (
            2,
            True,
        ), err
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == held


def test_evaluate_writes_no_file_twice(cli, cases: Path, tmp_path: Path):
    out = tmp_path / "out"
    for second in (("--pictures", out), ("--json", out / "drawn" / "flat.png")):
        code, _, err = cli("evaluate", cases, "--predictions", out, *second)
        assert (code, "two results would be this file" in err) == (2, True)
    assert not out.exists()


def test_evaluate_along_a_run(cli, cases: Path, tmp_path: Path):
    """Coverage of each map in the table and the JSON, and the curve beside the pictures."""
    code, out, _ = cli(
        "evaluate",
        cases,
        "--group",
        "drawn",
        "--along",
        "--json",
        tmp_path / "f.json",
        "--pictures",
        tmp_path,
    )
    assert code == 0
    assert "100.0%" in out
    assert "IDF1" in out
    figures = json.loads((tmp_path / "f.json").read_text())
    assert figures["tracks"]["drawn"]["found"]["idf1"] == 100
    assert figures["tracks"]["drawn"]["true_rooms"]["true_tracks"] == 2
    along = figures["along"]["drawn"]
    assert [point["name"] for point in along] == ["half", "flat"]
    assert 0.6 < along[0]["coverage"] < 0.9
    assert along[1]["coverage"] == 1.0
    assert (tmp_path / "drawn.along.png").exists()


def test_evaluate_names_the_truth_that_counts(cli, cases: Path, tmp_path: Path):
    """A column of every table and a key of every row; no column where no case has two truths."""
    assert "truth" not in cli("evaluate", cases)[1]
    listed = json.loads(cases.read_text())["cases"]
    write_label_image(tmp_path / "one.png", (two_rooms() == 254).astype(int))
    listed[1] |= {"rooms": "one.png", "rooms_other": listed[1]["rooms"]}
    cases.write_text(json.dumps({"cases": listed}))
    code, out, _ = cli("evaluate", cases, "--json", tmp_path / "f.json")
    assert code == 0
    assert "truth" in out
    lines = {line.split()[0]: line.rstrip() for line in out.splitlines() if line.strip()}
    assert lines["half"].endswith(" rooms")
    assert lines["flat"].endswith(" rooms_other")
    assert [row["truth"] for row in json.loads((tmp_path / "f.json").read_text())["maps"]] == [
        "rooms",
        "rooms_other",
    ]
    code, out, _ = cli("evaluate", cases, "--along", "--json", tmp_path / "f.json", "--overwrite")
    assert (code, out.count(" truth")) == (0, 2)
    figures = json.loads((tmp_path / "f.json").read_text())
    assert [point["truth"] for point in figures["along"]["drawn"]] == ["rooms", "rooms_other"]
    assert figures["tracks"]["drawn"]["truth"] == "rooms_other"
    assert figures["tracks"]["drawn"]["found"]["idf1"] == 100


def test_evaluate_says_what_is_wrong_with_a_second_truth(cli, cases: Path, tmp_path: Path):
    """A file that is missing is one line."""
    listed = json.loads(cases.read_text())["cases"]
    listed[1]["rooms_other"] = "none.png"
    cases.write_text(json.dumps({"cases": listed}))
    code, _, err = cli("evaluate", cases)
    assert (code, err.strip().count("\n")) == (2, 0)
    assert "none.png: cannot be read as an image" in err


def test_info_takes_the_parameters_that_its_messages_name(cli, tmp_path: Path):
    """A map that is larger than the limit is told with it; the limit can be set as for the other commands."""
    tight = ["--set", "reading.map_max_cells=100000"]
    code, out, _ = cli("info", SAMPLE_LOGS / "office.mcap", *tight)
    assert (code, "reading.map_max_cells" in out) == (0, True)
    config = tmp_path / "limits.toml"
    config.write_text("[reading]\nmap_max_cells = 100000\n")
    assert cli("info", SAMPLE_LOGS / "office.mcap", "--config", config)[1] == out
    code, out, _ = cli(
        "info", SAMPLE_LOGS / "office.mcap", "--config", config, "--set", "reading.map_max_cells=1000000"
    )
    assert (code, "704 x 512 cells" in out) == (0, True)


@pytest.mark.parametrize("command", ["info", "analyze", "batch", "report", "compare", "evaluate"])
def test_help_shows_flags_as_flags_and_cuts_nothing(cli, command: str):
    """No type stands behind a flag, as if it took a value; no example is cut off."""
    code, out, _ = cli(command, "--help")
    lines = [line for line in out.splitlines() if "<bool>" in line and "--help" not in line]
    assert (code, lines, "…" in out) == (0, [], False)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--set", "room_min_area=2"], "did you mean regions.room_min_area_m2?"),
        (["--set", "floor_plan.room_area_m2=2"], "did you mean floor_plan.room_min_area_m2?"),
        (["--set", "rooms.room_min_area_m2=2"], "did you mean regions.room_min_area_m2?"),
        (["--set", "color=2"], "write it as block.name=value"),
        (["--start", "9000"], "20.0 to 596.7 s after the start of the log"),
    ],
)
def test_a_slip_is_told_with_what_may_have_been_meant(cli, tmp_path: Path, arguments: list[str], told: str):
    """Of parameters the next name, of times those that the log has, as they are given."""
    code, _, err = cli("analyze", SAMPLE_LOGS / "office.mcap", "-o", tmp_path, *arguments)
    assert (code, told in err, len(err.splitlines())) == (2, True, 1)


def test_a_folder_above_is_told_with_the_one_that_may_have_been_meant(cli, tmp_path: Path):
    """For a recording the folder that has one; for a log the command that takes folders; for a map a file."""
    (tmp_path / "results" / "run").mkdir(parents=True)
    (tmp_path / "results" / "run" / "run.rrd").write_bytes(b"")
    _, _, err = cli("view", tmp_path / "results")
    assert f"did you mean {tmp_path / 'results' / 'run'}?" in err
    _, _, err = cli("analyze", tmp_path / "results", "-o", tmp_path / "out")
    assert "analyze a folder of many logs as a batch" in err
    _, _, err = cli("segment", tmp_path / "results", "-o", tmp_path / "out")
    assert "is a folder, not a file; name the map in it" in err


def test_paths_behind_an_equals_sign_begin_in_the_home_folder(cli, tmp_path: Path, monkeypatch):
    """Shells leave the sign there as it is."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    (tmp_path / "few.toml").write_text("[walls]\nextension_m = 6.0\n")
    log = str(SAMPLE_LOGS / "office.mcap")
    few = ("--max-snapshots=1", "--no-rrd", "--no-mcap")
    assert cli("analyze", log, "--out=~/one", "--config=~/few.toml", *few)[0] == 0
    assert cli("figure", "~/one/office", "--out=~/plan.svg")[0] == 0
    assert cli("batch", log, "--out=~/many", *few)[0] == 0
    assert (tmp_path / "one" / "office" / "summary.json").is_file()
    assert (tmp_path / "plan.svg").is_file()
    assert (tmp_path / "many" / "summary.csv").is_file()
    assert not list((tmp_path / "work").iterdir())
