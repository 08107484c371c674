"""Logs behind URLs, by fsspec: listed, identified by what their server says of them, and fetched."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

from rose2_logs.batch.location import Location
from rose2_logs.errors import LogError
from rose2_logs.io.discovery import (
    IMAGE_ENDINGS,
    MAP_ENDINGS,
    STORAGE_ENDINGS,
    plain_name,
)

EXTRA = "pip install 'rose2-logs[batch]'"
VERSION_KEYS = (
    "etag",
    "content-md5",
    "md5hash",
    "digest",
    "crc32c",
    "generation",
    "versionid",
    "last-modified",
    "lastmodified",
    "last_modified",
    "mtime",
    "updated",
)
"""What servers and object stores call the version of a file in the answers of fsspec; one is enough."""
CONNECT_TIMEOUT_S, SILENCE_TIMEOUT_S = 30.0, 60.0
"""Of HTTP; a download may take any time as long as bytes arrive."""
PASSING_STATUS = (408, 429)
"""HTTP codes of errors that may pass: timeout, too many requests."""
OBJECT_STORES = frozenset({"s3", "gs", "gcs", "az", "abfs"})
"""File systems whose outermost folders are buckets."""
CREDENTIALS = (
    "S3 takes them from AWS_PROFILE, or from AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, on every machine "
    "that works; FSSPEC_S3_ANON=true reads public buckets without"
)


class TransferError(LogError):
    """A server or the way to it failed; another try may succeed."""


@dataclass(frozen=True)
class RemoteFile:
    """A file of a log behind a URL.

    Attributes
    ----------
    path : str
        What its file system calls it.
    name : str
        Path relative to the folder that the log is fetched into.
    size_bytes : int or None
        None if the server does not say.
    version : tuple of str
        What the server says of its version, as ``key=value``; empty if nothing.
    """

    path: str
    name: str
    size_bytes: int | None
    version: tuple[str, ...]


def check(url: str) -> None:
    """Check that the packages are installed that opening a URL takes.

    Raises
    ------
    LogError
        If not.
    """
    file_system(url)


def matching(url: str) -> list[tuple[str, bool]]:
    """List the URLs that match a pattern, sorted, each with whether it is a folder.

    Raises
    ------
    LogError
        If they cannot be listed.
    """
    files, path = file_system(url)
    with asking(url, files, path):
        found: dict[str, Any] = files.glob(path, detail=True)
        if not found:
            _require_bucket(files, path)
    return [(_url_of(each, url, path), found[each]["type"] == "directory") for each in sorted(found)]


def files_below(url: str) -> list[str]:
    """List the files below a folder at any depth, as paths relative to it.

    Raises
    ------
    LogError
        If they cannot be listed.
    """
    files, path = file_system(url)
    with asking(url, files, path):
        found = files.find(path)
        if not found:
            _require_bucket(files, path)
    return [_relative(each, path) for each in found]


def files_in(url: str) -> list[str]:
    """List the names of the files in a folder.

    Raises
    ------
    LogError
        If they cannot be listed.
    """
    files, path = file_system(url)
    with asking(url, files, path):
        listed = files.ls(path, detail=True)
    return [PurePosixPath(each["name"]).name for each in listed if each["type"] == "file"]


def describe(url: str) -> list[RemoteFile]:
    """List the files of a log, sorted by name.

    Raises
    ------
    LogError
        If there is no such log, or the server does not answer.
    """
    files, path = file_system(url)
    name = _local_name(path, PurePosixPath(path).name or "log")
    with asking(url, files, path):
        about = files.info(path)
        # HTTP knows no folders: what is not named like a log is one.
        is_folder = about["type"] == "directory"
        is_folder |= _is_web(url) and not plain_name(name.lower()).endswith((*STORAGE_ENDINGS, *MAP_ENDINGS))
        paths = sorted(files.find(path)) if is_folder else [path, *_images_of(files, path)]
        described = []
        for each in paths:
            info = files.info(each)
            own = _local_name(each, _relative(each, path) if is_folder else PurePosixPath(each).name)
            own = f"{name}/{own}" if is_folder else own
            described.append(RemoteFile(each, own, info.get("size"), _version(info)))
    return described


def fetch(url: str, described: list[RemoteFile], folder: Path) -> Path:
    """Copy a log's files into a local folder.

    Returns
    -------
    path
        The log there.

    Raises
    ------
    TransferError
        If a file does not arrive whole.
    """
    files, path = file_system(url)
    for file in described:
        local = folder / file.name
        local.parent.mkdir(parents=True, exist_ok=True)
        with asking(url, files, path):
            files.get_file(file.path, str(local))
        arrived = local.stat().st_size
        if file.size_bytes not in (None, arrived):
            raise TransferError(
                f"{Location(url).address}: only {arrived} of {file.size_bytes} bytes of {file.name} arrived"
            )
    return folder / PurePosixPath(described[0].name).parts[0]


def file_system(url: str) -> tuple[Any, str]:
    """Open the file system of a URL, and tell what it calls the URL.

    Raises
    ------
    LogError
        If the packages are not installed that it takes.
    """
    shown = Location(url).address
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise LogError(f"{shown}: logs behind URLs need fsspec: {EXTRA}") from error
    # What a worker that runs for long has seen before must not be taken for how a log is now.
    options: dict[str, Any] = {"skip_instance_cache": True}
    try:
        if _is_web(url):
            from aiohttp import ClientTimeout

            timeout = ClientTimeout(total=None, sock_connect=CONNECT_TIMEOUT_S, sock_read=SILENCE_TIMEOUT_S)
            options["client_kwargs"] = {"timeout": timeout}
        files, path = url_to_fs(url, **options)
        files.invalidate_cache()
    except ImportError as error:
        needed = f"{error}: {EXTRA}" if _is_web(url) else f"{error} (with pip)"
        raise LogError(f"{shown}: {needed}") from error
    except ValueError as error:
        raise LogError(f"{shown}: {error}") from error
    return files, str(path)


@contextmanager
def asking(url: str, files: Any, path: str) -> Iterator[None]:
    """Turn any failure into an error about the log; each library behind fsspec has its own."""
    shown = Location(url).address
    try:
        yield
    except (FileNotFoundError, NotADirectoryError) as error:
        # Where the server does not answer at all, HTTP's file system says "not found" too.
        if isinstance(error.__cause__, OSError):
            raise TransferError(f"{shown}: {error.__cause__}") from error
        _require_bucket(files, path)
        raise LogError(f"{shown}: there is no such file or folder") from error
    except PermissionError as error:
        raise LogError(f"{shown}: the server gives no permission: {error}") from error
    except LogError:
        raise
    except Exception as error:
        if "Credentials" in type(error).__name__:
            raise LogError(f"{shown}: {error}; {CREDENTIALS}") from error
        status = getattr(error, "status", None)
        # The text of an HTTP error holds the URL with its signature.
        reason = f"HTTP {status}" if isinstance(status, int) else str(error).replace(url, shown)
        refused = isinstance(status, int) and 400 <= status < 500 and status not in PASSING_STATUS
        kind = LogError if refused else TransferError
        raise kind(f"{shown}: {type(error).__name__}: {reason}") from error


def _require_bucket(files: Any, path: str) -> None:
    """Tell where nothing is found because an object store has no such bucket."""
    bucket = path.partition("/")[0]
    schemes = (files.protocol,) if isinstance(files.protocol, str) else files.protocol
    if OBJECT_STORES.intersection(schemes) and not files.exists(bucket):
        raise LogError(f"{schemes[0]}://{path}: there is no bucket {bucket!r} that these credentials can see")


def _is_web(url: str) -> bool:
    return url.startswith(("http://", "https://"))


def _url_of(path: str, url: str, asked: str) -> str:
    """URL of a path of the file system that opened `url`, which calls that one `asked`."""
    head, link, chain = url.partition("::")
    return head.removesuffix(asked) + path + link + chain


def _relative(path: str, folder: str) -> str:
    return path.removeprefix(folder).strip("/")


def _local_name(path: str, name: str) -> str:
    """Name for a local copy, which cannot lead out of the folder that it is put into."""
    local = PurePosixPath(unquote(name.partition("?")[0]) if _is_web(path) else name)
    if local.is_absolute() or ".." in local.parts or "\\" in str(local) or not local.name:
        raise LogError(f"{Location(path).address}: its name {str(local)!r} cannot be that of a local file")
    return str(local)


def _images_of(files: Any, path: str) -> list[str]:
    """Images next to a saved map's ``.yaml``."""
    if not path.lower().endswith(MAP_ENDINGS):
        return []
    beside = files.ls(str(path).rpartition("/")[0], detail=False)
    stem = path.rpartition(".")[0]
    return sorted(each for each in beside if each in {f"{stem}{ending}" for ending in IMAGE_ENDINGS})


def _version(info: dict[str, Any]) -> tuple[str, ...]:
    known = {key.lower(): value for key, value in info.items() if value}
    return tuple(f"{key}={known[key]}" for key in VERSION_KEYS if key in known)
