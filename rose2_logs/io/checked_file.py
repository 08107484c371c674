"""A file whose bad sectors count as damage to the log, while other storage errors are passed on."""

from __future__ import annotations

import errno
import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

DAMAGE = (errno.EIO, errno.EINVAL)
"""An unreadable sector, and an impossible offset as a damaged index may give. Other errors, such as a lost
network, may be temporary: the caller can retry."""


@contextmanager
def _as_damage() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno not in DAMAGE:
            raise
        raise ValueError(f"the storage device cannot read it: {error.strerror}") from error
    except OverflowError as error:
        raise ValueError("it is beyond the end of the file") from error


class CheckedFile(io.FileIO):
    """A file opened for reading that raises ValueError where it is damaged."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Read up to `size` bytes."""
        with _as_damage():
            return super().read(-1 if size is None else size) or b""

    def readinto(self, buffer: Any, /) -> int:
        """Read into a buffer."""
        with _as_damage():
            return super().readinto(buffer) or 0

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """Move to an offset."""
        with _as_damage():
            return super().seek(offset, whence)
