"""Runs that are killed, interrupted or cannot write: nothing or all appears; --resume ends in the same."""

from __future__ import annotations

import hashlib
import json
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from commands import ROSE2_LOGS, WAIT_S, below, is_running, started, wait_for
from saved_maps import save_map, save_run, two_rooms

from rose2_logs.cli.main import main
from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import AlreadyWholeError, InvalidMapError, OutputError, ParameterError
from rose2_logs.runs.output_folder import OutputFolder, difference
from rose2_logs.runs.run import Run
from rose2_logs.runs.tables import TABLES
from rose2_logs.system.files import locked
from rose2_logs.workflows.analyze import RunOptions, analyze_log

SEEN = (110, 130, 150, 170, 190, 210, 240)
OPTIONS = {"recording": False, "annotated_log": True}
JOURNAL, PART, LOCK = ".out.journal", ".out.part", ".out.lock"

KILLED = """
import os, signal, sys
from pathlib import Path
from rose2_logs.workflows.analyze import RunOptions, analyze_log

log, folder, moment, overwrite, recording = sys.argv[1:]
kill = lambda: os.kill(os.getpid(), signal.SIGKILL)
frames, moves = 0, 0

def count_frames(frame, share):
    global frames
    frames += 1
    if moment == f"map {frames}":
        kill()

def count_moves(real):
    def move(self, target):
        global moves
        place = Path(folder).parent if moment == "renaming" else Path(folder)
        if Path(target).parent.samefile(place):
            moves += 1
            if moment in ("renaming", f"file {moves}"):
                kill()
        return real(self, target)
    return move

if moment == "renaming":
    Path.rename = count_moves(Path.rename)
if moment.startswith("file"):
    Path.replace = count_moves(Path.replace)
unlink = Path.unlink
def remove(self, missing_ok=False):
    if moment == "journal" and self.name.endswith(".journal"):
        kill()
    unlink(self, missing_ok)
Path.unlink = remove
options = RunOptions(
    recording=recording == "True", annotated_log=recording != "True", overwrite=overwrite == "True"
)
analyze_log(Path(log), Path(folder), options, count_frames)
"""

HELD = """
import sys, time
from rose2_logs.cli.main import main
from rose2_logs.runs.journal import Journal

maps, add = int(sys.argv.pop(1)), Journal.add

def add_and_wait(journal, *found):
    add(journal, *found)
    if journal.maps >= maps:
        time.sleep(3600)

Journal.add = add_and_wait
main()
"""
"""The command line, which waits once so many maps are in the journal: a signal finds it at work."""


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    return save_run(tmp_path_factory.mktemp("log") / "maps", SEEN)


@pytest.fixture(scope="module")
def fresh(log: Path, tmp_path_factory) -> dict[str, bytes]:
    """What a run gives that nobody stops."""
    folder = tmp_path_factory.mktemp("fresh") / "out"
    analyze_log(log, folder, RunOptions(**OPTIONS))
    return contents(folder)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file; of the summary all but the times and where the log lies as seen from there."""
    found = {file.name: file.read_bytes() for file in folder.iterdir()}
    summary = json.loads(found["summary.json"])
    assert set(found) == {"summary.json", *summary["files"]}
    del summary["seconds"]
    return found | {"summary.json": json.dumps(summary).encode()}


def kill_at(moment: str, log: Path, folder: Path, overwrite: bool = False, recording: bool = False) -> None:
    command = [sys.executable, "-c", KILLED, *map(str, (log, folder, moment, overwrite, recording))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(("moment", "kept"), [("map 1", 1), ("map 5", 5), ("renaming", 7)])
def test_a_killed_run_leaves_no_results_and_goes_on_to_the_same(
    log: Path, fresh, tmp_path: Path, caplog, monkeypatch, moment: str, kept: int
):
    """In the first map, in the middle, with all written but nothing in place. Known maps are not analyzed."""
    kill_at(moment, log, tmp_path / "out")
    assert names(tmp_path) == [JOURNAL, LOCK, PART]
    analyzed = []
    count_calls(monkeypatch, analyzed)
    analyze_log(log, tmp_path / "out", RunOptions(**OPTIONS, resume=True))
    assert f"goes on after the {kept} maps" in caplog.text
    assert analyzed == list(range(kept, len(SEEN)))
    assert contents(tmp_path / "out") == fresh
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("is_log", [False, True])
def test_results_that_only_the_earlier_run_has_made_go_with_it(log: Path, tmp_path: Path, is_log: bool):
    """A table beside a recording of other parameters would be taken for its own; but no log is removed."""
    out = tmp_path / "out"
    analyze_log(log, out, RunOptions(**OPTIONS))
    before = set(names(out))
    (out / "notes.txt").write_text("mine")
    annotated = out / "maps.rose2.mcap"
    tables = RunOptions(recording=False, annotated_log=False, overwrite=True, topic="/map")
    analyze_log(annotated if is_log else log, out, tables)
    kept = {"summary.json", "notes.txt", *(f"{table}.parquet" for table in TABLES)}
    assert set(names(out)) == kept | ({annotated.name} if is_log else set())
    assert annotated.name in before - kept


def test_what_was_made_of_the_results_before_is_told(log: Path, tmp_path: Path, caplog):
    """A page beside new results would be taken for theirs; what has other names is somebody's own."""
    out = tmp_path / "out"
    out.mkdir()
    for name in ("out.bag", "out.notes.txt", "out.graph.json"):
        (out / name).write_text("")
    analyze_log(log, out, RunOptions(**OPTIONS))
    assert "made of the results" not in caplog.text
    (out / "out.graph.json").unlink()
    for name in ("report.html", "out.figure.png", "out.floor_plan.geojson", "notes.txt"):
        (out / name).write_text("")
    assert "made of the results" not in caplog.text
    analyze_log(log, out, RunOptions(**OPTIONS, overwrite=True))
    (told,) = [each for each in caplog.messages if "made of the results that were here before" in each]
    assert "out.figure.png, out.floor_plan.geojson, report.html; make them again or remove them" in told


def count_calls(monkeypatch, analyzed: list[int]) -> None:
    from rose2_logs.runs import stream as tracked_stream

    real = tracked_stream.analyze

    def analyze(snapshot, *arguments, **options):
        analyzed.append(snapshot.index)
        return real(snapshot, *arguments, **options)

    monkeypatch.setattr(tracked_stream, "analyze", analyze)


@pytest.fixture(scope="module")
def fresh_recording(log: Path, tmp_path_factory) -> dict[str, list[Row]]:
    folder = tmp_path_factory.mktemp("fresh") / "out"
    analyze_log(log, folder, RunOptions(annotated_log=False))
    return recorded(folder / "maps.rrd")


Row = dict[str, Any]


def recorded(path: Path) -> dict[str, list[Row]]:
    """Rows of every entity in the order in which they were logged, times and components.

    Left out is what is another one in each run: Rerun's own numbers of the rows, and when the run began.
    """
    from rerun.chunk import RrdReader

    reader = RrdReader(path)
    # The layout stands before the first map, for viewers that still load the file, and at the end.
    assert len(reader.blueprints()) == 2
    (run,) = reader.recordings()
    found: dict[str, list[tuple[bytes, Row]]] = defaultdict(list)
    for chunk in reader.stream(store=run):
        for row in chunk.to_record_batch().to_pylist():
            row.pop("RecordingInfo:start_time", None)
            found[str(chunk.entity_path)].append((row.pop("rerun.controls.RowId"), row))
    return {
        entity: [row for _, row in sorted(rows, key=lambda each: each[0])] for entity, rows in found.items()
    }


@pytest.mark.parametrize("moment", ["map 5", "renaming"])
def test_the_recording_of_a_run_that_went_on_holds_what_that_of_a_fresh_one_does(
    log: Path, fresh_recording, tmp_path: Path, moment: str
):
    """Every row of every entity, by Rerun's own reader; the killed run's file does not appear."""
    kill_at(moment, log, tmp_path / "out", recording=True)
    assert names(tmp_path) == [JOURNAL, LOCK, PART]
    analyze_log(log, tmp_path / "out", RunOptions(annotated_log=False, resume=True))
    found = recorded(tmp_path / "out" / "maps.rrd")
    assert set(found) == set(fresh_recording) >= {"/world/map", "/run/coverage", "/summary", "/room/1"}
    for entity, rows in found.items():
        assert rows == fresh_recording[entity], entity
    assert names(tmp_path) == ["out"]


def test_whole_results_are_not_taken_for_those_with_other_names(log: Path, tmp_path: Path):
    """Names decide nothing about the maps, and yet they are in all outputs."""
    out, names = tmp_path / "out", tmp_path / "names.csv"
    names.write_text("name,track\nKitchen,1\n")
    analyze_log(log, out, RunOptions(**OPTIONS))
    again = RunOptions(**OPTIONS, resume=True, names=str(names))
    with pytest.raises(OutputError, match="with no names of rooms"):
        analyze_log(log, out, again)
    analyze_log(log, out, RunOptions(**OPTIONS, names=str(names), overwrite=True))
    with pytest.raises(AlreadyWholeError, match="nothing is left to do"):
        analyze_log(log, out, again)
    names.write_text("name,track\nPantry,2\n")
    for other in (again, RunOptions(**OPTIONS, resume=True)):
        with pytest.raises(OutputError, match="with other names of rooms"):
            analyze_log(log, out, other)
    assert set(Run(out).names.values()) == {"Kitchen"}
    (tmp_path / "moved.csv").write_text("name,track\nKitchen,1\n")
    with pytest.raises(AlreadyWholeError):
        analyze_log(log, out, RunOptions(**OPTIONS, resume=True, names=str(tmp_path / "moved.csv")))


def test_names_that_cannot_be_read_are_refused_before_the_log_is(log: Path, tmp_path: Path):
    gone = RunOptions(**OPTIONS, names=str(tmp_path / "gone.csv"))
    with pytest.raises(ParameterError, match=r"gone\.csv"):
        analyze_log(tmp_path / "no.mcap", tmp_path / "out", gone)
    assert not (tmp_path / "out").exists()


def test_a_run_killed_after_all_is_in_place_is_whole(log: Path, fresh, tmp_path: Path):
    """What is left to do is to remove the journal."""
    kill_at("journal", log, tmp_path / "out")
    assert contents(tmp_path / "out") == fresh
    with pytest.raises(AlreadyWholeError, match="whole already"):
        analyze_log(log, tmp_path / "out", RunOptions(**OPTIONS, resume=True))
    assert names(tmp_path) == ["out"]
    assert contents(tmp_path / "out") == fresh


def test_results_that_are_being_replaced_have_no_summary_until_they_are_whole(
    log: Path, fresh, tmp_path: Path
):
    """Killed between two files: told apart from whole results, and completed."""
    out = tmp_path / "out"
    analyze_log(log, out, RunOptions(**OPTIONS, parameters=Parameters().replaced(SMALL_ROOMS)))
    kill_at("file 3", log, out, overwrite=True)
    assert not (out / "summary.json").exists()
    with pytest.raises(OutputError, match="already exists"):
        analyze_log(log, out, RunOptions(**OPTIONS))
    analyze_log(log, out, RunOptions(**OPTIONS, resume=True))
    assert contents(out) == fresh
    assert names(tmp_path) == ["out"]


SMALL_ROOMS = {"floor_plan": {"room_min_area_m2": 0.5}}


def stop(number: int, kind: type[BaseException]) -> Callable[[object, float], None]:
    """Raise at a snapshot."""

    def on_snapshot(frame: object, share: float) -> None:
        nonlocal number
        number -= 1
        if number == 0:
            raise kind("stopped")

    return on_snapshot


def test_a_run_that_was_interrupted_keeps_its_maps_and_says_so(log: Path, fresh, tmp_path: Path, caplog):
    """Nothing else of it stays; stopped again, it goes on from the later map."""
    out = tmp_path / "out"
    for resume, number in ((False, 2), (True, 4)):
        with pytest.raises(KeyboardInterrupt):
            analyze_log(log, out, RunOptions(**OPTIONS, resume=resume), stop(number, KeyboardInterrupt))
        assert f"{number} maps done; resume=True goes on from there" in caplog.text
        assert names(tmp_path) == [JOURNAL]
    analyze_log(log, out, RunOptions(**OPTIONS, resume=True, workers=2))
    assert contents(out) == fresh


@pytest.mark.parametrize("kind", [InvalidMapError, ZeroDivisionError])
def test_what_would_come_again_leaves_nothing(log: Path, tmp_path: Path, kind: type[Exception]):
    with pytest.raises(kind):
        analyze_log(log, tmp_path / "out", RunOptions(**OPTIONS), stop(2, kind))
    assert names(tmp_path) == []


def test_a_fresh_start_says_that_the_stopped_run_could_have_gone_on(log: Path, fresh, tmp_path: Path, caplog):
    with pytest.raises(KeyboardInterrupt):
        analyze_log(log, tmp_path / "out", RunOptions(**OPTIONS), stop(2, KeyboardInterrupt))
    analyze_log(log, tmp_path / "out", RunOptions(**OPTIONS))
    assert "stopped here after 2 maps; resume=True would have gone on" in caplog.text
    assert contents(tmp_path / "out") == fresh


def test_another_run_is_not_gone_on_with(log: Path, tmp_path: Path):
    """The first difference is named; without --resume the run begins anew."""
    with pytest.raises(KeyboardInterrupt):
        analyze_log(log, tmp_path / "out", RunOptions(**OPTIONS), stop(2, KeyboardInterrupt))
    other = Parameters().replaced(SMALL_ROOMS)
    options = {**OPTIONS, "parameters": other}
    with pytest.raises(
        OutputError, match=r"another one \(parameters\.floor_plan\.room_min_area_m2 was .*0\.5"
    ):
        analyze_log(log, tmp_path / "out", RunOptions(**options, resume=True))
    assert JOURNAL in names(tmp_path)
    with pytest.raises(OutputError, match="method was rose2, is voronoi"):
        analyze_log(log, tmp_path / "out", RunOptions(**OPTIONS, method="voronoi", resume=True))
    analyze_log(log, tmp_path / "out", RunOptions(**options))
    assert names(tmp_path) == ["out"]


def test_two_runs_do_not_write_to_one_folder(log: Path, tmp_path: Path):
    with (
        locked(tmp_path / LOCK, "first"),
        pytest.raises(OutputError, match="another run is writing"),
    ):
        analyze_log(log, tmp_path / "out", RunOptions(**OPTIONS))
    assert names(tmp_path) == []


def test_a_log_is_never_written_over(log: Path, tmp_path: Path):
    """Neither its files, by links either, nor among its files; --overwrite does not help."""
    maps = save_run(tmp_path / "maps", (200, 240))
    before = hash_of(maps)
    replace_all = RunOptions(**OPTIONS, overwrite=True)
    for folder in (maps, maps / "inside", tmp_path / "other" / ".." / "maps"):
        (tmp_path / "other").mkdir(exist_ok=True)
        with pytest.raises(OutputError, match="lies in the log"):
            analyze_log(maps, folder, replace_all)
    single = save_map(tmp_path / "single", "flat", two_rooms())
    for make in (Path.symlink_to, Path.hardlink_to):
        out = tmp_path / make.__name__
        out.mkdir()
        make(out / "summary.json", single)
        with pytest.raises(OutputError, match="is a file of the log itself"):
            analyze_log(single, out, replace_all)
        assert single.read_text().startswith("image:")
    assert hash_of(maps) == before


def hash_of(folder: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted(folder.rglob("*")):
        digest.update(file.name.encode() + (file.read_bytes() if file.is_file() else b""))
    return digest.hexdigest()


def test_differences_are_told_by_name():
    assert difference({"a": {"b": 1}, "c": 2}, {"a": {"b": 1}, "c": 2}) == ""
    assert difference({"a": {"b": 1}}, {"a": {"b": 2}}) == "a.b was 1, is 2"
    assert difference({}, {"a": 1}) == "a was None, is 1"


def test_a_folder_that_is_a_file_is_told(log: Path, tmp_path: Path, monkeypatch):
    """Before the first map is analyzed."""
    (tmp_path / "file").write_text("")
    analyzed = []
    count_calls(monkeypatch, analyzed)
    for folder in (tmp_path / "file" / "out", tmp_path / "file"):
        with pytest.raises(OutputError, match="file"):
            analyze_log(log, folder, RunOptions(**OPTIONS, overwrite=True))
    assert analyzed == []
    assert OutputFolder(tmp_path / "x", ["a"]).files == (tmp_path / "x" / "a",)


COMMAND = [*ROSE2_LOGS, "analyze"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of POSIX")
def test_a_full_disk_is_one_line(log: Path, tmp_path: Path):
    """Files that cannot grow, as on a full disk: exit code 2, no rests untold, the log as it was."""
    before = hash_of(log)
    limited = 'ulimit -f 20; exec "$@"'  # in blocks of 1024 bytes
    command = [*COMMAND, str(log), "-o", str(tmp_path), "--no-rrd"]
    done = subprocess.run(["bash", "-c", limited, "-", *command], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1
    assert "cannot be written" in errors[0]
    assert ".part" not in errors[0]
    assert not any(name.endswith((".part", ".lock")) for name in names(tmp_path))
    assert ("--resume" in done.stderr) == (names(tmp_path) != [])
    assert hash_of(log) == before


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals of POSIX")
def test_killed_and_interrupted_commands_end_with_their_workers(tmp_path: Path, monkeypatch, capsys):
    """kill -9 leaves no process behind; Ctrl-C is one line and exit code 130; --resume ends it."""
    many = save_run(tmp_path / "maps", tuple(range(120, 160)))
    command = ["analyze", str(many), "-o", str(tmp_path / "o"), "--no-rrd"]
    journal = tmp_path / "o" / ".maps.journal"
    for number, maps, extra in ((signal.SIGKILL, 8, ["--workers", "2"]), (signal.SIGINT, 16, ["--resume"])):
        with started(sys.executable, "-c", HELD, maps, *command, *extra) as running:
            size = journal.stat().st_size if journal.exists() else 10_000
            wait_for(lambda size=size: journal.exists() and journal.stat().st_size > size)
            children = below(running.pid)
            running.send_signal(number)
            _, err = running.communicate(timeout=WAIT_S)
            assert not (tmp_path / "o" / "maps").exists()
            wait_for(lambda children=children: not any(map(is_running, children)))
    assert running.returncode == 130
    assert [line for line in err.splitlines() if line.startswith("error: ")] == [
        "error: interrupted; unfinished results were removed"
    ]
    assert "--resume goes on from there" in err
    assert names(tmp_path / "o") == [".maps.journal"]
    monkeypatch.setattr(sys, "argv", ["rose2-logs", *command, "--resume"])
    for said in ("results in", "is whole already"):
        with pytest.raises(SystemExit) as ended:
            main()
        assert not ended.value.code
        assert said in capsys.readouterr().out
    analyze_log(many, tmp_path / "fresh", RunOptions(**OPTIONS))
    assert contents(tmp_path / "o" / "maps") == contents(tmp_path / "fresh")


def test_tables_are_all_there(fresh):
    assert {f"{name}.parquet" for name in TABLES} < set(fresh)
