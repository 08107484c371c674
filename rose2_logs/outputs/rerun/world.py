"""What a recording shows of one map: its layers in the world, and its spectrum."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rose2_logs.drawing.hatching import hatch_unseen
from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.robot_trail import GAP_M, RobotTrail
from rose2_logs.model.borders import UNSURE_BORDER_BELOW
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.model.room_names import NameOf, room_name, short_name
from rose2_logs.model.room_quality import UNSURE_SIGN, is_unsure
from rose2_logs.outputs.rerun.columns import Label, Strips
from rose2_logs.outputs.rerun.layers import Layers
from rose2_logs.outputs.rerun.pictures import MapPictures, spectrum_picture
from rose2_logs.system.text import percent
from rose2_logs.tracking.track_history import quality_of
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

LAYER_STEP_M = 0.01
"""Layers are this far above each other, so that none flickers through another."""
OUTLINE_POINTS, DOOR_POINTS, PATH_POINTS, LINE_POINTS, THIN_POINTS = 2.0, 4.0, 2.0, 1.5, 0.75
"""Widths of lines in points of the screen, which stay readable at any zoom."""
DOOR_COLOR, PATH_COLOR, ROBOT_COLOR = (230, 90, 20), (20, 90, 200), (200, 20, 60)
LINE_COLOR, VORONOI_COLOR, DIRECTION_COLOR = (60, 110, 230), (150, 20, 150), (255, 190, 40)
UNCLUSTERED_COLOR = (130, 130, 130)
LABEL_COLOR, SPECTRUM_LABEL_COLOR = (0, 0, 0), (255, 255, 255)
"""Letters on the box that the viewer draws behind them, pale in its light theme, half dark in its dark one.
On the pale map only black can be read in both, on the dark spectrum white."""
PAPER, DARK = (236, 236, 236), (12, 12, 16)
"""Ground of the views."""
STRONG_EDGE, WEAK_EDGE = (20, 20, 90), (80, 165, 235)
"""Edges that walls cover all along, and not at all; distinct also for those who do not see red and green."""
SURE_BORDER, UNSURE_BORDER = (20, 20, 90), (190, 40, 230)
"""Borders of strength 1, and those that are unsure; between them the color goes from half way on."""
OUTLINE_SHADE, SEGMENT_SHADE = 0.6, 0.75
"""Share of the color of a fill that its outline has, and of a track's that a wall's segments have."""
ROBOT_LENGTH_M, ROBOT_WIDTH_M = 0.7, 0.45
"""Size of the arrowhead that stands for the robot, about that of a mobile base."""
MARKS = (0.8, 0.98)
"""Where the marks of the directions begin and end, from the center of the spectrum's picture to its rim."""
BORDER_NAME = "{one} | {other}: {strength}"
NAMED_SHARE = 0.004
"""Rooms with less of the area of a square view get a number only: number and area are about 65 of the usual
1000 points wide, the side of a room of this share."""
MAP, ROOMS, DOORWAYS = "/world/map", "/world/rooms", "/world/doorways"
BORDERS = "/world/borders"
FILLS, CLEAN, SCORE = "/world/room_fills", "/world/clean_map", "/world/structure_score"
PREDICTED, PATH, ROBOT = "/world/predicted", "/world/path", "/world/robot"
PATH_IN_PART = "/world/path_in_part"
"""The robot's path of runs in parts, as a whole with each map; of others `PATH` has a piece with each map."""
SEGMENTS, LINES, FACES, VORONOI = "/world/segments", "/world/lines", "/world/faces", "/world/voronoi"
SPECTRUM = "/spectrum"
HEIGHTS = (
    MAP,
    CLEAN,
    SCORE,
    FILLS,
    PREDICTED,
    ROOMS,
    FACES,
    LINES,
    SEGMENTS,
    VORONOI,
    DOORWAYS,
    BORDERS,
    PATH,
    ROBOT,
)
"""From the lowest layer to the highest; labels are above them all."""
Color = tuple[int, int, int]


class World:
    """Logs the layers of one map after the other.

    Parameters
    ----------
    layers : Layers
        Where to log.
    recording : RecordingStream
        For what stays the same over the run.
    wanted : collection of str
        Those of `RECORDING_LAYERS` that are to be written.
    name_of : callable
        Name of a room by its track.
    """

    def __init__(
        self,
        layers: Layers,
        recording: rr.RecordingStream,
        wanted: Collection[str],
        name_of: NameOf = room_name,
    ) -> None:
        self._layers = layers
        self._name_of = name_of
        self._recording = recording
        self._wanted = wanted
        self._shown: set[int] = set()
        self._known: set[int] = set()
        self._named: set[int] = set()
        self._begun: set[str] = set()
        self._pose: FloatArray | None = None
        self._trail = RobotTrail()
        recording.log("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for path, width, color in (
            (DOORWAYS, DOOR_POINTS, DOOR_COLOR),
            (BORDERS, DOOR_POINTS, None),
            (PATH, PATH_POINTS, PATH_COLOR),
            (ROBOT, OUTLINE_POINTS, ROBOT_COLOR),
            (PREDICTED, THIN_POINTS, None),
            (SEGMENTS, OUTLINE_POINTS, None),
            (LINES, THIN_POINTS, LINE_COLOR),
            (FACES, LINE_POINTS, None),
            (VORONOI, LINE_POINTS, VORONOI_COLOR),
            (f"{SPECTRUM}/directions", LINE_POINTS, DIRECTION_COLOR),
        ):
            self._style_lines(path, width, color)

    @property
    def has_path(self) -> bool:
        """Whether the robot's path is known so far."""
        return self._pose is not None

    def log(self, step: TrackedSnapshot, view_side_m: float) -> None:
        """Log one map, after the layers have begun its snapshot; the view is so high, at first."""
        self._log_pictures(step)
        self._log_rooms(step, view_side_m)
        doors = np.array([door.ends_m for door in step.analysis.rooms.doorways]).reshape(-1, 4)
        self._log_lines(DOORWAYS, doors)
        if "borders" in self._wanted:
            self._log_borders(step)
        if "predicted" in self._wanted:
            lines, room = hatch_unseen(step)
            colors = np.array([track_color(track) for track in step.track_ids], float).reshape(-1, 3)
            self._log_lines(PREDICTED, lines, (OUTLINE_SHADE * colors[room]).astype(np.uint8))
        self._log_structure(step)
        if step.path is not None and step.part is None:
            self._log_path(step.path)
        elif step.path is not None:
            self._log_trail(step, step.path)

    def _log_pictures(self, step: TrackedSnapshot) -> None:
        pictures = MapPictures(step.snapshot)
        self._layers.show(MAP, pictures.map(_height_m(MAP)))
        self._layers.show(FILLS, pictures.rooms(step.analysis.rooms.labels, step.track_ids, _height_m(FILLS)))
        structure = step.analysis.structure
        if structure is None:
            return
        if "clean_map" in self._wanted:
            self._layers.show(CLEAN, pictures.clean_map(structure.clean, _height_m(CLEAN)))
        if "score" in self._wanted:
            self._layers.show(SCORE, pictures.score(structure.score, _height_m(SCORE)))
        if "spectrum" in self._wanted:
            yaw = step.analysis.geometry.yaw_rad
            self._layers.show(f"{SPECTRUM}/magnitude", spectrum_picture(structure.spectrum, yaw))
            self._log_directions(structure.directions_rad)

    def _log_directions(self, directions_rad: FloatArray) -> None:
        """Mark, through the spectrum's center, where walls of the dominant directions have their ridge."""
        across = directions_rad + np.pi / 2
        # At the rim of the picture only, so that the ridge itself can be seen.
        begins, ends = (reach * np.column_stack([np.cos(across), np.sin(across)]) for reach in MARKS)
        marks = np.concatenate([np.hstack([begins, ends]), np.hstack([-begins, -ends])])
        points = np.column_stack([marks.reshape(-1, 2), np.full(2 * len(marks), LAYER_STEP_M)])
        lengths = np.full(len(marks), 2, np.int32)
        self._layers.show(f"{SPECTRUM}/directions", Strips(points.astype(np.float32), lengths))
        for number, (angle, place) in enumerate(zip(directions_rad, begins, strict=True)):
            text = direction_name(angle)
            label = Label((float(place[0]), float(place[1]), 2 * LAYER_STEP_M), text)
            if number not in self._named:
                self._named.add(number)
                self._style_label(f"{SPECTRUM}/names/{number}", SPECTRUM_LABEL_COLOR)
            self._layers.show(f"{SPECTRUM}/names/{number}", label)
        for number in range(len(directions_rad), self._layers.count_below(f"{SPECTRUM}/names")):
            self._layers.clear(f"{SPECTRUM}/names/{number}")

    def _log_rooms(self, step: TrackedSnapshot, view_side_m: float) -> None:
        rooms = step.analysis.rooms
        for track in sorted(self._shown - set(step.track_ids)):
            self._layers.clear(f"{ROOMS}/{track}")
        self._shown = set(step.track_ids)
        points = lifted(np.nan_to_num(rooms.label_points_m), len(HEIGHTS)).tolist()
        for number, track in enumerate(step.track_ids):
            if track not in self._known:
                self._known.add(track)
                self._begin_track(track)
            self._layers.show(f"{ROOMS}/{track}", _rings(rooms.outer_rings_m[number]))
            x, y, z = points[number]
            wall_share, _ = quality_of(step, number)
            area_m2 = float(rooms.areas_m2[number])
            name = short_name(track, self._name_of)
            text = room_label(name, area_m2, view_side_m, unsure=is_unsure(wall_share))
            self._layers.show(f"{ROOMS}/{track}/label", Label((x, y, z), text))

    def _begin_track(self, track: int) -> None:
        """Log what stays the same for a track."""
        red, green, blue = (int(OUTLINE_SHADE * value) for value in track_color(track))
        self._style_lines(f"{ROOMS}/{track}", OUTLINE_POINTS, (red, green, blue))
        self._style_label(f"{ROOMS}/{track}/label")

    def _log_borders(self, step: TrackedSnapshot) -> None:
        """Show how sure the borders are through which rooms are open to one another; name unsure ones."""
        strength = {border.rooms: border.strength for border in step.analysis.borders}
        doors = [door for door in step.analysis.rooms.doorways if door.rooms in strength]
        sure = np.array([strength[door.rooms] for door in doors])
        share = np.clip((sure - UNSURE_BORDER_BELOW) / (1 - UNSURE_BORDER_BELOW), 0, 1)[:, None]
        share = np.where(sure[:, None] < UNSURE_BORDER_BELOW, 0, (1 + share) / 2)
        colors = share * np.array(SURE_BORDER) + (1 - share) * np.array(UNSURE_BORDER)
        ends_m = np.array([door.ends_m for door in doors]).reshape(-1, 4)
        self._log_lines(BORDERS, ends_m, colors.astype(np.uint8))
        unsure = [door for door in doors if strength[door.rooms] < UNSURE_BORDER_BELOW]
        for number, door in enumerate(unsure):
            path = f"{BORDERS}/unsure/{number}"
            if path not in self._begun:
                self._begun.add(path)
                self._style_label(path)
            x, y, z = lifted(door.ends_m.mean(0)[None], len(HEIGHTS))[0].tolist()
            one, other = sorted(step.track_ids[room - 1] for room in door.rooms)
            text = BORDER_NAME.format(
                one=short_name(one, self._name_of),
                other=short_name(other, self._name_of),
                strength=percent(strength[door.rooms]),
            )
            self._layers.show(path, Label((x, y, z), text))
        for number in range(len(unsure), self._layers.count_below(f"{BORDERS}/unsure")):
            self._layers.clear(f"{BORDERS}/unsure/{number}")

    def _log_structure(self, step: TrackedSnapshot) -> None:
        analysis = step.analysis
        if analysis.walls is not None and "segments" in self._wanted:
            self._log_lines(
                SEGMENTS, analysis.walls.segments_m, _cluster_colors(analysis.walls.segment_cluster)
            )
        if analysis.walls is not None and "lines" in self._wanted:
            self._log_lines(LINES, analysis.walls.lines_m)
        if analysis.floor_plan is not None and "faces" in self._wanted:
            weight = analysis.floor_plan.edge_weight[:, None]
            colors = weight * np.array(STRONG_EDGE) + (1 - weight) * np.array(WEAK_EDGE)
            self._log_lines(FACES, analysis.floor_plan.edges_m, colors.astype(np.uint8))
        if analysis.voronoi_m is not None:
            self._log_lines(VORONOI, analysis.voronoi_m)

    def _log_path(self, path: FloatArray) -> None:
        """Log the robot's path since the map before; the view shows it together with all earlier pieces."""
        if not len(path):
            return
        poses = path if self._pose is None else np.concatenate([self._pose[None], path])
        self._pose = path[-1]
        far = np.hypot(*np.diff(poses[:, :2], axis=0).T) > GAP_M
        lengths = np.diff([0, *np.flatnonzero(far) + 1, len(poses)])
        self._layers.add(PATH, Strips(lifted(poses[:, :2], HEIGHTS.index(PATH)), lengths.astype(np.int32)))
        self._log_robot(self._pose)

    def _log_trail(self, step: TrackedSnapshot, path: FloatArray) -> None:
        """Log the robot's whole path on the map of a part, which replaces that of the map before.

        Pieces that a view shows together would stay where the map is begun anew.
        """
        if PATH_IN_PART not in self._begun:
            self._begun.add(PATH_IN_PART)
            self._style_lines(PATH_IN_PART, PATH_POINTS, PATH_COLOR)
        self._trail.follow(step)
        points = np.concatenate([np.zeros((0, 2)), *self._trail.pieces_m])
        lengths = np.array([len(piece) for piece in self._trail.pieces_m], np.int32)
        self._layers.show(PATH_IN_PART, Strips(lifted(points, HEIGHTS.index(PATH)), lengths))
        if len(path):
            self._pose = path[-1]
            self._log_robot(self._pose)
        elif not self._trail.pieces_m:
            self._layers.show(ROBOT, Strips(np.zeros((0, 3), np.float32), np.zeros(0, np.int32)))

    def _log_robot(self, pose: FloatArray) -> None:
        tip, back, side = ROBOT_LENGTH_M / 2, -ROBOT_LENGTH_M / 2, ROBOT_WIDTH_M / 2
        head = np.array([[tip, 0], [back, side], [0.6 * back, 0], [back, -side], [tip, 0]])
        cosine, sine = np.cos(pose[2]), np.sin(pose[2])
        there = head @ np.array([[cosine, sine], [-sine, cosine]]) + pose[:2]
        self._layers.show(ROBOT, Strips(lifted(there, HEIGHTS.index(ROBOT)), np.array([5], np.int32)))

    def _log_lines(self, path: str, ends_m: FloatArray, colors: NDArray[np.uint8] | None = None) -> None:
        points = lifted(ends_m.reshape(-1, 2), HEIGHTS.index(path))
        self._layers.show(path, Strips(points, np.full(len(ends_m), 2, np.int32), colors))

    def _style_lines(self, path: str, width: float, color: Color | None) -> None:
        self._recording.log(path, line_style(width, color), static=True)

    def _style_label(self, path: str, color: Color = LABEL_COLOR) -> None:
        self._recording.log(path, label_style(color), static=True)


def line_style(width: float, color: Color | None) -> rr.LineStrips3D:
    """Width in points of the screen that all lines of a path have, and their color if it is one."""
    return rr.LineStrips3D.from_fields(
        radii=rr.components.Radius.ui_points(width), colors=None if color is None else [color]
    )


def label_style(color: Color = LABEL_COLOR) -> rr.Points3D:
    """How names are shown: by default for a pale ground."""
    return rr.Points3D.from_fields(
        colors=[color], radii=rr.components.Radius.ui_points(0.5), show_labels=True
    )


def direction_name(angle_rad: float) -> str:
    """Name a direction of walls, which is the same after half a turn: from 0.0 to 179.9 degrees."""
    return f"walls at {round(math.degrees(angle_rad), 1) % 180:.1f}°"


def room_label(
    name: str, area_m2: float, view_side_m: float, *, unsure: bool = False, text: str | None = None
) -> str:
    """Label a room: its short name and area in one line, the name alone if these would cover its neighbors.

    The viewer cuts labels of several lines down to the first one where there are many. `text` stands in place
    of the area where that is not what matters.
    """
    label = f"{name}{UNSURE_SIGN if unsure else ''}"
    if area_m2 < NAMED_SHARE * view_side_m**2:
        return label
    return f"{label}: {text or f'{area_m2:.0f} m²'}"


def _height_m(path: str) -> float:
    return HEIGHTS.index(path) * LAYER_STEP_M


def _cluster_colors(cluster: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Color (N, 3) of each segment by its wall."""
    count = int(cluster.max(initial=-1)) + 1
    colors = [np.array(track_color(number + 1)) * SEGMENT_SHADE for number in range(count)]
    # A segment of no wall has the number -1: the last color.
    return np.array([*colors, UNCLUSTERED_COLOR])[cluster].astype(np.uint8)


def lifted(points_m: FloatArray, layer: float) -> NDArray[np.float32]:
    """Points (K, 2) as (K, 3) at a layer's height; half of one lies between two."""
    return np.column_stack([points_m, np.full(len(points_m), layer * LAYER_STEP_M)]).astype(np.float32)


def _rings(rings: Sequence[FloatArray]) -> Strips:
    """Closed rings at the height of rooms."""
    points = lifted(np.concatenate([np.zeros((0, 2)), *rings]), HEIGHTS.index(ROOMS))
    return Strips(points, np.array([len(ring) for ring in rings], np.int32))
