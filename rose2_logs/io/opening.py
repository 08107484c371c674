"""From a path to its reader: the format is recognized by a file's first bytes, else by its name."""

from __future__ import annotations

import glob
import logging
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.config.reading import ReadingParameters
from rose2_logs.config.selection import Selection
from rose2_logs.errors import LogError
from rose2_logs.io.carmen_format import CARMEN_FORMAT, is_carmen
from rose2_logs.io.decompression import DAMAGED, TooLargeError, decompress_file, first_bytes, is_packed
from rose2_logs.io.discovery import (
    ANNOTATED_ENDING,
    BAG_DESCRIPTION,
    IMAGE_ENDINGS,
    MAP_ENDINGS,
    STORAGE_ENDINGS,
    is_bag,
    is_storage,
    load_yaml,
    plain_name,
)
from rose2_logs.io.log import LogReader, choose_topic
from rose2_logs.io.source import LogInfo, MessageSource
from rose2_logs.system.files import OnFailure, require_local
from rose2_logs.system.text import counted, listed
from rose2_logs.system.warnings import UNCOUNTED, log_warning

if TYPE_CHECKING:
    from rose2_logs.io.file_log import FileLog, OpenFile
    from rose2_logs.io.scan_maps import ScanMaps

logger = logging.getLogger(__name__)

LogPath = str | Path | Sequence[str | Path]

EVERYTHING = Selection()
DEFAULT_LIMITS = ReadingParameters()
USUAL = OccupancyParameters()
DEFAULT_MAPPING = MappingParameters()
DISK_LEFT_BYTES = 1 << 30
"""Disk space left free where the temporary folder is when a bag is decompressed there."""
MASK_WORDS = ("mask", "keepout", "speed_limit")
"""In the names of masks of costmap filters: where a robot must not go, or go slowly."""
_TOLD_FROM_BYTES = 100_000_000
"""Compressed files of this size or more take a while, and their room on the disk."""
_ARCHIVE_ENDINGS = frozenset((".zip", ".tar", ".tgz", ".tbz2", ".txz", ".7z", ".rar"))
_MOST_NAMED = 3
"""Number of files that a warning names."""
_FORMATS = (
    "an .mcap file, a ROS 1 .bag, a ROS 2 bag directory or .db3, a map_server .yaml or a folder of those, or "
    "a CARMEN log"
)
_MAGIC = {b"\x89MCAP0\r\n": ".mcap", b"#ROSBAG ": ".bag", b"SQLite f": ".db3"}
_MAGIC_BYTES = 8


def open_log(
    path: LogPath,
    *,
    topic: str | None = None,
    selection: Selection = EVERYTHING,
    limits: ReadingParameters = DEFAULT_LIMITS,
    occupancy: OccupancyParameters = USUAL,
    part: int | None = None,
    map_from: str | None = None,
    map_frame: str | None = None,
    mapping: MappingParameters = DEFAULT_MAPPING,
) -> LogReader:
    """Open a log to read its maps.

    Parameters
    ----------
    path : str, Path or a sequence of them
        An ``.mcap`` file, a ROS 1 ``.bag``, a ROS 2 bag directory, a ``.db3`` file, a map_server ``.yaml``
        (one snapshot), a folder of such maps, a pattern such as ``maps/*.yaml`` (natural order), or several
        files of one kind, which are read as one log.
    topic : str, optional
        The map topic; by default ``/map``, else the only one.
    selection : Selection
        Which maps to read.
    limits : ReadingParameters
        The largest sizes that are accepted.
    occupancy : OccupancyParameters
        What the numbers in the cells mean.
    part : int, optional
        Which part of the maps to take alone, from 1; by default all where the map was begun anew, and where
        several nodes publish the one that tells most.
    map_from : str, optional
        Topic of laser scans to build the maps from, instead of reading recorded ones.
    map_frame : str, optional
        Frame of built maps; by default ``map``, else ``odom``.
    mapping : MappingParameters
        How maps are built.

    Returns
    -------
    LogReader
        Close it, or use it as a context manager.

    Raises
    ------
    NoMapTopicError
        If the log has no map topic, or several, none of them ``/map``, and none is named.
    LogError
        If the log cannot be opened.
    """
    source = open_source(path, limits, occupancy)
    parameters = Parameters(reading=limits, mapping=mapping, occupancy=occupancy)
    with OnFailure(source.close):
        if map_from is not None or source.info.format == CARMEN_FORMAT:
            built = _with_maps(source, map_from, map_frame, selection, limits, mapping)
            return LogReader(built, topic or built.topic, selection, parameters, part)
        return LogReader(source, topic, selection, parameters, part)


def _with_maps(
    source: MessageSource,
    map_from: str | None,
    frame: str | None,
    selection: Selection,
    limits: ReadingParameters,
    mapping: MappingParameters,
) -> ScanMaps:
    """Add the maps that are built from scans to an open log."""
    from rose2_logs.io.carmen import CarmenLog, CarmenScans
    from rose2_logs.io.placed_scans import PlacedScans, RosScans
    from rose2_logs.io.scan_maps import ScanMaps

    scans: PlacedScans
    if isinstance(source, CarmenLog):
        scans = CarmenScans(source, mapping)
    else:
        scans = RosScans(source, map_from or "", frame, mapping)
    return ScanMaps(source, scans, mapping, selection, limits.map_max_cells)


def inspect_log(path: LogPath, limits: ReadingParameters = DEFAULT_LIMITS) -> LogInfo:
    """Describe what a log contains, even one without maps.

    Parameters
    ----------
    path, limits
        As for `open_log`.

    Raises
    ------
    LogError
        If the log cannot be opened.
    """
    source = open_source(path, limits)
    source.close()
    return source.info


def map_topics(
    path: LogPath, limits: ReadingParameters = DEFAULT_LIMITS, asked: Sequence[str] = ()
) -> list[str]:
    """Names of the topics of a log that hold maps, ascending; or of those that are asked for, each once.

    Parameters
    ----------
    path : str, Path or a sequence of them
        As for `open_log`.
    limits : ReadingParameters
        The largest sizes that are accepted.
    asked : sequence of str
        The topics that are wanted, in their order; by default all.

    Raises
    ------
    NoMapTopicError
        If there are none, or one that is asked for is none of them; the message says what could be done.
    LogError
        If the log cannot be opened.
    """
    info = inspect_log(path, limits)
    if asked:
        return list(dict.fromkeys(choose_topic(info, topic) for topic in asked))
    found = [topic.name for topic in info.topics if topic.is_map and topic.message_count != 0]
    return sorted(set(found)) or [choose_topic(info)]


def open_source(
    path: LogPath, limits: ReadingParameters = DEFAULT_LIMITS, occupancy: OccupancyParameters = USUAL
) -> MessageSource:
    """Open a log to read several of its topics; the caller closes it.

    Parameters
    ----------
    path, limits, occupancy
        As for `open_log`.

    Raises
    ------
    LogError
        If the log cannot be opened.
    ParameterError
        If it is a URL.
    """
    try:
        source = _open_source(path, limits)
    except OSError as error:
        where = error.filename or path
        raise LogError(f"{where}: cannot be read: {error.strerror or error}", file=str(where)) from error
    source.occupancy = occupancy
    return source


def _open_source(path: LogPath, limits: ReadingParameters) -> MessageSource:
    if not isinstance(path, (str, Path)):
        files = [Path(each) for each in path]
        if not files:
            raise LogError("no log given; pass at least one file")
        return _open_files(files[0], files, limits) if len(files) > 1 else _open_source(files[0], limits)
    log = Path(path)
    if log.is_dir():
        return _open_directory(log, limits)
    if not log.exists():
        found = [Path(each) for each in glob.glob(str(path))]  # noqa: PTH207 (may be absolute)
        if not found:
            require_local(log)
            raise LogError(f"{path}: no such file or directory", file=str(path))
        return _open_files(log, _in_natural_order(found), limits)
    return _open_files(log, [log], limits)


def _open_files(
    log: Path, files: list[Path], limits: ReadingParameters, *, is_bag: bool = False
) -> MessageSource:
    """Open files of one kind as one log."""
    if missing := [file for file in files if not file.is_file()]:
        what = "is a folder, not a file" if missing[0].is_dir() else "there is no such file"
        what += "; only files can be read together as one log"
        raise LogError(f"{missing[0]}: {what}", file=missing[0])
    kinds = _kinds(files)
    if len(kinds) > 1:
        raise LogError(
            f"{log}: files of different kinds ({', '.join(sorted(kinds))}) cannot be one log; "
            "give files of one kind",
            file=log,
        )
    match kinds.pop():
        case ".yaml":
            from rose2_logs.io.saved_maps import MapFilesSource

            return MapFilesSource(log, files, limits)
        case "image":
            from rose2_logs.io.saved_maps import MapFilesSource

            return MapFilesSource(log, [_yaml_beside(file) for file in files], limits)
        case kind if kind == CARMEN_FORMAT:
            from rose2_logs.io.carmen import CarmenLog

            if len(files) > 1:
                raise LogError(f"{log}: several CARMEN logs cannot be read as one; give one", file=log)
            return CarmenLog(files[0])
        case kind:
            return _open_storage(log, files, kind, limits, is_bag=is_bag)


def _open_storage(
    log: Path, files: list[Path], kind: str, limits: ReadingParameters, *, is_bag: bool
) -> FileLog:
    """Open MCAP files, bags or databases; compressed ones are first decompressed into a temporary folder."""
    from rose2_logs.io.file_log import FileLog

    open_file, name, bag_name = _format(kind)
    size = sum(each.stat().st_size for each in (log.iterdir() if log.is_dir() else files) if each.is_file())
    scratch = tempfile.TemporaryDirectory(prefix="rose2_logs_") if any(map(_is_packed, files)) else None
    clean_up = (lambda: None) if scratch is None else scratch.cleanup
    with OnFailure(clean_up):
        if scratch is not None:
            files = [
                _decompressed(file, Path(scratch.name, str(number)), limits) if _is_packed(file) else file
                for number, file in enumerate(files)
            ]
        return FileLog(
            log,
            files,
            open_file,
            limits,
            format_name=bag_name if is_bag else name,
            size_bytes=size,
            on_close=clean_up,
        )


def _format(kind: str) -> tuple[OpenFile, str, str]:
    """How a kind of file is opened, and its name, alone and as a ROS 2 bag; no other kind is imported."""
    match kind:
        case ".mcap":
            from rose2_logs.io.mcap.index import McapFile

            return McapFile, "MCAP", "ROS 2 bag (mcap)"
        case ".bag":
            from rose2_logs.io.rosbag1.index import BagFile

            return BagFile, "ROS 1 bag", "ROS 1 bag"
        case _:
            from rose2_logs.io.rosbag2.index import SqliteFile

            return SqliteFile, "ROS 2 database (sqlite3)", "ROS 2 bag (sqlite3)"


def _kinds(files: list[Path]) -> set[str]:
    """Kinds of the files; files whose kind cannot be recognized are ignored as long as another one can.

    Raises
    ------
    LogError
        If no kind can be recognized.
    """
    kinds, failures = set(), []
    for file in files:
        try:
            kinds.add(_kind(file))
        except LogError as error:
            failures.append(error)
    if not kinds:
        raise failures[0]
    return kinds


def _kind(file: Path) -> str:
    """Kind of a file by its first bytes, else by its name."""
    with file.open("rb") as stream:
        begin = stream.read(_MAGIC_BYTES)
    if begin in _MAGIC:
        return _MAGIC[begin]
    name = file.name.lower()
    if is_packed(begin) and (kind := _MAGIC.get(first_bytes(file, len(begin)))) is not None:
        return kind
    suffix = file.suffix.lower()
    if file.name == BAG_DESCRIPTION:
        raise LogError(f"{file}: describes a ROS 2 bag; give its folder, {file.parent}", file=file)
    if suffix in MAP_ENDINGS:
        return ".yaml"
    if suffix in IMAGE_ENDINGS:
        return "image"
    if is_carmen(file):
        return CARMEN_FORMAT
    if (plain := plain_name(name)).endswith(STORAGE_ENDINGS):
        kind = PurePosixPath(plain).suffix
        holds = "holds no" if is_packed(begin) else "does not start like a"
        what = "is empty" if not begin else f"{holds} {kind} file"
        raise LogError(f"{file}: {what}; was it copied completely?", file=file)
    if _ARCHIVE_ENDINGS.intersection(PurePosixPath(name).suffixes):
        raise LogError(f"{file}: is an archive; unpack it, and give the log in it", file=file)
    raise LogError(f"{file}: is not a supported kind of log; give {_FORMATS}", file=file)


def _is_packed(file: Path) -> bool:
    """Whether a file is compressed as a whole."""
    with file.open("rb") as stream:
        return is_packed(stream.read(_MAGIC_BYTES))


def _yaml_beside(image: Path) -> Path:
    for suffix in MAP_ENDINGS:
        if (beside := image.with_suffix(suffix)).exists():
            return beside
    raise LogError(
        f"{image}: needs {image.stem}.yaml next to it with resolution and origin (map_server format)",
        file=image,
    )


def _in_natural_order(files: list[Path]) -> list[Path]:
    from rose2_logs.io.saved_maps import natural_order

    return sorted(files, key=natural_order)


def _open_directory(log: Path, limits: ReadingParameters) -> MessageSource:
    """Open a ROS 2 bag, even one without a description (its recorder crashed), or a folder of saved maps."""
    from rose2_logs.io.saved_maps import is_map_file

    if (log / BAG_DESCRIPTION).exists():
        return _open_files(log, _files_of_bag(log), limits, is_bag=True)
    if files := _stored_in(log):
        _warn_files_as_one(log, files)
        return _open_files(log, files, limits)
    inside = sorted(each for each in log.iterdir() if each.is_file())
    # A YAML file with an image of the same name counts as a map even if unreadable; reading it then warns.
    images = {each.stem for each in inside if each.suffix.lower() in IMAGE_ENDINGS}
    described = [each for each in inside if each.suffix.lower() in MAP_ENDINGS]
    if maps := [each for each in described if each.stem in images or is_map_file(each)]:
        return _open_files(log, _in_natural_order(_without_masks(log, maps)), limits)
    raise LogError(
        f"{log}: contains neither a bag ({BAG_DESCRIPTION}) nor saved maps; give {_FORMATS}; "
        "analyze a folder of many logs as a batch",
        file=log,
    )


def _without_masks(log: Path, maps: list[Path]) -> list[Path]:
    """Leave out the masks of costmap filters, which are saved as maps are, from the maps of a folder."""
    masks = [each for each in maps if any(word in each.stem.lower() for word in MASK_WORDS)]
    if not masks or len(masks) == len(maps):
        return maps
    text = f"{log}: {listed([each.name for each in masks], _MOST_NAMED)} left out, as a mask and no map"
    log_warning(logger, "masks", f"{text}; name the file to read it", file=log)
    return [each for each in maps if each not in masks]


def _stored_in(log: Path) -> list[Path]:
    """A folder's files of the first storage kind found; annotated logs only if there are no others."""
    inside = [each for each in log.iterdir() if each.is_file()]
    inside = [each for each in inside if plain_name(each.name).lower().endswith(STORAGE_ENDINGS)]
    inside = [each for each in inside if not each.name.endswith(ANNOTATED_ENDING)] or inside
    for suffix in STORAGE_ENDINGS:
        files = [each for each in inside if plain_name(each.name).lower().endswith(suffix)]
        names = {each.name for each in files}
        # One that was compressed and kept is there twice.
        if files := [each for each in files if not names & {plain_name(each.name)} - {each.name}]:
            return _in_natural_order(files)
    return []


def _warn_files_as_one(log: Path, files: list[Path]) -> None:
    """Warn that files without a description are read as one run: they may be several, or incomplete."""
    names = [file.name for file in files]
    inside = list(log.iterdir())
    stored = {each.name for each in inside if each.is_file() and is_storage(each.name)}
    bags = [f"{each.name}/" for each in inside if (each / BAG_DESCRIPTION).is_file()]
    others = sorted(stored.difference(names)) + sorted(bags)
    if not others and (len(names) == 1 or is_bag(names, log.resolve().name)):
        return
    read = f"{names[0]} is" if len(names) == 1 else f"{len(names)} files from {names[0]} on are"
    ignored = f", {listed(others, _MOST_NAMED)} ignored" if others else ""
    text = (
        f"{log}: has no {BAG_DESCRIPTION}; {read} read as one log{ignored}; if that is wrong, name the file, "
        "or analyze the folder as a batch"
    )
    log_warning(logger, "files_as_one", text, file=log)


def _files_of_bag(log: Path) -> list[Path]:
    """Files of a ROS 2 bag according to its description; warns about missing ones."""
    path = log / BAG_DESCRIPTION
    try:
        named = [log / PurePosixPath(name).name for name in _described_files(path)]
    except LogError as error:
        if not (files := _stored_in(log)):
            raise
        log_warning(logger, "description", f"{error}; the files next to it are read", file=path)
        return files
    files = [file for file in named if file.is_file()]
    missing = [file for file in named if not file.is_file()]
    # Who renames the files of a bag leaves its description as it is.
    if missing and (renamed := [each for each in _stored_in(log) if each not in files]):
        text = (
            f"{path}: lists {missing[0].name}, which is not there; {counted(len(renamed), 'file')} that it "
            f"does not list, {listed([each.name for each in renamed], _MOST_NAMED)}, read instead"
        )
        log_warning(logger, "file_missing", text, file=missing[0])
        return files + renamed
    for file in missing:
        text = f"{file}: is missing although {path} lists it"
        if not files:
            raise LogError(text, file=file)
        log_warning(logger, "file_missing", f"{text}; the other files are read", file=file)
    if not files:
        raise LogError(f"{path}: lists no files; run `ros2 bag reindex` on {log}", file=path)
    return files


def _described_files(path: Path) -> list[str]:
    try:
        described: Any = load_yaml(path)["rosbag2_bagfile_information"]
        return [str(name) for name in described["relative_file_paths"] or []]
    except (KeyError, TypeError, LogError) as error:
        raise LogError(
            f"{path}: does not describe a ROS 2 bag; run `ros2 bag reindex` on {path.parent}", file=path
        ) from error


def _decompressed(file: Path, directory: Path, limits: ReadingParameters) -> Path:
    # One folder per file: files from different folders may have the same name.
    directory.mkdir()
    target = directory / file.stem
    free = max(shutil.disk_usage(directory).free - DISK_LEFT_BYTES, 0)
    if file.stat().st_size >= _TOLD_FROM_BYTES:
        where = directory.parent.parent
        text = f"{file}: is decompressed into {where} for now, where {free / 1e9:.1f} GB are free"
        logger.warning("%s", text, extra=UNCOUNTED)
    try:
        decompress_file(file, target, min(free, limits.unpacked_max_bytes))
    except DAMAGED as error:
        text = f"{file}: cannot be decompressed: {error}"
        if isinstance(error, TooLargeError):
            remedy = "if that is correct, raise the parameter reading.unpacked_max_bytes"
            if free < limits.unpacked_max_bytes:
                remedy = (
                    f"free some disk space in {directory.parent.parent}, or name another folder in TMPDIR"
                )
            raise LogError(f"{text}; {remedy}", file=file) from error
        if not target.exists() or not target.stat().st_size:
            raise LogError(text, file=file) from error
        log_warning(logger, "cut_off", f"{text}; everything before the damage is read", file=file)
    return target
