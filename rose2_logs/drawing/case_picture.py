"""Pictures that show at a glance what a segmentation has wrong: map, true rooms, found rooms, errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from rose2_logs.drawing.palette import track_color
from rose2_logs.evaluation.case_errors import Comparison, Mark
from rose2_logs.evaluation.scores import Scores
from rose2_logs.model.labels import known_window

Image = NDArray[np.uint8]
Color = tuple[int, int, int]
Scalar = TypeVar("Scalar", bound=np.generic)

SIDE_MIN_PX = 620
"""The longer side of a panel is drawn at least this long, so that room numbers can be read on small maps."""
MARGIN_CELLS = 6
GAP_PX = 12
TEXT_PX, TITLE_PX, NUMBER_PX = 17, 21, 15
SCREEN_ASPECT = 1.5
"""Width over height that the four panels are arranged for: about a page or a screen."""
TEXT_GROWS_FROM_PX = 900
"""On panels with a longer side than this, text grows with them: they are looked at from further away."""
OCCUPIED_MIN_PERCENT = 50
"""Cells above are drawn as walls over the rooms."""
STRIPE_PX, STRIPE_EVERY_PX = 3, 12
"""Found rooms without a partner are striped: their color alone might pass for a true room's."""

PAPER, INK = (255, 255, 255), (0, 0, 0)
UNKNOWN_COLOR, FREE_COLOR, OCCUPIED_COLOR, BORDER_COLOR = (
    (205, 205, 205),
    (254, 254, 254),
    (0, 0, 0),
    (70, 70, 70),
)
MARK_COLORS: dict[Mark, Color] = {
    Mark.RIGHT: (222, 236, 222),
    Mark.MERGED: (214, 39, 40),
    Mark.SPLIT: (255, 150, 20),
    Mark.LEAKED: (150, 80, 200),
    Mark.MISSED: (30, 110, 220),
}
MARK_WORDS: dict[Mark, str] = {
    Mark.RIGHT: "right",
    Mark.MERGED: "merged: the found room is another's",
    Mark.SPLIT: "split: a further part of its room",
    Mark.LEAKED: "leaked: outside every true room",
    Mark.MISSED: "missed: in no found room",
}


def draw_comparison(cells: NDArray[np.int8], comparison: Comparison, scores: Scores, title: str) -> Image:
    """Draw map, truth, found and errors side by side, with a title and a legend.

    Parameters
    ----------
    cells : (H, W) int8
        -1 unknown, 0..100 occupancy in percent.
    comparison : Comparison
        Labels and marks of the same shape. Row 0 of all three becomes the top of the picture.
    scores : Scores
        Figures for the title line.
    title : str
        What the map is called.

    Returns
    -------
    (H', W', 3) uint8
        RGB, cropped to what is known.
    """
    panels = draw_panels(cells, comparison)
    captions = (
        "map",
        f"truth: {scores.rooms_gt:.0f} rooms",
        f"found: {scores.rooms_seg:.0f} rooms (striped: no partner)",
        "errors",
    )
    grown = _text_growth(panels[0].shape)
    sheet = _arrange(
        [_captioned(panel, text, TEXT_PX * grown) for panel, text in zip(panels, captions, strict=True)]
    )
    head = text_line(f"{title}   {figures_line(scores)}", sheet.shape[1], TITLE_PX * grown)
    return np.concatenate([head, sheet, _legend(comparison, sheet.shape[1], TEXT_PX * grown)])


def figures_line(scores: Scores) -> str:
    """Return the figures that a picture shows, as one line."""
    return (
        f"iou_seg {scores.iou_seg:.1f}   iou_gt {scores.iou_gt:.1f}   iou_sym {scores.iou_sym:.1f}   "
        f"rooms found/true {scores.rooms_seg:.0f}/{scores.rooms_gt:.0f}"
    )


def draw_panels(
    cells: NDArray[np.int8], comparison: Comparison, *, numbered: bool = True
) -> tuple[Image, Image, Image, Image]:
    """Draw the four panels map, truth, found and errors, all of the same size, without any caption.

    A found room has the color of its partner, and a color of its own, striped, where it has none.
    """
    drawn = (cells >= 0) | (comparison.truth > 0) | (comparison.found > 0)
    window = _with_margin(known_window(drawn), drawn.shape)
    cells, marks = cells[window], comparison.marks[window]
    truth, found = comparison.truth[window], comparison.found[window]
    scale = max(1, int(np.ceil(SIDE_MIN_PX / max(cells.shape))))
    plain = _scaled(_plain(cells), scale)
    walls = _scaled(cells > OCCUPIED_MIN_PERCENT, scale)

    truth_colors = room_colors(int(comparison.truth.max(initial=0)))
    found_colors, alone = _found_colors(comparison, len(truth_colors))
    mark_colors = np.zeros((len(Mark), 3), np.uint8)
    for mark, color in MARK_COLORS.items():
        mark_colors[mark] = color

    truth, found, marks = _scaled(truth, scale), _scaled(found, scale), _scaled(marks, scale)
    striped = alone[found] & _stripes(found.shape)
    panels = []
    for labels, colors in ((truth, truth_colors), (found, found_colors)):
        panel = np.where((labels > 0)[..., None], colors[labels], plain)
        if labels is found:
            panel[striped] = PAPER
        panel[walls] = OCCUPIED_COLOR
        panel[_borders(labels)] = BORDER_COLOR
        panels.append(_numbered(panel, labels) if numbered else panel)
    errors: Image = np.where((marks != Mark.NONE)[..., None], mark_colors[marks], plain)
    errors[walls] = OCCUPIED_COLOR
    return plain, panels[0], panels[1], errors


def room_colors(count: int) -> Image:
    """Colors (count + 1, 3) of labels, RGB; label 0 has none."""
    return np.array([(0, 0, 0), *(track_color(number) for number in range(1, count + 1))], np.uint8)


def _found_colors(comparison: Comparison, used: int) -> tuple[Image, NDArray[np.bool_]]:
    """Color of each found room, its partner's where it has one; and which rooms have none."""
    partner = comparison.partner_of_found
    alone = partner == 0
    alone[0] = False
    own = np.cumsum(alone) + used - 1
    colors = room_colors(int(own[-1]))
    return colors[np.where(alone, own, partner)], alone


def _plain(cells: NDArray[np.int8]) -> Image:
    image = np.empty((*cells.shape, 3), np.uint8)
    image[:] = UNKNOWN_COLOR
    gray = np.array(FREE_COLOR) * (1 - cells[..., None] / 100)
    image[cells >= 0] = np.round(gray[cells >= 0])
    return image


def _with_margin(window: tuple[slice, slice], shape: tuple[int, ...]) -> tuple[slice, slice]:
    rows, columns = (
        slice(max(span.start - MARGIN_CELLS, 0), min(span.stop + MARGIN_CELLS, size))
        for span, size in zip(window, shape, strict=True)
    )
    return rows, columns


def _scaled(values: NDArray[Scalar], scale: int) -> NDArray[Scalar]:
    return values.repeat(scale, axis=0).repeat(scale, axis=1)


def _stripes(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    stripes: NDArray[np.bool_] = (rows + columns) % STRIPE_EVERY_PX < STRIPE_PX
    return stripes


def _borders(labels: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Pixels of rooms whose right or lower neighbor has another label."""
    borders = np.zeros(labels.shape, bool)
    borders[:-1] |= labels[:-1] != labels[1:]
    borders[:, :-1] |= labels[:, :-1] != labels[:, 1:]
    return borders & (labels > 0)


def _numbered(panel: Image, labels: NDArray[np.integer]) -> Image:
    """Write each room's number where the room is widest."""
    import cv2

    image = PillowImage.fromarray(panel)
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(NUMBER_PX * _text_growth(panel.shape))
    for label in np.unique(labels[labels > 0]).tolist():
        rows, columns = known_window(labels == label)
        own = np.pad((labels[rows, columns] == label).astype(np.uint8), 1)
        deepest = int(cv2.distanceTransform(own, cv2.DIST_L2, 3).argmax())
        y, x = np.unravel_index(deepest, own.shape)
        place = (int(x) - 1 + columns.start, int(y) - 1 + rows.start)
        draw.text(place, str(label), INK, font, anchor="mm", stroke_width=2, stroke_fill=PAPER)
    return np.asarray(image)


def _text_growth(shape: tuple[int, ...]) -> float:
    return max(1.0, max(shape) / TEXT_GROWS_FROM_PX)


def text_line(text: str, width: int, size_px: float) -> Image:
    """Draw one line of text on white, as wide as asked for; a longer text is set smaller until it fits."""
    height = round(size_px) + GAP_PX
    image = PillowImage.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(image)
    natural = draw.textlength(text, ImageFont.load_default(size_px))
    fitting = size_px * min(1.0, (width - 2 * GAP_PX) / max(natural, 1.0))
    draw.text((GAP_PX, height // 2), text, INK, ImageFont.load_default(fitting), anchor="lm")
    return np.asarray(image)


def _captioned(panel: Image, caption: str, size_px: float) -> Image:
    return np.concatenate([text_line(caption, panel.shape[1], size_px), panel])


def _arrange(panels: Sequence[Image]) -> Image:
    """Put panels of one size into as many columns as bring the whole nearest to a screen's shape."""
    height, width = panels[0].shape[:2]
    columns = min(
        (count for count in range(1, len(panels) + 1) if len(panels) % count == 0),
        key=lambda count: abs(np.log(count * width / (len(panels) / count * height) / SCREEN_ASPECT)),
    )
    return tiled(panels, columns)


def tiled(panels: Sequence[Image], columns: int) -> Image:
    """Put panels of one size into rows of `columns`, with white gaps; missing ones are left white."""
    height, width = panels[0].shape[:2]
    rows = -(-len(panels) // columns)
    sheet = np.full((rows * (height + GAP_PX), columns * (width + GAP_PX), 3), PAPER, np.uint8)
    for number, panel in enumerate(panels):
        top, left = number // columns * (height + GAP_PX), number % columns * (width + GAP_PX)
        sheet[top : top + height, left : left + width] = panel
    return sheet


def _legend(comparison: Comparison, width: int, size_px: float) -> Image:
    """Draw what the colors of the errors panel mean, and how many of the rooms' cells have each."""
    total = max(1, int(np.count_nonzero(comparison.marks)))
    font, box = ImageFont.load_default(size_px), round(size_px)
    step = box + GAP_PX
    entries = [
        (color, f"{MARK_WORDS[mark]} ({comparison.count(mark) / total:.1%})")
        for mark, color in MARK_COLORS.items()
    ]
    # Entries flow into as many lines as the width asks for.
    places, line, left = [], 0, GAP_PX
    for _, text in entries:
        needed = round(font.getlength(text)) + 2 * step
        if left > GAP_PX and left + needed > width:
            line, left = line + 1, GAP_PX
        places.append((left, line * step))
        left += needed
    image = PillowImage.new("RGB", (width, (line + 1) * step + GAP_PX), PAPER)
    draw = ImageDraw.Draw(image)
    for (color, text), (left, top) in zip(entries, places, strict=True):
        draw.rectangle((left, top, left + box, top + box), color, INK)
        draw.text((left + step // 2 + box // 2, top + box // 2), text, INK, font, anchor="lm")
    return np.asarray(image)
