"""Write maps, transforms and odometry as a robot's log: MCAP, ROS 1 bag, or rosbag2 directory."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapFileWriter
from numpy.typing import NDArray
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag1 import Writer as Bag1FileWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2FileWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from simulation.lidar import Lidar

from rose2_logs.model.occupancy import GridGeometry

NANOSECONDS = 1_000_000_000
MAP, TF, ODOM, SCAN = "/map", "/tf", "/odom", "/scan"
TOPICS = {MAP: "nav_msgs/msg/OccupancyGrid", TF: "tf2_msgs/msg/TFMessage", ODOM: "nav_msgs/msg/Odometry"}
TOPICS_WITH_SCANS = TOPICS | {SCAN: "sensor_msgs/msg/LaserScan"}
DURATION_FOREVER = QosTime(9223372036, 854775807)
"""No deadline, as rmw spells it."""


def quality_of_service(topic: str) -> Qos:
    """The quality of service that SLAM nodes offer: a latched map, the rest as it comes."""
    latched = topic == MAP
    return Qos(
        QosHistory.KEEP_LAST,
        1 if latched else 100,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        DURATION_FOREVER,
        DURATION_FOREVER,
        QosLiveliness.AUTOMATIC,
        DURATION_FOREVER,
        avoid_ros_namespace_conventions=False,
    )


class _Storage(Protocol):
    """A log file that takes serialized messages."""

    typestore: Typestore

    def put(self, topic: str, log_time_ns: int, message: Any) -> None:
        """Append one message."""

    def close(self) -> None:
        """Finish the file."""


class _McapStorage:
    def __init__(self, path: Path, start_ns: int, origin: dict[str, str], topics: dict[str, str]) -> None:
        self._topics = topics
        self.typestore = get_typestore(Stores.ROS2_HUMBLE)
        self._stream = path.open("wb")
        self._writer = McapFileWriter(self._stream, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="rose2_logs tools")
        self._channels = {topic: self._channel(topic, kind) for topic, kind in topics.items()}
        self._sequence = dict.fromkeys(topics, 0)
        # One metadata record and one attachment: without them the summary has groups that are empty, which
        # strict readers report.
        self._writer.add_metadata("origin", origin)
        text = json.dumps(origin, indent=1).encode()
        self._writer.add_attachment(start_ns, start_ns, "origin.json", "application/json", text)

    def _channel(self, topic: str, kind: str) -> int:
        text, _ = self.typestore.generate_msgdef(kind, ros_version=2)
        schema = self._writer.register_schema(kind, "ros2msg", text.encode())
        qos = _qos_yaml(quality_of_service(topic))
        return self._writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": qos})

    def put(self, topic: str, log_time_ns: int, message: Any) -> None:
        data = bytes(self.typestore.serialize_cdr(message, self._topics[topic]))
        sequence = self._sequence[topic] = self._sequence[topic] + 1
        self._writer.add_message(self._channels[topic], log_time_ns, data, log_time_ns, sequence)

    def close(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()


class _Bag1Storage:
    def __init__(self, path: Path, start_ns: int, origin: dict[str, str], topics: dict[str, str]) -> None:
        self._topics = topics
        self.typestore = get_typestore(Stores.ROS1_NOETIC)
        transforms = "geometry_msgs/TransformStamped[] transforms\n"  # the noetic store lacks tf2_msgs
        self.typestore.register(get_types_from_msg(transforms, TOPICS[TF]))
        self._writer = Bag1FileWriter(path)
        self._writer.set_compression(Bag1FileWriter.CompressionFormat.BZ2)
        self._writer.open()
        self._connections = {
            topic: self._writer.add_connection(
                topic, kind, typestore=self.typestore, latching=1 if topic == MAP else None
            )
            for topic, kind in topics.items()
        }

    def put(self, topic: str, log_time_ns: int, message: Any) -> None:
        data = self.typestore.serialize_ros1(message, self._topics[topic])
        self._writer.write(self._connections[topic], log_time_ns, data)

    def close(self) -> None:
        self._writer.close()


class _Bag2Storage:
    def __init__(self, path: Path, start_ns: int, origin: dict[str, str], topics: dict[str, str]) -> None:
        self._topics = topics
        self.typestore = get_typestore(Stores.ROS2_HUMBLE)
        self._writer = Bag2FileWriter(path, version=8, storage_plugin=StoragePlugin.SQLITE3)
        self._writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
        for key, value in origin.items():
            self._writer.set_custom_data(key, value)
        self._writer.open()
        self._connections = {
            topic: self._writer.add_connection(
                topic, kind, typestore=self.typestore, offered_qos_profiles=[quality_of_service(topic)]
            )
            for topic, kind in topics.items()
        }

    def put(self, topic: str, log_time_ns: int, message: Any) -> None:
        data = self.typestore.serialize_cdr(message, self._topics[topic])
        self._writer.write(self._connections[topic], log_time_ns, data)

    def close(self) -> None:
        self._writer.close()


class RobotLog:
    """A log that maps and poses are written to, in the order of time."""

    def __init__(self, storage: _Storage, start_ns: int) -> None:
        self._storage = storage
        self._types = storage.typestore.types
        self._start_ns = start_ns
        self._sequence = 0

    def write_map(self, time_s: float, cells: NDArray[np.int8], geometry: GridGeometry) -> None:
        """Write one map to ``/map``.

        Parameters
        ----------
        time_s : float
            Seconds since the log's start.
        cells : (H, W) int8
            -1 unknown, 0..100; row 0 at the origin.
        geometry : GridGeometry
            Where the map lies; its yaw becomes the origin's quaternion.
        """
        t, time_ns = self._types, self._time_ns(time_s)
        origin = t["geometry_msgs/msg/Pose"](
            position=self._point(*geometry.origin_xy_m), orientation=self._quaternion(geometry.yaw_rad)
        )
        info = t["nav_msgs/msg/MapMetaData"](
            map_load_time=self._stamp(time_ns),
            resolution=geometry.resolution_m,
            width=geometry.shape[1],
            height=geometry.shape[0],
            origin=origin,
        )
        data = np.ascontiguousarray(cells).reshape(-1)
        header = self._header(time_ns, geometry.frame_id)
        self._storage.put(MAP, time_ns, t[TOPICS[MAP]](header=header, info=info, data=data))

    def write_pose(
        self, time_s: float, pose_in_map: NDArray[np.float64], odometry: NDArray[np.float64]
    ) -> None:
        """Write the robot's pose to ``/tf`` (map to odom to base_link) and ``/odom``.

        Parameters
        ----------
        time_s : float
            Seconds since the log's start.
        pose_in_map, odometry : (3,) float
            x, y in meters and heading in radians, in the frames ``map`` and ``odom``.
        """
        t, time_ns = self._types, self._time_ns(time_s)
        turn = pose_in_map[2] - odometry[2]
        c, s = np.cos(turn), np.sin(turn)
        shift = pose_in_map[:2] - np.array([[c, -s], [s, c]]) @ odometry[:2]
        transforms = [
            t["geometry_msgs/msg/TransformStamped"](
                header=self._header(time_ns, parent),
                child_frame_id=child,
                transform=t["geometry_msgs/msg/Transform"](
                    translation=t["geometry_msgs/msg/Vector3"](x=float(xy[0]), y=float(xy[1]), z=0.0),
                    rotation=self._quaternion(float(yaw)),
                ),
            )
            for parent, child, xy, yaw in [
                ("map", "odom", shift, turn),
                ("odom", "base_link", odometry[:2], odometry[2]),
            ]
        ]
        self._storage.put(TF, time_ns, t[TOPICS[TF]](transforms=transforms))

        still = t["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
        pose = t["geometry_msgs/msg/Pose"](
            position=self._point(float(odometry[0]), float(odometry[1])),
            orientation=self._quaternion(float(odometry[2])),
        )
        message = t[TOPICS[ODOM]](
            header=self._header(time_ns, "odom"),
            child_frame_id="base_link",
            pose=t["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
            twist=t["geometry_msgs/msg/TwistWithCovariance"](
                twist=t["geometry_msgs/msg/Twist"](linear=still, angular=still), covariance=np.zeros(36)
            ),
        )
        self._storage.put(ODOM, time_ns, message)

    def write_scan(
        self, time_s: float, lidar: Lidar, ranges_m: NDArray[np.float64], *, sweep_s: float, period_s: float
    ) -> None:
        """Write one scan of a lidar in the middle of the robot to ``/scan``, where the log has that topic.

        Parameters
        ----------
        time_s : float
            When the first beam was measured, seconds since the log's start.
        lidar : Lidar
            Bearings and range.
        ranges_m : (B,) float
            Measured ranges; infinite or NaN where nothing returned.
        sweep_s, period_s : float
            Time from the first beam to the last, and from scan to scan.
        """
        time_ns, bearings = self._time_ns(time_s), lidar.bearings_rad
        message = self._types[TOPICS_WITH_SCANS[SCAN]](
            header=self._header(time_ns, "base_link"),
            angle_min=float(bearings[0]),
            angle_max=float(bearings[-1]),
            angle_increment=lidar.field_of_view_rad / (lidar.beams - 1),
            time_increment=sweep_s / (lidar.beams - 1),
            scan_time=period_s,
            range_min=0.05,
            range_max=lidar.max_range_m,
            ranges=np.where(np.isnan(ranges_m), np.inf, ranges_m).astype(np.float32),
            intensities=np.zeros(0, np.float32),
        )
        self._storage.put(SCAN, time_ns, message)

    def _time_ns(self, time_s: float) -> int:
        return self._start_ns + round(time_s * NANOSECONDS)

    def _stamp(self, time_ns: int) -> Any:
        kind = self._types["builtin_interfaces/msg/Time"]
        return kind(sec=time_ns // NANOSECONDS, nanosec=time_ns % NANOSECONDS)

    def _header(self, time_ns: int, frame_id: str) -> Any:
        fields: dict[str, Any] = {"stamp": self._stamp(time_ns), "frame_id": frame_id}
        if isinstance(self._storage, _Bag1Storage):
            self._sequence += 1
            fields["seq"] = self._sequence
        return self._types["std_msgs/msg/Header"](**fields)

    def _point(self, x: float, y: float) -> Any:
        return self._types["geometry_msgs/msg/Point"](x=x, y=y, z=0.0)

    def _quaternion(self, yaw_rad: float) -> Any:
        half = yaw_rad / 2
        kind = self._types["geometry_msgs/msg/Quaternion"]
        return kind(x=0.0, y=0.0, z=float(np.sin(half)), w=float(np.cos(half)))


@contextmanager
def robot_log(
    path: Path, start_ns: int, origin: dict[str, str], *, topics: dict[str, str] = TOPICS
) -> Iterator[RobotLog]:
    """Open a log for writing; it appears under its name when it is whole, and replaces what was there.

    Parameters
    ----------
    path : Path
        ``*.mcap`` makes an MCAP (ROS 2, CDR, zstd), ``*.bag`` a ROS 1 bag (bz2), a name without suffix a
        rosbag2 directory (sqlite3, messages compressed by zstd).
    start_ns : int
        Time zero of the log, nanoseconds since the epoch.
    origin : dict of str
        Where the log comes from: kept as a metadata record in an MCAP and as custom data in a rosbag2.
    topics : dict of str
        Topics of the log and their types: `TOPICS` or `TOPICS_WITH_SCANS`.

    Yields
    ------
    RobotLog

    Raises
    ------
    ValueError
        If the suffix names no known kind of log.
    """
    kinds: dict[str, type[_McapStorage | _Bag1Storage | _Bag2Storage]] = {
        ".mcap": _McapStorage,
        ".bag": _Bag1Storage,
        "": _Bag2Storage,
    }
    if path.suffix not in kinds:
        raise ValueError(f"{path}: no log ends in {path.suffix!r}; use .mcap, .bag, or no suffix (rosbag2)")
    # rosbag2 names its files after its directory: hence a directory for what is not whole yet.
    unfinished = path.parent / f".{path.name}.part"
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir(parents=True)
    try:
        storage = kinds[path.suffix](unfinished / path.name, start_ns, origin, topics)
        try:
            yield RobotLog(storage, start_ns)
        finally:
            storage.close()
        if path.is_dir():
            shutil.rmtree(path)
        (unfinished / path.name).replace(path)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _qos_yaml(qos: Qos) -> str:
    """Quality of service as rosbag2 writes it into an MCAP's channel metadata."""
    forever = f"sec: {DURATION_FOREVER.sec}\n    nsec: {DURATION_FOREVER.nsec}"
    return (
        f"- history: {qos.history.value}\n  depth: {qos.depth}\n  reliability: {qos.reliability.value}\n"
        f"  durability: {qos.durability.value}\n  deadline:\n    {forever}\n  lifespan:\n    {forever}\n"
        f"  liveliness: {qos.liveliness.value}\n  liveliness_lease_duration:\n    {forever}\n"
        "  avoid_ros_namespace_conventions: false"
    )
