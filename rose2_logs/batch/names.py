"""Names of logs' folders: safe on every file system, one for each log, the same when the batch goes on."""

from __future__ import annotations

import hashlib
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping

from rose2_logs.batch.location import Location
from rose2_logs.io.discovery import stem_of

LONGEST_BYTES = 120
"""File systems take names of 255 bytes; endings and ``log=`` come on top."""
HASH_DIGITS = 8

_UNSAFE = re.compile(r"[^\w.-]+")
_NUMBER_LIKE = re.compile(r"[-+.\d_]+(e[-+]?\d+)?|nan|[-+]?inf(inity)?|null|none|true|false", re.IGNORECASE)


def safe_name(text: str) -> str:
    """Make one part of a path of any text: letters, digits, and ``. _ -``, never hidden, never empty.

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
    """Give every log a name of its own.

    Parameters
    ----------
    logs : iterable of Location
    known : mapping of address to name
        Logs that have a name; they keep it.
    taken : iterable of str
        More names that cannot be given, to logs that are not known.

    Returns
    -------
    dict of Location to str
        The log's own name, preceded by those of its folders as far as it takes to tell it from the others;
        where that is not enough a hash of its address follows. Names differ by more than upper and lower
        case.
    """
    logs = list(logs)
    names = {log: known[log.address] for log in logs if log.address in known}
    used = {name.casefold() for name in (*known.values(), *taken)}
    new = sorted(log for log in logs if log not in names)
    level = 0
    while new:
        candidates = {log: _candidate(log, level) for log in new}
        wanted = Counter(name.casefold() for name in candidates.values())
        for log, name in candidates.items():
            if wanted[name.casefold()] == 1 and name.casefold() not in used:
                names[log] = name
                used.add(name.casefold())
        new = [log for log in new if log not in names]
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
