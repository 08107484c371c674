"""Logs compressed as a whole, as they lie about, are read as the logs in them."""

from __future__ import annotations

import bz2
import gzip
import lzma
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from reader_logs import START_NS, Map, write_bag, write_rosbag2

from rose2_logs.config.reading import ReadingParameters
from rose2_logs.errors import LogError
from rose2_logs.io import open_log
from rose2_logs.io.discovery import is_bag, is_storage, logs_among, plain_name, stem_of
from rose2_logs.system.warnings import collect_warnings

PACK: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.compress,
    ".bz2": bz2.compress,
    ".xz": lzma.compress,
    ".lz4": lz4.frame.compress,
    ".zst": zstandard.compress,
    ".zstd": zstandard.compress,
}


def messages(count: int = 3):
    """A room of which more is seen in each map."""
    for number in range(count):
        cells = np.full((40, 60), -1)
        cells[5:35, 5 : 20 + 10 * number] = 0
        yield "/map", START_NS + number * 10**9, Map(cells)


def free_cells(path: Path, **limits: int) -> list[int]:
    with open_log(path, limits=ReadingParameters(**limits)) as reader:
        return [int((each.cells == 0).sum()) for each in reader.snapshots()]


def bag(folder: Path) -> Path:
    return write_bag(folder / "run.bag", list(messages()))


def mcap(folder: Path) -> Path:
    return next(write_rosbag2(folder / "as_mcap", list(messages()), "MCAP").glob("*.mcap"))


def database(folder: Path) -> Path:
    return next(write_rosbag2(folder / "as_database", list(messages())).glob("*.db3"))


@pytest.mark.parametrize("make", [bag, mcap, database])
@pytest.mark.parametrize("ending", PACK)
def test_a_packed_log_is_read_as_the_one_in_it(make, ending: str, tmp_path: Path):
    plain = make(tmp_path)
    packed = plain.with_name(plain.name + ending)
    packed.write_bytes(PACK[ending](plain.read_bytes()))
    expected = free_cells(plain)
    plain.unlink()
    with collect_warnings() as told:
        assert free_cells(packed) == expected == [450, 750, 1050]
    assert not told.kinds


def test_the_content_tells_what_it_is_whatever_the_name(tmp_path: Path):
    packed = tmp_path / "download"
    packed.write_bytes(gzip.compress(bag(tmp_path).read_bytes()))
    assert free_cells(packed) == [450, 750, 1050]


@pytest.mark.parametrize("ending", PACK)
def test_of_one_that_is_cut_off_the_beginning_is_read(ending: str, tmp_path: Path):
    plain = bag(tmp_path)
    noise = np.random.default_rng(1).integers(0, 256, 1 << 20, np.uint8).tobytes()
    data = PACK[ending](plain.read_bytes() + noise)
    packed = tmp_path / f"cut.bag{ending}"
    packed.write_bytes(data[: len(data) // 2])
    with collect_warnings() as told:
        if ending == ".bz2":  # of its blocks of 900 kB not even the first is whole
            with pytest.raises(LogError, match=r"cut\.bag\.bz2"):
                free_cells(packed)
        else:
            assert free_cells(packed) == [450, 750, 1050]
            # The reader of zstd does not notice; that of the log does where something of the log is missing.
            assert "cut_off" in told.kinds or ending.startswith(".zst")


@pytest.mark.parametrize("ending", PACK)
def test_a_bomb_ends_at_the_limit(ending: str, tmp_path: Path):
    packed = tmp_path / f"bomb.bag{ending}"
    packed.write_bytes(PACK[ending](bag(tmp_path).read_bytes() + bytes(1 << 24)))
    with pytest.raises(LogError, match=r"more than 1000000 bytes; .*reading.unpacked_max_bytes") as refused:
        free_cells(packed, unpacked_max_bytes=10**6)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("inside", [b"", b"no log at all"])
@pytest.mark.parametrize("ending", PACK)
def test_what_holds_no_log_is_refused_in_one_line(ending: str, inside: bytes, tmp_path: Path):
    packed = tmp_path / f"run.bag{ending}"
    packed.write_bytes(PACK[ending](inside))
    with pytest.raises(LogError, match=r"run\.bag") as refused:
        free_cells(packed)
    assert "\n" not in str(refused.value)


def test_names_of_packed_logs():
    assert plain_name("run.bag.gz") == "run.bag"
    assert plain_name("run.txt.gz") == "run.txt.gz"
    assert stem_of("run.mcap.zst") == "run"
    assert is_storage("run.db3.xz")
    assert not is_storage("run.rose2.mcap.zst")
    assert logs_among(["a/run.bag.gz", "a/run.bag", "b/other.mcap.zst", "b/notes.gz"], "top") == [
        "a/run.bag",
        "b/other.mcap.zst",
    ]
    assert is_bag(["run_0.mcap.zstd", "run_1.mcap.zstd"], "run")
