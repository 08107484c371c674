"""Logs with a fault each, in every kind of input: what the matrix of faults is made of.

Messages are packed here by hand, because no writer would write what they claim.
"""

from __future__ import annotations

import math
import sqlite3
import struct
import zlib
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_grids import SCHEMA, foxglove_message
from mcap.writer import CompressionType, IndexType, Writer
from reader_logs import START_NS, typestore
from rosbags import rosbag1, rosbag2

SECOND = 10**9
MOST_DOUBT = 19
"""Occupancy below which the cells of the rooms here are free."""
GRID, PATCH, STRING = (
    "nav_msgs/msg/OccupancyGrid",
    "map_msgs/msg/OccupancyGridUpdate",
    "std_msgs/msg/String",
)
FLAT = (1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""A pose: position, and a quaternion x, y, z, w."""


@dataclass(frozen=True)
class Grid:
    """An occupancy grid as it is claimed to be; the data are the bytes of its cells."""

    data: bytes
    width: int
    height: int
    resolution: float = 0.05
    pose: tuple[float, ...] = FLAT
    frame: str = "map"
    stamp_ns: int = START_NS
    more: bytes = b""


@dataclass(frozen=True)
class Patch:
    """An update of a rectangle of the grid before."""

    data: bytes
    x: int
    y: int
    width: int
    height: int
    stamp_ns: int = START_NS


@dataclass(frozen=True)
class Text:
    """Traffic that is no map."""

    text: str = "hello"


Message = Grid | Patch | Text
Logged = tuple[str, int, Message]


def grid(cells: Any, **claims: Any) -> Grid:
    """Pack cells; what is claimed about them may be changed."""
    cells = np.asarray(cells, np.int8)
    return replace(Grid(cells.tobytes(), cells.shape[1], cells.shape[0]), **claims)


def room(seen: int, seed: int = 0) -> np.ndarray:
    """Cells of a room of 3 x 4 m in rough walls, explored up to a column: what an analysis can work on."""
    cells = np.full((70, 90), -1, np.int8)
    cells[4:66, 4:86] = 100
    cells[6:64, 6:84] = 0
    cells[40:44, 30:60] = 100
    # Grain, so that no compression makes the log so small that a cut has no place.
    noise = np.random.default_rng(seed).integers(0, MOST_DOUBT, cells.shape, np.int8)
    cells[cells == 0] = noise[cells == 0]
    cells[:, seen:] = -1
    return cells


COUNT = 5
SEEN = (30, 45, 60, 75, 90)


def run() -> list[Logged]:
    """Five maps of one room, a second apart, with other traffic between them."""
    logged: list[Logged] = []
    for k in range(COUNT):
        time = START_NS + k * SECOND
        logged.append(("/map", time, grid(room(SEEN[k], k), stamp_ns=time)))
        logged.append(("/chatter", time + SECOND // 2, Text(f"after map {k}")))
    return logged


def packed(message: Message, encoding: str) -> bytes:
    """Bytes of a message in the encoding ``cdr`` or ``ros1``, or of a grid in ``protobuf``."""
    if encoding == "protobuf":
        assert isinstance(message, Grid)
        return _protobuf(message)
    out = _Packer(encoding)
    if isinstance(message, Text):
        out.string(message.text)
        return bytes(out.data)
    out.header(message.stamp_ns, message.frame if isinstance(message, Grid) else "map")
    if isinstance(message, Grid):
        out.numbers("II", 0, 0)
        out.numbers("f", message.resolution)
        out.numbers("II", message.width, message.height)
        out.numbers("d" * 7, *message.pose)
        out.octets(message.data)
        out.data += message.more
    else:
        out.numbers("iiII", message.x, message.y, message.width, message.height)
        out.octets(message.data)
    return bytes(out.data)


class _Packer:
    def __init__(self, encoding: str) -> None:
        self.is_cdr = encoding == "cdr"
        self.data = bytearray(b"\0\1\0\0" if self.is_cdr else b"")

    def numbers(self, codes: str, *values: float) -> None:
        for code, value in zip(codes, values, strict=True):
            if self.is_cdr:
                self.data += bytes(-(len(self.data) - 4) % struct.calcsize(code))
            self.data += struct.pack("<" + code, value)

    def octets(self, data: bytes) -> None:
        self.numbers("I", len(data))
        self.data += data

    def string(self, text: str) -> None:
        self.octets(text.encode() + (b"\0" if self.is_cdr else b""))

    def header(self, stamp_ns: int, frame: str) -> None:
        if not self.is_cdr:
            self.numbers("I", 7)
        self.numbers("II", stamp_ns // SECOND, stamp_ns % SECOND)
        self.string(frame)


def _protobuf(message: Grid) -> bytes:
    made = foxglove_message(np.zeros((1, 1), np.int8), 2)
    made.timestamp.seconds, made.timestamp.nanos = divmod(message.stamp_ns, SECOND)
    made.frame_id = message.frame
    x, y, z, *turn = message.pose
    made.pose.position.x, made.pose.position.y, made.pose.position.z = x, y, z
    for name, value in zip("xyzw", turn, strict=True):
        setattr(made.pose.orientation, name, value)
    made.column_count = made.row_stride = message.width
    made.cell_stride = 1
    made.cell_size.x = made.cell_size.y = message.resolution
    made.data = message.data
    return bytes(made.SerializeToString()) + message.more


def _type_of(message: Message) -> str:
    return {Grid: GRID, Patch: PATCH, Text: STRING}[type(message)]


def _definition(message_type: str, ros: int) -> str:
    return str(typestore(ros).generate_msgdef(message_type, ros_version=ros)[0])


def write_mcap(
    path: Path,
    logged: Sequence[Logged],
    *,
    encoding: str = "cdr",
    schemas: dict[str, bytes] | None = None,
    **options: Any,
) -> Path:
    """Write an MCAP, a chunk for each message unless asked otherwise; `schemas` replace those by type."""
    with path.open("wb") as file:
        writer = Writer(file, **({"chunk_size": 1, "compression": CompressionType.ZSTD} | options))
        writer.start(profile="ros2" if encoding == "cdr" else "")
        channels: dict[tuple[str, str], int] = {}
        for topic, time, message in logged:
            kind, coded, language = _type_of(message), "cdr", "ros2msg"
            text = _definition(kind, 2).encode()
            if encoding == "protobuf" and isinstance(message, Grid):
                kind, coded, language, text = "foxglove.Grid", "protobuf", "protobuf", SCHEMA
            text = (schemas or {}).get(kind, text)
            if (topic, kind) not in channels:
                schema = writer.register_schema(kind, language, text)
                channels[topic, kind] = writer.register_channel(topic, coded, schema)
            writer.add_message(channels[topic, kind], time, packed(message, coded), time)
        writer.finish()
    return path


def write_bag(
    path: Path,
    logged: Sequence[Logged],
    *,
    compression: str = "NONE",
    schemas: dict[str, bytes] | None = None,
) -> Path:
    """Write a ROS 1 bag, a chunk for each message."""
    writer = rosbag1.Writer(path)
    if compression != "NONE":
        writer.set_compression(rosbag1.Writer.CompressionFormat[compression])
    writer.chunk_threshold = 1
    _write_all(writer, logged, 1, "ros1", schemas, {"md5sum": "0" * 32})
    return path


def write_rosbag2(
    path: Path,
    logged: Sequence[Logged],
    *,
    storage: str = "SQLITE3",
    compression: str = "NONE",
    schemas: dict[str, bytes] | None = None,
) -> Path:
    """Write a ROS 2 bag directory."""
    writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[storage])
    writer.set_compression(rosbag2.CompressionMode[compression], rosbag2.CompressionFormat.ZSTD)
    _write_all(writer, logged, 2, "cdr", schemas, {"rihs01": "RIHS01_0"})
    for database in path.glob("*.db3"):
        _lay_out_anew(database)
    return path


def _write_all(
    writer: Any,
    logged: Sequence[Logged],
    ros: int,
    encoding: str,
    schemas: dict[str, bytes] | None,
    checksum: dict[str, str],
) -> None:
    """Write messages to a bag of a version of ROS; a type of another definition gets that checksum."""
    with writer:
        connections: dict[tuple[str, str], Any] = {}
        for topic, time, message in logged:
            kind = _type_of(message)
            if (topic, kind) not in connections:
                text = (schemas or {}).get(kind)
                own = {} if text is None else {"msgdef": text.decode("latin-1"), **checksum}
                connections[topic, kind] = writer.add_connection(topic, kind, typestore=typestore(ros), **own)
            writer.write(connections[topic, kind], time, packed(message, encoding))


def _lay_out_anew(database: Path) -> None:
    """Let the same pages stand at the same places whatever SQLite wrote them: newer ones add statistics."""
    with closing(sqlite3.connect(database)) as base:
        base.execute("DROP TABLE IF EXISTS sqlite_stat1")
        base.commit()
        base.execute("VACUUM")


@dataclass(frozen=True)
class Input:
    """A kind of log: how it is written, and which of its files holds the data."""

    name: str
    write: Callable[..., Path]
    suffix: str

    def make(self, folder: Path, logged: Sequence[Logged] | None = None, **options: Any) -> Path:
        return self.write(folder / f"run{self.suffix}", run() if logged is None else logged, **options)

    def data_file(self, log: Path) -> Path:
        return next(each for each in log.iterdir() if each.suffix != ".yaml") if log.is_dir() else log


def _mcap(**options: Any) -> Callable[..., Path]:
    return lambda path, logged, **more: write_mcap(path, logged, **(options | more))


NO_INDEX = {
    "index_types": IndexType.NONE,
    "repeat_channels": False,
    "repeat_schemas": False,
    "use_statistics": False,
    "use_summary_offsets": False,
}
INPUTS = {
    each.name: each
    for each in (
        Input("MCAP, zstd", _mcap(), ".mcap"),
        Input("MCAP, lz4", _mcap(compression=CompressionType.LZ4), ".mcap"),
        Input("MCAP, plain", _mcap(compression=CompressionType.NONE), ".mcap"),
        Input("MCAP, no index", _mcap(**NO_INDEX), ".mcap"),
        Input("ROS 1 bag", write_bag, ".bag"),
        Input(
            "ROS 1 bag, bz2",
            lambda path, logged, **more: write_bag(path, logged, compression="BZ2", **more),
            ".bag",
        ),
        Input("ROS 2, sqlite3", write_rosbag2, ""),
        Input(
            "ROS 2, mcap",
            lambda path, logged, **more: write_rosbag2(path, logged, storage="MCAP", **more),
            "",
        ),
    )
}
FOXGLOVE = Input("foxglove.Grid", _mcap(encoding="protobuf"), ".mcap")


# --- faults of messages: the same in every kind of log -----------------------------------------------------

FAULTY = 2
"""The map that is spoilt, from 0."""


def spoilt(**claims: Any) -> Callable[[], list[Logged]]:
    """A run whose third map claims something else."""

    def made() -> list[Logged]:
        return [
            (
                topic,
                time,
                replace(message, **claims) if k == 2 * FAULTY and isinstance(message, Grid) else message,
            )
            for k, (topic, time, message) in enumerate(run())
        ]

    return made


def _with(*more: tuple[int, Logged]) -> list[Logged]:
    """A run with messages put in before those of the given places; the highest place first."""
    logged = run()
    for place, message in sorted(more, key=lambda each: -each[0]):
        logged.insert(place, message)
    return logged


def _at(seconds: float) -> int:
    return START_NS + round(seconds * SECOND)


def _maps(*cells: np.ndarray) -> list[Logged]:
    return [("/map", _at(k), grid(each, stamp_ns=_at(k))) for k, each in enumerate(cells)]


def _tilted(degrees: float) -> tuple[float, ...]:
    half = math.radians(degrees) / 2
    return (1.0, 2.0, 0.0, math.sin(half), 0.0, 0.0, math.cos(half))


def _backwards_clock() -> list[Logged]:
    """The recorder's clock is set back by an hour before the fourth map."""
    return [(t, time - (3600 * SECOND if k >= 6 else 0), m) for k, (t, time, m) in enumerate(run())]


def _stamps(stamp: Callable[[int, int], int]) -> list[Logged]:
    return [
        (topic, time, replace(m, stamp_ns=stamp(k // 2, time)) if isinstance(m, Grid) else m)
        for k, (topic, time, m) in enumerate(run())
    ]


def _patch(x: int, y: int, at: float) -> Logged:
    cells = np.full((4, 6), 100, np.int8)
    return ("/map_updates", _at(at), Patch(cells.tobytes(), x, y, 6, 4, _at(at)))


def _frames() -> list[Logged]:
    return [
        (topic, time, replace(m, frame="odom") if k >= 6 and isinstance(m, Grid) else m)
        for k, (topic, time, m) in enumerate(run())
    ]


TEXT_ON_MAP = ("/map", _at(2.2), Text("no map"))
NAN = math.nan
CELLS = 70 * 90

MESSAGE_FAULTS: dict[str, Callable[[], list[Logged]]] = {
    "nothing wrong": run,
    "one column too many": spoilt(width=91),
    "width and height 2^32 - 1": spoilt(width=2**32 - 1, height=2**32 - 1),
    "width times height past 2^32": spoilt(width=65536, height=65536),
    "width and height 0, with data": spoilt(width=0, height=0),
    "no cells": spoilt(width=0, height=0, data=b""),
    "data cut short": spoilt(data=bytes(100)),
    "bytes after the fields": spoilt(more=bytes(40)),
    "resolution 0": spoilt(resolution=0.0),
    "resolution NaN": spoilt(resolution=NAN),
    "resolution negative": spoilt(resolution=-0.05),
    "resolution 1e9 m": spoilt(resolution=1e9),
    "origin NaN": spoilt(pose=(NAN, *FLAT[1:])),
    "origin 1e300 m": spoilt(pose=(1e300, *FLAT[1:])),
    "quaternion NaN": spoilt(pose=(*FLAT[:6], NAN)),
    "quaternion not unit": spoilt(pose=(*FLAT[:6], 2.0)),
    "quaternion all zero": spoilt(pose=(*FLAT[:6], 0.0)),
    "tilted by 30 degrees": spoilt(pose=_tilted(30)),
    "upside down": spoilt(pose=_tilted(180)),
    "cells out of range": spoilt(data=bytes([127, 200]) * (CELLS // 2)),
    "stamps of zero": lambda: _stamps(lambda k, time: 0),
    "stamps going backwards": lambda: _stamps(lambda k, time: time - (60 * SECOND if k >= 3 else 0)),
    "clock set back": _backwards_clock,
    "log times all zero": lambda: [(topic, 0, m) for topic, _, m in run()],
    "out of order": lambda: [run()[k] for k in (4, 0, 2, 1, 8, 6, 3, 5, 7, 9)],
    "every message twice": lambda: [each for each in run() for _ in range(2)],
    "frame changes": _frames,
    "text on the map topic": lambda: _with((5, TEXT_ON_MAP)),
    "patch before the first map": lambda: [_patch(0, 0, -1), *run()],
    "patch outside the map": lambda: _with((3, _patch(88, 0, 1.2))),
    "patch at negative cells": lambda: _with((3, _patch(-2, -1, 1.2))),
    "patch after a map that is left out": lambda: [
        *spoilt(resolution=NAN)()[:5],
        _patch(1, 1, 2.2),
        *run()[5:],
    ],
    "maps of 1 x 1": lambda: _maps(*(np.full((1, 1), k, np.int8) for k in range(3))),
    "all maps unknown": lambda: _maps(*(np.full((40, 40 + k), -1) for k in range(3))),
    "all maps occupied": lambda: _maps(*(np.full((40, 40 + k), 100) for k in range(3))),
    "all maps empty": lambda: [
        ("/map", _at(k), Grid(b"", 0, 0, resolution=0.0, stamp_ns=_at(k))) for k in range(3)
    ],
    "all maps invalid": lambda: [
        ("/map", _at(k), grid(room(90), resolution=NAN, stamp_ns=_at(k))) for k in range(3)
    ],
    "no message at all": list,
}
SCHEMA_FAULTS: dict[str, bytes] = {
    "definition is not that of the type": b"float64 x\nstring name\n",
    "definition is no definition": b"\x00\xff { not a message ;",
    "definition empty": b"",
}
"""Texts that stand as the definition of nav_msgs/OccupancyGrid in a log that is right otherwise."""
NOT_IN_FOXGLOVE = {
    # It has no height and no patches; one channel holds one type.
    "width times height past 2^32",
    "data cut short",
    "bytes after the fields",
    "text on the map topic",
    *(name for name in MESSAGE_FAULTS if name.startswith("patch")),
}


# --- faults of files --------------------------------------------------------------------------------------


def cut(path: Path, length: int) -> None:
    """Cut a file off."""
    path.write_bytes(path.read_bytes()[:length])


def flip(path: Path, at: int) -> None:
    """Turn all bits of a byte."""
    data = bytearray(path.read_bytes())
    data[at] ^= 0xFF
    path.write_bytes(data)


def _inside(path: Path) -> int:
    """Place at 30 % of a file, of MCAP the next cell there that is free with some doubt.

    Its writers differ by version in the lengths of what they put before the maps.
    """
    begin, data = path.stat().st_size * 3 // 10, path.read_bytes()
    if path.suffix != ".mcap":
        return begin
    return next(at for at in range(begin, len(data)) if 0 < data[at] < MOST_DOUBT)


def blank(path: Path, begin: int, length: int) -> None:
    """Overwrite a stretch with zeros, as a lost sector reads."""
    data = bytearray(path.read_bytes())
    data[begin : begin + length] = bytes(len(data[begin : begin + length]))
    path.write_bytes(data)


def _index_begins(path: Path) -> int:
    """Where the index of a log begins that has one at its end, else the last tenth."""
    data = path.read_bytes()
    if path.suffix == ".bag":
        header = data.index(b"index_pos=") + len(b"index_pos=")
        return int(struct.unpack_from("<Q", data, header)[0])
    if path.suffix == ".mcap":
        start = int(struct.unpack_from("<Q", data, len(data) - 28)[0])
        return start or len(data) - 37
    return len(data) * 9 // 10


def _share(share: float) -> Callable[[Path], None]:
    return lambda path: cut(path, int(path.stat().st_size * share))


FILE_FAULTS: dict[str, Callable[[Path], None]] = {
    "empty file": lambda path: cut(path, 0),
    "cut in the magic": lambda path: cut(path, 5),
    "cut in the head": lambda path: cut(path, 40),
    "cut at 30 %": _share(0.3),
    "cut at 60 %": _share(0.6),
    "cut before the index": lambda path: cut(path, _index_begins(path)),
    "cut in the index": lambda path: cut(path, _index_begins(path) + 100),
    "cut in the last bytes": lambda path: cut(path, path.stat().st_size - 5),
    "byte flipped at 30 %": lambda path: flip(path, _inside(path)),
    "byte flipped in the index": lambda path: flip(path, _index_begins(path) + 30),
    "sector lost at 50 %": lambda path: blank(path, path.stat().st_size // 2, 4096),
    "all zeros after 40 %": lambda path: blank(path, path.stat().st_size * 4 // 10, 1 << 30),
    "garbage at the end": lambda path: path.write_bytes(path.read_bytes() + b"\xa5" * 5000),
}


# --- bombs ------------------------------------------------------------------------------------------------


def mcap_record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def mcap_chunk(packed_data: bytes, claimed: int, compression: str = "zstd", crc: int = 0) -> bytes:
    """A chunk record that claims an uncompressed size."""
    name = compression.encode()
    head = struct.pack("<QQQII", START_NS, START_NS, claimed, crc, len(name)) + name
    return mcap_record(6, head + struct.pack("<Q", len(packed_data)) + packed_data)


def bag_record(header: dict[str, bytes], data: bytes) -> bytes:
    fields = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
        for name, value in header.items()
    )
    return struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(data)) + data


def bag_chunk(packed_data: bytes, claimed: int, compression: bytes) -> bytes:
    """A chunk record that claims an uncompressed size."""
    header = {"compression": compression, "op": b"\5", "size": struct.pack("<I", claimed)}
    return bag_record(header, packed_data)


def png_claiming(width: int, height: int, rows: bytes) -> bytes:
    """A gray PNG that claims a size, whatever its rows are."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + chunk(b"IDAT", zlib.compress(rows))
        + chunk(b"IEND", b"")
    )


# --- faults of what lies beside the file ------------------------------------------------------------------


def _without(name: str) -> Callable[[Path], Path]:
    def spoil(log: Path) -> Path:
        (log / name).unlink()
        return log

    return spoil


def _rewritten(name: str, text: str) -> Callable[[Path], Path]:
    def spoil(log: Path) -> Path:
        (log / name).write_text(text)
        return log

    return spoil


def _with_second_file(log: Path) -> Path:
    """A description that names a second file, which is not there."""
    described = (log / "metadata.yaml").read_text()
    (entry,) = [line for line in described.splitlines() if line.strip() in ("- run.db3", "- run.mcap")]
    second = entry.replace("- run.", "- run_1.")
    (log / "metadata.yaml").write_text(described.replace(entry, f"{entry}\n{second}", 1))
    return log


def _with_journal(log: Path) -> Path:
    (log / "run.db3-wal").write_bytes(bytes(100))
    return log


def _renamed(log: Path) -> Path:
    return log.rename(log.with_suffix(".bag" if log.suffix == ".mcap" else ".mcap"))


ROS2 = ("ROS 2, sqlite3", "ROS 2, mcap")
PATH_FAULTS: dict[str, tuple[Callable[[Path], Path], tuple[str, ...]]] = {
    "no metadata.yaml": (_without("metadata.yaml"), ROS2),
    "metadata.yaml empty": (_rewritten("metadata.yaml", ""), ROS2),
    "metadata.yaml of something else": (_rewritten("metadata.yaml", "image: map.png"), ROS2),
    "metadata.yaml names a file that is missing": (_with_second_file, ROS2),
    "journal beside the database": (_with_journal, ROS2[:1]),
    "wrong suffix": (_renamed, ("MCAP, zstd", "ROS 1 bag")),
}
