"""From arguments to logs: files, folders, patterns."""

from __future__ import annotations

from pathlib import Path

import pytest

from rose2_logs.batch.finding import find_logs
from rose2_logs.batch.location import Location
from rose2_logs.errors import LogError


@pytest.fixture
def data(tmp_path: Path) -> Path:
    for name in (
        "a/run.mcap",
        "a/notes.txt",
        "b/run.bag",
        "b/bag/metadata.yaml",
        "b/bag/bag_0.mcap",
        "results/logs/run/run.rose2.mcap",
        "results/logs/run/copy.mcap",
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return tmp_path


def found(data: Path, *arguments: str) -> list[str]:
    logs = find_logs([str(data / argument) for argument in arguments], data / "results")
    return [Path(log.target).relative_to(data).as_posix() for log in logs]


def test_a_folder_is_searched_at_any_depth_but_for_the_results(data: Path):
    """Results of ours in the folder are no logs."""
    assert found(data, "") == ["a/run.mcap", "b/bag", "b/run.bag"]


@pytest.mark.parametrize("pattern", ["*/*", "**", "**/*.*", "[ab]/*"])
def test_patterns_find_logs_and_nothing_else(data: Path, pattern: str):
    """Also bags by their folder, or by a file in it."""
    kept = [log for log in found(data, pattern) if not log.startswith("results")]
    assert sorted(kept) == ["a/run.mcap", "b/bag", "b/run.bag"]


def test_a_file_of_a_ros2_bag_means_the_bag(data: Path):
    """It would be analyzed in parts otherwise."""
    assert found(data, "b/bag/bag_0.mcap", "b/bag") == ["b/bag"]


def test_no_log_is_found_twice_and_the_order_is_that_of_the_arguments(data: Path):
    """However it is written."""
    assert found(data, "b/../b/run.bag", "b", "a") == ["b/run.bag", "b/bag", "a/run.mcap"]


def test_a_file_url_is_a_path(data: Path):
    """It needs no fsspec."""
    (log,) = find_logs([(data / "a" / "run.mcap").as_uri()], data / "results")
    assert log == Location(str(data / "a" / "run.mcap"))


@pytest.mark.parametrize("argument", ["a/*.bag", "empty", "**/*.db3"])
def test_nothing_found_is_an_error_that_names_the_argument(data: Path, argument: str):
    """Likely a slip of the pen: it is told before any work is done."""
    (data / "empty").mkdir()
    with pytest.raises(LogError, match="no log there") as told:
        found(data, "a/run.mcap", argument)
    assert argument in str(told.value)


def test_a_single_log_that_is_not_there_is_for_the_worker_to_tell(data: Path):
    """The others are analyzed all the same."""
    assert found(data, "nowhere.mcap") == ["nowhere.mcap"]


@pytest.mark.parametrize(
    ("target", "address"),
    [
        ("s3://bucket/run.mcap", "s3://bucket/run.mcap"),
        ("https://me:secret@host/run.mcap", "https://host/run.mcap"),
        ("https://host/run.mcap?X-Amz-Signature=abc&X-Amz-Date=1", "https://host/run.mcap"),
        ("https://host/get?log=7", "https://host/get?log=7"),
    ],
)
def test_addresses_hold_no_secrets(target: str, address: str):
    """They are written beside the results."""
    assert Location(target).address == address


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["run_0.bag", "run_1.bag", "run_2.bag"], "run_0.bag, run_1.bag, run_2.bag"),
        (["a_2023-01-01-10-00-00_0.bag", "a_2023-01-01-10-05-00_1.bag"], "a_2023-01-01-10-00-00_0.bag, "),
        (["run_0.mcap.zstd", "run_1.mcap.zstd"], "run_0.mcap.zstd, run_1.mcap.zstd"),
        (["run_1.bag", "run_2.bag"], ""),
        (["run_0.bag", "run_2.bag"], ""),
        (["run_0.bag", "run_1.mcap"], ""),
        (["hall_0.bag", "lab_1.bag"], ""),
        (["run_0.yaml", "run_1.yaml"], ""),
    ],
)
def test_pieces_of_one_recording_that_are_given_as_logs_are_told(tmp_path: Path, names, told: str, caplog):
    for name in names:
        (tmp_path / name).touch()
    find_logs([str(tmp_path / name) for name in names], tmp_path / "out")
    assert ("may be pieces of one recording" in caplog.text) == bool(told)
    assert told in caplog.text
