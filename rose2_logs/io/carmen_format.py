"""How a CARMEN log is recognized: it is plain text, so that only its first lines tell."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path
from typing import IO

CARMEN_FORMAT = "CARMEN log"
GZIP_MAGIC = b"\x1f\x8b"
_KINDS = ("PARAM ", "ODOM ", "FLASER ", "RLASER ", "ROBOTLASER1 ")
"""How lines of a log begin."""
_LOOKED_AT = 1 << 16
"""Characters among which the first message is: comments and the edges of a graph may come before it."""


def is_carmen(path: Path) -> bool:
    """Whether a message of CARMEN is among the first lines of a file."""
    try:
        with opened_text(path) as text:
            lines = text.read(_LOOKED_AT).splitlines()
    except (OSError, EOFError, UnicodeDecodeError, zlib.error):
        return False
    return any(line.startswith(_KINDS) for line in lines)


def opened_text(path: Path) -> IO[str]:
    """Open a log as text, decompressed if it is packed."""
    with path.open("rb") as file:
        is_packed = file.read(len(GZIP_MAGIC)) == GZIP_MAGIC
    return gzip.open(path, "rt", encoding="ascii") if is_packed else path.open(encoding="ascii")
