"""Decompression up to a limit, whatever size a header claims and however large the data really are."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import zstandard

from rose2_logs.io.discovery import ZSTD_MAGIC

COPIED_AT_ONCE = 1 << 20
"""Bytes that are in memory while a file is decompressed into another one."""


REMEDY = "if that is correct, raise the parameter reading.chunk_max_bytes"


class TooLargeError(ValueError):
    """Something is, or claims to be, larger than the limit."""


def decompress(
    compression: str,
    data: bytes | memoryview,
    claimed_bytes: int | None,
    most_bytes: int,
    *,
    is_cut: bool = False,
) -> bytes | memoryview:
    """Decompress data in memory.

    Parameters
    ----------
    compression : str
        ``zstd``, ``lz4`` (frames) or ``bz2``; empty or ``none`` returns the data unchanged.
    data : bytes
        The compressed data.
    claimed_bytes : int, optional
        The decompressed size that a header around the data claims.
    most_bytes : int
        The largest decompressed size that is accepted.
    is_cut : bool
        Whether the data are only the beginning: then whatever can be decompressed is returned.

    Raises
    ------
    TooLargeError
        If the claimed or the real size exceeds the limit.
    ValueError
        If the data are damaged, or their size is not the claimed one.
    """
    if claimed_bytes is not None and claimed_bytes > most_bytes:
        raise TooLargeError(f"it claims {claimed_bytes} bytes, more than the limit of {most_bytes}; {REMEDY}")
    if compression in ("", "none"):
        if len(data) > most_bytes:
            raise TooLargeError(f"it has {len(data)} bytes, more than the limit of {most_bytes}; {REMEDY}")
        return data
    if compression not in _BY_NAME:
        raise ValueError(f"unknown compression {compression!r}")
    limit = most_bytes if claimed_bytes is None else claimed_bytes
    try:
        plain = _BY_NAME[compression](data, limit, is_cut)
    except (zstandard.ZstdError, OSError, EOFError, RuntimeError) as error:
        raise ValueError(f"the {compression} data are damaged: {error}") from error
    if len(plain) > limit:
        raise TooLargeError(f"{len(data)} bytes decompress to more than {limit} bytes; {REMEDY}")
    if claimed_bytes is not None and len(plain) != claimed_bytes and not is_cut:
        raise ValueError(f"it decompresses to {len(plain)} bytes instead of the claimed {claimed_bytes}")
    return plain


def _zstd(data: bytes | memoryview, limit: int, is_cut: bool) -> bytes:
    claimed = zstandard.frame_content_size(data)
    if claimed > limit:
        raise TooLargeError(f"it claims {claimed} bytes, more than the limit of {limit}; {REMEDY}")
    if claimed >= 0 and not is_cut:
        return zstandard.ZstdDecompressor().decompress(data)
    # One byte more than the limit, so that exceeding it is noticed.
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


GZIP_MAGIC = b"\x1f\x8b"
XZ_MAGIC = b"\xfd7zXZ\x00"
LZ4_MAGIC = b"\x04\x22\x4d\x18"
DAMAGED = (zstandard.ZstdError, ValueError, OSError, EOFError, RuntimeError, zlib.error, lzma.LZMAError)
"""What the libraries raise for damaged data."""


def is_packed(begin: bytes) -> bool:
    """Whether a file is compressed, by its first bytes."""
    return begin.startswith(tuple(_PACKED))


@contextmanager
def opened_packed(packed: Path) -> Iterator[Any]:
    """Open a compressed file to read what is in it, as far as it goes, with ``read1``."""
    with packed.open("rb") as source:
        begin = source.read(_LONGEST_MAGIC)
        source.seek(0)
        opened = next(opener for magic, opener in _PACKED.items() if begin.startswith(magic))
        with opened(source) as stream:
            yield stream


def first_bytes(packed: Path, count: int) -> bytes:
    """Return what a compressed file begins with once it is decompressed; nothing if it is damaged."""
    found = b""
    with suppress(*DAMAGED), opened_packed(packed) as stream:
        while len(found) < count and (part := stream.read1(count - len(found))):
            found += part
    return found


def decompress_file(packed: Path, plain: Path, most_bytes: int) -> None:
    """Decompress a file into another file.

    Parameters
    ----------
    packed, plain : path
        The two files; what the first is compressed with, its first bytes tell.
    most_bytes : int
        The largest size that is accepted.

    Raises
    ------
    TooLargeError
        If more come out.
    DAMAGED
        If a file cannot be read or written, or is damaged; what comes before the damage is written.
    """
    left = most_bytes
    with opened_packed(packed) as stream, plain.open("wb") as target:
        while part := stream.read1(COPIED_AT_ONCE):
            left -= len(part)
            if left < 0:
                raise TooLargeError(f"it decompresses to more than {most_bytes} bytes")
            target.write(part)


def _open_zstd(source: IO[bytes]) -> Any:
    return zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True)


def _open_lz4(source: IO[bytes]) -> Any:
    from lz4.frame import LZ4FrameFile

    return LZ4FrameFile(source)


_PACKED: dict[bytes, Callable[[IO[bytes]], Any]] = {
    GZIP_MAGIC: lambda source: gzip.GzipFile(fileobj=source),
    ZSTD_MAGIC: _open_zstd,
    b"BZh": bz2.BZ2File,
    XZ_MAGIC: lzma.LZMAFile,
    LZ4_MAGIC: _open_lz4,
}
"""How a compressed file is opened, by its first bytes."""
_LONGEST_MAGIC = max(map(len, _PACKED))
