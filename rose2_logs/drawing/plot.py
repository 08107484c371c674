"""Floor plans in the axes of matplotlib, for notebooks and papers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from rose2_logs.drawing.map_painter import (
    DOORWAY_COLOR,
    INK,
    OUTLINE_SHADE,
    UNKNOWN_GRAY,
    UNSURE_COLOR,
    WHITE,
    tinted_cells,
)
from rose2_logs.drawing.palette import shaded, track_color
from rose2_logs.drawing.plan import MARGIN_M, PREDICTED_OPACITY, SEEN_OPACITY, SHAPE_OPACITY, area_text
from rose2_logs.errors import MissingPackageError
from rose2_logs.model.room_plan import PlanRoom, RoomPlan, predicted_parts
from rose2_logs.model.room_quality import unsure_sign

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import PathPatch
    from shapely.geometry.base import BaseGeometry

    from rose2_logs.drawing.shapes import Color

HATCH, HATCH_LINE, OUTLINE_LINE, DOOR_LINE, NAME_RIM = "////", 0.5, 0.8, 2.0, 2.0
"""Pattern of unseen parts, and widths of lines in points."""
NAME_POINTS = 8.0
LAYER_MAP, LAYER_AREAS, LAYER_OUTLINES, LAYER_DOORS, LAYER_NAMES = 0, 1, 2, 3, 4


def plot_plan(plan: RoomPlan, ax: Axes | None = None) -> Axes:
    """Draw a floor plan with matplotlib, in meters of its frame.

    The map is below, rooms have the colors of their tracks, their unseen parts are hatched; a question mark
    behind a room's number says that little of its outline is supported by walls.

    Parameters
    ----------
    plan : RoomPlan
    ax : matplotlib Axes, optional
        Axes to draw into; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The same, to be drawn on further.

    Raises
    ------
    MissingPackageError
        If matplotlib is not installed.
    """
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise MissingPackageError(
            "plots need matplotlib, which is not installed: pip install 'rose2-logs[notebook]'"
        ) from error
    if ax is None:
        _, ax = plt.subplots(layout="constrained")
    tinted = _show_map(plan, ax)
    predicted = predicted_parts(plan)
    for room in plan.rooms:
        _show_room(ax, room, predicted.get(room.number, shapely.Polygon()), is_tinted=room.number in tinted)
    unsure = plan.unsure_doorways
    for doorway in plan.doorways:
        x, y = doorway.ends_m.reshape(2, 2).T
        color = _unit(UNSURE_COLOR if doorway in unsure else DOORWAY_COLOR)
        ax.plot(x, y, color=color, linewidth=DOOR_LINE, solid_capstyle="butt", zorder=LAYER_DOORS)
    x0, y0, x1, y1 = plan.bounds_m
    ax.set(
        xlim=(x0 - MARGIN_M, x1 + MARGIN_M),
        ylim=(y0 - MARGIN_M, y1 + MARGIN_M),
        aspect="equal",
        title=plan.title,
        xlabel=f"x in {plan.frame_id}, m",
        ylabel=f"y in {plan.frame_id}, m",
    )
    return ax


def _show_map(plan: RoomPlan, ax: Axes) -> set[int]:
    """Show the cells of the map, tinted by their rooms; return the numbers of these."""
    if plan.map is None:
        return set()
    from matplotlib.transforms import Affine2D

    ax.set_facecolor(_unit((UNKNOWN_GRAY,) * 3))
    below = plan.map.cropped()
    geometry, (height, width) = below.geometry, below.cells.shape
    colors = {room.number: track_color(room.number) for room in plan.rooms}
    x, y = geometry.origin_xy_m
    from_cells = Affine2D().scale(geometry.resolution_m).rotate(geometry.yaw_rad).translate(x, y)
    # Transformed here and not by its extent: the grid may be turned in the world.
    ax.imshow(
        tinted_cells(below.cells, below.labels, colors, SEEN_OPACITY),
        origin="lower",
        extent=(0, width, 0, height),
        interpolation="nearest",
        transform=from_cells + ax.transData,
        zorder=LAYER_MAP,
    )
    return set(colors) & set(np.unique(below.labels).tolist())


def _show_room(ax: Axes, room: PlanRoom, predicted: BaseGeometry, *, is_tinted: bool) -> None:
    """Show the shape of a room, hatched where it was not seen, and its name."""
    from matplotlib import patheffects

    if room.shape.is_empty:
        return
    color = track_color(room.number)
    dark = _unit(shaded(color, OUTLINE_SHADE))
    if not is_tinted:
        fill = _patch(room.shape.difference(predicted))
        fill.set(facecolor=(*_unit(color), SHAPE_OPACITY), linewidth=0, zorder=LAYER_AREAS)
        ax.add_patch(fill)
    if not predicted.is_empty:
        unseen = _patch(predicted)
        unseen.set(facecolor=(*_unit(color), PREDICTED_OPACITY), edgecolor=dark, linewidth=0)
        unseen.set(hatch=HATCH, hatch_linewidth=HATCH_LINE, zorder=LAYER_AREAS)
        ax.add_patch(unseen)
    outline = _patch(room.shape)
    outline.set(fill=False, edgecolor=dark, linewidth=OUTLINE_LINE, zorder=LAYER_OUTLINES)
    ax.add_patch(outline)
    x, y = room.label_point_m or tuple(room.shape.representative_point().coords[0])
    ax.text(
        x,
        y,
        f"{room.number}{unsure_sign(room.wall_support)}\n{area_text(room.area_m2)}",
        color=_unit(INK),
        fontsize=NAME_POINTS,
        horizontalalignment="center",
        verticalalignment="center",
        path_effects=[patheffects.withStroke(linewidth=NAME_RIM, foreground=_unit(WHITE))],
        clip_on=True,
        zorder=LAYER_NAMES,
    )


def _patch(shape: BaseGeometry) -> PathPatch:
    """Turn a polygon or multipolygon into a patch; its holes stay open."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    # Outer rings run one way and holes the other, which distinguishes them.
    parts = [shapely.orient_polygons(part) for part in shapely.get_parts(shape)]
    rings = [ring for part in parts for ring in shapely.get_rings(part)]
    return PathPatch(Path.make_compound_path(*(Path(ring.coords, closed=True) for ring in rings)))


def _unit(color: Color) -> tuple[float, float, float]:
    """Red, green, blue in [0, 1]."""
    red, green, blue = color
    return red / 255, green / 255, blue / 255
