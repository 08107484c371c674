"""Logs among paths, folders, patterns and URLs."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

from rose2_logs.batch.location import WEB_SCHEMES, Location, require_place
from rose2_logs.errors import LogError
from rose2_logs.io.discovery import (
    MAP_ENDINGS,
    STORAGE_ENDINGS,
    is_bag,
    is_storage,
    logs_among,
    plain_name,
    tell_split_recordings,
)
from rose2_logs.system.files import expanded


def find_logs(arguments: Sequence[str], out: Path) -> list[Location]:
    """Find the logs that arguments stand for.

    Parameters
    ----------
    arguments : sequence of str
        Logs, folders of logs at any depth, patterns (``**`` for any depth), URLs of these. A storage file of
        a ROS 2 bag means the bag.
    out : path
        The folder for the results, which is not searched.

    Returns
    -------
    list of Location
        In the order of the arguments, those of one folder sorted, none twice.

    Raises
    ------
    LogError
        If a folder or a pattern has no logs, or a URL cannot be listed. A single log that is not there is
        returned: opening it reports why.
    ParameterError
        If a URL ends behind its scheme.
    """
    found: dict[str, Location] = {}
    # Many arguments may be in the same folder, which is listed only once.
    is_bag_at = cache(_is_bag_at)
    for argument in arguments:
        path = _local_path(argument)
        if "://" in path:
            require_place(path)
        logs = _remote(path, is_bag_at) if "://" in path else _local(path, out, is_bag_at)
        if not logs:
            raise LogError(
                f"{Location(argument).address}: no log there (files {', '.join(STORAGE_ENDINGS)}, "
                "folders of ROS 2 bags or of saved maps)"
            )
        for log in logs:
            each = Location(log)
            found.setdefault(each.address, each)
    remedy = "if they are, analyze them as one, without batch: a folder that holds only these is one log"
    tell_split_recordings((each.address for each in found.values()), remedy)
    return list(found.values())


def _local_path(argument: str) -> str:
    """Turn a URL of a local file into its path; leave all else."""
    url = urlsplit(argument)
    is_file = url.scheme == "file" and url.netloc in ("", "localhost") and "::" not in argument
    return url2pathname(url.path) if is_file else argument


def _local(argument: str, out: Path, is_bag_at: Callable[[str], bool]) -> list[str]:
    path = os.path.abspath(expanded(Path(argument)))  # noqa: PTH100 (resolves "..", keeps symbolic links)
    if Path(path).exists() or not glob.has_magic(argument):
        matches = [path]
    else:
        matches = sorted(glob.glob(path, recursive=True))  # noqa: PTH207 (may be absolute)
        matches = [match for match in matches if Path(match).is_dir() or _is_log_of(match, argument)]
    logs = []
    for match in map(Path, matches):
        if match.is_dir():
            logs += [str(match / log) for log in logs_among(_files_below(match, out), match.name)]
        else:
            is_part = is_storage(match.name) and is_bag_at(str(match.parent))
            logs.append(str(match.parent if is_part else match))
    return logs


def _files_below(folder: Path, out: Path) -> Iterator[str]:
    results = out.absolute()
    for where, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if Path(where, name).absolute() != results]
        for name in names:
            yield Path(where, name).relative_to(folder).as_posix()


def _is_bag_at(folder: str) -> bool:
    """Whether a folder, here or behind a URL, is a ROS 2 bag."""
    if "://" in folder:
        from rose2_logs.batch import remote

        return is_bag(remote.files_in(folder), Location(folder).parts[-1])
    if not Path(folder).is_dir():
        return False
    return is_bag([each.name for each in Path(folder).iterdir()], Path(folder).name)


def _is_log_of(name: str, pattern: str) -> bool:
    """Whether a match of a pattern is a log: of other files only those count that the pattern asks for."""
    return is_storage(name) or (name.endswith(MAP_ENDINGS) and pattern.endswith(MAP_ENDINGS))


def _remote(url: str, is_bag_at: Callable[[str], bool]) -> list[str]:
    from rose2_logs.batch import remote

    if glob.has_magic(urlsplit(url).path if url.startswith(WEB_SCHEMES) else url):
        logs = []
        for match, is_folder in remote.matching(url):
            if is_folder:
                logs += _in_remote_folder(match)
            elif _is_log_of(match, url):
                folder = match.rpartition("/")[0]
                logs.append(folder if is_storage(match) and is_bag_at(folder) else match)
        return logs
    inside = url.partition("::")[0]
    if plain_name(inside.partition("?")[0].lower()).endswith((*STORAGE_ENDINGS, *MAP_ENDINGS)):
        remote.check(url)
        return [url]
    return _in_remote_folder(url)


def _in_remote_folder(url: str) -> list[str]:
    from rose2_logs.batch import remote

    inside, link, outer = url.partition("::")
    inside = inside if inside.endswith("://") else inside.rstrip("/")
    between = "" if inside.endswith("://") else "/"
    names = remote.files_below(f"{inside}{link}{outer}")
    logs = logs_among(names, Location(url).parts[-1])
    return [f"{inside}{between if log else ''}{log}{link}{outer}" for log in logs]
