"""What Rerun's writer of files needs around it: where it cannot write, it waits without end."""

from __future__ import annotations

import ctypes
import shutil
from pathlib import Path

import rerun as rr

from rose2_logs.errors import OutputError

LEAST_FREE_BYTES = 1 << 25
"""Space that must be left on the disk while a recording is written: more than a snapshot and what waits."""


def require_space(part: Path, path: Path) -> None:
    """Refuse to go on writing where the disk is nearly full.

    Raises
    ------
    OutputError
        If less than `LEAST_FREE_BYTES` are left.
    """
    free = shutil.disk_usage(part.parent).free
    if free < LEAST_FREE_BYTES:
        raise OutputError(f"{path}: cannot be written: the disk is full ({free / 1e6:.1f} MB are left)")


def abandon(recording: rr.RecordingStream) -> None:
    """Leave a recording whose file cannot be written.

    To close or delete it, or the usual end of the process, would wait for the writer for ever.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(recording))
    rr.unregister_shutdown()
