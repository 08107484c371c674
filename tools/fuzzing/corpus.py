"""Seeds of the fuzzing: the first maps of the sample logs, cut small, in every kind of log."""

from __future__ import annotations

import bz2
import gzip
import lzma
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from log_writing import MAP, robot_log
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from PIL import Image
from rosbags.rosbag1 import Reader as BagReader
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fuzzing.targets import FRAME_BYTES, SCAN_KINDS, SPLIT
from rose2_logs.io import open_log
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot

MAPS, SIDE = 3, 12
"""Maps of a seed, and the side in cells of what is cut out of them: small inputs are run faster."""
ORIGIN = {"origin": "fuzzing"}
UPDATE = "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"
UPDATE_TYPE = "map_msgs/msg/OccupancyGridUpdate"
MCAP_VARIANTS: dict[str, dict[str, Any]] = {
    "zstd": {},
    "lz4": {"compression": CompressionType.LZ4},
    # Without checksums a change is not noticed at once, and reaches what lies behind.
    "plain": {"compression": CompressionType.NONE, "enable_crcs": False},
    "unchunked": {"use_chunking": False, "enable_crcs": False},
    "no_index": {
        "compression": CompressionType.NONE,
        "enable_crcs": False,
        "index_types": IndexType.NONE,
        "use_statistics": False,
    },
}


def make_corpus(logs: list[Path], folder: Path) -> None:
    """Write the seeds of every target to a folder of its name.

    Parameters
    ----------
    logs : list of Path
        The sample logs.
    folder : Path
        Where to; what is there stays.
    """
    snapshots = [cut_small(each) for log in logs for each in first_maps(log)]
    with tempfile.TemporaryDirectory() as scratch:
        for target, write in _WRITERS.items():
            seeds = folder / target
            seeds.mkdir(parents=True, exist_ok=True)
            for name, data in write(snapshots[:MAPS], Path(scratch)):
                (seeds / f"seed_{name}").write_bytes(data)


def first_maps(log: Path) -> list[OccupancySnapshot]:
    """Return the first maps of a log."""
    with open_log(log) as reader:
        return list(islice(reader.snapshots(), MAPS))


def cut_small(snapshot: OccupancySnapshot) -> OccupancySnapshot:
    """Cut a window out of the middle of a map's known part."""
    rows, columns = np.nonzero(snapshot.cells >= 0)
    row, column = int(np.median(rows)), int(np.median(columns))
    cells = np.ascontiguousarray(snapshot.cells[row : row + SIDE, column : column + SIDE])
    before = snapshot.geometry
    geometry = GridGeometry(
        before.resolution_m, before.origin_xy_m, before.yaw_rad, before.frame_id, cells.shape
    )
    return OccupancySnapshot(0, snapshot.log_time_ns, snapshot.stamp_ns, MAP, cells, geometry)


_NUMBER, _BYTES, _TEXT, _DOUBLE = 13, 12, 9, 1
_FOXGLOVE: dict[str, dict[str, int | str]] = {
    "Time": {"seconds": _NUMBER, "nanos": _NUMBER},
    "Vector": dict.fromkeys("xyz", _DOUBLE),
    "Quaternion": dict.fromkeys("xyzw", _DOUBLE),
    "Pose": {"position": "Vector", "orientation": "Quaternion"},
    "Field": {"name": _TEXT, "offset": _NUMBER, "type": _NUMBER},
    "Grid": {
        "timestamp": "Time",
        "frame_id": _TEXT,
        "pose": "Pose",
        "column_count": _NUMBER,
        "cell_size": "Vector",
        "row_stride": _NUMBER,
        "cell_stride": _NUMBER,
        "fields": "Field",
        "data": _BYTES,
    },
}
"""Messages that have the fields of foxglove.Grid's, with their types, numbers of descriptor.proto."""

Seeds = Iterator[tuple[str, bytes]]


def _written(path: Path, snapshots: list[OccupancySnapshot]) -> Path:
    with robot_log(path, snapshots[0].log_time_ns, ORIGIN) as log:
        for k, each in enumerate(snapshots):
            log.write_map(float(k), each.cells, each.geometry)
            log.write_pose(k + 0.5, np.zeros(3), np.zeros(3))
    return path


def _mcaps(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    source = _written(scratch / "run.mcap", snapshots)
    for name, options in MCAP_VARIANTS.items():
        path = scratch / f"{name}.mcap"
        with source.open("rb") as stream, path.open("wb") as target:
            writer = Writer(target, **({"chunk_size": 400} | options))
            writer.start(profile="ros2")
            ids: dict[int, int] = {}
            for schema, channel, message in make_reader(stream).iter_messages():
                if channel.id not in ids:
                    assert schema is not None
                    schema_id = writer.register_schema(schema.name, schema.encoding, b"")
                    ids[channel.id] = writer.register_channel(channel.topic, "cdr", schema_id)
                writer.add_message(ids[channel.id], message.log_time, message.data, message.publish_time)
            writer.finish()  # type: ignore[no-untyped-call]
        yield name, path.read_bytes()


def _bags(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    source = _written(scratch / "run.bag", snapshots)
    yield "bz2", source.read_bytes()
    for name in ("plain", "lz4"):
        path = scratch / f"{name}.bag"
        writer = BagWriter(path)
        writer.chunk_threshold = 400
        if name == "lz4":
            writer.set_compression(BagWriter.CompressionFormat.LZ4)
        with BagReader(source) as reader, writer:
            ids = {
                each.id: writer.add_connection(each.topic, each.msgtype, msgdef="byte data", md5sum="0" * 32)
                for each in reader.connections
            }
            for connection, time, data in reader.messages():
                writer.write(ids[connection.id], time, data)
        yield name, path.read_bytes()
    whole = (scratch / "plain.bag").read_bytes()
    yield "cut", whole[: len(whole) * 2 // 3]


def _databases(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    path = _written(scratch / "run", snapshots) / "run.db3"
    yield "zstd", path.read_bytes()
    small = scratch / "small.db3"
    shutil.copy(path, small)
    with sqlite3.connect(small) as base:
        # In small pages a change hits more of what matters.
        base.execute("PRAGMA page_size = 512")
        base.execute("DELETE FROM message_definitions")
        base.commit()
        base.execute("VACUUM")
    yield "small", small.read_bytes()


def _messages(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(UPDATE, UPDATE_TYPE))
    types = store.types
    source = _written(scratch / "grids.mcap", snapshots)
    framed = b""
    with source.open("rb") as stream:
        grids = [bytes(message.data) for _, _, message in make_reader(stream).iter_messages(topics=[MAP])]
    for k, data in enumerate(grids):
        stamp = types["builtin_interfaces/msg/Time"](sec=k, nanosec=0)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="map")
        cells = np.arange(6, dtype=np.int8)
        patch = types[UPDATE_TYPE](header=header, x=k, y=1, width=3, height=2, data=cells)
        framed += _framed(0, data) + _framed(1, bytes(store.serialize_cdr(patch, UPDATE_TYPE)))
    yield "grids_and_patches", framed
    for kind in range(6):
        yield f"kind_{kind}", _framed(kind, grids[0])


def _framed(kind: int, message: bytes) -> bytes:
    return bytes([kind]) + len(message).to_bytes(FRAME_BYTES - 1, "little") + message


def _schemas(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    described = descriptor_pb2.FileDescriptorSet()
    file = described.file.add(name="Grid.proto", package="foxglove", syntax="proto3")
    kinds = descriptor_pb2.FieldDescriptorProto
    for name, fields in _FOXGLOVE.items():
        message = file.message_type.add(name=name)
        for number, (field, kind) in enumerate(fields.items(), start=1):
            is_many = field == "fields"
            made = message.field.add(
                name=field, number=number, label=kinds.LABEL_REPEATED if is_many else kinds.LABEL_OPTIONAL
            )
            if isinstance(kind, str):
                made.type, made.type_name = kinds.TYPE_MESSAGE, f".foxglove.{kind}"
            else:
                made.type = kind
    schema = described.SerializeToString()
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    grid = message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.Grid"))()
    cells = snapshots[0].cells
    grid.frame_id, grid.pose.orientation.w = "map", 1.0
    grid.cell_size.x = grid.cell_size.y = 0.05
    grid.column_count = grid.row_stride = cells.shape[1]
    grid.cell_stride, grid.data = 1, cells.tobytes()
    grid.fields.add(name="occupancy", offset=0, type=2)
    yield "grid", len(schema).to_bytes(2, "little") + schema + grid.SerializeToString()


def _saved_maps(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    pixels = np.select([snapshots[0].cells == 0, snapshots[0].cells > 50], [254, 0], 205).astype(np.uint8)
    about = "image: map.img\nresolution: 0.05\norigin: [1.0, 2.0, 0.1]\nnegate: 0\n"
    about += "occupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n"
    for ending in ("png", "ppm", "bmp", "tiff"):
        path = scratch / f"map.{ending}"
        Image.fromarray(pixels).save(path)
        yield ending, about.encode() + SPLIT + path.read_bytes()


def _scan_messages(times: int = 12) -> Iterator[tuple[str, int, str, Any]]:
    """Topic, log time, type and message of transforms and scans of a lidar that moves in the open."""
    types = get_typestore(Stores.ROS2_HUMBLE).types
    for second in range(times):
        stamp = types["builtin_interfaces/msg/Time"](sec=second, nanosec=0)
        turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
        place = types["geometry_msgs/msg/Vector3"](x=0.1 * second, y=0.0, z=0.0)
        move = types["geometry_msgs/msg/TransformStamped"](
            types["std_msgs/msg/Header"](stamp=stamp, frame_id="map"),
            "laser",
            types["geometry_msgs/msg/Transform"](place, turn),
        )
        yield "/tf", second, "tf2_msgs/msg/TFMessage", types["tf2_msgs/msg/TFMessage"]([move])
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="laser")
        ranges, none = np.full(24, 2.0, np.float32), np.zeros(0, np.float32)
        numbers = (-3.0, 3.0, 0.25, 0.0, 0.1, 0.1, 30.0)
        yield (
            "/scan",
            second,
            "sensor_msgs/msg/LaserScan",
            types["sensor_msgs/msg/LaserScan"](header, *numbers, ranges, none),
        )
        if second == 0:
            echoes = [types["sensor_msgs/msg/LaserEcho"](ranges[:1])] * 24
            kind = "sensor_msgs/msg/MultiEchoLaserScan"
            yield "/echoes", second, kind, types[kind](header, *numbers, echoes, [])


def _scans(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    store = get_typestore(Stores.ROS2_HUMBLE)
    for topic, _, kind, message in _scan_messages(1):
        number = [name for name, _ in SCAN_KINDS].index(kind)
        yield topic[1:], bytes([number]) + bytes(store.serialize_cdr(message, kind))


def _scan_logs(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    store, path = get_typestore(Stores.ROS2_HUMBLE), scratch / "scans.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE, enable_crcs=False)
        writer.start(profile="ros2")
        ids: dict[str, int] = {}
        for topic, second, kind, message in _scan_messages():
            if topic not in ids:
                ids[topic] = writer.register_channel(
                    topic, "cdr", writer.register_schema(kind, "ros2msg", b"")
                )
            data = bytes(store.serialize_cdr(message, kind))
            writer.add_message(ids[topic], second * 10**9, data, second * 10**9)
        writer.finish()  # type: ignore[no-untyped-call]
    yield "mcap", path.read_bytes()


def _flatbuffers(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    """A Grid of nothing but its root and an empty table of fields: the rest is for the fuzzer to find."""
    yield "empty", (0).to_bytes(2, "little") + bytes([8, 0, 0, 0, 4, 0, 4, 0, 4, 0, 0, 0])


def _packed_logs(snapshots: list[OccupancySnapshot], scratch: Path) -> Seeds:
    plain = _written(scratch / "plain_run.bag", snapshots).read_bytes()
    for compress in (gzip.compress, bz2.compress, lzma.compress, zstandard.compress):
        yield compress.__module__, compress(plain)


_WRITERS: dict[str, Callable[[list[OccupancySnapshot], Path], Seeds]] = {
    "mcap": _mcaps,
    "bag": _bags,
    "sqlite": _databases,
    "updates": _messages,
    "schema": _schemas,
    "saved_map": _saved_maps,
    "scans": _scans,
    "scan_log": _scan_logs,
    "flatbuffer": _flatbuffers,
    "packed": _packed_logs,
}
