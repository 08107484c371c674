"""What is fuzzed: from bytes to maps, to a copy of the log, to a patched map; known errors may come out."""

from __future__ import annotations

import contextlib
import logging
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from rose2_logs.config.reading import ReadingParameters
from rose2_logs.config.selection import Selection
from rose2_logs.errors import LogError
from rose2_logs.io import open_log
from rose2_logs.io.file_log import FileLog, OpenFile
from rose2_logs.io.flatbuffer_maps import flatbuffer_decoder
from rose2_logs.io.foxglove_grid import grid_decoder
from rose2_logs.io.grids import Decoder, Grid
from rose2_logs.io.log import LogReader
from rose2_logs.io.map_stream import MapStream, ReadCounts
from rose2_logs.io.mcap.index import DAMAGE, McapFile
from rose2_logs.io.messages import CdrFields, Ros1Fields, decoder
from rose2_logs.io.rosbag1.index import BagFile
from rose2_logs.io.rosbag2.index import SqliteFile
from rose2_logs.io.saved_maps import read_map
from rose2_logs.io.scans import scan_of, transforms_of
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.outputs.mcap.input import CopiedChunk, copied_log
from rose2_logs.system.warnings import PACKAGE

LIMITS = ReadingParameters(
    map_max_cells=1 << 16, chunk_max_bytes=1 << 22, unpacked_max_bytes=1 << 22, map_max_messages=2000
)
"""Low, so that what is read in spite of them shows in the memory of the process."""
MOST_MAPS = 50
"""Maps that are read of a log: more would only cost time."""
FRAME_BYTES = 3
"""Before each message of the target `updates`: its kind, and its length in two bytes."""

Target = Callable[[bytes], None]


def quieten() -> None:
    """Show no warnings: nearly every input deserves some."""
    logger = logging.getLogger(PACKAGE)
    logger.handlers, logger.propagate = [logging.NullHandler()], False


@contextlib.contextmanager
def stored(data: bytes, name: str) -> Iterator[Path]:
    """Put bytes into a file, in memory where the system has a place for that."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        yield path


def _log(data: bytes, name: str, open_file: OpenFile) -> None:
    """Read a log in full, as maps and as a copy."""
    with stored(data, name) as path:
        try:
            source = FileLog(path, [path], open_file, LIMITS, format_name=name)
        except LogError:
            return
        with contextlib.closing(source):
            for topic in [each.name for each in source.info.topics if each.is_map][:2]:
                with contextlib.suppress(LogError):
                    _check_maps(LogReader(source, topic, Selection(max_snapshots=MOST_MAPS)))
            for file in source.files:
                for _ in file.messages():
                    pass
                if isinstance(file, McapFile):
                    _copy(source)


def _copy(source: FileLog) -> None:
    log = copied_log(source)
    for part in (log.channels(), log.attachments(), log.metadata()):
        list(part)
    for item in log.messages():
        if isinstance(item, CopiedChunk):
            with contextlib.suppress(*DAMAGE):
                item.messages()


def _check_maps(reader: LogReader) -> None:
    snapshots = 0
    for snapshot in reader.snapshots():
        snapshots += 1
        assert snapshot.cells.size <= LIMITS.map_max_cells
        assert snapshot.cells.min() >= -1
        assert snapshot.cells.max() <= 100
    counts = reader.counts
    told = snapshots + counts.repeats + counts.skipped + counts.damaged + counts.invalid
    assert counts.messages == told, f"{counts} and {snapshots} snapshots"


def mcap(data: bytes) -> None:
    """Read an MCAP file."""
    _log(data, "run.mcap", McapFile)


def bag(data: bytes) -> None:
    """Read a ROS 1 bag."""
    _log(data, "run.bag", BagFile)


def sqlite(data: bytes) -> None:
    """Read a database of a ROS 2 bag."""
    _log(data, "run.db3", SqliteFile)


KINDS = (
    ("nav_msgs/msg/OccupancyGrid", "cdr"),
    ("map_msgs/msg/OccupancyGridUpdate", "cdr"),
    ("nav_msgs/OccupancyGrid", "ros1"),
    ("map_msgs/OccupancyGridUpdate", "ros1"),
    ("nav2_msgs/msg/Costmap", "cdr"),
    ("nav2_msgs/msg/CostmapUpdate", "cdr"),
)
"""Kinds of messages of the target `updates`."""


def decoders() -> list[Decoder]:
    """Return what decodes each of `KINDS`."""
    found = [decoder(name, encoding, b"", LIMITS.map_max_cells) for name, encoding in KINDS]
    return [each for each in found if each is not None]


_DECODERS = decoders()


def updates(data: bytes) -> None:
    """Decode messages and apply them as grids and patches, one to the map that those before have made."""
    stream, place = MapStream("/map", ReadCounts()), 0
    before: OccupancySnapshot | None = None
    for time in range(MOST_MAPS):
        if place + FRAME_BYTES > len(data):
            return
        kind, length = data[place], int.from_bytes(data[place + 1 : place + FRAME_BYTES], "little")
        message = data[place + FRAME_BYTES : place + FRAME_BYTES + length]
        place += FRAME_BYTES + length
        with contextlib.suppress(LogError):
            decoded = _DECODERS[kind % len(_DECODERS)](memoryview(message))
            if isinstance(decoded, Grid):
                assert decoded.cells.shape == decoded.geometry.shape
            kept = None if before is None else (before.cells, before.cells.copy())
            stream.apply(decoded)
            now = stream.snapshot(time)
            if kept is not None:
                assert (kept[0] == kept[1]).all(), "a patch changed a map that was given out"
            before = now or before


def schema(data: bytes) -> None:
    """Take bytes as a protobuf schema and the rest as a message of it."""
    length = int.from_bytes(data[:2], "little")
    with contextlib.suppress(LogError):
        grid_decoder(data[2 : 2 + length], LIMITS.map_max_cells)(memoryview(data[2 + length :]))


SPLIT = b"\n---\n"
"""Between the description and the image of the target `saved_map`."""


def saved_map(data: bytes) -> None:
    """Read a map_server map: its description and its image."""
    described, _, image = data.partition(SPLIT)
    with stored(described, "map.yaml") as path:
        path.with_name("map.img").write_bytes(image)
        with contextlib.suppress(LogError):
            read_map(path, 0, LIMITS.map_max_cells)


SCAN_KINDS = (
    ("sensor_msgs/msg/LaserScan", "cdr"),
    ("sensor_msgs/LaserScan", "ros1"),
    ("sensor_msgs/msg/MultiEchoLaserScan", "cdr"),
    ("tf2_msgs/msg/TFMessage", "cdr"),
    ("tf2_msgs/TFMessage", "ros1"),
)
"""Kinds of messages of the target `scans`, which are told by its first byte."""


def scans(data: bytes) -> None:
    """Decode a scan or transforms."""
    if not data:
        return
    name, encoding = SCAN_KINDS[data[0] % len(SCAN_KINDS)]
    with contextlib.suppress(LogError):
        fields = (CdrFields if encoding == "cdr" else Ros1Fields)(memoryview(data[1:]))
        if name.endswith("TFMessage"):
            list(transforms_of(fields))
        else:
            scan = scan_of(fields, name)
            assert scan.ranges_m.shape == scan.bearings_rad.shape == scan.times_ns.shape


def scan_log(data: bytes) -> None:
    """Build maps from the scans of an MCAP file."""
    with stored(data, "run.mcap") as path, contextlib.suppress(LogError):
        reader = open_log(path, limits=LIMITS, map_from="/scan", selection=Selection(max_snapshots=MOST_MAPS))
        with reader:
            _check_maps(reader)


def flatbuffer(data: bytes) -> None:
    """Take bytes as a schema of FlatBuffers and the rest as a foxglove.Grid."""
    length = int.from_bytes(data[:2], "little")
    with contextlib.suppress(LogError):
        flatbuffer_decoder(data[2 : 2 + length], LIMITS.map_max_cells)(memoryview(data[2 + length :]))


def packed(data: bytes) -> None:
    """Read a log that is compressed as a whole."""
    with (
        stored(data, "run.bag.gz") as path,
        contextlib.suppress(LogError),
        open_log(path, limits=LIMITS) as log,
    ):
        _check_maps(log)


TARGETS: dict[str, Target] = {
    each.__name__: each
    for each in (mcap, bag, sqlite, updates, schema, saved_map, scans, scan_log, flatbuffer, packed)
}
