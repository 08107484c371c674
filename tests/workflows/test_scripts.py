"""Scripts that people write: no guard against being imported again, from a file or typed in."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from commands import WAIT_S
from saved_maps import save_run

import rose2_logs as rl
from rose2_logs.runs.tables import TABLES

OUTPUTS = {"recording": False, "annotated_log": False}


@pytest.fixture(scope="module")
def by_one(tmp_path_factory) -> rl.Run:
    """Results of one process, of the log beside them."""
    folder = tmp_path_factory.mktemp("one")
    return rl.analyze(save_run(folder / "maps"), folder / "out", **OUTPUTS)


def same_tables(one: Path, other: Path) -> bool:
    return all(
        (one / f"{name}.parquet").read_bytes() == (other / f"{name}.parquet").read_bytes() for name in TABLES
    )


@pytest.mark.parametrize("given", ["file", "stdin", "argument"])
def test_workers_need_no_guard(by_one: rl.Run, tmp_path: Path, given: str):
    """The script runs once, not once more in each process; the tables are those of one process."""
    script = (
        "import rose2_logs as rl\n"
        "print('begun')\n"
        f"run = rl.analyze({str(by_one.folder.parent / 'maps')!r}, {str(tmp_path / 'out')!r}, workers=2,\n"
        "                 recording=False, annotated_log=False)\n"
        "print(len(run))\n"
    )
    (tmp_path / "script.py").write_text(script)
    arguments = {"file": [str(tmp_path / "script.py")], "stdin": ["-"], "argument": ["-c", script]}[given]
    done = subprocess.run(
        [sys.executable, *arguments],
        input=script if given == "stdin" else "",
        capture_output=True,
        text=True,
        check=False,
        timeout=WAIT_S,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "begun\n3\n"
    assert done.stderr == ""
    assert same_tables(tmp_path / "out", by_one.folder)


def test_the_stream_of_a_script_needs_no_guard(by_one: rl.Run, tmp_path: Path):
    """Left before its end, too."""
    script = tmp_path / "script.py"
    script.write_text(
        "import rose2_logs as rl\n"
        f"for step in rl.track({str(by_one.folder.parent / 'maps')!r}, workers=2):\n"
        "    print(step.snapshot.index, len(step.track_ids))\n"
        "    if step.snapshot.index == 1:\n"
        "        break\n"
    )
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, check=False, timeout=WAIT_S
    )
    rooms = by_one.snapshots["rooms"].tolist()
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"0 {rooms[0]}\n1 {rooms[1]}\n"
