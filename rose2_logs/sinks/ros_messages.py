"""ROS 2 messages that the annotated MCAP writes, and their definitions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.occupancy import UNKNOWN, FloatArray
from rose2_logs.sinks.cdr import CdrWriter
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
MARKER_LAYERS = ("rooms", "lines", "walls", "outlines", "doorways", "labels")
"""Namespaces of markers, the lowest first."""
LAYER_STEP_M = 0.01
TOUCH_M = 1e-3
"""How much wider a shape is drawn that cannot be triangulated as it is: far below a cell."""
ADD, DELETE_ALL = 0, 3
LINE_LIST, TEXT, TRIANGLES = 5, 9, 11
NO_TURN = (0.0, 0.0, 0.0, 1.0)
"""Quaternion x, y, z, w."""


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
        self._triangles: dict[bytes, FloatArray] = {}

    def definition(self, message_type: str) -> bytes:
        """Text of a type's definition with all it is made of, as MCAP's ros2msg schema."""
        return self._store.generate_msgdef(message_type, ros_version=2)[0].encode()

    def source_map(self, frame: TrackedSnapshot) -> bytearray:
        """Make the map itself, for inputs that are no log of messages."""
        return _grid(frame, frame.snapshot.cells)

    def segmented_map(self, frame: TrackedSnapshot) -> bytearray:
        """Make the segmented map: rooms as 1..98, occupied 100, other free cells 0, unknown -1."""
        values = np.array([0, *(1 + (track - 1) % HIGHEST_VALUE for track in frame.track_ids)], np.int8)
        labels = frame.analysis.rooms.labels
        return _grid(frame, np.where(labels == 0, np.maximum(frame.snapshot.cells, UNKNOWN), values[labels]))

    def clean_map(self, frame: TrackedSnapshot) -> bytearray | None:
        """Make the clean map: 100 where structure, 0 where free or clutter, -1 unknown; None without one."""
        structure = frame.analysis.structure
        if structure is None:
            return None
        known = np.clip(frame.snapshot.cells, UNKNOWN, 0)
        return _grid(frame, np.where(structure.clean, np.int8(100), known))

    def rooms(self, frame: TrackedSnapshot) -> bytearray:
        """Make the rooms message, by ascending track."""
        rooms, tracks = frame.analysis.rooms, frame.track_ids
        message = CdrWriter()
        message.header(frame.snapshot.stamp_ns, frame.analysis.geometry.frame_id)
        message.numbers("d", frame.coverage)
        message.numbers("I", len(rooms))
        points = np.nan_to_num(rooms.label_points_m).tolist()
        for track, number in sorted(zip(tracks, range(1, len(rooms) + 1), strict=True)):
            shape = rooms.polygons[number - 1]
            message.numbers("I", track)
            message.numbers("d", float(rooms.areas_m2[number - 1]), shape.area, *points[number - 1], 0.0)
            rings = outer_rings(shape)
            message.numbers("I", len(rings))
            for ring in rings:
                # The last corner of a ring repeats the first; a ROS polygon closes by itself.
                message.points(ring[:-1], np.float32)
            neighbours = sorted(tracks[other - 1] for other in rooms.neighbours(number))
            message.sequence(np.array(neighbours, np.uint32))
        return message.message()

    def markers(self, frame: TrackedSnapshot) -> bytearray:
        """Make the markers: all old ones deleted, then fills, outlines, labels, walls, lines, doorways."""
        analysis, rooms = frame.analysis, frame.analysis.rooms
        made = [Marker("", 0, TRIANGLES, action=DELETE_ALL)]
        points = np.nan_to_num(rooms.label_points_m).tolist()
        triangles: dict[bytes, FloatArray] = {}
        for track, number in sorted(zip(frame.track_ids, range(len(rooms)), strict=True)):
            shape = rooms.polygons[number]
            red, green, blue = (value / 255 for value in track_colour(track))
            fill, line = (red, green, blue, FILL_OPACITY), (red * 0.7, green * 0.7, blue * 0.7, 1.0)
            # Many a shape is that of the map before, and large ones take long to triangulate.
            if (corners := self._triangles.get(key := shape.wkb)) is None:
                corners = triangle_corners(shape)
            triangles[key] = corners
            x, y = points[number]
            made += [
                Marker("rooms", track, TRIANGLES, corners, fill),
                Marker("outlines", track, LINE_LIST, ring_segments(shape), line, OUTLINE_WIDTH_M),
                Marker(
                    "labels",
                    track,
                    TEXT,
                    colour=(0.0, 0.0, 0.0, 1.0),
                    width_m=LABEL_HEIGHT_M,
                    text=f"{track}\n{shape.area:.0f} m2",
                    position_m=(x, y),
                ),
            ]
        self._triangles = triangles
        if analysis.walls is not None:
            walls, lines = analysis.walls.segments_m.reshape(-1, 2), analysis.walls.lines_m.reshape(-1, 2)
            made.append(Marker("walls", 0, LINE_LIST, walls, (0.1, 0.1, 0.1, 1.0), OUTLINE_WIDTH_M))
            made.append(Marker("lines", 0, LINE_LIST, lines, (0.2, 0.4, 0.9, 0.35), LINE_WIDTH_M))
        doors = np.array([door.ends_m for door in rooms.doorways]).reshape(-1, 2)
        made.append(Marker("doorways", 0, LINE_LIST, doors, (0.9, 0.3, 0.1, 1.0), OUTLINE_WIDTH_M))
        # One above the other, so that none flickers through another or through the map.
        heights = {name: LAYER_STEP_M * (layer + 1) for layer, name in enumerate(MARKER_LAYERS)}
        message = CdrWriter()
        message.numbers("I", len(made))
        for marker in (replace(each, height_m=heights.get(each.ns, 0.0)) for each in made):
            marker.write(message, frame.snapshot.stamp_ns, analysis.geometry.frame_id)
        return message.message()


@dataclass(frozen=True, eq=False)
class Marker:
    """What differs between the markers of a map: the fields of a visualization_msgs/Marker.

    Attributes
    ----------
    ns, number : str, int
        Namespace and id.
    kind : int
        Its type.
    points_m : (N, 2) float
        World metres.
    colour : (float, float, float, float)
        Red, green, blue, opacity in [0, 1].
    width_m : float
        Scale: the width of lines, the height of text.
    action : int
        To add it or to delete all.
    text : str
        What it says.
    position_m : (float, float)
        Where the text stands.
    height_m : float
        How far it lies above the map.
    """

    ns: str
    number: int
    kind: int
    points_m: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    colour: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    width_m: float = 1.0
    action: int = ADD
    text: str = ""
    position_m: tuple[float, float] = (0.0, 0.0)
    height_m: float = 0.0

    def write(self, message: CdrWriter, stamp_ns: int, frame_id: str) -> None:
        """Append the marker, with the stamp and frame of its map."""
        message.header(stamp_ns, frame_id)
        message.string(self.ns)
        message.numbers("i", self.number, self.kind, self.action)
        message.numbers("d", *self.position_m, self.height_m, *NO_TURN, *[self.width_m] * 3)
        message.numbers("f", *self.colour)
        message.numbers("i", 0, 0)  # lifetime: for ever
        message.numbers("B", 0)  # frame_locked
        message.points(self.points_m)
        message.numbers("I", 0)  # colors
        message.string("")  # texture_resource
        message.header(stamp_ns, frame_id)  # texture: an empty picture
        message.string("")
        message.numbers("I", 0, 0)  # data of the texture, uv_coordinates
        message.string(self.text)
        message.string("")  # mesh_resource
        message.string("")  # mesh_file: its name and data
        message.numbers("I", 0)
        message.numbers("B", 0)  # mesh_use_embedded_materials


def _grid(frame: TrackedSnapshot, cells: NDArray[np.int8]) -> bytearray:
    """Make a nav_msgs/OccupancyGrid with the stamp and the geometry of the map."""
    geometry, stamp_ns = frame.analysis.geometry, frame.snapshot.stamp_ns
    message = CdrWriter()
    message.header(stamp_ns, geometry.frame_id)
    message.time(stamp_ns)  # map_load_time
    message.numbers("f", geometry.resolution_m)
    message.numbers("I", geometry.shape[1], geometry.shape[0])
    half = geometry.yaw_rad / 2
    message.numbers("d", *geometry.origin_xy_m, 0.0, 0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
    message.sequence(cells.astype(np.int8, copy=False).ravel())
    return message.message()


def triangle_corners(shape: BaseGeometry) -> FloatArray:
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


def outer_rings(shape: BaseGeometry) -> list[FloatArray]:
    """Closed outer rings (K, 2) of the polygons of a shape, world metres."""
    parts = shapely.get_parts(shape)
    rings = shapely.get_exterior_ring(parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON])
    points, ring = shapely.get_coordinates(rings, return_index=True)
    return np.split(points, np.flatnonzero(np.diff(ring)) + 1) if len(points) else []


def ring_segments(shape: BaseGeometry) -> FloatArray:
    """Ends (2 N, 2) of the segments that the outer rings of a shape are made of, world metres."""
    ends = [np.repeat(ring, 2, axis=0)[1:-1] for ring in outer_rings(shape)]
    return np.concatenate([np.zeros((0, 2)), *ends])
