"""How a CARMEN log is recognized: it is plain text, so that only its first lines tell."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import IO

CARMEN_FORMAT = "CARMEN log"
GZIP_MAGIC = b"\x1f\x8b"
_KINDS = ("PARAM", "SYNC", "ODOM", "TRUEPOS", "MARKER", "FLASER", "RLASER", "ROBOTLASER1", "ROBOTLASER2")
"""First words of the lines of a log."""
_LOOKED_AT = 1 << 16
"""Characters within which the first line comes that is no comment."""


def is_carmen(path: Path) -> bool:
    """Whether a file begins like a CARMEN log: comments, then one of its messages."""
    try:
        with opened_text(path) as lines:
            for line in lines.read(_LOOKED_AT).splitlines():
                words = line.split(maxsplit=1)
                if words and not words[0].startswith("#"):
                    return words[0] in _KINDS
    except (OSError, EOFError, UnicodeDecodeError):
        pass
    return False


def opened_text(path: Path) -> IO[str]:
    """Open a log as text, decompressed if it is packed."""
    with path.open("rb") as file:
        is_packed = file.read(len(GZIP_MAGIC)) == GZIP_MAGIC
    return gzip.open(path, "rt", encoding="ascii") if is_packed else path.open(encoding="ascii")
