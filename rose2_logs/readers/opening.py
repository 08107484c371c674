"""From a path to what reads it: told by how a file begins, else by its name."""

from __future__ import annotations

import glob
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from rose2_logs.errors import LogError
from rose2_logs.readers.discovery import IMAGE_ENDINGS, MAP_ENDINGS, STORAGE_ENDINGS
from rose2_logs.readers.log import LogReader
from rose2_logs.readers.selection import Selection
from rose2_logs.readers.source import LogInfo, MessageSource

LogPath = str | Path | Sequence[str | Path]

EVERYTHING = Selection()
_FORMATS = (
    "an .mcap file, a ROS 1 .bag, a ROS 2 bag directory or .db3, a map_server .yaml or a folder of those"
)
_MAGIC = {b"\x89MCAP0\r\n": ".mcap", b"#ROSBAG ": ".bag", b"SQLite f": ".db3"}


def open_log(path: LogPath, *, topic: str | None = None, selection: Selection = EVERYTHING) -> LogReader:
    """Open a log for reading its maps.

    Parameters
    ----------
    path : str, Path or a sequence of them
        An ``.mcap`` file, a ROS 1 ``.bag``, a ROS 2 bag directory, a ``.db3`` file, a map_server ``.yaml``
        (one snapshot), a folder of such maps, a pattern like ``maps/*.yaml`` (natural order), or several
        files of one kind, which are read as one log.
    topic : str, optional
        The map topic; by default ``/map``, else the only one.
    selection : Selection
        Which of its maps to take.

    Returns
    -------
    LogReader
        To be closed, or used as a context manager.

    Raises
    ------
    NoMapTopicError
        If the log has no map topic, or several, none of them ``/map``, and none is named.
    LogError
        If the log cannot be opened.
    """
    source = open_source(path)
    try:
        return LogReader(source, topic, selection)
    except BaseException:
        source.close()
        raise


def inspect_log(path: LogPath) -> LogInfo:
    """Tell what a log holds, also one without any map.

    Parameters
    ----------
    path : str, Path or a sequence of them
        As for `open_log`.

    Raises
    ------
    LogError
        If the log cannot be opened.
    """
    source = open_source(path)
    source.close()
    return source.info


def open_source(path: LogPath) -> MessageSource:
    """Open a log for looking at several of its topics; to be closed.

    Parameters
    ----------
    path : str, Path or a sequence of them
        As for `open_log`.

    Raises
    ------
    LogError
        If the log cannot be opened.
    """
    if not isinstance(path, (str, Path)):
        files = [Path(each) for each in path]
        if not files:
            raise LogError("no log was given")
        return _open_files(files[0], files) if len(files) > 1 else open_source(files[0])
    log = Path(path)
    if log.is_dir():
        return _open_directory(log)
    if not log.exists():
        found = [Path(each) for each in glob.glob(str(path))]  # noqa: PTH207 (may be absolute)
        if not found:
            raise LogError(f"{path}: there is no such file or directory")
        return _open_files(log, found, in_natural_order=True)
    return _open_files(log, [log])


def _open_files(log: Path, files: list[Path], in_natural_order: bool = False) -> MessageSource:
    """Open files of one kind as one log."""
    from rose2_logs.readers.map_files import MapFilesSource, natural_order

    if missing := [file for file in files if not file.is_file()]:
        raise LogError(f"{missing[0]}: is not a file; several logs are read as one only if all are files")
    if in_natural_order:
        files = sorted(files, key=natural_order)
    kinds = {_kind(file) for file in files}
    if len(kinds) > 1:
        raise LogError(f"{log}: files of different kinds ({', '.join(sorted(kinds))}) cannot be one log")
    size = sum(file.stat().st_size for file in files)
    match kinds.pop():
        case ".yaml":
            return MapFilesSource(log, files)
        case "image":
            return MapFilesSource(log, [_yaml_beside(file) for file in files])
        case ".mcap":
            from rose2_logs.readers.mcap_log import McapSource

            return McapSource(log, files)
        case kind:
            from rose2_logs.readers.bag_log import BagSource

            return BagSource(log, files, "ROS 1 bag" if kind == ".bag" else "ROS 2 database (sqlite3)", size)


def _kind(file: Path) -> str:
    """Kind of a file by how it begins, else by its name."""
    try:
        with file.open("rb") as stream:
            begin = stream.read(8)
    except OSError as error:
        raise LogError(f"{file}: cannot be opened: {error.strerror}") from error
    suffix = file.suffix.lower()
    if begin in _MAGIC:
        return _MAGIC[begin]
    if suffix in MAP_ENDINGS:
        return ".yaml"
    if suffix in IMAGE_ENDINGS:
        return "image"
    if suffix in STORAGE_ENDINGS:
        what = "is empty" if not begin else f"does not begin as {suffix} files do"
        raise LogError(f"{file}: {what}; was it copied whole?")
    raise LogError(f"{file}: is not a kind of log that can be read; give {_FORMATS}")


def _yaml_beside(image: Path) -> Path:
    for suffix in MAP_ENDINGS:
        if (beside := image.with_suffix(suffix)).exists():
            return beside
    raise LogError(
        f"{image}: needs {image.stem}.yaml beside it with its resolution and origin (map_server's format)"
    )


def _open_directory(log: Path) -> MessageSource:
    """Open a ROS 2 bag, or a folder of saved maps, or of the files of a recording that was not closed."""
    from rose2_logs.readers.map_files import is_map_file

    if (log / "metadata.yaml").exists():
        return _open_rosbag2(log)
    inside = sorted(each for each in log.iterdir() if each.is_file())
    for suffix in STORAGE_ENDINGS:
        if files := [each for each in inside if each.suffix == suffix]:
            return _open_files(log, files, in_natural_order=True)
    if maps := [each for each in inside if each.suffix.lower() in MAP_ENDINGS and is_map_file(each)]:
        return _open_files(log, maps, in_natural_order=True)
    raise LogError(f"{log}: holds neither a bag (metadata.yaml) nor saved maps; give {_FORMATS}")


def _open_rosbag2(log: Path) -> MessageSource:
    described = _rosbag2_metadata(log)
    size = sum(each.stat().st_size for each in log.iterdir() if each.is_file())
    if described.get("storage_identifier") != "mcap":
        from rose2_logs.readers.bag_log import BagSource

        return BagSource(log, [log], "ROS 2 bag (sqlite3)", size)
    # rosbags refuses MCAP files with other than ROS 2 channels beside the map.
    from rose2_logs.readers.mcap_log import McapSource

    files = [log / PurePosixPath(name).name for name in described.get("relative_file_paths") or []]
    if missing := [file for file in files if not file.exists()]:
        raise LogError(f"{missing[0]}: is missing, but {log / 'metadata.yaml'} names it")
    mode = str(described.get("compression_mode") or "none").lower()
    if mode != "none" and described.get("compression_format") != "zstd":
        raise LogError(f"{log}: its compression {described.get('compression_format')!r} is unknown; use zstd")
    if mode != "file":
        return McapSource(
            log, files, format_name="ROS 2 bag (mcap)", size_bytes=size, messages_are_zstd=mode == "message"
        )
    scratch = tempfile.TemporaryDirectory(prefix="rose2_logs_")
    try:
        files = [_decompressed(file, Path(scratch.name)) for file in files]
        return McapSource(
            log, files, format_name="ROS 2 bag (mcap)", size_bytes=size, on_close=scratch.cleanup
        )
    except BaseException:
        scratch.cleanup()
        raise


def _rosbag2_metadata(log: Path) -> dict[str, Any]:
    import yaml

    path = log / "metadata.yaml"
    try:
        described = yaml.safe_load(path.read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    except (yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError) as error:
        raise LogError(f"{path}: does not describe a ROS 2 bag; run `ros2 bag reindex` on {log}") from error
    if not isinstance(described, dict):
        raise LogError(f"{path}: does not describe a ROS 2 bag; run `ros2 bag reindex` on {log}")
    return described


def _decompressed(file: Path, directory: Path) -> Path:
    import zstandard

    target = directory / file.stem
    try:
        with file.open("rb") as packed, target.open("wb") as plain:
            shutil.copyfileobj(zstandard.ZstdDecompressor().stream_reader(packed), plain)
    except (zstandard.ZstdError, OSError) as error:
        raise LogError(f"{file}: cannot be decompressed: {error}") from error
    return target
