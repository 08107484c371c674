"""Values passed between processes: large arrays through shared memory, everything else as a pickle.

Through a pipe, the arrays of one map would be copied four times in pieces of a few kilobytes.
"""

from __future__ import annotations

import mmap
import pickle
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rose2_logs.errors import Rose2LogsError

SHARED_MEMORY = Path("/dev/shm")
"""Where Linux keeps files in memory; other systems use the folder for temporary files."""
LARGE_BYTES = 1 << 16
"""Arrays of this size or more go through shared memory: the capacity of a pipe."""
ALIGNMENT_BYTES = 64
"""Arrays start at multiples of this, as NumPy and OpenCV prefer."""


class SharedMemoryError(Rose2LogsError):
    """There is not enough space for a value to be passed to another process."""


@dataclass(frozen=True)
class Packed:
    """A value on its way to another process.

    Attributes
    ----------
    pickled : bytes
        Everything but the large arrays.
    file : str, optional
        File with the large arrays; it is removed when the value is unpacked.
    spans : tuple of (int, int)
        Start and end of each array in the file.
    """

    pickled: bytes
    file: str | None = None
    spans: tuple[tuple[int, int], ...] = ()


@contextmanager
def shared_memory_folders() -> Iterator[tuple[str, ...]]:
    """Yield folders for packed values, the best one first; they are removed afterwards with their content."""
    with ExitStack() as stack:
        places = [str(SHARED_MEMORY)] if SHARED_MEMORY.is_dir() else []
        folders = []
        for place in (*places, tempfile.gettempdir()):
            with suppress(OSError):
                folders.append(
                    stack.enter_context(tempfile.TemporaryDirectory(prefix="rose2_logs_", dir=place))
                )
        yield tuple(folders)


def pack(value: Any, folders: Sequence[str]) -> Packed:
    """Pack a picklable value; its large arrays are written to the first folder with enough space.

    Raises
    ------
    SharedMemoryError
        If no folder has enough space.
    """
    arrays: list[memoryview] = []

    def keep_in_pickle(buffer: pickle.PickleBuffer) -> bool:
        if (raw := buffer.raw()).nbytes < LARGE_BYTES:
            return True
        arrays.append(raw)
        return False

    pickled = pickle.dumps(value, protocol=5, buffer_callback=keep_in_pickle)
    if not arrays:
        return Packed(pickled)
    spans, end = [], 0
    for array in arrays:
        begin = end + -end % ALIGNMENT_BYTES
        end = begin + array.nbytes
        spans.append((begin, end))
    why: OSError | None = None
    for folder in folders:
        try:
            return Packed(pickled, _written(arrays, spans, folder), tuple(spans))
        except OSError as error:
            why = error
    raise SharedMemoryError(
        f"not enough space for {end / 1e6:.0f} MB in {' or '.join(folders) or tempfile.gettempdir()}: {why}; "
        "free some space or use one worker"
    )


def _written(arrays: Sequence[memoryview], spans: Sequence[tuple[int, int]], folder: str) -> str:
    """Write arrays to a new file in a folder and return its name."""
    # Written, not mapped: in full shared memory, writing raises an error, but mapping kills the process.
    with tempfile.NamedTemporaryFile(dir=folder, delete=False, buffering=0) as file:
        try:
            for array, (begin, _) in zip(arrays, spans, strict=True):
                file.seek(begin)
                left = array
                while left:
                    left = left[file.write(left) :]
        except BaseException:
            Path(file.name).unlink()
            raise
    return file.name


def unpack(packed: Packed) -> Any:
    """Unpack a value (only once); its arrays keep the mapped memory alive as long as they exist."""
    if packed.file is None:
        return pickle.loads(packed.pickled)  # noqa: S301 (of a worker of this run)
    with Path(packed.file).open("rb") as file:
        mapped = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
    # On Windows a mapped file cannot be removed; it is removed with its folder.
    with suppress(OSError):
        Path(packed.file).unlink()
    arrays = [mapped[begin:end] for begin, end in packed.spans]
    return pickle.loads(packed.pickled, buffers=arrays)  # noqa: S301 (of a worker of this run)
