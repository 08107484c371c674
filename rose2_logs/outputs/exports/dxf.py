"""Floor plans as DXF for CAD programs, written by ezdxf: in meters, one layer per kind of object."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.drawing.palette import track_color
from rose2_logs.io.dxf_plan import LABELS
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.model.room_plan import PlanRoom, RoomPlan, predicted_parts, wall_outlines
from rose2_logs.system.files import replacing

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts.layout import Modelspace
    from ezdxf.math import BoundingBox

VERSION = "R2010"
"""Read by every CAD program in use; the first release with true colors on all entities."""
ROOMS, PREDICTED, DOORWAYS, WALLS = "ROOMS", "PREDICTED", "DOORWAYS", "WALLS"
LAYERS = {ROOMS: 7, PREDICTED: 8, DOORWAYS: 1, WALLS: 7, LABELS: 7}
"""Layers and their AutoCAD color indices: 7 is black or white, 8 gray, 1 red."""
TEXT_HEIGHT_M = 0.25
"""Of labels at least, where there is space: readable on a print at 1:100 (2.5 mm)."""
TEXT_SHARE = 1 / 75
"""Height of labels as a share of that of the view which a file is opened with: 8 pixels of 600."""
TEXT_MIN_M = 0.1
"""Of labels in small rooms: below it, they cannot be read on a print at 1:100 (1 mm)."""
TEXT_STEP = 0.9
"""Labels become smaller by this factor until they are within their rooms."""
LETTER_WIDTH = 0.8
"""Width that a letter takes in the fonts of CAD programs, with the space beside it, in its height."""
LINE_RISE = 0.75
"""The two lines of a label are centered this many heights above and below its point, half a line apart."""
TURNED_GAIN = 1.5
"""A label is turned to be read from the right where it can then be this many times as high."""
MARGIN = 1.05
"""Of the view that a file is opened with, over all that is drawn."""
VIEW_ASPECT = 4 / 3
"""Width over height of this view: few windows are narrower, and wider ones have space at the sides."""
HATCH_PATTERN, HATCH_SCALE = "ANSI31", 0.08
"""Lines at 45 degrees, about a quarter of a meter apart."""


def write_dxf(plan: RoomPlan, path: Path) -> None:
    """Write a plan as DXF.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    from ezdxf import bbox, options, units  # type: ignore[attr-defined]
    from ezdxf.filemanagement import new

    # Without this the file would contain the time and random numbers; the same plan must give the same file.
    fixed, options.write_fixed_meta_data_for_testing = options.write_fixed_meta_data_for_testing, True
    try:
        document = new(VERSION, units=units.M)
        for name, color in LAYERS.items():
            document.layers.add(name, color=color)
        space = document.modelspace()
        _draw(plan, space)
        drawn = bbox.extents(space, fast=True)
        if drawn.has_data:
            # Programs open a file on the view in it; without one they show the surroundings of the origin.
            space.reset_extents(drawn.extmin, drawn.extmax)
            _open_on(document, drawn)
        # By default ezdxf lists the classes in the order of a set, which changes from run to run.
        for name in sorted(document.entitydb.dxf_types_in_use()):
            document.classes.add_class(name)
        with replacing(path) as part:
            document.saveas(part)
    finally:
        options.write_fixed_meta_data_for_testing = fixed


def _open_on(document: Drawing, drawn: BoundingBox) -> None:
    """Set the view of the model to all that is drawn.

    The center of a view is told relative to its target, and the target in the world. LibreCAD 2.2 knows no
    target and puts the upper right corner of its window at twice the center. So the center is half of the
    view's upper right corner, and the target says the rest to all programs that follow the definition.
    """
    size, middle = drawn.size.vec2 * MARGIN, drawn.center.vec2
    center = (middle + size / 2) / 2
    view = {"aspect_ratio": VIEW_ASPECT, "target": (middle - center).vec3}
    document.set_modelspace_vport(max(size.y, size.x / VIEW_ASPECT), center, dxfattribs=view)


def _draw(plan: RoomPlan, space: Modelspace) -> None:
    from ezdxf import const
    from ezdxf.colors import rgb2int
    from ezdxf.enums import TextEntityAlignment

    predicted = predicted_parts(plan)
    x0, y0, x1, y1 = plan.bounds_m
    wanted_m = max(TEXT_HEIGHT_M, TEXT_SHARE * MARGIN * max(y1 - y0, (x1 - x0) / VIEW_ASPECT))
    for room in plan.rooms:
        color = rgb2int(track_color(room.number))
        for ring in _rings(room.shape):
            space.add_lwpolyline(ring, close=True, dxfattribs={"layer": ROOMS, "true_color": color})
        unseen = predicted.get(room.number)
        for part in [] if unseen is None else shapely.get_parts(unseen):
            hatch = space.add_hatch(dxfattribs={"layer": PREDICTED, "true_color": color})
            hatch.set_pattern_fill(HATCH_PATTERN, scale=HATCH_SCALE)
            for number, ring in enumerate(_rings(part)):
                outer = const.BOUNDARY_PATH_EXTERNAL | const.BOUNDARY_PATH_OUTERMOST
                inner = const.BOUNDARY_PATH_DEFAULT
                hatch.paths.add_polyline_path(ring, is_closed=True, flags=inner if number else outer)
                attributes = {"layer": PREDICTED, "true_color": color}
                space.add_lwpolyline(ring, close=True, dxfattribs=attributes)
        if room.label_point_m is None:
            continue
        lines = (room.name, f"{room.area_m2:.1f} m2")
        height_m, is_turned = _label_size(room, max(map(len, lines)), wanted_m)
        x, y = room.label_point_m
        for text, rise_m in zip(lines, (LINE_RISE * height_m, -LINE_RISE * height_m), strict=True):
            attributes = {"layer": LABELS, "rotation": 90.0 * is_turned}
            label = space.add_text(text, height=height_m, dxfattribs=attributes)
            middle = (x - rise_m, y) if is_turned else (x, y + rise_m)
            label.set_placement(middle, align=TextEntityAlignment.MIDDLE_CENTER)
    for door in plan.doorways:
        start, end = door.ends_m.tolist()
        space.add_line(start, end, dxfattribs={"layer": DOORWAYS})
    for wall in wall_outlines(plan):
        for ring in _rings(wall):
            space.add_lwpolyline(ring, close=True, dxfattribs={"layer": WALLS})


def _label_size(room: PlanRoom, letters: int, wanted_m: float) -> tuple[float, bool]:
    """Height of a room's label, and whether it is turned, so that it is within the room where it can be."""
    steps = math.ceil(math.log(TEXT_MIN_M / wanted_m, TEXT_STEP))
    heights = np.maximum(wanted_m * TEXT_STEP ** np.arange(steps + 1), TEXT_MIN_M)
    x, y = room.label_point_m or (0.0, 0.0)
    long, short = heights * LETTER_WIDTH * letters / 2, heights * (LINE_RISE + 0.5)

    def fitting(half_x: FloatArray, half_y: FloatArray) -> float:
        boxes = shapely.box(x - half_x, y - half_y, x + half_x, y + half_y)
        return float(heights[shapely.covers(room.shape, boxes)].max(initial=TEXT_MIN_M))

    level_m, turned_m = fitting(long, short), fitting(short, long)
    is_turned = turned_m >= TURNED_GAIN * level_m
    return (turned_m if is_turned else level_m), is_turned


def _rings(shape: BaseGeometry) -> list[list[tuple[float, float]]]:
    """Corners of all rings of a shape, without the last one, which repeats the first."""
    rings = shapely.get_rings(shapely.get_parts(np.array([shape], object)))
    return [[(x, y) for x, y in shapely.get_coordinates(ring)[:-1].tolist()] for ring in rings]
