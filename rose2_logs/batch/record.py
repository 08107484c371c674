"""What is kept with the results of a log so that a batch can be resumed: log, signature, options."""

from __future__ import annotations

import dataclasses
import json
import sys
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from rose2_logs import __version__
from rose2_logs.batch.location import Location
from rose2_logs.config.run_options import RECORDING_LAYERS, RunOptions
from rose2_logs.errors import LogError
from rose2_logs.runs.provenance import log_files
from rose2_logs.runs.summary import write_json
from rose2_logs.system.files import readable

RECORD = ".batch.json"
"""Beside the results of a log; no other command looks at it."""
SETTLED_S = 2.0
"""A file may change again within this time and keep its time stamp: FAT's stamps are even seconds."""


def deciding_settings(options: RunOptions) -> dict[str, Any]:
    """Return everything but the log that its tables depend on, as flat JSON values; the version too."""
    deciding = options.deciding()
    blocks = deciding.pop("parameters")
    flat = {f"{block}.{name}": value for block, values in blocks.items() for name, value in values.items()}
    return {"rose2-logs": __version__, **deciding, **flat}


@dataclass(frozen=True, slots=True)
class Signature:
    """What is known of the files of a log without reading them.

    The log's fingerprint is the SHA-256 of all its bytes (`provenance.fingerprint`), which a run computes
    anyway. It need not be computed again as long as the signature is the same. Of local files the signature
    holds name, size and the times of the last change of content and of metadata, in nanoseconds: to change a
    file and keep all of them takes setting back the clock. Of files behind URLs it holds name, size and
    whatever the server reports about their version (ETag, checksum, generation, time of change).

    Attributes
    ----------
    files : tuple
        For each file its name, size and version.
    is_sound : bool
        Whether the same signature means the same content: not where a file had changed within `SETTLED_S`
        before, or its server reports nothing about its version.
    """

    files: tuple[tuple[str, int | None, tuple[str, ...]], ...]
    is_sound: bool

    @property
    def size_bytes(self) -> int:
        """Size of all files, as far as known."""
        return sum(size or 0 for _, size, _ in self.files)

    def proves_unchanged_since(self, earlier: Signature) -> bool:
        """Whether the log is certainly the same as when `earlier` was taken."""
        return earlier.is_sound and earlier.files == self.files


def local_signature(log: Path) -> Signature:
    """Take the signature of a log on this machine.

    Raises
    ------
    LogError
        If it is not there.
    """
    now_ns = time.time_ns()
    base = log if log.is_dir() else log.parent
    files, newest_ns = [], 0
    try:
        for file in log_files(log):
            about = file.stat()
            name = readable(file.relative_to(base).as_posix() if file.is_relative_to(base) else file)
            files.append((name, about.st_size, (str(about.st_mtime_ns), str(about.st_ctime_ns))))
            newest_ns = max(newest_ns, about.st_mtime_ns, about.st_ctime_ns)
    except OSError as error:
        raise LogError(f"{log}: cannot be read: {error.strerror}") from error
    if not files:
        raise LogError(f"{log}: there is no such file or directory, or it is empty")
    return Signature(tuple(files), newest_ns + round(SETTLED_S * 1e9) <= now_ns)


@dataclass(frozen=True, slots=True)
class Record:
    """What is kept with the results of one log.

    Attributes
    ----------
    address : str
        Path or URL of the log.
    signature : Signature
        Signature of the log.
    sha256 : str
        Fingerprint of the log.
    settings : dict
        `deciding_settings`.
    layers : tuple of str
        Layers of the recording, if there is one.
    """

    address: str
    signature: Signature
    sha256: str
    settings: dict[str, Any]
    layers: tuple[str, ...] = RECORDING_LAYERS

    def write(self, folder: Path) -> None:
        """Write it next to the results in a folder.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        write_json(folder / RECORD, dataclasses.asdict(self))

    def difference(self, settings: dict[str, Any]) -> str:
        """Describe the first of the settings that differs from that of the record; empty if none does."""
        if self.settings == settings:
            return ""
        for name in (*settings, *self.settings):
            before, now = self.settings.get(name), settings.get(name)
            if before != now:
                return (
                    f"{name} {'unset' if before is None else before}, now {'unset' if now is None else now}"
                )
        return ""


def read_record(folder: Path) -> Record | None:
    """Read the record of the results of a log; None if there is no usable one."""
    try:
        kept = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        files = tuple((name, size, tuple(version)) for name, size, version in kept["signature"]["files"])
        signature = Signature(files, bool(kept["signature"]["is_sound"]))
        settings = _shared(json.dumps(kept["settings"]))
        layers = tuple(map(sys.intern, kept.get("layers", RECORDING_LAYERS)))
        return Record(str(kept["address"]), signature, str(kept["sha256"]), settings, layers)
    except (OSError, ValueError, KeyError, TypeError):
        return None


@lru_cache(maxsize=16)
def _shared(settings: str) -> dict[str, Any]:
    """Return the settings of a text in JSON: the same object for the same text, not one for each log."""
    return dict(json.loads(settings))


def signature_of(log: Location) -> Signature:
    """Take the signature of a log wherever it lies.

    Raises
    ------
    LogError
        If it is not there, or its server does not answer.
    """
    if not log.is_remote:
        return local_signature(Path(log.target))
    from rose2_logs.batch.remote import describe

    files = describe(log.target)
    return Signature(
        tuple((file.name, file.size_bytes, file.version) for file in files),
        all(file.version for file in files),
    )
