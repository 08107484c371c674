"""The folder for a batch's results: locked, cleaned up after a killed one, filled with whole results only."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rose2_logs.batch.task import RUNNING
from rose2_logs.system import files
from rose2_logs.system.files import writing

LOGS_FOLDER = "logs"
WORK_FOLDER = ".batch"
"""In the folder for results: what is unfinished, and the lock. It may be removed while no batch runs."""
UNFINISHED, REPLACED, LOCK = "unfinished", "replaced", "lock"


def put_in_place(results: Path, out: Path, name: str) -> None:
    """Give whole results of a log their final place; those that stood there go.

    Raises
    ------
    OSError
        If they cannot be moved; then all is as before.
    """
    folder, old = out / LOGS_FOLDER / name, out / WORK_FOLDER / REPLACED / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    if folder.exists():
        old.parent.mkdir(parents=True, exist_ok=True)
        folder.rename(old)
    try:
        results.rename(folder)
    except OSError:
        if old.exists():
            old.rename(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)


@contextmanager
def locked(out: Path) -> Iterator[None]:
    """Keep other batches out of the folder; the lock of one that was killed does not hold."""
    with writing(out):
        (out / WORK_FOLDER).mkdir(parents=True, exist_ok=True)
    with files.locked(out / WORK_FOLDER / LOCK, f"{out}: another batch is writing to this folder"):
        yield


@contextmanager
def work_folder(out: Path) -> Iterator[Path]:
    """Give a folder for unfinished results, after whatever an earlier batch has left is put right."""
    unfinished, replaced = out / WORK_FOLDER / UNFINISHED, out / WORK_FOLDER / REPLACED
    for old in replaced.glob("*"):
        # Stopped between the two steps of `put_in_place`: the earlier results were whole.
        folder = out / LOGS_FOLDER / old.name
        if folder.exists():
            shutil.rmtree(old, ignore_errors=True)
        else:
            old.rename(folder)
    shutil.rmtree(unfinished, ignore_errors=True)
    work = unfinished / uuid.uuid4().hex[:8]
    work.mkdir(parents=True)
    (work / RUNNING).touch()
    try:
        yield work
    finally:
        # First of all: workers on other machines look for it.
        (work / RUNNING).unlink(missing_ok=True)
        shutil.rmtree(unfinished, ignore_errors=True)
