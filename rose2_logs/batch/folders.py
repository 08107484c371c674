"""Folders of a batch: their names; the output folder is locked, cleaned, and filled with complete results.

The names are safe on every file system, one for each log, and the same when the batch is resumed.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import unicodedata
import uuid
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from rose2_logs.batch.location import Location
from rose2_logs.io.discovery import stem_of
from rose2_logs.system import files
from rose2_logs.system.files import writing

LOGS_FOLDER = "logs"
WORK_FOLDER = ".batch"
"""In the folder for results: unfinished results and the lock. It may be removed while no batch runs."""
UNFINISHED, REPLACED, LOCK = "unfinished", "replaced", "lock"
RUNNING = "running"
"""File in the folder for unfinished results that is there as long as the batch runs."""

LONGEST_BYTES = 120
"""File systems allow names of 255 bytes; endings and ``log=`` are added."""
HASH_DIGITS = 8

_UNSAFE = re.compile(r"[^\w.-]+")
_NUMBER_LIKE = re.compile(r"[-+.\d_]+(e[-+]?\d+)?|nan|[-+]?inf(inity)?|null|none|true|false", re.IGNORECASE)


def put_in_place(results: Path, out: Path, name: str) -> None:
    """Move whole results of a log to their final place; earlier ones are deleted.

    Raises
    ------
    OSError
        If they cannot be moved; then everything is as before.
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
    """Keep other batches out of the folder; the lock of a killed one does not count."""
    with writing(out):
        (out / WORK_FOLDER).mkdir(parents=True, exist_ok=True)
    with files.locked(out / WORK_FOLDER / LOCK, f"{out}: another batch is writing to this folder"):
        yield


@contextmanager
def work_folder(out: Path) -> Iterator[Path]:
    """Give a folder for unfinished results, after cleaning up what an earlier batch may have left."""
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
        # First of all, as workers on other machines look for it.
        (work / RUNNING).unlink(missing_ok=True)
        shutil.rmtree(unfinished, ignore_errors=True)


def safe_name(text: str) -> str:
    """Make a valid name of a folder of any text: letters, digits, and ``. _ -``, never hidden, never empty.

    Names that readers of a partitioned data set would take for numbers, dates or missing values get a prefix.
    """
    name = _UNSAFE.sub("_", unicodedata.normalize("NFC", text)).strip("._")
    name = name.encode()[:LONGEST_BYTES].decode(errors="ignore").rstrip("._")
    if not name or _NUMBER_LIKE.fullmatch(name):
        name = f"log_{name}".rstrip("_")
    return name


def assign_names(
    logs: Iterable[Location], known: Mapping[str, str], taken: Iterable[str] = ()
) -> dict[Location, str]:
    """Give every log a different name.

    Parameters
    ----------
    logs : iterable of Location
    known : mapping of address to name
        Logs that have a name; they keep it.
    taken : iterable of str
        Names that are not free for logs that have none.

    Returns
    -------
    dict of Location to str
        The log's own name, preceded by those of its folders as far as needed to make it unique;
        where that is not enough a hash of its address follows. Names differ by more than upper and lower
        case. A log gets the same name whichever of the others have theirs already.
    """
    logs = sorted(logs)
    names = {log: known[log.address] for log in logs if log.address in known}
    used = {name.casefold() for name in (*known.values(), *taken)}
    level = 0
    while logs:
        candidates = {log: _candidate(log, level) for log in logs}
        wanted = Counter(name.casefold() for name in candidates.values())
        left = []
        for log, name in candidates.items():
            is_used = name.casefold() in used and names.get(log) != name
            if is_used or wanted[name.casefold()] > 1:
                left.append(log)
            elif log not in names:
                names[log] = name
                used.add(name.casefold())
        logs = left
        level += 1
    return names


def _candidate(log: Location, level: int) -> str:
    """Name with `level` folders before it; beyond the outermost with a hash, another at each level."""
    *folders, own = log.parts
    stem = stem_of(own)
    if level <= len(folders):
        return safe_name("_".join((*folders[len(folders) - level :], stem)))
    digest = hashlib.sha256(f"{level - len(folders)}{log.address}".encode()).hexdigest()
    return f"{safe_name(stem)}-{digest[:HASH_DIGITS]}"
