"""A floor plan drawn: the map in gray, rooms in the color of their tracks, what was not seen hatched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.shapes import Area, Color, Drawing, Lines, Picture, Text, hatching
from rose2_logs.model.labels import distinct_labels
from rose2_logs.model.room_plan import PlanMap, PlanRoom, RoomPlan, predicted_parts
from rose2_logs.model.room_quality import UNSURE_SIGN, unsure_sign
from rose2_logs.system.text import percent

UNKNOWN_GRAY, FREE_GRAY, OCCUPIED_GRAY = 232, 255, 25
SEEN_OPACITY, PREDICTED_OPACITY, SHAPE_OPACITY = 0.55, 0.22, 0.5
"""Of the color on seen cells, on unseen parts, and on whole shapes where there is no map."""
OUTLINE_DARKER, HATCH_DARKER = 0.6, 0.8
"""Shares of the brightness of a room's color."""
DOORWAY_COLOR: Color = (205, 45, 20)
LABEL_GRAY: Color = (25, 25, 25)
MARGIN_M = 0.5
TALLEST = 1.3
"""A plan is at most so many times as high as wide; a higher one is drawn narrower."""
SCALE_BAR_SHARE = 0.25
"""The scale bar is the longest round length below this share of the plan's width."""
ROUND_LENGTHS_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
HOLE_MIN = 60.0
"""Holes in a room's shape are drawn from this area on, square units of the page: no single cells."""
LETTER_EM = 0.56
"""Usual width of a letter in sizes of the font."""

Bounds = tuple[float, float, float, float]


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
        Whether rooms are told by name and area where they have room for it, and not by number only.
    has_legend : bool
        Whether a strip below holds a scale bar and what the signs mean.
    picture_most_px : int
        Pixels along the longer side of the map's picture, at most.
    tells : bool
        Whether rooms say what they are when they are pointed at.
    """

    width: float = 800.0
    font: float = 13.0
    hatch_gap: float = 5.0
    line: float = 1.2
    detail: float = 0.3
    has_names: bool = True
    has_legend: bool = True
    picture_most_px: int = 4000
    tells: bool = True


FIGURE = PlanStyle()
PANEL = PlanStyle(
    360.0, 11.0, 4.0, 0.9, 0.8, has_names=False, has_legend=False, picture_most_px=480, tells=False
)


def draw_plan(plan: RoomPlan, style: PlanStyle = FIGURE, bounds_m: Bounds | None = None) -> Drawing:
    """Draw a plan.

    Parameters
    ----------
    plan : RoomPlan
    style : PlanStyle
    bounds_m : (x0, y0, x1, y1), optional
        Part of the world to show, so that several plans can be compared; by default all of the plan.
    """
    x0, y0, x1, y1 = plan.bounds_m if bounds_m is None else bounds_m
    x0, y0, x1, y1 = x0 - MARGIN_M, y0 - MARGIN_M, x1 + MARGIN_M, y1 + MARGIN_M
    scale = min(style.width / (x1 - x0), TALLEST * style.width / (y1 - y0))
    left = (style.width - (x1 - x0) * scale) / 2
    height = (y1 - y0) * scale
    strip = 3 * style.font if style.has_legend else 0.0
    drawing = Drawing(style.width, height + strip, plan.title)

    # From world meters to the page.
    matrix = np.array([[scale, 0.0, left - x0 * scale], [0.0, -scale, y1 * scale]])

    def on_page(shape: BaseGeometry) -> BaseGeometry:
        return shapely.transform(shape, lambda xy: xy @ matrix[:, :2].T + matrix[:, 2])

    if plan.map is not None:
        drawing.add(Area(shapely.box(0, 0, style.width, height), (UNKNOWN_GRAY,) * 3))
        drawing.add(_picture(plan.map.cropped(), matrix, style.picture_most_px))
    shapes = {room.number: _simpler(on_page(room.shape), style.detail) for room in plan.rooms}
    predicted = predicted_parts(plan)
    # Names stand on what was seen.
    seen = dict(shapes)
    for room in plan.rooms:
        shape, color = shapes[room.number], track_color(room.number)
        if plan.map is None:
            drawing.add(Area(shape, color, SHAPE_OPACITY, _told(room)))
        elif room.number in predicted:
            part = _simpler(on_page(predicted[room.number]), style.detail)
            seen[room.number] = shape.difference(part)
            lines = Lines(hatching(part, style.hatch_gap), _darker(color, HATCH_DARKER), 0.7 * style.line)
            drawing.add(Area(part, color, PREDICTED_OPACITY), lines)
    for number, shape in shapes.items():
        drawing.add(Lines(shape, _darker(track_color(number)), style.line))
    doors = on_page(shapely.MultiLineString([door.ends_m for door in plan.doorways]))
    drawing.add(Lines(doors, (255, 255, 255), 4 * style.line), Lines(doors, DOORWAY_COLOR, 2.4 * style.line))
    if plan.map is not None and style.tells:
        # Nothing to be seen, but pointed at they tell what they are.
        white = (255, 255, 255)
        drawing.add(*(Area(shapes[room.number], white, 0.0, _told(room)) for room in plan.rooms))
    if style.font:
        for room in plan.rooms:
            name_on = seen[room.number] if seen[room.number].area else shapes[room.number]
            drawing.add(*_label(room, name_on, style))
    if style.has_legend:
        # Rays may go on beyond the plan.
        drawing.add(Area(shapely.box(0, height, style.width, height + strip), drawing.paper))
        drawing.add(*_legend(plan, style, scale, height, has_predicted=bool(predicted)))
    return drawing


def _simpler(shape: BaseGeometry, detail: float) -> BaseGeometry:
    """Return a shape on the page without what is too small to be read there."""
    parts = []
    for part in shapely.get_parts(shape.simplify(detail)):
        if part.is_empty:
            continue
        rings = shapely.polygons(shapely.get_rings(part))
        holes = [ring.exterior for ring in rings[1:] if ring.area >= HOLE_MIN]
        parts.append(shapely.Polygon(rings[0].exterior, holes))
    return shapely.MultiPolygon(parts)


def _told(room: PlanRoom) -> str:
    sure = (
        "" if room.wall_support is None else f", {percent(room.wall_support)} of its outline backed by walls"
    )
    return f"{room.name}: {room.area_m2:.1f} m² seen of {room.predicted_area_m2:.1f} m²{sure}"


def _picture(below: PlanMap, to_page: NDArray[np.float64], most_px: int) -> Picture:
    """Cells as a picture; reduced where they are more than the page can show."""
    import cv2

    cells, labels = below.cells, below.labels
    # The color of each value of a cell, one row for each room after that of none.
    values = np.arange(2**8)
    gray = np.interp(values, (0, 100), (FREE_GRAY, OCCUPIED_GRAY))
    gray[values > 100] = UNKNOWN_GRAY
    numbers = [number for number in distinct_labels(labels)[0].tolist() if number > 0]
    tints = np.array([track_color(number) for number in numbers], float).reshape(-1, 1, 3)
    tinted = (1 - SEEN_OPACITY) * gray[:, None] + SEEN_OPACITY * tints
    table = np.concatenate([np.repeat(gray[:, None], 3, axis=1)[None], tinted])
    row = np.zeros(max([0, *numbers]) + 1, np.uint16)
    row[numbers] = np.arange(1, len(numbers) + 1)
    pixels = np.round(table).astype(np.uint8)[row[labels], cells.view(np.uint8)]
    height, width = cells.shape
    block = -(-max(height, width) // most_px)
    size = (-(-width // block), -(-height // block))
    if block > 1:
        pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
    geometry = below.geometry
    meters = np.array([width / size[0], height / size[1]]) * geometry.resolution_m
    to_world = np.column_stack([geometry.rotation * meters, geometry.origin_xy_m])
    linear = to_page[:, :2] @ to_world
    linear[:, 2] += to_page[:, 2]
    return Picture(pixels, linear)


def _label(room: PlanRoom, shape: BaseGeometry, style: PlanStyle) -> list[Text]:
    """Name and area of a room where they have room, else its number."""
    if shape.is_empty:
        return []
    circle = shapely.maximum_inscribed_circle(shape, tolerance=0.5)
    (x, y), radius = shapely.get_coordinates(circle)[0].tolist(), float(shapely.length(circle))
    area = f"{room.area_m2:.0f} m²" if room.area_m2 >= 10 else f"{room.area_m2:.1f} m²"
    font, rim = style.font, 0.14 * style.font
    sign = unsure_sign(room.wall_support)
    number, name = f"{room.number}{sign}", f"{room.name}{sign}"
    if not style.has_names:
        return [Text(number, x, y, font, is_bold=True, rim=rim)]
    name = name if _fits(name, font, radius, lines=2) else number
    small = 0.8 * font
    if _fits(area, small, radius, lines=2):
        return [
            Text(name, x, y - 0.5 * font, font, is_bold=True, rim=rim),
            Text(area, x, y + 0.6 * font, small, rim=rim),
        ]
    return [Text(number, x, y, font, is_bold=True, rim=rim)]


def _fits(text: str, font: float, radius: float, lines: int) -> bool:
    return bool(np.hypot(LETTER_EM * font * len(text), lines * font) <= 2 * radius)


def _legend(
    plan: RoomPlan, style: PlanStyle, scale: float, top: float, *, has_predicted: bool
) -> list[Area | Lines | Text]:
    """Scale bar, and what the signs mean, in the strip below the plan."""
    font, line = 0.85 * style.font, style.line
    y = top + 1.7 * style.font
    shapes: list[Area | Lines | Text] = []
    longest = SCALE_BAR_SHARE * style.width / scale
    length_m = max((length for length in ROUND_LENGTHS_M if length <= longest), default=ROUND_LENGTHS_M[0])
    x, x1 = font, font + length_m * scale
    tick = 0.35 * font
    bar = [[(x, y), (x1, y)], [(x, y - tick), (x, y + tick)], [(x1, y - tick), (x1, y + tick)]]
    shapes.append(Lines(shapely.MultiLineString(bar), LABEL_GRAY, 1.3 * line))
    shapes.append(Text(f"{length_m:g} m", x1 + 0.6 * font, y, font, is_centered=False))
    x = x1 + 0.6 * font + 6 * LETTER_EM * font
    example = plan.rooms[0].number if plan.rooms else 1
    color = track_color(example)
    signs: list[tuple[str, str]] = [("room", "room, seen" if plan.map is not None else "room")]
    signs += [("predicted", "predicted, unseen")] if has_predicted else []
    signs += [("doorway", "doorway")] if plan.doorways else []
    signs += [("unsure", "unsure, little wall around")] if any(room.is_unsure for room in plan.rooms) else []
    for sign, text in signs:
        box = shapely.box(x, y - 0.5 * font, x + 1.8 * font, y + 0.5 * font)
        if sign == "doorway":
            shapes.append(Lines(shapely.LineString([(x, y), (x + 1.8 * font, y)]), DOORWAY_COLOR, 2.4 * line))
        elif sign == "unsure":
            shapes.append(Text(f"7{UNSURE_SIGN}", x + 0.9 * font, y, font, is_bold=True))
        elif sign == "predicted":
            shapes += [
                Area(box, color, PREDICTED_OPACITY),
                Lines(hatching(box, style.hatch_gap), _darker(color, HATCH_DARKER), 0.7 * line),
                Lines(box, _darker(color), line),
            ]
        else:
            shapes += [Area(box, color, SEEN_OPACITY), Lines(box, _darker(color), line)]
        shapes.append(Text(text, x + 2.3 * font, y, font, is_centered=False))
        x += 2.3 * font + (len(text) + 2.5) * LETTER_EM * font
    return shapes


def _darker(color: Color, share: float = OUTLINE_DARKER) -> Color:
    red, green, blue = (round(value * share) for value in color)
    return red, green, blue
