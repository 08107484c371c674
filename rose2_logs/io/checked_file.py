"""A file whose lost sectors are damage of the log, while other faults of the storage stay what they are."""

from __future__ import annotations

import errno
import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

DAMAGE = (errno.EIO, errno.EINVAL)
"""A sector that cannot be read, and a place that cannot be, which an index may name. Others, as a lost
network, may pass: whoever reads may try again."""


@contextmanager
def _as_damage() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno not in DAMAGE:
            raise
        raise ValueError(f"the storage cannot read it: {error.strerror}") from error
    except OverflowError as error:
        raise ValueError("it lies beyond the end of the file") from error


class CheckedFile(io.FileIO):
    """A file for reading that raises ValueError where it is damaged."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Read up to so many bytes."""
        with _as_damage():
            return super().read(-1 if size is None else size) or b""

    def readinto(self, buffer: Any, /) -> int:
        """Read into a buffer."""
        with _as_damage():
            return super().readinto(buffer) or 0

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """Go to a place."""
        with _as_damage():
            return super().seek(offset, whence)
