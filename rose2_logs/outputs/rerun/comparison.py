"""Two layouts laid over each other as a Rerun recording: one, the other, and what differs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.comparison.layouts import LayoutComparison
from rose2_logs.comparison.room_changes import ROOM_STATUSES
from rose2_logs.comparison.wall_changes import WALL_STATUSES
from rose2_logs.drawing.comparison_picture import ROOM_COLORS, WALL_COLORS
from rose2_logs.drawing.palette import track_color
from rose2_logs.model.labels import known_window
from rose2_logs.model.occupancy import UNKNOWN, FloatArray
from rose2_logs.model.outlines import outer_rings
from rose2_logs.outputs.rerun.blueprint import eye_above
from rose2_logs.outputs.rerun.disk import require_resources, require_space
from rose2_logs.outputs.rerun.world import LABEL_COLOR, OUTLINE_POINTS, OUTLINE_SHADE, PAPER, lifted
from rose2_logs.system.files import replacing
from rose2_logs.tracking.registration import RigidMotion

CELLS, FILLS, OUTLINES, WALLS, CHANGED_WALLS, NAMES = range(6)
"""Layers above the map, from the lowest, each one step above the one before."""
WALL_POINTS = 4.0
"""Width of walls that differ in points of the screen."""
FAINT = (110, 110, 110)
CELLS_OF_A, CELLS_OF_B = (200, 120, 120), (120, 140, 200)
"""Colors of both maps' occupied cells below what differs."""
ROOM_ALPHA = 150
"""The map shows through rooms of this opacity, of 255."""
WIDE_VIEW, FLAT_VIEW = 1.05, 1.65
"""Width over height of the views on an ordinary screen: the large one, and those next to it."""


def write_comparison_recording(path: Path, comparison: LayoutComparison) -> None:
    """Write both layouts in A's frame, what differs, and how they are looked at.

    Entities are ``/a`` and ``/b``, each with ``map``, ``rooms``, ``outlines``, ``names`` and ``walls``, and
    ``/difference`` with a layer for each status of rooms and walls; all of them can be switched.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with replacing(path) as part:
        require_resources(path)
        require_space(part, path)
        recording = rr.RecordingStream(
            "rose2_logs_compare", recording_id=f"{comparison.a.name}-{comparison.b.name}"
        )
        recording.set_sinks(rr.FileSink(str(part)))
        for root in ("a", "b", "difference"):
            recording.log(f"/{root}", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        still, b_to_a = RigidMotion.none(), comparison.placement.motion
        _log_layout(recording, "a", comparison.a, still, [each.tracks_a for each in comparison.rooms])
        _log_layout(recording, "b", comparison.b, b_to_a, [each.tracks_b for each in comparison.rooms])
        _log_differences(recording, comparison)
        document = rr.TextDocument(_document(comparison), media_type="text/markdown")
        recording.log("/summary", document, static=True)
        recording.send_blueprint(_blueprint(comparison))
        recording.flush()
        recording.disconnect()


def _log_layout(
    recording: rr.RecordingStream,
    root: str,
    layout: FinalLayout,
    motion: RigidMotion,
    groups: list[tuple[int, ...]],
) -> None:
    recording.log(f"/{root}/map", _map(layout, motion), static=True)
    group_of = {track: number for number, tracks in enumerate(groups, start=1) for track in tracks}
    named = list(zip(layout.tracks, layout.shapes_moved(motion), strict=True))
    for track, shape in named:
        fill = _mesh([shape], track_color(group_of[track]), ROOM_ALPHA)
        recording.log(f"/{root}/rooms/{track}", fill, static=True)
    rings = [(ring, track_color(group_of[track])) for track, shape in named for ring in outer_rings(shape)]
    recording.log(f"/{root}/outlines", _strips(rings, OUTLINE_POINTS, OUTLINES), static=True)
    recording.log(
        f"/{root}/names", _names([shape for _, shape in named], list(map(str, layout.tracks))), static=True
    )
    if layout.walls is not None:
        ends = motion.points(layout.walls.segments_m.reshape(-1, 2, 2))
        recording.log(
            f"/{root}/walls", _strips([(each, FAINT) for each in ends], OUTLINE_POINTS, WALLS), static=True
        )


def _log_differences(recording: rr.RecordingStream, comparison: LayoutComparison) -> None:
    # Both maps' walls below what differs.
    for root, layout, motion, color in (
        ("walls_of_a", comparison.a, RigidMotion.none(), CELLS_OF_A),
        ("walls_of_b", comparison.b, comparison.placement.motion, CELLS_OF_B),
    ):
        points = motion.points(layout.map.snapshot.geometry.cell_centers(*np.nonzero(layout.map.occupied)))
        radius = layout.map.resolution_m / 2
        cells = rr.Points3D(lifted(points, CELLS), radii=radius, colors=[color])
        recording.log(f"/difference/{root}", cells, static=True)
    for status in ROOM_STATUSES:
        changes = [change for change in comparison.rooms if change.status == status]
        if not changes:
            continue
        path = f"/difference/rooms/{status.replace(' ', '_')}"
        wholes = [shapely.union(change.shape_a, change.shape_b) for change in changes]
        recording.log(f"{path}/fill", _mesh(wholes, ROOM_COLORS[status]), static=True)
        dark = tuple(int(value * OUTLINE_SHADE) for value in ROOM_COLORS[status])
        rings = [
            (ring, dark)
            for change in changes
            for shape in (change.shape_a, change.shape_b)
            for ring in outer_rings(shape)
        ]
        recording.log(f"{path}/outline", _strips(rings, OUTLINE_POINTS, OUTLINES), static=True)
        said = "" if status == "same" else f"{status} "
        texts = [f"{said}{_numbers(change.tracks_a)} > {_numbers(change.tracks_b)}" for change in changes]
        recording.log(f"{path}/names", _names(wholes, texts), static=True)
    for wall_status in WALL_STATUSES:
        walls = comparison.walls.changes if comparison.walls is not None else ()
        lines = [
            (ends.reshape(2, 2), WALL_COLORS[wall_status])
            for wall in walls
            if wall.status == wall_status
            for ends in (wall.ends_a_m, wall.ends_b_m)
            if ends is not None
        ]
        if lines:
            recording.log(
                f"/difference/walls/{wall_status}", _strips(lines, WALL_POINTS, CHANGED_WALLS), static=True
            )


def _numbers(tracks: tuple[int, ...]) -> str:
    return ", ".join(map(str, tracks)) or "none"


def _map(layout: FinalLayout, motion: RigidMotion) -> rr.GridMap:
    snapshot = layout.map.snapshot
    window = known_window(snapshot.cells != UNKNOWN)
    place = motion.grid(snapshot.geometry.part(window))
    # As an unsigned byte unknown is 255, which is what the RViz colors expect; a picture begins at its top.
    pixels = np.ascontiguousarray(snapshot.cells[window][::-1]).view(np.uint8)
    turn = rr.Quaternion(xyzw=(0.0, 0.0, float(np.sin(place.yaw_rad / 2)), float(np.cos(place.yaw_rad / 2))))
    return rr.GridMap(
        data=pixels.tobytes(),
        format=rr.components.ImageFormat(
            width=pixels.shape[1], height=pixels.shape[0], color_model="L", channel_datatype="U8"
        ),
        cell_size=place.resolution_m,
        translation=(*place.origin_xy_m, 0.0),
        quaternion=turn,
        colormap=rr.components.Colormap.RvizMap,
    )


def _strips(
    lines: Sequence[tuple[FloatArray, tuple[int, ...]]], width_points: float, layer: int
) -> rr.LineStrips3D:
    return rr.LineStrips3D(
        [lifted(points, layer) for points, _ in lines],
        colors=[color for _, color in lines],
        radii=rr.components.Radius.ui_points(width_points),
    )


def _mesh(shapes: list[BaseGeometry], color: tuple[int, int, int], alpha: int = 255) -> rr.Mesh3D:
    """Fill shapes with triangles."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapes))
    # The last corner of a ring is its first.
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    return rr.Mesh3D(
        vertex_positions=lifted(corners, FILLS),
        triangle_indices=np.arange(len(corners)).reshape(-1, 3),
        vertex_colors=np.tile(np.array([*color, alpha], np.uint8), (len(corners), 1)),
    )


def _names(shapes: list[BaseGeometry], texts: list[str]) -> rr.Points3D:
    drawn = [(shape, text) for shape, text in zip(shapes, texts, strict=True) if not shape.is_empty]
    circles = shapely.maximum_inscribed_circle([shape for shape, _ in drawn], tolerance=0.05)
    points = shapely.get_coordinates(shapely.get_point(circles, 0)).reshape(-1, 2)
    return rr.Points3D(
        lifted(points, NAMES),
        labels=[text for _, text in drawn],
        show_labels=True,
        radii=rr.components.Radius.ui_points(1.0),
        colors=[LABEL_COLOR],
    )


def _document(comparison: LayoutComparison) -> str:
    counts = "\n".join(
        f"| {status} | {count} | {ROOM_STATUSES[status]} |"
        for status, count in comparison.room_counts.items()
    )
    walls = {} if comparison.walls is None else comparison.walls.lengths_m
    lengths = "\n".join(
        f"| {status} | {length:.1f} m | {WALL_STATUSES[status]} |" for status, length in walls.items()
    )
    verdict = f"Floor overlaps {comparison.floor_iou:.0%}, rooms {comparison.rooms_iou:.0%}."
    if not comparison.same_building:
        verdict = f"**These do not seem to be two runs in one building.** {verdict}"
    elif comparison.ambiguous:
        verdict = f"**B may be misaligned: another position fits about as well.** {verdict}"
    return (
        f"A: {comparison.a.name}, B: {comparison.b.name}\n\n{verdict}\n\n"
        f"| rooms | | |\n|---|---|---|\n{counts}\n\n"
        f"| walls | | |\n|---|---|---|\n{lengths}\n\n"
        "Missing walls are red, new ones blue, moved ones orange.\n"
    )


def _blueprint(comparison: LayoutComparison) -> rrb.Blueprint:
    corners = []
    for layout, motion in (
        (comparison.a, RigidMotion.none()),
        (comparison.b, comparison.placement.motion),
    ):
        corners.append(motion.points(layout.map.walls))
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)

    def view(name: str, origin: str, aspect: float) -> rrb.Spatial3DView:
        eye = eye_above(low, high, aspect)
        return rrb.Spatial3DView(
            name=name, origin=origin, eye_controls=eye, line_grid=False, background=PAPER
        )

    return rrb.Blueprint(
        rrb.Horizontal(
            view("What differs", "/difference", WIDE_VIEW),
            rrb.Vertical(
                view(f"A: {comparison.a.name}", "/a", FLAT_VIEW),
                view(f"B: {comparison.b.name}", "/b", FLAT_VIEW),
                rrb.TextDocumentView(name="Summary", origin="/summary"),
            ),
            column_shares=[2, 1],
        ),
        rrb.TimePanel(state="hidden"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )
