"""What happens to a command itself: full disks, missing folders, limits, closed outputs, odd names."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from commands import ROSE2_LOGS, WAIT_S, started, wait_for
from finished_runs import SAMPLE_LOGS
from saved_maps import save_run

from rose2_logs.outputs.exports.formats import FORMATS

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a shell and limits of POSIX")
QUICK = ("--no-rrd", "--no-mcap")


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    return save_run(tmp_path_factory.mktemp("log") / "maps", (180, 240))


def run(shell: str, *command: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command from a shell that first does something to itself; there is no internal error."""
    words = [*ROSE2_LOGS, *map(str, command)]
    done = subprocess.run(
        ["bash", "-c", shell, "-", *words],
        capture_output=True, text=True, check=False, env=os.environ | environment,
    )  # fmt: skip
    assert "internal error" not in done.stderr, done.stderr
    assert "Traceback" not in done.stderr, done.stderr
    return done


def errors(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.startswith("error: ")]


def is_whole(folder: Path) -> bool:
    """Whether the folder holds every file that its summary names, and nothing unfinished."""
    summary = json.loads((folder / "summary.json").read_text())
    return {path.name for path in folder.iterdir()} == {"summary.json", *summary["files"]}


@pytest.mark.parametrize(
    ("shell", "environment"),
    [
        ("ulimit -n 64; exec \"$@\"", {}),
        ("ulimit -v 6000000; exec \"$@\"", {}),
        ('exec "$@"', {"TMPDIR": "/there/is/no/such/folder"}),
        ('exec "$@"', {"TMPDIR": "/proc"}),
        ('exec "$@"', {"LC_ALL": "C", "LANG": "C", "PYTHONIOENCODING": ""}),
        ('exec "$@" >&-', {}),
        ('exec "$@" >&- 2>&-', {}),
        ('exec "$@" <&-', {}),
        ('set -o pipefail; "$@" | head -c 1 >/dev/null; true', {}),
    ],
    ids=["few files", "little memory", "no TMPDIR", "TMPDIR not writable", "C locale", "no stdout",
         "no outputs", "no stdin", "head"],
)  # fmt: skip
def test_results_are_whole_all_the_same(log: Path, tmp_path: Path, shell: str, environment: dict[str, str]):
    named = shutil.copytree(log, tmp_path / "mapy č 3")
    before = sorted(path.name for path in named.iterdir())
    done = run(shell, "analyze", named, "-o", tmp_path / "out", *QUICK, "--workers", 2, **environment)
    assert (done.returncode, errors(done.stderr)) == (0, [])
    assert is_whole(tmp_path / "out" / "mapy č 3")
    assert sorted(path.name for path in named.iterdir()) == before


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        ("ulimit -v 3000000", "addresses"),
        ("ulimit -n 24", "open files"),
        ("ulimit -f 9000", "files may have"),
    ],
)
def test_rerun_is_not_started_where_it_would_end_the_process(
    log: Path, tmp_path: Path, office_results: Path, limit: str, told: str
):
    """Or wait forever; one line says what it needs, and nothing stays of the results."""
    done = run(f'{limit}; exec "$@"', "analyze", log, "-o", tmp_path / "out", "--no-mcap")
    assert (done.returncode, len(errors(done.stderr))) == (2, 1), done.stderr
    assert told in done.stderr
    assert not list(tmp_path.rglob("*.rrd*")) + list(tmp_path.rglob("*.part"))
    command = ("compare", office_results, office_results, "-o", tmp_path / "compared")
    done = run(f'{limit}; exec "$@"', *command)
    assert (done.returncode, len(errors(done.stderr))) == (2, 1), done.stderr
    assert "comparison.rrd" in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="names of sockets are short on Linux")
@pytest.mark.parametrize("length", [60, 75, 76, 150])
def test_a_folder_for_temporary_files_may_have_a_long_name(log: Path, tmp_path: Path, length: int):
    """Names of sockets have 107 bytes at most. Other files lie where they always do; nothing is left."""
    with tempfile.TemporaryDirectory() as short:
        long = Path(short) / ("x" * (length - len(short) - 1))
        long.mkdir()
        done = run(
            'exec "$@"', "analyze", log, "-o", tmp_path / "out", *QUICK, "--workers", 2, TMPDIR=str(long)
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert is_whole(tmp_path / "out" / "maps")
        assert list(long.iterdir()) == []


@pytest.mark.parametrize("limit", ["ulimit -v 200000", "ulimit -n 8"])
def test_too_little_for_python_is_no_endless_wait(log: Path, tmp_path: Path, limit: str):
    """Libraries then say so themselves, at worst with a traceback of theirs; nothing is written."""
    words = [*ROSE2_LOGS, "analyze", str(log), "-o", str(tmp_path / "out"), *QUICK]
    done = subprocess.run(
        ["bash", "-c", f'{limit}; exec "$@"', "-", *words], capture_output=True, timeout=WAIT_S, check=False
    )
    assert done.returncode != 0
    assert not list(tmp_path.rglob("summary.json"))


@pytest.mark.parametrize("kind", ["size=4k", "ro"])
def test_without_space_in_shared_memory_a_line_says_what_helps(log: Path, tmp_path: Path, kind: str):
    """Not even the semaphores of worker processes can be made then; one process needs none."""
    shell = f'mount -t tmpfs -o {kind} tmpfs /dev/shm; exec "$@"'
    own = ["unshare", "-m", "bash", "-c", shell, "-"]
    if subprocess.run([*own, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this user may mount nothing")
    command = ("analyze", log, "-o", tmp_path / "out", *QUICK)
    done = run(f'exec {shlex.join(own)} "$@"', *command, "--workers", 2)
    assert (done.returncode, len(errors(done.stderr))) == (2, 1)
    assert "worker processes cannot start" in done.stderr
    assert "take --workers 1" in done.stderr
    assert not (tmp_path / "out").exists()
    done = run(f'exec {shlex.join(own)} "$@"', *command)
    assert (done.returncode, errors(done.stderr)) == (0, [])


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("command", ["info", "report --help"])
def test_an_output_that_is_full_is_told(log: Path, command: str, unbuffered: str):
    """By one line, also where Python keeps output until it ends."""
    if not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full")
    words = [*command.split(), *([log] if command == "info" else [])]
    done = run('exec "$@" >/dev/full', *words, PYTHONUNBUFFERED=unbuffered)
    assert (done.returncode, errors(done.stderr)) == (2, ["error: No space left on device"])
    assert "ignored" not in done.stderr


def test_an_output_folder_that_is_removed_is_told(tmp_path: Path):
    """Or made again, if nothing was written to it yet."""
    many, out = save_run(tmp_path / "maps", tuple(range(100, 240))), tmp_path / "out"
    with started(*ROSE2_LOGS, "analyze", many, "-o", out, *QUICK) as process:
        wait_for(lambda: list(out.rglob("*.part")))
        shutil.rmtree(out)
        _, err = process.communicate(timeout=WAIT_S)
    assert "internal error" not in err
    assert (process.returncode, len(errors(err))) in ((2, 1), (0, 0)), err
    assert process.returncode == 2 or is_whole(out / "maps")
    assert process.returncode == 0 or not list(tmp_path.rglob("summary.json"))


def mounted(folder: Path, kilobytes: int) -> bool:
    """Mount a small disk, where this user may."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(folder)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize("kilobytes", [16, 80, 160, 320, 640])
def test_a_full_disk_is_one_line_at_whatever_output(tmp_path: Path, kilobytes: int):
    """Tables, recording, annotated log, journal; and the results are whole on a disk that is large enough."""
    disk = tmp_path / "disk"
    if not mounted(disk, kilobytes):
        pytest.skip("this user may mount nothing")
    try:
        done = run('exec "$@"', "analyze", SAMPLE_LOGS / "office.mcap", "-o", disk, "--max-snapshots", 2)
        assert (done.returncode, len(errors(done.stderr))) == (2, 1), done.stderr
        assert str(disk) in done.stderr
        assert not list(disk.rglob("summary.json"))
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)


@pytest.mark.parametrize(
    ("command", "kilobytes"),
    [
        (("report", "RUN", "-o", "DISK/page.html"), 8),
        (("figure", "RUN", "-o", "DISK/plan.png"), 8),
        *((("export", "RUN", "--format", name, "-o", "DISK/plans"), 4) for name in FORMATS),
        (("compare", "RUN", "RUN", "-o", "DISK/compared"), 8),
        (("compare", "RUN", "RUN", "-o", "DISK/compared"), 800),
        (("segment", SAMPLE_LOGS / "office.rooms.png", "--resolution", "0.05", "-o", "DISK/rooms"), 4),
        (("batch", SAMPLE_LOGS / "office.mcap", "-o", "DISK/all", *QUICK, "--max-snapshots", "1"), 60),
    ],
    ids=lambda value: " ".join(map(str, value[:1] + value[2:4])) if isinstance(value, tuple) else None,
)
def test_every_command_tells_of_a_full_disk(
    tmp_path: Path, office_results: Path, command: tuple[object, ...], kilobytes: int
):
    """In one line that names the file, without an end that never comes; no half file stays."""
    disk = tmp_path / "disk"
    if not mounted(disk, kilobytes):
        pytest.skip("this user may mount nothing")
    places = {"RUN": str(office_results), "DISK": str(disk)}
    words = [re.sub("RUN|DISK", lambda found: places[found[0]], str(word)) for word in command]
    try:
        done = run(f'exec timeout -k 1 {WAIT_S} "$@"', *words)
        assert (done.returncode, len(errors(done.stderr))) == (2, 1), done.stderr
        assert str(disk) in errors(done.stderr)[0]
        assert not list(disk.rglob("*.part"))
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)


def test_a_log_that_is_still_written_is_read_as_far_as_it_is(tmp_path: Path):
    whole = (SAMPLE_LOGS / "office.mcap").read_bytes()
    growing = tmp_path / "growing.mcap"
    growing.write_bytes(whole[: len(whole) // 2])
    command = ("analyze", growing, "-o", tmp_path / "out", *QUICK, "--max-snapshots", "3")
    with started(*ROSE2_LOGS, *command) as process:
        wait_for(lambda: process.poll() is not None or list((tmp_path / "out").rglob("*.part")))
        with growing.open("ab") as file:
            file.write(whole[len(whole) // 2 :])
        _, err = process.communicate(timeout=WAIT_S)
    assert (process.returncode, errors(err)) == (0, [])
    assert "warning: " in err
    assert is_whole(tmp_path / "out" / "growing")


def test_a_bag_that_rosbag_still_writes_is_read_by_its_name_of_then(tmp_path: Path):
    whole = (SAMPLE_LOGS / "wing.bag").read_bytes()
    growing = tmp_path / "wing.bag.active"
    growing.write_bytes(whole[: len(whole) // 2])
    done = run('exec "$@"', "info", growing)
    assert (done.returncode, errors(done.stderr)) == (0, [])
    assert "everything before is read" in done.stderr


def test_a_database_that_is_still_written_is_read_without_its_journal(tmp_path: Path):
    """The recorder holds it open and writes; nothing of its files is touched."""
    bag = shutil.copytree(SAMPLE_LOGS / "ring", tmp_path / "ring")
    (database,) = bag.glob("*.db3")
    recorder = sqlite3.connect(database)
    recorder.execute("pragma journal_mode=wal")
    recorder.execute("pragma wal_autocheckpoint=0")
    recorder.execute(
        "insert into messages select max(id) + 1, topic_id, max(timestamp) + 1000, data from messages"
    )
    recorder.commit()
    before = {path.name: path.read_bytes() for path in bag.iterdir()}
    done = run('exec "$@"', "info", bag)
    assert (done.returncode, errors(done.stderr)) == (0, [])
    assert "contains messages that are not in the database yet" in done.stderr
    assert {path.name: path.read_bytes() for path in bag.iterdir()} == before
    recorder.close()


def test_a_second_run_to_a_folder_ends_and_the_first_goes_on(tmp_path: Path):
    many, out = save_run(tmp_path / "maps", tuple(range(100, 240, 10))), tmp_path / "out"
    command = ("analyze", many, "-o", out, *QUICK)
    with started(*ROSE2_LOGS, *command) as process:
        wait_for(lambda: list(out.rglob("*.part")))
        process.send_signal(signal.SIGSTOP)  # so that it is still at work, however busy the machine is
        for options in ((), ("--overwrite",), ("--resume",)):
            done = run('exec "$@"', *command, *options)
            assert (done.returncode, len(errors(done.stderr))) == (2, 1)
            assert "another run is writing to this folder; wait for it, or name another" in done.stderr
        process.send_signal(signal.SIGCONT)
        _, err = process.communicate(timeout=WAIT_S)
    assert (process.returncode, errors(err)) == (0, [])
    assert is_whole(out / "maps")


@pytest.mark.parametrize("name", ["two\nlines", "n" * 255, "n" * 230], ids=["line break", "255", "230"])
def test_names_with_line_breaks_and_of_255_bytes(log: Path, tmp_path: Path, name: str):
    named = shutil.copytree(log, tmp_path / name)
    done = run('exec "$@"', "analyze", named, "-o", tmp_path / "out", *QUICK)
    assert len(errors(done.stderr)) == (done.returncode == 2)
    if done.returncode:
        assert "its name is longer than" in done.stderr
        assert len(name) > 240
    else:
        assert is_whole(tmp_path / "out" / name)


def test_an_annotated_log_can_be_analyzed_again(tmp_path: Path):
    """The maps of the robot are taken, not what was added; it is not annotated twice."""
    options = ("--no-rrd", "--max-snapshots", 2)
    run('exec "$@"', "analyze", SAMPLE_LOGS / "office.mcap", "-o", tmp_path / "one", *options)
    annotated = tmp_path / "one" / "office" / "office.rose2.mcap"
    done = run('exec "$@"', "analyze", annotated, "-o", tmp_path / "two", *options)
    assert (done.returncode, len(errors(done.stderr))) == (2, 1)
    assert "analyze the log it was made from" in done.stderr
    done = run('exec "$@"', "analyze", annotated, "-o", tmp_path / "two", *options, "--no-mcap")
    assert (done.returncode, errors(done.stderr)) == (0, [])
    one, two = (json.loads(path.read_text()) for path in sorted(tmp_path.glob("*/*/summary.json")))
    assert one["topic"] == two["topic"]
    assert one["results"] == two["results"]
    for table in (tmp_path / "one" / "office").glob("*.parquet"):
        assert table.read_bytes() == (tmp_path / "two" / "office.rose2" / table.name).read_bytes()
