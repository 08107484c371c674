"""Errors about files and folders say in words what is in the way."""

from __future__ import annotations

from pathlib import Path

import pytest

from rose2_logs.errors import OutputError
from rose2_logs.system.files import reason_of, replacing


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


def test_other_errors_lose_only_their_number():
    assert reason_of(OSError(28, "No space left on device")) == "No space left on device"
    assert reason_of(OSError("lost")) == "lost"
    assert reason_of(ValueError("odd")) == "odd"
