"""A picture of two layouts laid over each other: one, the other, and what differs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont
from shapely.geometry.base import BaseGeometry

from rose2_logs.comparison.room_changes import RoomStatus
from rose2_logs.comparison.wall_changes import WallStatus
from rose2_logs.drawing.case_picture import text_line
from rose2_logs.drawing.palette import track_color
from rose2_logs.model.labels import known_window
from rose2_logs.model.occupancy import UNKNOWN, FloatArray, GridGeometry
from rose2_logs.tracking.matching import resample_labels
from rose2_logs.tracking.registration import RigidMotion

if TYPE_CHECKING:
    from rose2_logs.comparison.final_layout import FinalLayout
    from rose2_logs.comparison.layouts import LayoutComparison

Image = NDArray[np.uint8]
Color = tuple[int, int, int]

SIDE_PX = 1000
"""Longer side of the panel of what differs; the layouts are drawn half as large."""
MARGIN_M = 0.5
GAP_PX, TEXT_PX, TITLE_PX, NUMBER_PX = 14, 18, 22, 16
WIDE = 1.6
"""Width over height from which the layouts stand above what differs and not beside it."""
ROOM_OPACITY = 0.6
STRIPE_PX, STRIPE_EVERY_PX = 3, 12
LINE_PX = 5
PAPER, INK, UNKNOWN_COLOR, OUTLINE, FAINT = (
    (255, 255, 255),
    (0, 0, 0),
    (225, 225, 225),
    (70, 70, 70),
    (150, 150, 150),
)
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


def draw_layout_comparison(comparison: LayoutComparison) -> Image:
    """Draw A, B in A's frame, and what differs, with a title and a legend.

    Returns
    -------
    (H, W, 3) uint8
        RGB, row 0 at the top as in the world. Rooms that belong together have one color in A and B.
    """
    b_to_a = comparison.placement.motion
    large, small = _Canvas(comparison, SIDE_PX), _Canvas(comparison, (SIDE_PX - GAP_PX) // 2)
    found = _captioned("what differs", large.differences(comparison))
    layouts = [
        _captioned(f"A: {comparison.a.name}", small.layout(comparison.a, RigidMotion.none(), "tracks_a")),
        _captioned(f"B: {comparison.b.name}, laid over A", small.layout(comparison.b, b_to_a, "tracks_b")),
    ]
    height, width = found.shape[:2]
    if width > WIDE * height:
        sheet = _joined([_joined(layouts, axis=1), found], axis=0)
    else:
        sheet = _joined([found, _joined(layouts, axis=0)], axis=1)
    title = text_line(_title(comparison), sheet.shape[1], TITLE_PX)
    return np.concatenate([title, sheet, _legend(comparison, sheet.shape[1])])


def _captioned(text: str, panel: Image) -> Image:
    return np.concatenate([text_line(text, panel.shape[1], TEXT_PX), panel])


def _joined(images: Sequence[Image], axis: int) -> Image:
    """Put pictures one after the other with a gap, below (0) or beside (1) each other."""
    across = 1 - axis
    most = max(image.shape[across] for image in images)
    parts = []
    for number, image in enumerate(images):
        after = [(0, 0), (0, 0), (0, 0)]
        after[across] = (0, most - image.shape[across])
        after[axis] = (GAP_PX if number else 0, 0)
        parts.append(np.pad(image, after, constant_values=255))
    return np.concatenate(parts, axis=axis)


def _title(comparison: LayoutComparison) -> str:
    if not comparison.same_building:
        return "These do not seem to be two runs in one building"
    sure = "   (B may lie wrongly: another way fits about as well)" if comparison.ambiguous else ""
    return f"floor overlaps {comparison.floor_iou:.0%}, rooms {comparison.rooms_iou:.0%}{sure}"


class _Canvas:
    """The part of A's frame that holds both layouts, as pixels."""

    def __init__(self, comparison: LayoutComparison, side_px: int) -> None:
        self._changes = comparison.rooms
        a, b, motion = comparison.a, comparison.b, comparison.placement.motion
        corners = np.concatenate([_known_corners(a), motion.points(_known_corners(b))])
        low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
        cell = float((high - low).max()) / side_px
        columns, rows = np.ceil((high - low) / cell).astype(int).tolist()
        x, y = low.tolist()
        self._geometry = GridGeometry(cell, (x, y), 0.0, "a", (rows, columns))

    def layout(
        self, layout: FinalLayout, motion: RigidMotion, tracks_of: Literal["tracks_a", "tracks_b"]
    ) -> Image:
        """Draw a layout with its rooms in the colors of what they belong to, with their numbers."""
        image = self._map(layout, motion)
        groups = [getattr(change, tracks_of) for change in self._changes]
        group_of = {track: number for number, tracks in enumerate(groups, start=1) for track in tracks}
        named = sorted(zip(layout.tracks, layout.shapes_moved(motion), strict=True), key=lambda each: each[0])
        for track, shape in named:
            self._fill(image, shape, track_color(group_of[track]))
        return self._labeled(image, ((str(track), shape) for track, shape in named))

    def differences(self, comparison: LayoutComparison) -> Image:
        """Draw what became of rooms and walls."""
        import cv2

        image = np.full((*self._geometry.shape, 3), 255, np.uint8)
        for layout, motion in (
            (comparison.a, RigidMotion.none()),
            (comparison.b, comparison.placement.motion),
        ):
            image[self._resampled(layout.map.occupied.astype(np.int32), layout, motion) > 0] = FAINT
        for change in comparison.rooms:
            whole = shapely.union(change.shape_a, change.shape_b)
            self._fill(image, whole, ROOM_COLORS[change.status], striped=change.status == "unseen")
        for change in comparison.rooms:
            for shape in (change.shape_a, change.shape_b):
                cv2.polylines(image, self._rings(shape), True, OUTLINE, 1, cv2.LINE_AA)
        for wall in () if comparison.walls is None else comparison.walls.changes:
            for ends, thickness in ((wall.ends_a_m, LINE_PX // 2), (wall.ends_b_m, LINE_PX)):
                if ends is not None:
                    # Where a moved wall was is drawn thin.
                    width = thickness if wall.status == "moved" else LINE_PX
                    points = self._pixels(ends.reshape(2, 2))
                    cv2.polylines(image, [points], False, WALL_COLORS[wall.status], width, cv2.LINE_AA)
        return self._labeled(
            image,
            (
                (_pair_name(change.tracks_a, change.tracks_b), shapely.union(change.shape_a, change.shape_b))
                for change in comparison.rooms
                if change.status not in ("same", "partly seen")
            ),
        )

    def _map(self, layout: FinalLayout, motion: RigidMotion) -> Image:
        cells = self._resampled(layout.map.snapshot.cells.astype(np.int32) - UNKNOWN, layout, motion)
        gray = 255 - (cells - 1).clip(0) * 2.55
        return np.where((cells == 0)[..., None], UNKNOWN_COLOR, gray[..., None]).astype(np.uint8)

    def _resampled(
        self, labels: NDArray[np.int32], layout: FinalLayout, motion: RigidMotion
    ) -> NDArray[np.int32]:
        source = motion.grid(layout.map.snapshot.geometry)
        return np.ascontiguousarray(resample_labels(labels, source, self._geometry)[::-1])

    def _pixels(self, points_m: FloatArray) -> NDArray[np.int32]:
        x, y = (self._geometry.world_to_grid(points_m) / self._geometry.resolution_m).T
        return np.round(np.column_stack([x, self._geometry.shape[0] - y])).astype(np.int32)

    def _rings(self, shape: BaseGeometry) -> list[NDArray[np.int32]]:
        parts = shapely.get_parts(shape)
        areal = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
        return [self._pixels(shapely.get_coordinates(ring)) for ring in shapely.get_rings(areal)]

    def _fill(self, image: Image, shape: BaseGeometry, color: Color, striped: bool = False) -> None:
        """Fill a shape so that what lies below shows through, and draw its outline."""
        import cv2

        rings = self._rings(shape)
        if not rings:
            return
        mask = np.zeros(image.shape[:2], np.uint8)
        cv2.fillPoly(mask, rings, 1)
        inside = mask > 0
        if striped:
            rows, columns = np.indices(mask.shape)
            image[inside & ((rows + columns) % STRIPE_EVERY_PX < STRIPE_PX)] = FAINT
        else:
            blend = ROOM_OPACITY * np.array(color) + (1 - ROOM_OPACITY) * image[inside]
            image[inside] = blend.astype(np.uint8)
        cv2.polylines(image, rings, True, OUTLINE, 1, cv2.LINE_AA)

    def _labeled(self, image: Image, labels: Iterable[tuple[str, BaseGeometry]]) -> Image:
        picture = PillowImage.fromarray(image)
        draw, font = ImageDraw.Draw(picture), ImageFont.load_default(NUMBER_PX)
        for text, shape in labels:
            if not shape.is_empty:
                circle = shapely.maximum_inscribed_circle(shape, tolerance=0.05)
                x, y = self._pixels(shapely.get_coordinates(circle)[:1])[0].tolist()
                draw.text((x, y), text, INK, font, anchor="mm", stroke_width=2, stroke_fill=PAPER)
        return np.asarray(picture)


def _pair_name(tracks_a: tuple[int, ...], tracks_b: tuple[int, ...]) -> str:
    """Name rooms by their numbers in A and B."""
    a, b = ("+".join(map(str, tracks)) for tracks in (tracks_a, tracks_b))
    return f"{a} > {b}" if a and b else a or b


def _known_corners(layout: FinalLayout) -> FloatArray:
    snapshot = layout.map.snapshot
    return snapshot.geometry.part(known_window(snapshot.cells != UNKNOWN)).corners_m()


def _legend(comparison: LayoutComparison, width: int) -> Image:
    """Draw what the colors mean, of the statuses that occur."""
    font = ImageFont.load_default(TEXT_PX)
    counts = comparison.room_counts
    boxes: list[tuple[Color, str, bool]] = [
        (ROOM_COLORS[status], f"{status}: {counts[status]}", False)
        for status in ROOM_COLORS
        if status in counts
    ]
    lengths = {} if comparison.walls is None else comparison.walls.lengths_m
    boxes += [
        (WALL_COLORS[status], f"wall {status}: {lengths[status]:.1f} m", True)
        for status in WALL_COLORS
        if status in lengths
    ]
    places, line, left = [], 0, GAP_PX
    for _, text, _ in boxes:
        needed = round(font.getlength(text)) + TEXT_PX + 2 * GAP_PX
        if left > GAP_PX and left + needed > width:
            line, left = line + 1, GAP_PX
        places.append((left, GAP_PX + line * (TEXT_PX + GAP_PX)))
        left += needed
    image = PillowImage.new("RGB", (width, (line + 1) * (TEXT_PX + GAP_PX) + GAP_PX), PAPER)
    draw = ImageDraw.Draw(image)
    for (color, text, is_line), (x, y) in zip(boxes, places, strict=True):
        middle = y + TEXT_PX // 2
        if is_line:
            draw.line((x, middle, x + TEXT_PX, middle), color, LINE_PX)
        else:
            draw.rectangle((x, y, x + TEXT_PX, y + TEXT_PX), color, INK)
        draw.text((x + TEXT_PX + GAP_PX // 2, middle), text, INK, font, anchor="lm")
    return np.asarray(image)
