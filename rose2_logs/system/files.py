"""Files that are whole or absent: written hidden beside their name and renamed at the end."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rose2_logs.errors import OutputError

logger = logging.getLogger(__name__)

LONGEST_NAME_BYTES = 255 - len("..journal")
"""File systems take 255; what is hidden beside results while they are made has a dot and an ending more."""


def part_of(path: Path) -> Path:
    """Return where a file is written until it is whole: hidden, in the folder where it will stand."""
    return path.with_name(f".{path.name}.part")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Name a file in the error of whatever cannot be written.

    Raises
    ------
    OutputError
        Instead of an OSError within.
    """
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error}") from error


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a path to write to, which takes the place of another when all went well; its folder is made.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    part = part_of(path)
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield part
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def readable(path: Path | str) -> str:
    """Return a path as text that any file can hold: bytes that are not UTF-8 are written as in Python."""
    return os.fsencode(path).decode(errors="backslashreplace")


def require_utf8(path: Path) -> None:
    """Refuse a name that results could not hold: tables, recordings and pages are UTF-8.

    Raises
    ------
    OutputError
        If the path has bytes that are not.
    """
    try:
        str(path.resolve()).encode()
    except UnicodeEncodeError as error:
        raise OutputError(
            f"{readable(path)}: its name is not UTF-8, and results could not name it; rename it"
        ) from error


def require_short(files: Iterable[Path]) -> None:
    """Refuse names that are too long for a file system.

    Raises
    ------
    OutputError
        If one is.
    """
    for file in files:
        if len(os.fsencode(file.name)) > LONGEST_NAME_BYTES:
            raise OutputError(
                f"{file}: cannot be written: its name is longer than {LONGEST_NAME_BYTES} bytes; "
                "give the log a shorter name"
            )


def refuse_existing(files: Iterable[Path], *, overwrite: bool) -> None:
    """Refuse to replace files unasked.

    Raises
    ------
    OutputError
        If one exists and may not be replaced.
    """
    if not overwrite and (existing := [file for file in files if file.exists()]):
        raise OutputError(
            f"{existing[0]}: exists already; choose another folder or allow overwriting (overwrite=True)"
        )


@contextmanager
def locked(path: Path, refusal: str) -> Iterator[None]:
    """Hold a lock, whose file goes with it; that of a process that was killed does not hold.

    Parameters
    ----------
    path : path
        Of the lock's file; its folder is there.
    refusal : str
        Said if another process holds it.

    Raises
    ------
    OutputError
        If another process holds it, or it cannot be made.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(path)
    try:
        lock.acquire(timeout=0)
    except Timeout as error:
        raise OutputError(refusal) from error
    except NotImplementedError:
        logger.warning(
            "%s: its file system has no locks; let nothing else write there meanwhile", path.parent
        )
    except OSError as error:
        raise OutputError(f"{path.parent}: cannot be written: {error}") from error
    try:
        yield
    finally:
        # Windows lets nothing remove a file that is open: there the lock itself does, once it is released.
        with suppress(OSError):
            path.unlink()
        lock.release()
