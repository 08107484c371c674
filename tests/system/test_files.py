"""Errors about files and folders say in words what is in the way."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from commands import WAIT_S

from rose2_logs.errors import OutputError, ParameterError
from rose2_logs.system.files import (
    OnFailure,
    expanded,
    reason_of,
    refuse_existing,
    replacing,
    require_local,
)


@pytest.mark.parametrize("below", ["file/out.txt", "file/folder/out.txt"])
def test_a_file_in_place_of_a_folder_is_named(tmp_path: Path, below: str):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError) as raised, replacing(tmp_path / below):
        pass
    assert str(raised.value).endswith(f"cannot be written: {tmp_path / 'file'} is a file, not a folder")


def test_a_folder_in_place_of_a_file_is_named(tmp_path: Path):
    (tmp_path / "out.txt").mkdir()
    with pytest.raises(OutputError) as raised, replacing(tmp_path / "out.txt") as part:
        part.touch()
    assert str(raised.value).endswith(f"cannot be written: {tmp_path / 'out.txt'} is a folder, not a file")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_written_to_and_stays(tmp_path: Path):
    pipe, heard = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: heard.append(pipe.read_text()))
    reader.start()
    refuse_existing([pipe], overwrite=False)
    with replacing(pipe) as part:
        part.write_text("figures")
    reader.join(WAIT_S)
    assert heard == ["figures"]
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]


@pytest.mark.skipif(not Path("/dev/stdout").exists(), reason="there is no /dev/stdout")
def test_what_goes_to_the_output_of_a_program_leaves_its_device(tmp_path: Path):
    """Also where that is a file."""
    code = "from pathlib import Path; from rose2_logs.system.files import replacing\n"
    code += "with replacing(Path('/dev/stdout')) as part: part.write_text('figures')"
    before = Path("/dev/stdout").readlink()
    with (tmp_path / "out").open("w") as out:
        subprocess.run([sys.executable, "-c", code], stdout=out, check=True)
    assert (tmp_path / "out").read_text() == "figures"
    assert Path("/dev/stdout").readlink() == before


def test_other_errors_lose_only_their_number():
    assert reason_of(OSError(28, "No space left on device")) == "No space left on device"
    assert reason_of(OSError("lost")) == "lost"
    assert reason_of(ValueError("odd")) == "odd"


def test_after_a_failure_what_was_begun_is_undone_and_the_first_error_told():
    undone = []

    def undo() -> None:
        undone.append(True)
        raise OSError("cannot be closed")

    with pytest.raises(ValueError, match="cannot be opened"), OnFailure(undo):
        raise ValueError("cannot be opened")
    assert undone == [True]
    with OnFailure(undo):
        pass
    assert undone == [True]


@pytest.mark.parametrize("url", ["s3://", "s3://bucket/run", "HTTPS://host/run.mcap", "a+b.c-d://x"])
def test_a_url_is_no_local_path(url: str):
    for path in (Path(url), Path(url) / "below"):
        with pytest.raises(ParameterError, match="is a URL, where a local path is needed"):
            require_local(path)


@pytest.mark.parametrize("path", ["C:/runs", "runs/s3:", "run 1: first", "12:30", "/data/s3:/x", "a:b/c"])
def test_a_name_with_a_colon_is_a_local_path(path: str):
    require_local(Path(path))


def test_only_a_folder_of_this_name_stands_for_the_home_folder(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HOME", "/home/ada")
    monkeypatch.setenv("USERPROFILE", "/home/ada")
    assert expanded(Path("~/runs/a.bag")) == Path("/home/ada/runs/a.bag")
    for path in ("~a.bag", "runs/~/a.bag", "/~/a.bag", "a~"):
        assert expanded(Path(path)) == Path(path)
