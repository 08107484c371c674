"""Which files of a folder make up logs, decided by their names alone, so that a listing is enough."""

from __future__ import annotations

import logging
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from rose2_logs.errors import InvalidMapError, LogError
from rose2_logs.system.files import reason_of
from rose2_logs.system.text import counted, listed
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

MAP_ENDINGS = (".yaml", ".yml")
IMAGE_ENDINGS = (".pgm", ".png", ".bmp", ".tif", ".tiff")
LOSSY_ENDINGS = (".jpg", ".jpeg", ".webp")
"""Endings of images that may not keep grays exactly: map savers write 205 for unknown, and 206 is free."""
STORAGE_ENDINGS = (".mcap", ".db3", ".bag", ".bag.active")
"""``.bag.active`` is a bag that its recorder did not close."""
CARMEN_ENDINGS = (".log.gz", ".clf.gz", ".log", ".clf")
"""Usual endings of CARMEN logs, which are recognized by their content; many other files end in ``.log``."""
COMPRESSED_ENDINGS = (".zstd", ".zst", ".gz", ".bz2", ".xz", ".lz4")
"""Endings of logs that were compressed as a whole: ROS 2 writes the first, people the others."""
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of zstd data. No CDR message starts like this: its first byte is 0."""
ANNOTATED_ENDING = ".rose2.mcap"
"""Ending of annotated logs, which are results and not logs to analyze."""
BAG_DESCRIPTION = "metadata.yaml"
TOLD_MOST = 3
"""Pieces of a recording that are named in one line."""
LAST_NUMBER = re.compile(r"_(\d+)(\.[a-z][a-z0-9]*)+$", re.IGNORECASE)
"""Recorders number the files of a recording one after the other, at the end of their names."""
_DIGITS = re.compile(r"\d+")


def plain_name(name: str) -> str:
    """Name of a log without the ending that says it is compressed."""
    for ending in COMPRESSED_ENDINGS:
        plain = name.removesuffix(ending)
        if plain != name and plain.lower().endswith(STORAGE_ENDINGS):
            return plain
    return name


def stem_of(name: str) -> str:
    """Name of a log without its format's ending."""
    name = plain_name(name)
    for ending in (*STORAGE_ENDINGS, *MAP_ENDINGS, *CARMEN_ENDINGS):
        name = name.removesuffix(ending)
    return name


def logs_among(files: Iterable[str], folder_name: str) -> list[str]:
    """Find the logs in a folder by the names of its files.

    A folder is one log if it is a ROS 2 bag, see `is_bag`, or if it contains saved maps and no bags: these
    are the maps of one run. Every other MCAP file, bag or database is a separate log. Hidden files and
    annotated logs are ignored.

    Parameters
    ----------
    files : iterable of str
        Paths relative to the folder, with ``/`` between their parts, at any depth.
    folder_name : str
        The folder's own name.

    Returns
    -------
    list of str
        Paths of the logs relative to the folder, sorted; ``""`` stands for the folder itself.
    """
    names_in: dict[str, list[str]] = defaultdict(list)
    for file in files:
        path = PurePosixPath(file)
        if not any(part.startswith(".") for part in path.parts):
            names_in[_text(path.parent)].append(path.name)
    found: list[str] = []
    bags: list[str] = []
    for folder in sorted(names_in):
        if any(folder == bag or folder.startswith(f"{bag}/") or bag == "" for bag in bags):
            continue
        names = sorted(names_in[folder])
        if is_bag(names, PurePosixPath(folder).name or folder_name):
            bags.append(folder)
            found.append(folder)
        elif stored := [name for name in names if is_storage(name)]:
            # One that was compressed and kept is there twice.
            once = [name for name in stored if plain_name(name) == name or plain_name(name) not in stored]
            found += [f"{folder}/{name}" if folder else name for name in once]
        elif _holds_maps(names):
            found.append(folder)
    return sorted(found)


def is_bag(names: Sequence[str], folder_name: str) -> bool:
    """Whether the files of a folder make up a ROS 2 bag.

    A bag has ``metadata.yaml`` next to its storage files. A recording that was not closed has only the
    storage files ``FOLDER_0``, ``FOLDER_1``, and so on.
    """
    stored = [name for name in names if is_storage(name)]
    if not stored or BAG_DESCRIPTION in names:
        return bool(stored)
    parts = {f"{folder_name}_{number}" for number in range(len(stored))}
    return {PurePosixPath(plain_name(name)).stem for name in stored} == parts


def split_recordings(logs: Iterable[str]) -> list[list[str]]:
    """Find logs that may be pieces of one recording.

    They are numbered from 0 on at the end of their names, which are alike but for digits.

    Parameters
    ----------
    logs : iterable of str
        Paths or URLs of files.

    Returns
    -------
    list of list of str
        The pieces of each, in order.
    """
    pieces: dict[tuple[str, str], dict[int, str]] = defaultdict(dict)
    for log in logs:
        folder, _, name = log.replace("\\", "/").rpartition("/")
        if is_storage(name) and (found := LAST_NUMBER.search(name)):
            # Recorders put the time at which a piece was begun before its number.
            alike = f"{folder}/{_DIGITS.sub('0', name[: found.start()])}"
            pieces[alike, PurePosixPath(plain_name(name)).suffix][int(found[1])] = log
    return [
        [numbers[place] for place in range(len(numbers))]
        for numbers in pieces.values()
        if len(numbers) > 1 and set(numbers) == set(range(len(numbers)))
    ]


def tell_split_recordings(logs: Iterable[str], remedy: str) -> None:
    """Warn of logs that are going to be analyzed by themselves, and may be pieces of one recording."""
    found = split_recordings(logs)
    if found:
        pieces = [PurePosixPath(log).name for log in found[0]]
        more = f", and {counted(len(found) - 1, 'other recording')} like it" if len(found) > 1 else ""
        text = (
            f"{listed(pieces, TOLD_MOST)}: may be pieces of one recording{more}, and are analyzed as a log "
            f"each; {remedy}"
        )
        log_warning(logger, "split_recording", text)


def is_storage(name: str) -> bool:
    """Whether a name belongs to an MCAP file, a bag or a database that is not an annotated log.

    It may be compressed.
    """
    plain = plain_name(name)
    return plain.lower().endswith(STORAGE_ENDINGS) and not plain.endswith(ANNOTATED_ENDING)


def _text(folder: PurePosixPath) -> str:
    return "" if folder == PurePosixPath(".") else folder.as_posix()


def _holds_maps(names: Sequence[str]) -> bool:
    stems = {PurePosixPath(name).stem for name in names if name.lower().endswith(IMAGE_ENDINGS)}
    return any(name.lower().endswith(MAP_ENDINGS) and PurePosixPath(name).stem in stems for name in names)


LARGEST_BYTES = 1 << 22
"""Descriptions take a few kilobytes; those of bags with thousands of files take a megabyte."""


def load_strings(path: Path) -> dict[str, Any]:
    """Read a mapping from a YAML file as `load_yaml` does, with every value as the text that stands there.

    YAML 1.1 and 1.2 differ in what is a number; who reads one says what counts.
    """
    return load_yaml(path, typed=False)


def load_yaml(path: Path, *, typed: bool = True) -> dict[str, Any]:
    """Read a mapping from a YAML file.

    Parameters
    ----------
    path : path
        The file.
    typed : bool
        Whether values are numbers, dates and so on where they look like it, and not all text.

    Raises
    ------
    LogError
        If the file cannot be read or is too large.
    InvalidMapError
        If it is not YAML, or describes nothing.
    """
    import yaml

    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise LogError(f"{path}: is too large to describe a map or a bag", file=path)
        # The loader in C where available: the one in Python takes quadratic time for deep nesting.
        names = ("CSafeLoader", "CBaseLoader") if yaml.__with_libyaml__ else ("SafeLoader", "BaseLoader")
        loader = getattr(yaml, names[0] if typed else names[1])
        described = yaml.load(path.read_text(encoding="utf-8"), loader)  # noqa: S506 (all are safe)
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: cannot be read: {reason_of(error)}", file=path) from error
    # RecursionError: endless nesting. ValueError: numbers and dates that Python does not accept.
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InvalidMapError(f"{path}: is not YAML: {' '.join(str(error).split())}", file=path) from error
    if not isinstance(described, dict):
        raise InvalidMapError(
            f"{path}: does not describe a map; it needs the fields image, resolution and origin", file=path
        )
    return described
