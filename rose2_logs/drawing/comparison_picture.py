"""A picture of two layouts laid over each other: one, the other, and what differs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.comparison.room_changes import RoomChange, RoomStatus
from rose2_logs.comparison.wall_changes import WallStatus
from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.hatching import hatching
from rose2_logs.drawing.map_painter import Bounds, MapPainter, simpler
from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.plan import PANEL, draw_plan
from rose2_logs.drawing.shapes import Color, Lines
from rose2_logs.drawing.sheet import Key, captioned, legend, side_by_side, stacked, text_line
from rose2_logs.model.labels import known_window
from rose2_logs.model.occupancy import UNKNOWN, BoolArray, FloatArray
from rose2_logs.model.room_names import short_name
from rose2_logs.model.room_plan import PlanMap, PlanRoom, RoomPlan
from rose2_logs.tracking.registration import RigidMotion

if TYPE_CHECKING:
    from rose2_logs.comparison.final_layout import FinalLayout
    from rose2_logs.comparison.layouts import LayoutComparison

WIDE_PX, NARROW_PX, GAP_PX = 1000.0, 493.0, 14.0
"""Width of the panel of what differs, and of the layouts next to or above it."""
TEXT_PX, TITLE_PX, NUMBER_PX = 18.0, 22.0, 16.0
MARGIN_M = 0.5
WIDE = 1.6
"""From this width over height on, the layouts are above what differs and not next to it."""
ROOM_OPACITY = 0.6
STRIPE_GAP, STRIPE_WIDTH, OUTLINE_WIDTH, WALL_WIDTH, THIN_WALL_WIDTH = 8.0, 1.5, 1.2, 5.0, 2.0
DETAIL = 0.8
"""Outlines lose smaller details, such as the steps of cells."""
OUTLINE, FAINT = (70, 70, 70), (150, 150, 150)
NOTED: frozenset[RoomStatus] = frozenset(
    {"changed", "split", "merged", "regrouped", "missing", "new", "unseen"}
)
"""Rooms whose numbers are written in the panel of what differs."""
LAYOUT_STYLE = dataclasses.replace(PANEL, width=NARROW_PX, font=NUMBER_PX, picture_most_px=1000)
ROOM_COLORS: dict[RoomStatus, Color] = {
    "same": (200, 228, 200),
    "partly seen": (224, 236, 200),
    "changed": (250, 214, 120),
    "split": (196, 160, 230),
    "merged": (196, 160, 230),
    "regrouped": (196, 160, 230),
    "missing": (244, 150, 140),
    "new": (140, 186, 244),
    "unseen": (238, 238, 238),
}
WALL_COLORS: dict[WallStatus, Color] = {
    "missing": (205, 25, 25),
    "new": (20, 80, 215),
    "moved": (225, 120, 0),
}


def draw_comparison(comparison: LayoutComparison) -> Drawing:
    """Draw A, B in A's frame, and what differs, with a title and a legend.

    Rooms that belong together have one color in A and B. A unit of the page is a pixel.
    """
    still, b_to_a = RigidMotion.none(), comparison.placement.motion
    a, b = comparison.a, comparison.b
    corners = np.concatenate([_known_corners(a), b_to_a.points(_known_corners(b))])
    bounds: Bounds = (*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist())
    differing = captioned(_differences(comparison, bounds), _differing_caption(comparison), TEXT_PX)
    is_wide = differing.width > WIDE * differing.height
    groups_a, groups_b = ([getattr(each, of) for each in comparison.rooms] for of in ("tracks_a", "tracks_b"))
    layouts = [
        captioned(_layout(a, still, groups_a, bounds), f"A: {a.name}", TEXT_PX),
        captioned(_layout(b, b_to_a, groups_b, bounds), f"B: {b.name}, laid over A", TEXT_PX),
    ]
    if is_wide:
        sheet = stacked([side_by_side(layouts, GAP_PX), differing], GAP_PX)
    else:
        sheet = side_by_side([differing, stacked(layouts, GAP_PX)], GAP_PX)
    title = _title(comparison)
    head = text_line(title, sheet.width, TITLE_PX)
    return stacked([head, sheet, legend(_keys(comparison), sheet.width, TEXT_PX)], GAP_PX, title)


def _title(comparison: LayoutComparison) -> str:
    if not comparison.same_building:
        return "These do not seem to be two runs in one building"
    sure = "   (B may be misaligned: another position fits about as well)" if comparison.ambiguous else ""
    return f"floor overlaps {comparison.floor_iou:.0%}, rooms {comparison.rooms_iou:.0%}{sure}"


def _differing_caption(comparison: LayoutComparison) -> str:
    """Say what is drawn, and what two numbers of a room mean where there are any."""
    has_pairs = any(each.status in NOTED and each.tracks_a and each.tracks_b for each in comparison.rooms)
    return "what differs" + (" (A > B: a room's number in A and in B)" if has_pairs else "")


def _known_corners(layout: FinalLayout) -> FloatArray:
    snapshot = layout.map.snapshot
    return snapshot.geometry.part(known_window(snapshot.cells != UNKNOWN)).corners_m()


def _layout(
    layout: FinalLayout, motion: RigidMotion, groups: Sequence[tuple[int, ...]], bounds: Bounds
) -> Drawing:
    """Draw a layout with its rooms in the colors of what they belong to, with their numbers."""
    group_of = {track: number for number, tracks in enumerate(groups, start=1) for track in tracks}
    shapes = layout.shapes_moved(motion)
    areas_m2 = layout.areas_m2.tolist()
    rooms = tuple(
        PlanRoom(track, shape, area, None, ())
        for track, shape, area in sorted(zip(layout.tracks, shapes, areas_m2, strict=True), key=_first)
    )
    snapshot = layout.map.snapshot
    # No cell is labeled, so the whole shapes of the rooms are filled.
    labels = np.zeros(snapshot.cells.shape, np.int32)
    below = PlanMap(motion.grid(snapshot.geometry), snapshot.cells, labels)
    plan = RoomPlan(layout.name, "", rooms, (), None, below)
    return draw_plan(
        plan, LAYOUT_STYLE, bounds, {track: track_color(group_of[track]) for track in layout.tracks}
    )


def _first(row: tuple[int, object, float]) -> int:
    return row[0]


def _differences(comparison: LayoutComparison, bounds: Bounds) -> Drawing:
    """Draw how rooms and walls changed."""
    x0, y0, x1, y1 = bounds
    painter = MapPainter((x0 - MARGIN_M, y0 - MARGIN_M, x1 + MARGIN_M, y1 + MARGIN_M), WIDE_PX)
    for layout, motion in (
        (comparison.a, RigidMotion.none()),
        (comparison.b, comparison.placement.motion),
    ):
        window = known_window(layout.map.occupied)
        grid = motion.grid(layout.map.snapshot.geometry).part(window)
        painter.picture(_faint(layout.map.occupied[window]), grid)
    for change in comparison.rooms:
        _draw_room(painter, change)
    for wall in () if comparison.walls is None else comparison.walls.changes:
        # Where a moved wall was is drawn thin.
        before = THIN_WALL_WIDTH if wall.status == "moved" else WALL_WIDTH
        for ends, width in ((wall.ends_a_m, before), (wall.ends_b_m, WALL_WIDTH)):
            if ends is not None:
                painter.lines(ends, WALL_COLORS[wall.status], width)
    for change in comparison.rooms:
        whole = painter.on_page(shapely.union(change.shape_a, change.shape_b))
        if change.status in NOTED and not whole.is_empty:
            circle = shapely.maximum_inscribed_circle(whole, tolerance=1.0)
            x, y = shapely.get_coordinates(circle)[0].tolist()
            painter.name(pair_name(comparison, change), x, y, NUMBER_PX)
    return painter.drawing


def _faint(mask: BoolArray) -> NDArray[np.uint8]:
    """Cells of a mask in gray, all others see-through."""
    pixels = np.zeros((*mask.shape, 4), np.uint8)
    pixels[mask] = (*FAINT, 255)
    return pixels


def _draw_room(painter: MapPainter, change: RoomChange) -> None:
    """Fill what both shapes of a room cover by its status, and draw the outlines of both."""
    shapes = [painter.on_page(shape) for shape in (change.shape_a, change.shape_b)]
    whole = shapely.union(*shapes)
    if change.status == "unseen":
        painter.hatch(hatching(whole, STRIPE_GAP), FAINT, STRIPE_WIDTH)
    else:
        painter.area(whole, ROOM_COLORS[change.status], ROOM_OPACITY)
    for shape in shapes:
        painter.drawing.add(Lines(simpler(shape, DETAIL), OUTLINE, OUTLINE_WIDTH))


def pair_name(comparison: LayoutComparison, change: RoomChange) -> str:
    """Name rooms by their numbers in A and B, or by the names that they were given."""
    a = "+".join(short_name(track, comparison.a.name_of) for track in change.tracks_a)
    b = "+".join(short_name(track, comparison.b.name_of) for track in change.tracks_b)
    return f"{a} > {b}" if a and b else a or b


def _keys(comparison: LayoutComparison) -> list[Key]:
    """Explain the colors of the statuses that occur."""
    counts = comparison.room_counts
    keys = [
        Key(f"{status}: {counts[status]}", color, "hatched" if status == "unseen" else "area")
        for status, color in ROOM_COLORS.items()
        if status in counts
    ]
    lengths = {} if comparison.walls is None else comparison.walls.lengths_m
    return keys + [
        Key(f"wall {status}: {lengths[status]:.1f} m", color, "line")
        for status, color in WALL_COLORS.items()
        if status in lengths
    ]
