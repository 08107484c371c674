"""What Rerun's writer of files needs around it: where it cannot write, it waits forever or ends Python."""

from __future__ import annotations

import ctypes
import shutil
import sys
from pathlib import Path

import rerun as rr

from rose2_logs.errors import OutputError

LEAST_FREE_BYTES = 1 << 25
"""Space that must be left on the disk while a recording is written: more than a snapshot and what waits."""
LEAST_ADDRESSES_BYTES = 4 << 30
"""Addresses that a process must be allowed: Rerun's threads reserve some, and end Python if they get none."""
LEAST_OPEN_FILES = 32
"""Files that a process must be allowed to open, for the same reason."""


def require_space(part: Path, path: Path) -> None:
    """Refuse to go on writing where the disk is nearly full, or the file nearly as large as it may be.

    Raises
    ------
    OutputError
        If less than `LEAST_FREE_BYTES` are left.
    """
    free = shutil.disk_usage(part.parent).free
    if free < LEAST_FREE_BYTES:
        raise OutputError(f"{path}: cannot be written: the disk is full ({free / 1e6:.1f} MB are left)")
    largest = _allowed("RLIMIT_FSIZE")
    written = part.stat().st_size if part.exists() else 0
    if largest is not None and largest - written < LEAST_FREE_BYTES:
        raise OutputError(
            f"{path}: cannot be written: files may have {largest / 1e6:.1f} MB (ulimit -f), "
            "too few for a recording"
        )


def require_resources(path: Path, instead: str = "") -> None:
    """Refuse to start Rerun where this process may have less than it needs.

    Parameters
    ----------
    path : path
        The recording.
    instead : str
        What one may do instead of allowing more, for the message.

    Raises
    ------
    OutputError
        If it may have fewer addresses or open files.
    """
    addresses, files = _allowed("RLIMIT_AS"), _allowed("RLIMIT_NOFILE")
    lack = ""
    if addresses is not None and addresses < LEAST_ADDRESSES_BYTES:
        lack = f"{LEAST_ADDRESSES_BYTES / 1e9:.1f} GB of addresses, not {addresses / 1e9:.1f} GB (ulimit -v)"
    elif files is not None and files < LEAST_OPEN_FILES:
        lack = f"{LEAST_OPEN_FILES} open files, not {files} (ulimit -n)"
    if lack:
        raise OutputError(f"{path}: cannot be written: a recording needs {lack}; allow more{instead}")


def _allowed(name: str) -> int | None:
    """Return a limit of this process, None without one."""
    if sys.platform == "win32":
        return None
    import resource

    limit, _ = resource.getrlimit(getattr(resource, name))
    return None if limit == resource.RLIM_INFINITY else limit


def abandon(recording: rr.RecordingStream) -> None:
    """Leave a recording whose file cannot be written.

    To close or delete it, or the usual end of the process, would wait for the writer forever.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(recording))
    rr.unregister_shutdown()
