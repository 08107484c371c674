"""A floor plan drawn: the map in gray, rooms in the color of their tracks, what was not seen hatched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.fonts import text_width
from rose2_logs.drawing.hatching import hatching
from rose2_logs.drawing.map_painter import (
    DOORWAY_COLOR,
    INK,
    UNSURE_COLOR,
    WHITE,
    Bounds,
    MapPainter,
    simpler,
    tinted_cells,
)
from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.shapes import Area, Color, Lines, Text
from rose2_logs.drawing.sheet import Key, legend, side_by_side, stacked
from rose2_logs.model.labels import distinct_labels
from rose2_logs.model.outlines import room_outlines
from rose2_logs.model.room_plan import PlanRoom, RoomPlan, predicted_parts
from rose2_logs.model.room_quality import UNSURE_SIGN, unsure_sign
from rose2_logs.system.text import percent

SEEN_OPACITY, PREDICTED_OPACITY, SHAPE_OPACITY = 0.55, 0.22, 0.5
"""Of the color on seen cells, on unseen parts, and on shapes where no cell is known to be the room's."""
WALL_COLOR: Color = (40, 70, 190)
MARGIN_M = 0.5
SCALE_BAR_SHARE = 0.25
"""The scale bar is the longest round length below this share of the plan's width."""
ROUND_LENGTHS_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
SIDE_PX, GAP_PX = 900.0, 12.0
"""Width of the map in the picture of a segmentation, and the gap to the next."""
WIDE = 1.5
"""From this width over height on, a map is drawn above its rooms and not next to them."""
LEGEND_FONT = 0.85
"""Size of the legend's texts over that of the rooms' names."""


@dataclass(frozen=True)
class PlanStyle:
    """How a plan is drawn.

    Attributes
    ----------
    width : float
        Of the page, in the units of the rest.
    font : float
        Size of the rooms' names, the largest; 0 for none.
    hatch_gap : float
        Between the lines over what was not seen.
    line : float
        Width of outlines; doorways are wider.
    detail : float
        Outlines lose what is smaller, as the steps of cells.
    has_names : bool
        Whether rooms are labeled with name and area where these fit, and not by number only.
    has_legend : bool
        Whether a strip below holds a scale bar and what the signs mean.
    has_walls : bool
        Whether the segments of walls are drawn, where the plan knows them.
    picture_most_px : int
        Pixels along the longer side of the map's picture, at most.
    tells : bool
        Whether rooms say what they are when the pointer is over them.
    """

    width: float = 800.0
    font: float = 13.0
    hatch_gap: float = 5.0
    line: float = 1.2
    detail: float = 0.3
    has_names: bool = True
    has_legend: bool = True
    has_walls: bool = False
    picture_most_px: int = 4000
    tells: bool = True


FIGURE = PlanStyle()
PANEL = PlanStyle(
    360.0, 11.0, 4.0, 0.9, 0.8, has_names=False, has_legend=False, picture_most_px=480, tells=False
)


def draw_plan(
    plan: RoomPlan,
    style: PlanStyle = FIGURE,
    bounds_m: Bounds | None = None,
    colors: Mapping[int, Color] | None = None,
) -> Drawing:
    """Draw a plan.

    Parameters
    ----------
    plan : RoomPlan
    style : PlanStyle
    bounds_m : (x0, y0, x1, y1), optional
        Part of the world to show, so that several plans can be compared; by default all of the plan.
    colors : mapping of int to Color, optional
        Color of each room by its number; by default that of its track.
    """
    x0, y0, x1, y1 = plan.bounds_m if bounds_m is None else bounds_m
    bounds = x0 - MARGIN_M, y0 - MARGIN_M, x1 + MARGIN_M, y1 + MARGIN_M
    painter = MapPainter(bounds, style.width, plan.title)
    colors = {room.number: track_color(room.number) for room in plan.rooms} if colors is None else colors
    seen_m = _lay_map(painter, plan, style)
    shapes = {room.number: simpler(painter.on_page(room.shape), style.detail) for room in plan.rooms}
    predicted = {
        number: simpler(painter.on_page(part), style.detail) for number, part in predicted_parts(plan).items()
    }
    # Names are placed on what was seen.
    seen = shapes | {number: shapes[number].difference(part) for number, part in predicted.items()}
    painter.drawing.begin_layer("unseen")
    for number, part in predicted.items():
        painter.area(part, colors[number], PREDICTED_OPACITY, identity=f"room-{number}-unseen")
        lines = hatching(part, style.hatch_gap)
        painter.hatch(lines, colors[number], 0.7 * style.line, f"room-{number}-hatching")
    painter.drawing.begin_layer("rooms")
    for room in plan.rooms:
        number, told = room.number, _told(room) if style.tells else ""
        if number in seen_m:
            cells = simpler(painter.on_page(seen_m[number]), style.detail)
            painter.area(cells, colors[number], SEEN_OPACITY, told, f"room-{number}")
        else:
            painter.area(seen[number], colors[number], SHAPE_OPACITY, told, f"room-{number}")
    painter.drawing.begin_layer("outlines")
    for number, shape in shapes.items():
        painter.outline(shape, colors[number], style.line, f"room-{number}-outline")
    if style.has_walls and plan.walls_m is not None:
        painter.drawing.begin_layer("walls")
        painter.lines(plan.walls_m, WALL_COLOR, 1.5 * style.line)
    painter.drawing.begin_layer("doorways")
    for doors, color in ((plan.doorways, DOORWAY_COLOR), (plan.unsure_doorways, UNSURE_COLOR)):
        ends_m = np.array([door.ends_m for door in doors]).reshape(-1, 2, 2)
        painter.lines(ends_m, color, 2.4 * style.line, rim=0.8 * style.line)
    if style.font:
        painter.drawing.begin_layer("names")
        for room in plan.rooms:
            name_on = seen[room.number] if seen[room.number].area else shapes[room.number]
            _write_name(painter, room, name_on, style)
    if style.has_legend:
        _add_legend(painter, plan, style, has_predicted=bool(predicted))
    return painter.drawing


def draw_segmentation(plan: RoomPlan) -> Drawing:
    """Draw a map as it was recorded, and below or next to it with its rooms, walls and doorways.

    Parameters
    ----------
    plan : RoomPlan
        With a map.

    Raises
    ------
    ValueError
        If it has none.
    """
    if plan.map is None:
        raise ValueError("a plan without a map has no segmentation to be drawn")
    corners = plan.map.cropped().geometry.corners_m()
    x0, y0, x1, y1 = plan.bounds_m
    low = np.minimum(corners.min(axis=0), (x0, y0)).tolist()
    high = np.maximum(corners.max(axis=0), (x1, y1)).tolist()
    bounds: Bounds = (low[0], low[1], high[0], high[1])
    unlabeled = replace(plan.map, labels=np.zeros_like(plan.map.labels))
    recorded = RoomPlan(plan.title, plan.frame_id, (), (), None, unlabeled)
    style = replace(FIGURE, width=SIDE_PX, has_walls=True, tells=False)
    parts = [
        draw_plan(recorded, replace(style, has_legend=False), bounds),
        draw_plan(plan, style, bounds),
    ]
    is_wide = parts[0].width > WIDE * parts[0].height
    drawing = stacked(parts, GAP_PX) if is_wide else side_by_side(parts, GAP_PX)
    drawing.title = plan.title
    return drawing


def _lay_map(painter: MapPainter, plan: RoomPlan, style: PlanStyle) -> dict[int, BaseGeometry]:
    """Lay the map on the page; return the outlines of the cells of the rooms that it shows, world meters."""
    painter.drawing.begin_layer("map")
    if plan.map is None:
        return {}
    below = plan.map.cropped()
    painter.ground()
    painter.picture(tinted_cells(below.cells), below.geometry, style.picture_most_px)
    numbers = [number for number in distinct_labels(below.labels)[0].tolist() if number > 0]
    ranks = np.zeros(max(numbers, default=0) + 1, np.int32)
    ranks[numbers] = np.arange(1, len(numbers) + 1)
    outlines = room_outlines(ranks[below.labels], below.geometry.resolution_m)
    shapes = dict(zip(numbers, outlines, strict=True))
    return {
        room.number: shapely.transform(shapes[room.number], below.geometry.grid_to_world)
        for room in plan.rooms
        if room.number in shapes
    }


def _told(room: PlanRoom) -> str:
    sure = (
        ""
        if room.wall_support is None
        else f", {percent(room.wall_support)} of its outline supported by walls"
    )
    return f"{room.name}: {room.area_m2:.1f} m² seen of {room.predicted_area_m2:.1f} m²{sure}"


def _write_name(painter: MapPainter, room: PlanRoom, shape: BaseGeometry, style: PlanStyle) -> None:
    """Write name and area of a room where they have room, else its number."""
    if shape.is_empty:
        return
    x, y = shapely.get_coordinates(shapely.maximum_inscribed_circle(shape, tolerance=0.5))[0].tolist()

    def fits(text: str, size: float) -> bool:
        half = text_width(text, size) / 2
        return bool(shape.covers(shapely.box(x - half, y - size, x + half, y + size)))

    area, font = area_text(room.area_m2), style.font
    sign = unsure_sign(room.wall_support)
    number, name = f"{room.number}{sign}", f"{room.name}{sign}"
    small = 0.8 * font
    if not (style.has_names and fits(area, small)):
        painter.name(number, x, y, font)
        return
    # A name that a person gave is rather written small than left out.
    if room.given_name and not fits(name, font) and fits(name, small):
        font = small
    painter.name(name if fits(name, font) else number, x, y - 0.5 * font, font)
    painter.name(area, x, y + 0.6 * font, small, is_bold=False)


def area_text(area_m2: float) -> str:
    """Format an area as in the names of rooms: with a decimal where it is small."""
    return f"{area_m2:.0f} m²" if area_m2 >= 10 else f"{area_m2:.1f} m²"


def _add_legend(painter: MapPainter, plan: RoomPlan, style: PlanStyle, *, has_predicted: bool) -> None:
    """Put a scale bar, and what the signs mean, in a strip below the plan."""
    page, font = painter.drawing, LEGEND_FONT * style.font
    longest = SCALE_BAR_SHARE * style.width / painter.scale
    length_m = max((length for length in ROUND_LENGTHS_M if length <= longest), default=ROUND_LENGTHS_M[0])
    label = f"{length_m:g} m"
    x, tick = font + length_m * painter.scale, 0.35 * font
    color = track_color(plan.rooms[0].number if plan.rooms else 1)
    keys = []
    if plan.rooms:
        keys.append(Key("room, seen" if plan.map is not None else "room", color, opacity=SEEN_OPACITY))
    if has_predicted:
        keys.append(Key("predicted, unseen", color, "hatched", PREDICTED_OPACITY))
    if plan.doorways:
        keys.append(Key("doorway", DOORWAY_COLOR, "line"))
    if plan.unsure_doorways:
        keys.append(Key("unsure border", UNSURE_COLOR, "line"))
    if style.has_walls and plan.walls_m is not None and len(plan.walls_m):
        keys.append(Key("wall segment", WALL_COLOR, "line"))
    if any(room.is_unsure for room in plan.rooms):
        keys.append(Key("unsure, little wall around", kind="sign", sign=f"7{UNSURE_SIGN}"))
    painter.drawing.begin_layer("legend")
    strip = legend(keys, style.width, font, indent=x + text_width(label, font) + 3 * font)
    top = page.height
    page.height += strip.height + 1.4 * style.font
    # Rays may go on beyond the plan.
    page.add(Area(shapely.box(0, top, style.width, page.height), page.paper or WHITE))
    page.lay(strip, 0.0, top + 0.7 * style.font)
    y = top + 0.7 * style.font + 0.8 * font
    bar = [[(font, y), (x, y)], [(font, y - tick), (font, y + tick)], [(x, y - tick), (x, y + tick)]]
    page.add(Lines(shapely.MultiLineString(bar), INK, 1.3 * style.line))
    page.add(Text(label, x + 0.6 * font, y, font, "start"))
