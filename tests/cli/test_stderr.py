"""What is told on stderr, to people and to programs, and what of it the summary keeps."""

from __future__ import annotations

import json
import logging
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import pytest
from mcap.writer import Writer
from saved_maps import save_run

from rose2_logs.system.warnings import PACKAGE, collect_warnings, log_warning, muted

MAPS = 12


@pytest.fixture
def damaged(tmp_path: Path) -> Path:
    """A run of saved maps of which all but the last two have no resolution."""
    folder = save_run(tmp_path / "maps", seen=tuple(range(40, 40 + 16 * MAPS, 16)))
    for k in range(MAPS - 2):
        path = folder / f"map{k}.yaml"
        path.write_text(path.read_text().replace("resolution: 0.05", "resolution: 0"))
    return folder


def analyze(cli, log: Path, *arguments: object) -> tuple[int, str, str]:
    return cli("analyze", log, "-o", log.parent / "out", "--no-rrd", "--no-mcap", *arguments)


def test_a_few_warnings_of_a_kind_are_shown_and_all_are_counted(cli, damaged):
    code, out, err = analyze(cli, damaged)
    assert code == 0
    lines = err.strip().splitlines()
    assert len(lines) == 4
    assert all(line.startswith("warning: ") for line in lines)
    assert "message 1 of 12 on /map" in lines[0]
    assert "map0.yaml: the map's resolution is 0 m" in lines[0]
    assert "only counted" in lines[3]
    assert "10 invalid_map" in out
    summary = json.loads((damaged.parent / "out" / "maps" / "summary.json").read_text())
    assert summary["warnings"]["count"] == 10
    kind = summary["warnings"]["kinds"]["invalid_map"]
    assert (kind["count"], len(kind["first"])) == (10, 5)
    assert kind["first"][1]["index"] == 2
    assert kind["first"][1]["topic"] == "/map"
    assert kind["first"][1]["file"].endswith("map1.yaml")
    assert summary["messages"]["invalid"] == 10
    assert summary["results"]["snapshots"] == 2


def test_a_log_without_faults_has_no_warnings(cli, tmp_path):
    maps = save_run(tmp_path / "maps")
    code, out, err = analyze(cli, maps)
    assert (code, err) == (0, "")
    assert "warnings" not in out
    summary = json.loads((tmp_path / "out" / "maps" / "summary.json").read_text())
    assert summary["warnings"] == {"count": 0, "kinds": {}}


def test_quiet_shows_only_errors(cli, damaged):
    code, out, err = analyze(cli, damaged, "--quiet")
    assert (code, err) == (0, "")
    assert "results in" in out
    code, _, err = cli("info", "nowhere.mcap", "-q")
    assert (code, err.count("\n")) == (2, 1)
    assert err.startswith("error: nowhere.mcap")


def test_verbose_shows_every_warning_and_what_is_done(cli, damaged):
    _, _, err = analyze(cli, damaged, "--verbose")
    lines = err.strip().splitlines()
    assert sum(line.startswith("warning: ") for line in lines) == 10
    assert any(line.startswith("info: ") and "12 messages on /map" in line for line in lines)
    assert sum("info: snapshot" in line for line in lines) == 2


def test_json_has_an_object_a_line_for_warnings_and_errors(cli, damaged, tmp_path):
    _, _, err = analyze(cli, damaged, "--json-log")
    entries = [json.loads(line) for line in err.strip().splitlines()]
    assert len(entries) == 10
    for number, entry in enumerate(entries, start=1):
        assert set(entry) == {"time", "level", "message", "kind", "file", "topic", "index"}
        assert datetime.fromisoformat(entry["time"]).tzinfo is not None
        assert (entry["level"], entry["kind"], entry["topic"]) == ("warning", "invalid_map", "/map")
        assert entry["index"] == number
        assert Path(entry["file"]).name == f"map{number - 1}.yaml"
    code, _, err = cli("info", tmp_path / "nowhere.mcap", "--json-log", "--debug")
    (entry,) = [json.loads(line) for line in err.strip().splitlines()]
    assert code == 2
    assert (entry["level"], entry["file"]) == ("error", str(tmp_path / "nowhere.mcap"))
    assert "Traceback" in entry["traceback"]


def test_strict_ends_at_the_first_warning_and_leaves_nothing(cli, damaged):
    code, out, err = analyze(cli, damaged, "--strict")
    assert (code, out, err.count("\n")) == (2, "", 1), err
    line = err.strip()
    assert line.startswith("error: ")
    assert "message 1 of 12 on /map" in line
    assert not list((damaged.parent / "out").rglob("*.*"))


def test_strict_is_about_the_log_and_not_about_parameters(cli, tmp_path):
    """A file of parameters may serve several commands."""
    maps, vain = save_run(tmp_path / "maps"), ("--set", "mapping.resolution_m=0.2")
    code, _, err = cli("analyze", maps, "-o", tmp_path / "out", "--no-rrd", "--no-mcap", "--strict", *vain)
    assert (code, "mapping.resolution_m has no effect here" in err) == (0, True)


def test_names_in_a_log_cannot_write_to_the_terminal(cli, tmp_path):
    """A name is shown as text: no colors of rich, no escape sequences, no second line."""
    log = tmp_path / "run.mcap"
    with log.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("nav_msgs/msg/OccupancyGrid", "ros2msg", b"")
        channel = writer.register_channel("/map[bold]\x1b[2Jx\ny", "cdr", schema)
        writer.add_message(channel, 1, b"\0\1\0\0", 1)
        writer.finish()
    for arguments in (["info", log], ["analyze", log, "-o", tmp_path / "out", "--topic", "nothing"]):
        _, out, err = cli(*arguments)
        assert "\x1b" not in out + err
        assert "/map[bold]" in out + err
        assert "x\ny" not in out + err


def test_every_command_has_the_options_and_help_tells_the_exit_codes(cli):
    for verb in ("info", "analyze", "batch", "segment", "evaluate", "view", "serve"):
        code, out, _ = cli(verb, "--help")
        assert code == 0
        assert all(option in out for option in ("--quiet", "--verbose", "--json-log"))
    code, out, _ = cli("--help")
    told = " ".join(out.split())
    assert all(
        part in told for part in ("Exit codes", "0 done", "1 internal error", "2 a log", "130 interrupted")
    )


def test_a_folder_that_cannot_be_written_to_is_one_line(tmp_path):
    maps = save_run(tmp_path / "maps")
    (tmp_path / "out").write_text("a file where a folder should be")
    command = [sys.executable, "-m", "rose2_logs", "analyze", str(maps), "-o", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert str(tmp_path / "out") in done.stderr


def test_a_map_that_the_method_stumbles_over_is_left_out(monkeypatch, tmp_path):
    from rose2_logs.runs import stream as tracked_stream
    from rose2_logs.workflows import analyze as run

    maps = save_run(tmp_path / "maps")
    analyze = tracked_stream.analyze

    def stumbling(snapshot, *others, **more):
        if snapshot.index == 1:
            raise IndexError("out of bounds")
        return analyze(snapshot, *others, **more)

    monkeypatch.setattr(tracked_stream, "analyze", stumbling)
    options = run.RunOptions(recording=False, annotated_log=False)
    result = run.analyze_log(maps, tmp_path / "out", options)
    totals = result.summary.totals
    assert (totals.snapshots, totals.invalid) == (2, 1)
    (told,) = result.warnings.kinds["snapshot_left_out"].first
    assert "snapshot 1 is left out: IndexError: out of bounds" in told["message"]
    assert "an internal error of rose2-logs" in told["message"]


def test_warnings_are_collected_by_kind_in_this_thread_and_only_inside_the_context():
    logger = logging.getLogger(f"{PACKAGE}.test")
    with collect_warnings() as outer:
        with collect_warnings() as inner:
            for k in range(7):
                log_warning(logger, "odd", f"number {k}", index=k)
        log_warning(logger, "even", "later")
        with muted():
            log_warning(logger, "even", "not at all")
    assert (inner.count, outer.count) == (7, 8)
    assert list(outer.kinds) == ["odd", "even"]
    assert [told["index"] for told in inner.kinds["odd"].first] == [0, 1, 2, 3, 4]
    assert inner.texts()[-1] == "2 more warnings of the kind odd"
    assert not any(type(each).__name__ == "Gather" for each in logging.getLogger(PACKAGE).handlers)
