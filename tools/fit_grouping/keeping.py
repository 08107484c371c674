"""What takes long is kept in files, whole or not at all, so that a run that was stopped goes on."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rose2_logs.system.files import replacing

Made = TypeVar("Made")


def kept(path: Path | None, make: Callable[[], Made]) -> Made:
    """Return what a file keeps, or make it and keep it there; without a path it is only made."""
    if path and path.exists():
        read: Made = pickle.loads(path.read_bytes())
        return read
    made = make()
    if path:
        with replacing(path) as part:
            part.write_bytes(pickle.dumps(made))
    return made
