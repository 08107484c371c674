"""Files that are either complete or absent: written under a hidden name and renamed at the end."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType

from rose2_logs.errors import OutputError, ParameterError

logger = logging.getLogger(__name__)

LONGEST_NAME_BYTES = 255 - len("..journal")
"""File systems allow 255 bytes; the hidden files of a run in progress add a dot and an ending to the name."""

_URL = re.compile("([a-z][a-z0-9+.-]+):(?:/+(.*))?", re.IGNORECASE)
"""A URL as a path has it: with one of its slashes, without any if nothing follows. A drive is one letter."""


def part_of(path: Path) -> Path:
    """Return the hidden path, in the same folder, at which a file is written until it is complete."""
    return path.with_name(f".{path.name}.part")


def reason_of(error: Exception) -> str:
    """Say in words why a file or folder cannot be used, without the system's error number."""
    if not isinstance(error, OSError):
        return str(error)
    names = [name for name in (error.filename2, error.filename) if isinstance(name, str | os.PathLike)]
    if isinstance(error, IsADirectoryError) and names:
        return f"{os.fspath(names[0])} is a folder, not a file"
    if isinstance(error, (FileExistsError, NotADirectoryError)):
        for path in map(Path, names):
            if file := next((each for each in (path, *path.parents) if each.is_file()), None):
                return f"{file} is a file, not a folder"
    return str(error).removeprefix(f"[Errno {error.errno}] ")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError in the context into an error that names the file.

    Raises
    ------
    OutputError
        In place of an OSError.
    """
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {reason_of(error)}") from error


def is_stream(path: Path) -> bool:
    """Whether something is there that is written to, but never replaced: a device or a pipe."""
    # What is printed may go to a file, which /dev/stdout then is.
    is_device = path.absolute().parent == Path("/dev")
    return path.exists() and not path.is_dir() and (is_device or not path.is_file())


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a path to write to; on success that file replaces `path`. Creates the folder if needed.

    What is written to a device or a pipe, as ``/dev/stdout``, goes through it.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    part = part_of(path)
    with writing(path):
        if is_stream(path):
            with TemporaryDirectory() as folder:
                yield Path(folder) / path.name
                with path.open("ab") as stream:
                    stream.write((Path(folder) / path.name).read_bytes())
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield part
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


@dataclass(frozen=True)
class OnFailure:
    """Undo what was begun if the context fails; its error is the one that is told, also if undoing fails."""

    undo: Callable[[], object]

    def __enter__(self) -> None:
        """Begin the context."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Undo after an error."""
        if kind is not None:
            with suppress(Exception):
                self.undo()


def readable(path: Path | str) -> str:
    """Return a path as valid text; bytes that are not UTF-8 become backslash escapes."""
    return os.fsencode(path).decode(errors="backslashreplace")


def require_utf8(path: Path) -> None:
    """Check that a path is valid UTF-8, as tables, recordings and pages require.

    Raises
    ------
    OutputError
        If it is not.
    """
    try:
        str(path.resolve()).encode()
    except UnicodeEncodeError as error:
        raise OutputError(
            f"{readable(path)}: its name is not valid UTF-8, so results cannot refer to it; rename it"
        ) from error


def expanded(path: Path) -> Path:
    """Return a path from the home folder where it begins with ``~/``, which shells leave in ``--out=~/runs``.

    A name that only begins with the sign is one of a file.
    """
    return path.expanduser() if path.parts[:1] == ("~",) else path


def require_local(path: Path) -> None:
    """Check that a path is no URL, whose scheme would be the name of a folder.

    Raises
    ------
    ParameterError
        If it is one.
    """
    if url := _URL.fullmatch(str(path)):
        raise ParameterError(
            f"{url[1]}://{url[2] or ''}: is a URL, where a local path is needed; only batch reads logs from "
            "URLs and writes results to object stores"
        )


def require_short(files: Iterable[Path]) -> None:
    """Check that no name is too long for a file system.

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
    """Check that no file would be replaced, unless `overwrite` is set.

    Raises
    ------
    OutputError
        If one exists and must not be replaced.
    """
    if not overwrite and (existing := [file for file in files if file.exists() and not is_stream(file)]):
        raise OutputError(
            f"{existing[0]}: already exists; choose another folder, or allow overwriting (overwrite=True)"
        )


@contextmanager
def locked(path: Path, refusal: str) -> Iterator[None]:
    """Hold a file lock while the context lasts; the lock of a killed process is released by the system.

    Parameters
    ----------
    path : path
        The lock file, removed afterwards; its folder must exist.
    refusal : str
        Error message if another process holds the lock.

    Raises
    ------
    OutputError
        If another process holds the lock, or the file cannot be created.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(path)
    try:
        lock.acquire(timeout=0)
    except Timeout as error:
        raise OutputError(refusal) from error
    except NotImplementedError:
        logger.warning(
            "%s: this file system has no locks; make sure that nothing else writes here meanwhile",
            path.parent,
        )
    except OSError as error:
        raise OutputError(f"{path.parent}: cannot be written: {reason_of(error)}") from error
    try:
        yield
    finally:
        # On Windows an open file cannot be removed: there the lock removes it when it is released.
        with suppress(OSError):
            path.unlink()
        lock.release()
