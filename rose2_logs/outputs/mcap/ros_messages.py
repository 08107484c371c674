"""ROS 2 messages that the annotated MCAP writes, and their definitions."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.drawing.palette import track_color
from rose2_logs.io.grids import GRID_TYPE
from rose2_logs.model.mitred import mitred
from rose2_logs.model.occupancy import UNKNOWN, FloatArray, classify
from rose2_logs.model.per_shape import PerShape
from rose2_logs.model.room_quality import unsure_sign
from rose2_logs.outputs.mcap.cdr import CdrWriter
from rose2_logs.tracking.track_history import quality_of
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore
    from shapely.geometry.base import BaseGeometry

ROOMS_TYPE = "rose2_msgs/msg/Rooms"
ROOM_TYPE = "rose2_msgs/msg/Room"
RING_TYPE = "rose2_msgs/msg/Ring"
"""Like geometry_msgs/Polygon, whose single precision is decimeters off in the coordinates of a country."""
WRITTEN_TYPES = (GRID_TYPE, "visualization_msgs/msg/MarkerArray", ROOMS_TYPE)
HEADER_TYPE = "std_msgs/msg/Header"
DEFINITIONS = Path(__file__).parent / "definitions"
"""Schemas of the written types: what `ros2_typestore` says of them, without loading all types of ROS 2."""
HIGHEST_VALUE = 98
"""Rooms have the values 1..98 in `/rose2/segmented_map`: between free, 0, and occupied, 100."""
VALUE_STEP = 37
"""From one track's value to the next one's, modulo 98: viewers draw values as shades, and neighboring rooms
often have neighboring tracks. It has no factor in common with 98, so the first 98 tracks differ."""
FILL_OPACITY = 0.45
OUTLINE_SHADE = 0.7
"""A room's outline has its color, darker by this factor, so that it stands out from the fill."""
MARKER_LAYERS = ("rooms", "lines", "walls", "outlines", "path", "doorways", "unsure_borders", "labels")
"""Namespaces of markers, the lowest first."""
VIEW_PX = 700
"""Height in pixels of the view that the next ones are meant for: that of a window on a laptop's screen."""
LABEL_PX, OUTLINE_PX, LINE_PX, DOORWAY_PX, PATH_PX = 14, 1.5, 1.0, 4.0, 2.0
"""Height of labels and widths of lines where a whole building fills this view."""
LAYER_STEP_M = 0.01
DEFAULT_OCCUPANCY = OccupancyParameters()
TOUCH_M = 1e-3
"""How much a shape is widened that cannot be triangulated as it is: far less than a cell."""
ADD, DELETE_ALL = 0, 3
LINE_STRIP, LINE_LIST, TEXT, TRIANGLES = 4, 5, 9, 11
PATH_COLOR = (0.0, 0.35, 0.75, 1.0)
NO_TURN = (0.0, 0.0, 0.0, 1.0)
"""Quaternion x, y, z, w."""


def definition(message_type: str) -> bytes:
    """Text of a written type's definition with the types that it uses, as a ros2msg schema of MCAP."""
    return (DEFINITIONS / f"{PurePosixPath(message_type).name}.msg").read_bytes()


def ros2_typestore(
    extra: Mapping[str, Any] | None = None, wanted: Collection[str] | None = None, *, is_ros1: bool = False
) -> Typestore:
    """Build a store with the ROS 2 types, the types that a log defines, and the rooms message.

    Parameters
    ----------
    extra : mapping of type name to fields, optional
        Definitions from a bag; the Header of ROS 2 takes precedence over that of ROS 1.
    wanted : collection of str, optional
        Register only these types and the types that they use: registering all of them is slow, and so is
        loading those of a distribution, which is left out where the given ones are enough.
    is_ros1 : bool
        Whether types that are not given are first looked for in ROS 1.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    written: dict[str, Any] = {}
    for kind in WRITTEN_TYPES:
        written |= get_types_from_msg(definition(kind).decode(), kind)
    own = {name: written[name] for name in (HEADER_TYPE, ROOMS_TYPE, ROOM_TYPE, RING_TYPE)}
    given = {**written, **(extra or {}), **own}
    found = given if wanted is None else _needed(given, wanted)
    used = {name for fields in found.values() for name in _used(fields)}
    if wanted is None or not found.keys() >= used.union(wanted):
        standard: dict[str, Any] = dict(get_typestore(Stores.ROS2_HUMBLE).fielddefs)
        if is_ros1:
            standard |= get_typestore(Stores.ROS1_NOETIC).fielddefs
        given = standard | given
        found = given if wanted is None else _needed(given, wanted)
    store = get_typestore(Stores.EMPTY)
    store.register(found)
    return store


def _needed(definitions: Mapping[str, Any], wanted: Iterable[str]) -> dict[str, Any]:
    """The wanted definitions and those that they use, as far as they are known."""
    found: dict[str, Any] = {}
    left = list(wanted)
    while left:
        name = left.pop()
        if name in definitions and name not in found:
            found[name] = definitions[name]
            left += _used(definitions[name])
    return found


def _used(definition: Any) -> list[str]:
    """Names of the message types that the fields of a definition have."""
    return [name for _, kind in definition[1] if "/" in (name := _type_name(kind))]


def _type_name(kind: Any) -> str:
    """Name of a field's type, or of an array's elements."""
    _, inner = kind
    # `inner`: a name; for an array the kind and number of its elements; for a number its name and size.
    return (
        inner if isinstance(inner, str) else inner[0] if isinstance(inner[0], str) else _type_name(inner[0])
    )


@dataclass(frozen=True)
class MarkerSizes:
    """Sizes of markers, in meters: viewers draw them in the scale of the map.

    Attributes
    ----------
    label_m : float
        Height of labels.
    outline_m, line_m, doorway_m, path_m : float
        Widths of lines: of rooms and walls, of representative lines, of doorways, of the robot's path.
    """

    label_m: float = 0.5
    outline_m: float = 0.06
    line_m: float = 0.03
    doorway_m: float = 0.15
    path_m: float = 0.06

    @classmethod
    def of_view(cls, height_m: float) -> Self:
        """Sizes to be seen in a view of `VIEW_PX` rows that shows a whole building, but no smaller ones."""
        pixel_m = height_m / VIEW_PX
        return cls(
            label_m=max(cls.label_m, LABEL_PX * pixel_m),
            outline_m=max(cls.outline_m, OUTLINE_PX * pixel_m),
            line_m=max(cls.line_m, LINE_PX * pixel_m),
            doorway_m=max(cls.doorway_m, DOORWAY_PX * pixel_m),
            path_m=max(cls.path_m, PATH_PX * pixel_m),
        )


SMALLEST_SIZES = MarkerSizes()


class MessageMaker:
    """Makes the serialized messages of a snapshot.

    Parameters
    ----------
    occupancy : OccupancyParameters
        Which cells are free and which are occupied.
    """

    def __init__(self, occupancy: OccupancyParameters = DEFAULT_OCCUPANCY) -> None:
        self._triangles = Triangles()
        # Value of the segmented map outside of rooms, indexed by the cell's value as an unsigned byte.
        values = np.arange(256, dtype=np.uint8).view(np.int8)
        free, occupied = classify(values, occupancy)
        self._unroomed = np.where(occupied, np.int8(100), np.where(free, np.int8(0), np.int8(UNKNOWN)))

    def source_map(self, step: TrackedSnapshot) -> bytearray:
        """Make the map itself, for saved maps, which are not messages yet."""
        return _grid(step, step.snapshot.cells)

    def segmented_map(self, step: TrackedSnapshot) -> bytearray:
        """Make the segmented map: rooms as 1..98, occupied 100, other free cells 0, all others -1."""
        values = np.array([0, *map(room_value, step.track_ids)], np.int8)
        labels = step.analysis.rooms.labels
        # The probabilities that some maps contain would look like rooms.
        known = np.ascontiguousarray(step.snapshot.cells).view(np.uint8)
        cells = cv2.LUT(known, self._unroomed.view(np.uint8)).view(np.int8)
        np.copyto(cells, values.take(labels, mode="clip"), where=labels > 0)
        return _grid(step, cells)

    def clean_map(self, step: TrackedSnapshot) -> bytearray | None:
        """Make the clean map: 100 where structure, 0 where free or clutter, -1 unknown; None without one."""
        structure = step.analysis.structure
        if structure is None:
            return None
        known = np.minimum(step.snapshot.cells, np.int8(0))
        np.copyto(known, np.int8(100), where=structure.clean)
        return _grid(step, known)

    def rooms(self, step: TrackedSnapshot) -> bytearray:
        """Make the rooms message, by ascending track."""
        rooms, tracks, z_m = step.analysis.rooms, step.track_ids, step.snapshot.z_m
        message = CdrWriter()
        message.header(step.snapshot.stamp_ns, step.analysis.geometry.frame_id)
        message.numbers("d2I", step.coverage, len(rooms), len(rooms))  # the count, the sequence's length
        points = np.nan_to_num(rooms.label_points_m).tolist()
        for track, number in sorted(zip(tracks, range(1, len(rooms) + 1), strict=True)):
            shape = rooms.polygons[number - 1]
            message.numbers("I", track)
            message.string(step.given_name(number - 1))
            message.numbers("5d", float(rooms.areas_m2[number - 1]), shape.area, *points[number - 1], z_m)
            rings = rooms.outer_rings_m[number - 1]
            message.numbers("I", len(rings))
            for ring in rings:
                # The last corner of a ring repeats the first; as a ROS polygon it closes by itself.
                message.points(ring[:-1], z_m)
            neighbors = sorted(tracks[other - 1] for other in rooms.neighbors(number))
            message.sequence(np.array(neighbors, np.uint32))
        return message.message()

    def markers(
        self,
        step: TrackedSnapshot,
        path_m: Sequence[FloatArray] = (),
        sizes: MarkerSizes = SMALLEST_SIZES,
    ) -> bytearray:
        """Make the markers: delete the old ones, then rooms, walls, lines, doorways and the robot's path.

        Parameters
        ----------
        step : TrackedSnapshot
            The map.
        path_m : sequence of (N, 2) float
            Where the robot has been up to then, world meters, in pieces.
        sizes : MarkerSizes
            Widths of lines and height of labels.
        """
        analysis, rooms = step.analysis, step.analysis.rooms
        markers = [Marker("", 0, TRIANGLES, action=DELETE_ALL)]
        points = np.nan_to_num(rooms.label_points_m).tolist()
        corners = self._triangles.corners_of(rooms.polygons)
        for track, number in sorted(zip(step.track_ids, range(len(rooms)), strict=True)):
            red, green, blue = (value / 255 for value in track_color(track))
            fill = (red, green, blue, FILL_OPACITY)
            line = (red * OUTLINE_SHADE, green * OUTLINE_SHADE, blue * OUTLINE_SHADE, 1.0)
            x, y = points[number]
            sign = unsure_sign(quality_of(step, number)[0])
            markers += [
                Marker("rooms", track, TRIANGLES, corners[number], fill),
                Marker(
                    "outlines",
                    track,
                    LINE_LIST,
                    ring_segments(rooms.outer_rings_m[number]),
                    line,
                    sizes.outline_m,
                ),
                Marker(
                    "labels",
                    track,
                    TEXT,
                    color=(0.0, 0.0, 0.0, 1.0),
                    width_m=sizes.label_m,
                    text=f"{step.given_name(number) or track}{sign}\n{rooms.areas_m2[number]:.0f} m2",
                    position_m=(x, y),
                ),
            ]
        if analysis.walls is not None:
            walls, lines = analysis.walls.segments_m.reshape(-1, 2), analysis.walls.lines_m.reshape(-1, 2)
            markers.append(Marker("walls", 0, LINE_LIST, walls, (0.1, 0.1, 0.1, 1.0), sizes.outline_m))
            markers.append(Marker("lines", 0, LINE_LIST, lines, (0.2, 0.4, 0.9, 0.35), sizes.line_m))
        for name, doors, color in (
            ("doorways", rooms.doorways, (0.9, 0.3, 0.1, 1.0)),
            ("unsure_borders", analysis.unsure_doorways, (0.6, 0.15, 0.8, 1.0)),
        ):
            ends = np.array([door.ends_m for door in doors]).reshape(-1, 2)
            markers.append(Marker(name, 0, LINE_LIST, ends, color, sizes.doorway_m))
        markers += [
            Marker("path", number, LINE_STRIP, points_m, PATH_COLOR, sizes.path_m)
            for number, points_m in enumerate(path_m)
            if len(points_m) > 1
        ]
        # RViz calls a marker without points an error.
        markers = [each for each in markers if len(each.points_m) or each.kind == TEXT or each.action != ADD]
        # At different heights, so that layers do not flicker through each other or through the map.
        base_m = step.snapshot.z_m
        heights = {name: base_m + LAYER_STEP_M * (layer + 1) for layer, name in enumerate(MARKER_LAYERS)}
        message = CdrWriter()
        message.numbers("I", len(markers))
        shared = SharedFields.of(step.snapshot.stamp_ns, analysis.geometry.frame_id)
        for marker in markers:
            marker.write(message, shared, heights.get(marker.ns, 0.0))
        return message.message()


class SharedFields(NamedTuple):
    """Serialized fields that all markers of a map share; each block starts at an aligned offset.

    Attributes
    ----------
    header : bytes
        Stamp and frame.
    after_points : bytes
        The fields between points and text: colors and texture, both empty.
    after_text : bytes
        The fields after the text: an empty mesh.
    """

    header: bytes
    after_points: bytes
    after_text: bytes

    @classmethod
    def of(cls, stamp_ns: int, frame_id: str) -> Self:
        """Serialize the fields."""
        header, after_points, after_text = CdrWriter(), CdrWriter(), CdrWriter()
        header.header(stamp_ns, frame_id)
        after_points.numbers("I", 0)  # colors
        after_points.string("")  # texture_resource
        after_points.header(stamp_ns, frame_id)  # texture: an empty picture
        after_points.string("")
        after_points.numbers("2I", 0, 0)  # data of the texture, uv_coordinates
        after_text.string("")  # mesh_resource
        after_text.string("")  # mesh_file: its name and data
        after_text.numbers("IB", 0, 0)  # and mesh_use_embedded_materials
        return cls(*(bytes(each.fields()) for each in (header, after_points, after_text)))


@dataclass(frozen=True, eq=False)
class Marker:
    """The fields of a visualization_msgs/Marker that differ between the markers of a map.

    Attributes
    ----------
    ns, number : str, int
        Namespace and id.
    kind : int
        Type of the marker.
    points_m : (N, 2) float
        World meters.
    color : (float, float, float, float)
        Red, green, blue, opacity in [0, 1].
    width_m : float
        Scale: the width of lines, the height of text.
    action : int
        `ADD` or `DELETE_ALL`.
    text : str
        Text to show.
    position_m : (float, float)
        Position of the text.
    """

    ns: str
    number: int
    kind: int
    points_m: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    color: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    width_m: float = 1.0
    action: int = ADD
    text: str = ""
    position_m: tuple[float, float] = (0.0, 0.0)

    def write(self, message: CdrWriter, shared: SharedFields, height_m: float) -> None:
        """Append the marker, at a height in the world."""
        width_m = self.width_m
        lifetime, frame_locked = (0, 0), 0  # forever; where it was
        message.written(shared.header, 4)
        message.string(self.ns)
        message.numbers(
            "3i10d4f2iB",
            *(self.number, self.kind, self.action),
            *(*self.position_m, height_m, *NO_TURN, width_m, width_m, width_m),
            *self.color,
            *lifetime,
            frame_locked,
        )
        message.points(self.points_m)
        message.written(shared.after_points, 4)
        message.string(self.text)
        message.written(shared.after_text, 4)


def room_value(track: int) -> int:
    """Value of a room's cells in the segmented map; tracks that differ by a multiple of 98 share one."""
    return 1 + VALUE_STEP * (track - 1) % HIGHEST_VALUE


def _grid(step: TrackedSnapshot, cells: NDArray[np.int8]) -> bytearray:
    """Make a nav_msgs/OccupancyGrid with the stamp, the geometry and the height of the map."""
    geometry, stamp_ns = step.analysis.geometry, step.snapshot.stamp_ns
    message = CdrWriter()
    message.header(stamp_ns, geometry.frame_id)
    message.time(stamp_ns)  # map_load_time
    message.numbers("f2I", geometry.resolution_m, geometry.shape[1], geometry.shape[0])
    half = geometry.yaw_rad / 2
    origin_m = (*geometry.origin_xy_m, step.snapshot.z_m)
    message.numbers("7d", *origin_m, 0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
    message.sequence(cells.astype(np.int8, copy=False).ravel())
    return message.message()


class Triangles:
    """Splits shapes into triangles, and caches the triangles of the previous map.

    Most parts of shapes do not change from map to map, and large ones take long to triangulate.
    """

    def __init__(self) -> None:
        self._of_parts = PerShape(_triangulated)

    def corners_of(self, shapes: Sequence[BaseGeometry]) -> list[FloatArray]:
        """Corners (3 K, 2) of the triangles of each shape, world meters."""
        parts, shape = shapely.get_parts(np.array(shapes, object), return_index=True)
        corners: list[list[FloatArray]] = [[np.zeros((0, 2))] for _ in shapes]
        for number, of_part in zip(shape.tolist(), self._of_parts(parts), strict=True):
            corners[number].append(of_part)
        return [np.concatenate(each) for each in corners]


def _triangulated(parts: NDArray[np.object_]) -> list[FloatArray]:
    """Corners (3 K, 2) of the triangles of each polygon, counterclockwise.

    RViz lights the front of a triangle, which is where its corners go around counterclockwise: from above.

    GEOS fails on some cell outlines in which a ring touches itself at a corner. Slightly widened, they touch
    along a line instead, and GEOS succeeds.
    """
    try:
        found = shapely.constrained_delaunay_triangles(parts)
    except shapely.errors.GEOSException:
        if len(parts) > 1:
            return [corners for part in parts for corners in _triangulated(np.array([part]))]
        wider = mitred(parts, TOUCH_M)
        found = shapely.constrained_delaunay_triangles(wider)
    triangles, part = shapely.get_parts(found, return_index=True)
    corners = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    ends = np.cumsum(np.bincount(part, minlength=len(parts)))
    return [each.reshape(-1, 2) for each in np.split(corners, ends[:-1])] if len(parts) else []


def ring_segments(rings: Sequence[FloatArray]) -> FloatArray:
    """End points (2 N, 2) of the segments of closed rings, world meters."""
    ends = [np.repeat(ring, 2, axis=0)[1:-1] for ring in rings]
    return np.concatenate([np.zeros((0, 2)), *ends])
