"""Decompression that ends at a limit, whatever a header claims and however much comes out."""

from __future__ import annotations

import bz2
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zstandard

COPIED_AT_ONCE = 1 << 20
"""Bytes that are in memory while a file is decompressed into another."""


REMEDY = "if it is real, raise the parameter reading.chunk_max_bytes"


class TooLargeError(ValueError):
    """Something is, or claims to be, larger than it may be."""


def decompress(
    compression: str,
    data: bytes | memoryview,
    claimed_bytes: int | None,
    most_bytes: int,
    *,
    is_cut: bool = False,
) -> bytes | memoryview:
    """Decompress what must fit into memory.

    Parameters
    ----------
    compression : str
        ``zstd``, ``lz4`` (frames), ``bz2``; empty or ``none`` gives the data back.
    data : bytes
        The compressed data.
    claimed_bytes : int, optional
        How much comes out, by a header around the data.
    most_bytes : int
        How much may come out.
    is_cut : bool
        Whether the data are but a beginning: as much comes out as can.

    Raises
    ------
    TooLargeError
        If more is claimed, or comes out, than may.
    ValueError
        If the data are damaged, or not of the claimed length.
    """
    if claimed_bytes is not None and claimed_bytes > most_bytes:
        raise TooLargeError(
            f"it claims {claimed_bytes} bytes; the most that are read is {most_bytes}; {REMEDY}"
        )
    if compression in ("", "none"):
        if len(data) > most_bytes:
            raise TooLargeError(f"it has {len(data)} bytes; the most that are read is {most_bytes}; {REMEDY}")
        return data
    if compression not in _BY_NAME:
        raise ValueError(f"the compression {compression!r} is unknown")
    limit = most_bytes if claimed_bytes is None else claimed_bytes
    try:
        plain = _BY_NAME[compression](data, limit, is_cut)
    except (zstandard.ZstdError, OSError, EOFError, RuntimeError, MemoryError) as error:
        raise ValueError(f"the {compression} data are damaged: {error}") from error
    if len(plain) > limit:
        raise TooLargeError(f"more than {limit} bytes come out of {len(data)}; {REMEDY}")
    if claimed_bytes is not None and len(plain) != claimed_bytes and not is_cut:
        raise ValueError(f"{len(plain)} bytes come out where {claimed_bytes} are claimed")
    return plain


def _zstd(data: bytes | memoryview, limit: int, is_cut: bool) -> bytes:
    claimed = zstandard.frame_content_size(data)
    if claimed > limit:
        raise TooLargeError(f"it claims {claimed} bytes; the most that are read is {limit}; {REMEDY}")
    if claimed >= 0 and not is_cut:
        return zstandard.ZstdDecompressor().decompress(data)
    # One more than may be, so that it shows.
    return zstandard.ZstdDecompressor().stream_reader(data).read(limit + 1)


def _lz4(data: bytes | memoryview, limit: int, is_cut: bool) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    decompressor: Any = LZ4FrameDecompressor()
    plain: bytes = decompressor.decompress(data, max_length=limit + 1)
    if not decompressor.eof and len(plain) <= limit and not is_cut:
        raise ValueError("the lz4 data end too early")
    return plain


def _bz2(data: bytes | memoryview, limit: int, is_cut: bool) -> bytes:
    decompressor = bz2.BZ2Decompressor()
    plain = decompressor.decompress(data, limit + 1)
    if not decompressor.eof and len(plain) <= limit and not is_cut:
        raise ValueError("the bz2 data end too early")
    return plain


_BY_NAME: dict[str, Callable[[bytes | memoryview, int, bool], bytes]] = {
    "zstd": _zstd,
    "lz4": _lz4,
    "bz2": _bz2,
}


def decompress_file(packed: Path, plain: Path, most_bytes: int) -> None:
    """Decompress a zstd file into another.

    Raises
    ------
    TooLargeError
        If more than `most_bytes` come out.
    OSError, zstandard.ZstdError
        If a file cannot be read or written, or is damaged.
    """
    left = most_bytes
    with packed.open("rb") as source, plain.open("wb") as target:
        stream = zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True)
        while part := stream.read(COPIED_AT_ONCE):
            left -= len(part)
            if left < 0:
                raise TooLargeError(f"more than {most_bytes} bytes come out of it")
            target.write(part)
