"""Logs with a part that is, or claims to be, far larger than it looks."""

from __future__ import annotations

import bz2
import functools
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import zstandard
from faulty_logs import NO_INDEX, bag_chunk, mcap_chunk, run, write_bag, write_mcap, write_rosbag2

HUGE = 64 << 20
"""Bytes that come out of a bomb: more than the limit of the tests, less than what hurts."""


@functools.cache
def huge(compression: str) -> bytes:
    """A small file that becomes huge."""
    return PACK[compression](bytes(HUGE))


PACK: dict[str, Callable[[bytes], bytes]] = {
    "zstd": zstandard.compress,
    "lz4": lz4.frame.compress,
    "bz2": bz2.compress,
}


def _with_mcap_chunk(path: Path, chunk: bytes) -> Path:
    """A log without an index, and a chunk more behind its header."""
    data = write_mcap(path, run(), **NO_INDEX).read_bytes()
    header_end = 8 + 9 + struct.unpack_from("<Q", data, 9)[0]
    path.write_bytes(data[:header_end] + chunk + data[header_end:])
    return path


def _with_bag_chunk(path: Path, chunk: bytes) -> Path:
    """A bag that was not closed, and a chunk more behind its header."""
    data = write_bag(path, run()).read_bytes()
    at = data.index(b"index_pos=") + len(b"index_pos=")
    data = data[:at] + bytes(8) + data[at + 8 :]
    path.write_bytes(data[:4109] + chunk + data[4109:])
    return path


def _mcap(compression: str, claimed: int, packed: bytes | None = None) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        data = huge(compression) if packed is None else packed
        return _with_mcap_chunk(folder / "run.mcap", mcap_chunk(data, claimed, compression))

    return make


def _bag(compression: str, claimed: int) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        data = huge(compression)
        return _with_bag_chunk(folder / "run.bag", bag_chunk(data, claimed, compression.encode()))

    return make


def _message(folder: Path) -> Path:
    """A ROS 2 bag whose messages are compressed one by one, the third one a bomb."""
    bag = write_rosbag2(folder / "run", run(), compression="MESSAGE")
    with sqlite3.connect(bag / "run.db3") as base:
        base.execute("UPDATE messages SET data = ? WHERE id = 5", (huge("zstd"),))
    return bag


def _lying_frame() -> bytes:
    """A zstd frame whose own header claims 2^50 bytes."""
    return b"\x28\xb5\x2f\xfd" + bytes([0xE0]) + struct.pack("<Q", 2**50) + b"\1\0\0"


BOMBS: dict[str, Callable[[Path], Path]] = {
    **{
        f"MCAP chunk, {name}, {what}": _mcap(name, claimed)
        for name in ("zstd", "lz4")
        for what, claimed in (
            ("64 MB as it claims", HUGE),
            ("64 MB, claims 1000 bytes", 1000),
            ("claims 2^62 bytes", 2**62),
        )
    },
    "MCAP chunk, zstd, its frame claims 2^50 bytes": _mcap("zstd", 1000, _lying_frame()),
    **{
        f"bag chunk, {name}, {what}": _bag(name, claimed)
        for name in ("bz2", "lz4")
        for what, claimed in (
            ("64 MB as it claims", HUGE),
            ("64 MB, claims 1000 bytes", 1000),
            ("claims 2^32 - 1 bytes", 2**32 - 1),
        )
    },
    "ROS 2 message, zstd, 64 MB": _message,
}
