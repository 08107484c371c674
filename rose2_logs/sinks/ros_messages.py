"""ROS 2 messages that the annotated MCAP writes, and their definitions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.occupancy import UNKNOWN, GridGeometry
from rose2_logs.sinks.palette import track_colour
from rose2_logs.tracking.frames import TrackedSnapshot

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore
    from shapely.geometry.base import BaseGeometry

ROOMS_TYPE = "rose2_msgs/msg/Rooms"
ROOMS_DEFINITION = """\
# The rooms of one map snapshot, found by rose2_logs.
std_msgs/Header header      # stamp and frame of the map
float64 coverage            # known free area over that of the run's last map, 0..1
rose2_msgs/Room[] rooms
"""
ROOM_DEFINITION = """\
uint32 track                # identity of the room over the run, never used again
float64 area                # m2 of its known free cells
float64 predicted_area      # m2 of its shape, the unseen part included
geometry_msgs/Point label_point
geometry_msgs/Polygon[] outline   # outer rings of its shape
uint32[] neighbours         # tracks of the rooms that a doorway connects it with
"""
HIGHEST_VALUE = 98
"""`/rose2/segmented_map` holds 1 + (track - 1) % 98 for a room: between free 0 and occupied 100."""
FILL_OPACITY = 0.45
LABEL_HEIGHT_M = 0.5
OUTLINE_WIDTH_M = 0.06
LINE_WIDTH_M = 0.03
LABEL_TOLERANCE_M = 0.05
"""A label lies at the deepest point of its room to this."""
TOUCH_M = 1e-3
"""How much wider a shape is drawn that cannot be triangulated as it is: far below a cell."""
ADD, DELETE_ALL = 0, 3
LINE_STRIP, LINE_LIST, TEXT, TRIANGLES = 4, 5, 9, 11


def ros2_typestore(extra: Mapping[str, Any] | None = None) -> Typestore:
    """Build a store with the ROS 2 types, what a log defines besides, and the rooms message.

    Parameters
    ----------
    extra : mapping of type name to fields, optional
        Definitions of a bag; ROS 2's own Header wins over that of ROS 1.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    ros2 = get_typestore(Stores.ROS2_HUMBLE)
    store = get_typestore(Stores.EMPTY)
    own: dict[str, Any] = {}
    own.update(get_types_from_msg(ROOM_DEFINITION, "rose2_msgs/msg/Room"))
    own.update(get_types_from_msg(ROOMS_DEFINITION, ROOMS_TYPE))
    definitions = {**ros2.fielddefs, **(extra or {}), **own}
    definitions["std_msgs/msg/Header"] = ros2.fielddefs["std_msgs/msg/Header"]
    store.register(definitions)
    return store


class MessageMaker:
    """Makes the serialised messages of a snapshot."""

    def __init__(self) -> None:
        self._store = ros2_typestore()

    def definition(self, message_type: str) -> bytes:
        """Text of a type's definition with all it is made of, as MCAP's ros2msg schema."""
        return self._store.generate_msgdef(message_type, ros_version=2)[0].encode()

    def source_map(self, frame: TrackedSnapshot) -> bytes:
        """Make the map itself, for inputs that are no log of messages."""
        return self._grid(frame, frame.snapshot.cells)

    def segmented_map(self, frame: TrackedSnapshot) -> bytes:
        """Make the segmented map: rooms as 1..98, occupied 100, other free cells 0, unknown -1."""
        values = np.array([0, *(1 + (track - 1) % HIGHEST_VALUE for track in frame.track_ids)], np.int8)
        cells = values[frame.analysis.rooms.labels]
        rest = frame.analysis.rooms.labels == 0
        cells[rest] = np.where(frame.snapshot.cells < 0, UNKNOWN, frame.snapshot.cells)[rest]
        return self._grid(frame, cells)

    def clean_map(self, frame: TrackedSnapshot) -> bytes | None:
        """Make the clean map: 100 where structure, 0 where free or clutter, -1 unknown; None without one."""
        structure = frame.analysis.structure
        if structure is None:
            return None
        cells = np.where(frame.snapshot.cells < 0, UNKNOWN, 0).astype(np.int8)
        cells[structure.clean] = 100
        return self._grid(frame, cells)

    def rooms(self, frame: TrackedSnapshot) -> bytes:
        """Make the rooms message, by ascending track."""
        types = self._store.types
        point = types["geometry_msgs/msg/Point"]
        rooms, tracks = frame.analysis.rooms, frame.track_ids
        made = []
        for number in sorted(range(1, len(rooms) + 1), key=lambda number: tracks[number - 1]):
            shape = rooms.polygons[number - 1]
            x, y = label_point(shape)
            made.append(
                types["rose2_msgs/msg/Room"](
                    track=tracks[number - 1],
                    area=float(rooms.areas_m2[number - 1]),
                    predicted_area=float(shape.area),
                    label_point=point(x=x, y=y, z=0.0),
                    outline=[self._polygon(ring) for ring in outer_rings(shape)],
                    neighbours=np.array(
                        sorted(tracks[other - 1] for other in rooms.neighbours(number)), np.uint32
                    ),
                )
            )
        message = types[ROOMS_TYPE](header=self._header(frame), coverage=frame.coverage, rooms=made)
        return self._serialised(message, ROOMS_TYPE)

    def markers(self, frame: TrackedSnapshot) -> bytes:
        """Make the markers: all old ones deleted, then fills, outlines, labels, walls, lines, doorways."""
        analysis, rooms = frame.analysis, frame.analysis.rooms
        made = [self._marker(frame, "", 0, TRIANGLES, action=DELETE_ALL)]
        for track, shape in sorted(
            zip(frame.track_ids, rooms.polygons, strict=True), key=lambda pair: pair[0]
        ):
            red, green, blue = (value / 255 for value in track_colour(track))
            corners = triangle_corners(shape)
            fill, line = (red, green, blue, FILL_OPACITY), (red * 0.7, green * 0.7, blue * 0.7, 1.0)
            made.append(self._marker(frame, "rooms", track, TRIANGLES, corners, fill, 1.0))
            for number, ring in enumerate(outer_rings(shape)):
                name = "outlines" if number == 0 else f"outlines {number}"
                made.append(self._marker(frame, name, track, LINE_STRIP, ring, line, OUTLINE_WIDTH_M))
            label = self._marker(
                frame,
                "labels",
                track,
                TEXT,
                colour=(0.0, 0.0, 0.0, 1.0),
                width_m=LABEL_HEIGHT_M,
                text=f"{track}\n{shape.area:.0f} m2",
            )
            label.pose.position.x, label.pose.position.y = label_point(shape)
            made.append(label)
        if analysis.walls is not None:
            walls, lines = analysis.walls.segments_m.reshape(-1, 2), analysis.walls.lines_m.reshape(-1, 2)
            made.append(
                self._marker(frame, "walls", 0, LINE_LIST, walls, (0.1, 0.1, 0.1, 1.0), OUTLINE_WIDTH_M)
            )
            made.append(
                self._marker(frame, "lines", 0, LINE_LIST, lines, (0.2, 0.4, 0.9, 0.35), LINE_WIDTH_M)
            )
        doors = np.array([door.ends_m for door in rooms.doorways]).reshape(-1, 2)
        made.append(
            self._marker(frame, "doorways", 0, LINE_LIST, doors, (0.9, 0.3, 0.1, 1.0), OUTLINE_WIDTH_M)
        )
        kind = "visualization_msgs/msg/MarkerArray"
        return self._serialised(self._store.types[kind](markers=made), kind)

    def _serialised(self, message: Any, kind: str) -> bytes:
        return bytes(self._store.serialize_cdr(message, kind))

    def _header(self, frame: TrackedSnapshot) -> Any:
        types, geometry = self._store.types, frame.analysis.geometry
        seconds, nanoseconds = divmod(frame.snapshot.stamp_ns, 10**9)
        stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id=geometry.frame_id)

    def _grid(self, frame: TrackedSnapshot, cells: NDArray[np.int8]) -> bytes:
        types, geometry = self._store.types, frame.analysis.geometry
        header = self._header(frame)
        info = types["nav_msgs/msg/MapMetaData"](
            map_load_time=header.stamp,
            resolution=geometry.resolution_m,
            width=geometry.shape[1],
            height=geometry.shape[0],
            origin=self._pose(geometry),
        )
        kind = "nav_msgs/msg/OccupancyGrid"
        data = np.ascontiguousarray(cells, np.int8).ravel()
        return self._serialised(types[kind](header=header, info=info, data=data), kind)

    def _pose(self, geometry: GridGeometry | None = None) -> Any:
        types = self._store.types
        (x, y), yaw = (geometry.origin_xy_m, geometry.yaw_rad) if geometry else ((0.0, 0.0), 0.0)
        return types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](x=x, y=y, z=0.0),
            orientation=types["geometry_msgs/msg/Quaternion"](
                x=0.0, y=0.0, z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2))
            ),
        )

    def _polygon(self, ring: NDArray[np.float64]) -> Any:
        types = self._store.types
        corner = types["geometry_msgs/msg/Point32"]
        # The last corner of a ring repeats the first; a ROS polygon closes by itself.
        corners = [corner(x=x, y=y, z=0.0) for x, y in ring[:-1].tolist()]
        return types["geometry_msgs/msg/Polygon"](points=corners)

    def _marker(
        self,
        frame: TrackedSnapshot,
        namespace: str,
        number: int,
        kind: int,
        points: NDArray[np.float64] | None = None,
        colour: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
        width_m: float = 1.0,
        *,
        action: int = ADD,
        text: str = "",
    ) -> Any:
        types = self._store.types
        point, rgba = types["geometry_msgs/msg/Point"], types["std_msgs/msg/ColorRGBA"]
        corners = [] if points is None else [point(x=x, y=y, z=0.0) for x, y in points.tolist()]
        return types["visualization_msgs/msg/Marker"](
            header=self._header(frame),
            ns=namespace,
            id=number,
            type=kind,
            action=action,
            pose=self._pose(),
            scale=types["geometry_msgs/msg/Vector3"](x=width_m, y=width_m, z=width_m),
            color=rgba(r=colour[0], g=colour[1], b=colour[2], a=colour[3]),
            lifetime=types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0),
            frame_locked=False,
            points=corners,
            colors=[],
            texture_resource="",
            texture=types["sensor_msgs/msg/CompressedImage"](
                header=self._header(frame), format="", data=np.zeros(0, np.uint8)
            ),
            uv_coordinates=[],
            text=text,
            mesh_resource="",
            mesh_file=types["visualization_msgs/msg/MeshFile"](filename="", data=np.zeros(0, np.uint8)),
            mesh_use_embedded_materials=False,
        )


def triangle_corners(shape: BaseGeometry) -> NDArray[np.float64]:
    """Corners (3 K, 2) of triangles that fill a shape, world metres.

    GEOS fails on some outlines of cells in which a ring touches itself at a corner; a hair wider they touch
    along a line instead, and it does not.
    """
    triangles = []
    for part in shapely.get_parts(shape):
        try:
            found = shapely.constrained_delaunay_triangles(part)
        except shapely.errors.GEOSException:
            found = shapely.constrained_delaunay_triangles(part.buffer(TOUCH_M, join_style="mitre"))
        triangles.append(shapely.get_coordinates(shapely.get_parts(found)).reshape(-1, 4, 2)[:, :3])
    return np.concatenate([np.zeros((0, 2)), *(corners.reshape(-1, 2) for corners in triangles)])


def outer_rings(shape: BaseGeometry) -> list[NDArray[np.float64]]:
    """Closed outer rings (K, 2) of the polygons of a shape, world metres."""
    return [
        shapely.get_coordinates(shapely.get_exterior_ring(part))
        for part in shapely.get_parts(shape)
        if part.geom_type == "Polygon"
    ]


def label_point(shape: BaseGeometry) -> tuple[float, float]:
    """Deepest point of a shape; the origin for an empty one."""
    if shape.is_empty:
        return 0.0, 0.0
    x, y = shapely.get_coordinates(shapely.maximum_inscribed_circle(shape, tolerance=LABEL_TOLERANCE_M))[0]
    return float(x), float(y)
