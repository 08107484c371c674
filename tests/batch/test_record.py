"""What is kept beside results, and when it proves that a log is the same."""

from __future__ import annotations

import dataclasses
import os
import time
from pathlib import Path

import pytest

from rose2_logs import __version__
from rose2_logs.batch.record import (
    RECORD,
    SETTLED_S,
    Record,
    Signature,
    deciding_settings,
    local_signature,
    read_record,
)
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import LogError


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "run.mcap"
    path.write_bytes(b"one")
    return path


def settled(log: Path) -> Signature:
    """Signature as it would be taken once the file is old enough."""
    return dataclasses.replace(local_signature(log), is_sound=True)


def test_a_log_that_is_left_alone_is_proven_unchanged(log: Path):
    """Without reading it."""
    assert local_signature(log).proves_unchanged_since(settled(log))


def test_a_signature_of_a_file_that_has_just_changed_proves_nothing(log: Path):
    """It could change once more within the grain of its time stamp; later it does."""
    log.touch()
    fresh = local_signature(log)
    assert not fresh.is_sound
    assert not local_signature(log).proves_unchanged_since(fresh)
    time.sleep(SETTLED_S)
    assert local_signature(log).is_sound


def test_a_change_that_keeps_size_and_time_stamp_is_noticed(log: Path):
    """The time of the last change of metadata cannot be set back."""
    before, stat = settled(log), log.stat()
    time.sleep(0.02)
    log.write_bytes(b"two")
    os.utime(log, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert log.stat().st_mtime_ns == stat.st_mtime_ns
    assert not local_signature(log).proves_unchanged_since(before)


def test_a_folder_is_the_sum_of_its_files(tmp_path: Path):
    """One more file is another log."""
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").write_text("a")
    before = settled(tmp_path / "bag")
    (tmp_path / "bag" / "bag_0.mcap").write_text("bb")
    after = local_signature(tmp_path / "bag")
    assert not after.proves_unchanged_since(before)
    assert (before.size_bytes, after.size_bytes) == (1, 3)


def test_a_log_that_is_not_there_has_no_signature(tmp_path: Path):
    """One line says so."""
    with pytest.raises(LogError, match="there is no such file"):
        local_signature(tmp_path / "nowhere.mcap")


def test_a_record_comes_back_as_it_was_written(log: Path, tmp_path: Path):
    """Settings and all; what is not a record is none."""
    settings = deciding_settings(RunOptions(max_snapshots=3))
    record = Record("/data/run.mcap", local_signature(log), "abc", settings)
    record.write(tmp_path)
    kept = read_record(tmp_path)
    assert kept == record
    assert kept is not None
    assert kept.difference(settings) == ""
    (tmp_path / RECORD).write_text("{}")
    assert read_record(tmp_path) is None
    assert read_record(tmp_path / "nowhere") is None


def test_the_settings_of_many_logs_are_held_once(log: Path, tmp_path: Path):
    """They are most of a record, and a fleet has a hundred thousand of those."""
    for name in ("one", "two"):
        folder = tmp_path / name
        folder.mkdir()
        Record(f"/data/{name}", local_signature(log), name, deciding_settings(RunOptions())).write(folder)
    one, two = (read_record(tmp_path / name) for name in ("one", "two"))
    assert one is not None
    assert two is not None
    assert one.settings is two.settings
    assert one != two


@pytest.mark.parametrize(
    ("now", "told"),
    [
        (RunOptions(method="distance"), "method rose2, now distance"),
        (RunOptions(max_snapshots=5), "max_snapshots unset, now 5"),
        (
            RunOptions(parameters=Parameters().replaced({"tracking": {"match_min_iou": 0.3}})),
            "tracking.match_min_iou 0.2, now 0.3",
        ),
        (RunOptions(recording=False), ""),
    ],
)
def test_a_difference_is_told_by_name_and_values(now: RunOptions, told: str):
    """Of what the tables depend on; which files are written beside them is another matter."""
    record = Record("", Signature((), True), "", deciding_settings(RunOptions()))
    assert record.difference(deciding_settings(now)) == told


def test_the_version_counts(monkeypatch):
    """Results of another version are other results."""
    record = Record("", Signature((), True), "", deciding_settings(RunOptions()))
    monkeypatch.setattr("rose2_logs.batch.record.__version__", "99.0")
    assert record.difference(deciding_settings(RunOptions())) == f"rose2-logs {__version__}, now 99.0"
