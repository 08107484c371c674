"""What a run has found so far, kept on the disk map by map, so that a run that was stopped can go on.

Only the analysis of the maps is kept, which takes nearly all of the time. Tracking and outputs follow from it
anew, so that they are what they would have been without the stop.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

import zstandard

from rose2_logs.errors import InvalidMapError, OutputError
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.runs.serialization import Serializer
from rose2_logs.system.files import writing
from rose2_logs.system.workers import Workers

Found = SnapshotAnalysis | InvalidMapError
"""What comes of one map, or why nothing does."""

MAGIC = b"rose2_logs journal 3\n"
"""At the beginning of the file, with the number of its layout."""
COMPRESSION_LEVEL = 1
"""Of zstd: what is gained above it is little and takes longer."""

_FRAME = struct.Struct("<QI")  # length of what follows, its CRC-32
Entry = tuple[int, int, SnapshotAnalysis | str]
"""Index and log time of a map, and what was found in it, or the message of the error."""

_SERIALIZER: Serializer[Entry] = Serializer(Entry)


@dataclass(frozen=True)
class KeptMaps:
    """What a journal on the disk holds.

    Attributes
    ----------
    facts : dict
        Of the run that wrote it, JSON values.
    maps : int
        How many maps are whole.
    begin, end : int
        Where they begin and end in the file; what comes after was cut off.
    """

    facts: dict[str, Any]
    maps: int
    begin: int
    end: int


def kept_maps(path: Path) -> KeptMaps | None:
    """Read a journal as far as it is complete; None if there is no usable one.

    It is read once through, one map at a time.
    """
    try:
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC or (head := _read_frame(file)) is None:
                return None
            facts = json.loads(zstandard.decompress(head))
            begin = end = file.tell()
            maps = 0
            while _read_frame(file) is not None:
                maps, end = maps + 1, file.tell()
    except (OSError, ValueError, zstandard.ZstdError):
        return None
    return KeptMaps(facts, maps, begin, end) if isinstance(facts, dict) else None


class Journal:
    """The journal of a run: gives what was found before a stop, and takes what is found from there on.

    A map is appended in one piece with its length and checksum, so that a stop at any moment costs no more
    than the maps in work. A context manager that closes the file; what becomes of it is the caller's.

    Parameters
    ----------
    path : path
        Where it is.
    facts : dict
        What the analysis depends on, JSON values; kept at its beginning.
    kept : KeptMaps, optional
        What it holds already, to go on with; else it begins anew.

    Attributes
    ----------
    maps : int
        How many it holds.
    """

    def __init__(self, path: Path, facts: dict[str, Any], kept: KeptMaps | None = None) -> None:
        self.maps = 0 if kept is None else kept.maps
        self._path = path
        self._facts = facts
        self._place, self._end = (0, 0) if kept is None else (kept.begin, kept.end)
        self._file: IO[bytes] | None = None
        self._compressor = zstandard.ZstdCompressor(COMPRESSION_LEVEL)

    def __enter__(self) -> Self:
        with writing(self._path):
            if self._end:
                self._file = self._path.open("r+b", buffering=0)
                self._file.truncate(self._end)
            else:
                self._file = self._path.open("w+b", buffering=0)
                self._append(json.dumps(self._facts).encode(), MAGIC)
                self._place = self._end
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._file is not None:
            self._file.close()

    def known(self, snapshot: OccupancySnapshot) -> Found | None:
        """Return what was found in a map before the stop, None after the last of these maps.

        Raises
        ------
        OutputError
            If it is not the next map in the journal, or the entry cannot be read.
        """
        if self._file is None or self._place >= self._end:
            return None
        with writing(self._path):
            self._file.seek(self._place)
            frame = _read_frame(self._file)
            self._place = self._file.tell()
        try:
            index, log_time_ns, found = _SERIALIZER.decode(zstandard.decompress(frame or b""))
        except (ValueError, zstandard.ZstdError) as error:
            raise self._does_not_fit(str(error)) from error
        if (index, log_time_ns) != (snapshot.index, snapshot.log_time_ns):
            raise self._does_not_fit(f"map {index} instead of {snapshot.index}")
        return InvalidMapError(found) if isinstance(found, str) else found

    def add(self, snapshot: OccupancySnapshot, found: Found) -> None:
        """Append what was found in a map.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        value = str(found) if isinstance(found, InvalidMapError) else found
        with writing(self._path):
            self._append(_SERIALIZER.encode((snapshot.index, snapshot.log_time_ns, value)))
        self._place = self._end
        self.maps += 1

    def _append(self, data: bytes, before: bytes = b"") -> None:
        assert self._file is not None
        packed = self._compressor.compress(data)
        piece = memoryview(before + _FRAME.pack(len(packed), zlib.crc32(packed)) + packed)
        self._file.seek(self._end)
        self._end += len(piece)
        while piece:
            piece = piece[self._file.write(piece) :]

    def _does_not_fit(self, why: str) -> OutputError:
        return OutputError(f"{self._path}: does not fit the log ({why}); leave out resume=True to begin anew")


class JournaledWorkers:
    """Workers whose results go through a journal: known results are read from it, new ones are added.

    Parameters
    ----------
    workers : Workers
        What analyzes the maps, started.
    journal : Journal
        Open.
    """

    def __init__(self, workers: Workers[OccupancySnapshot, Found], journal: Journal) -> None:
        self._workers = workers
        self._journal = journal

    def map(
        self,
        snapshots: Iterable[OccupancySnapshot],
        is_same: Callable[[OccupancySnapshot, OccupancySnapshot], bool] | None = None,
    ) -> Iterator[tuple[OccupancySnapshot, Found]]:
        """Return each map with what was found in it, in their order, as `Workers.map` does."""
        replayed = -1

        def known(snapshot: OccupancySnapshot) -> Found | None:
            nonlocal replayed
            found = self._journal.known(snapshot)
            if found is not None:
                replayed = snapshot.index
            return found

        def journaled() -> Iterator[tuple[OccupancySnapshot, Found]]:
            before: Found | None = None
            for snapshot, found in results:
                if found is not before and snapshot.index > replayed:
                    self._journal.add(snapshot, found)
                before = found
                yield snapshot, found

        results = self._workers.map(snapshots, is_same, known)
        return journaled()


def _read_frame(file: IO[bytes]) -> bytes | None:
    """Read the next piece; None if it is cut off or damaged."""
    head = file.read(_FRAME.size)
    if len(head) < _FRAME.size:
        return None
    length, checksum = _FRAME.unpack(head)
    # A length that was cut off or overwritten may say anything.
    left = os.fstat(file.fileno()).st_size - file.tell()
    # Zeros are what a power failure leaves; no piece is empty.
    if not 0 < length <= left:
        return None
    data = file.read(length)
    return data if len(data) == length and zlib.crc32(data) == checksum else None
