"""Pictures that show at a glance what a segmentation has wrong: map, true rooms, found rooms, errors."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import find_objects

from rose2_logs.drawing.chart import Curve, line_chart
from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.hatching import hatch_cells
from rose2_logs.drawing.map_painter import WHITE, MapPainter, tinted_cells
from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.shapes import Color, Lines, Picture, Shape, Text
from rose2_logs.drawing.sheet import Key, arranged, captioned, legend, stacked, text_line, tiled
from rose2_logs.evaluation.along import RunPoint
from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.case_errors import Comparison, Mark, compare
from rose2_logs.evaluation.cases import Case, Truth
from rose2_logs.evaluation.scores import Scores
from rose2_logs.model.labels import known_window, straight_runs
from rose2_logs.model.occupancy import BoolArray, FloatArray, GridGeometry

PANEL_PX = (640, 1000)
"""The longer side of a panel: room numbers can be read on small maps, large maps keep to a screen."""
TILE_PX, TILE_CAPTION_PX = (230, 190), 14.0
"""Width and height of one panel on a contact sheet, and size of the line above."""
COLUMNS, ROWS = 3, 8
"""Cases on one page of a contact sheet."""
MARGIN_CELLS = 6
GAP_PX = 12.0
TEXT_PX, TITLE_PX, NUMBER_PX = 17.0, 21.0, 15.0
SCREEN_ASPECT = 1.5
"""Width over height that the four panels are arranged for: about a page or a screen."""
ROOM_OPACITY = 0.8
STRIPE_GAP, STRIPE_WIDTH = 8.0, 2.5
"""Found rooms without a partner are striped: their color alone might pass for a true room's."""
BORDER_COLOR: Color = (70, 70, 70)
MARK_COLORS: dict[Mark, Color] = {
    Mark.RIGHT: (208, 234, 208),
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


def case_sheet(
    panels: Sequence[Drawing],
    comparison: Comparison,
    scores: Scores,
    title: str,
    truth: Truth | None = None,
) -> Drawing:
    """Arrange the panels of `draw_panels` with a title, captions and a legend; a unit of the page is a pixel.

    Parameters
    ----------
    panels : sequence of Drawing
        Map, truth, found and errors.
    comparison : Comparison
        What they show.
    scores : Scores
        Figures for the title line.
    title : str
        What the map is called.
    truth : {"rooms", "rooms_other"}, optional
        Which truth is shown, where there are two.
    """
    captions = (
        "map",
        f"{_truth_words(truth)}: {scores.rooms_gt:.0f} rooms",
        f"found: {scores.rooms_seg:.0f} rooms (striped: no partner)",
        "errors",
    )
    sheet = arranged(
        [captioned(panel, text, TEXT_PX) for panel, text in zip(panels, captions, strict=True)],
        SCREEN_ASPECT,
        GAP_PX,
    )
    head = text_line(f"{title}   {_figures(scores)}", sheet.width, TITLE_PX)
    total = max(1, int(np.count_nonzero(comparison.marks)))
    keys = [
        Key(f"{MARK_WORDS[mark]} ({comparison.count(mark) / total:.1%})", color)
        for mark, color in MARK_COLORS.items()
    ]
    return stacked([head, sheet, legend(keys, sheet.width, TEXT_PX)], GAP_PX / 2, title)


def _truth_words(truth: Truth | None) -> str:
    return "truth" if truth is None else f"truth that agrees better ({truth})"


def _figures(scores: Scores) -> str:
    return (
        f"iou_seg {scores.iou_seg:.1f}   iou_gt {scores.iou_gt:.1f}   iou_sym {scores.iou_sym:.1f}   "
        f"rooms found/true {scores.rooms_seg:.0f}/{scores.rooms_gt:.0f}"
    )


def draw_panels(cells: NDArray[np.int8], comparison: Comparison) -> tuple[Drawing, Drawing, Drawing, Drawing]:
    """Draw the four panels map, truth, found and errors, all of the same size, cropped to what is known.

    A found room has the color of its partner, and a different color, striped, where it has none.
    """
    shown = (cells >= 0) | (comparison.truth > 0) | (comparison.found > 0)
    window = _with_margin(known_window(shown), shown.shape)
    # From here on row 0 lies at the bottom, as in a grid.
    cells, truth, found, marks = (
        np.flipud(values[window]) for values in (cells, comparison.truth, comparison.found, comparison.marks)
    )
    true_colors = {number: track_color(number) for number in range(1, int(comparison.truth.max()) + 1)}
    found_colors, alone = _found_colors(comparison, len(true_colors))
    panels = [_Panel(cells) for _ in range(4)]
    panels[0].tint(None, {})
    panels[1].rooms(truth, true_colors, [])
    panels[2].rooms(found, found_colors, alone)
    panels[3].tint(marks, {int(mark): color for mark, color in MARK_COLORS.items()})
    return panels[0].drawing, panels[1].drawing, panels[2].drawing, panels[3].drawing


def _found_colors(comparison: Comparison, used: int) -> tuple[dict[int, Color], list[int]]:
    """Color of each found room, its partner's where it has one; and which rooms have none."""
    partner, present = comparison.partner_of_found, np.unique(comparison.found)
    alone = [number for number in present.tolist() if number and not partner[number]]
    colors = {number: track_color(other) for number, other in enumerate(partner.tolist()) if other}
    return colors | {number: track_color(used + 1 + place) for place, number in enumerate(alone)}, alone


def _with_margin(window: tuple[slice, slice], shape: tuple[int, ...]) -> tuple[slice, slice]:
    rows, columns = (
        slice(max(span.start - MARGIN_CELLS, 0), min(span.stop + MARGIN_CELLS, size))
        for span, size in zip(window, shape, strict=True)
    )
    return rows, columns


class _Panel:
    """One panel, drawn in a world whose meter is a cell.

    Parameters
    ----------
    cells : (H, W) int8
        The map; row 0 at the bottom.
    """

    def __init__(self, cells: NDArray[np.int8]) -> None:
        height, width = cells.shape
        self._cells, self._grid = cells, GridGeometry(1.0, (0.0, 0.0), 0.0, "cells", (height, width))
        scale = np.clip(max(height, width), *PANEL_PX) / max(height, width)
        self._painter = MapPainter((0, 0, width, height), float(np.ceil(scale * width)), tallest=np.inf)
        self.drawing = self._painter.drawing

    def tint(
        self, labels: NDArray[np.integer] | None, colors: dict[int, Color], opacity: float = 1.0
    ) -> None:
        """Draw the map, the cells of labels in their colors."""
        self._painter.picture(tinted_cells(self._cells, labels, colors, opacity), self._grid)

    def rooms(self, labels: NDArray[np.integer], colors: dict[int, Color], striped: Sequence[int]) -> None:
        """Draw the map with rooms, their borders and their numbers; some of them with stripes."""
        self.tint(labels, colors, ROOM_OPACITY)
        if striped:
            # As far apart on the page as they are to be, whatever a cell's size there.
            stripes = hatch_cells(np.isin(labels, striped), STRIPE_GAP / self._painter.scale)
            self._painter.lines(stripes, WHITE, STRIPE_WIDTH)
        self._painter.lines(_borders(labels), BORDER_COLOR, 1.0)
        for number, window in enumerate(find_objects(labels), start=1):
            if window is not None:
                corner = (window[1].start, window[0].start)
                place = self._painter.on_page(shapely.Point(_widest(labels[window] == number) + corner))
                self._painter.name(str(number), place.x, place.y, NUMBER_PX, is_bold=False)


def _borders(labels: NDArray[np.integer]) -> FloatArray:
    """Lines (N, 2, 2) between cells of different rooms, x and y of their ends in cells."""
    found = []
    for axis, one, other in ((0, np.s_[1:], np.s_[:-1]), (1, np.s_[:, 1:], np.s_[:, :-1])):
        row, column = np.nonzero((labels[one] != labels[other]) & (labels[one] > 0) & (labels[other] > 0))
        first, last = straight_runs(row, column, (axis, 1 - axis))
        # The border lies behind a cell along one axis, and goes along the cell on the other.
        last[:, 1 - axis] += 1
        ends = np.stack([first, last], axis=1)
        ends[..., axis] += 1
        found.append(ends[..., ::-1])
    return np.concatenate(found).astype(np.float64)


def _widest(mask: BoolArray) -> FloatArray:
    """Middle (x, y), in cells, of the cell of a mask that is farthest from its border."""
    import cv2

    own = np.pad(mask.astype(np.uint8), 1)
    row, column = divmod(int(cv2.distanceTransform(own, cv2.DIST_L2, 3).argmax()), own.shape[1])
    return np.array([column - 0.5, row - 0.5])


def draw_along(title: str, points: Sequence[RunPoint]) -> Drawing:
    """Draw the figures of a run over its coverage, and below them the number of rooms found and true."""
    x = np.array([100 * point.coverage for point in points])

    def curve(figure: str, name: str | None = None) -> Curve:
        return Curve(name or figure, x, np.array([getattr(point.scores, figure) for point in points]))

    figures = [curve(name) for name in ("iou_seg", "iou_gt", "iou_sym")]
    rooms = [curve("rooms_seg", "rooms found"), curve("rooms_gt", "rooms true")]
    return stacked(
        [
            line_chart(figures, title=title, x_label="coverage, %", y_range=(0.0, 100.0)),
            line_chart(rooms, title="number of rooms", x_label="coverage, %"),
        ],
        title=title,
    )


def files_of_pictures(folder: Path, cases: Sequence[Case]) -> list[Path]:
    """List what `CasePictures` writes for some cases.

    Raises
    ------
    CasesError
        If the name of a case leads out of the folder.
    """
    counts = Counter(case.group for case in cases)
    return [case.image_in(folder) for case in cases] + [
        _sheet_file(folder, group, page)
        for group, count in counts.items()
        for page in range(1, math.ceil(count / (COLUMNS * ROWS)) + 1)
    ]


def along_file(folder: Path, group: str) -> Path:
    """Where the curves of a group that is a run belong."""
    return folder / f"{group}.along.png"


def _sheet_file(folder: Path, group: str, page: int) -> Path:
    return folder / f"{group}.sheet_{page}.png"


class CasePictures:
    """Writes ``<group>/<name>.png`` for each case, and ``<group>.sheet_<page>.png`` at the end.

    Parameters
    ----------
    folder : path
        Output folder, created if needed.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._tiles: dict[str, list[Drawing]] = {}

    def __enter__(self) -> Self:
        return self

    def add(self, result: CaseResult) -> None:
        """Draw one case.

        Raises
        ------
        CasesError
            If an image of the case cannot be read any more.
        OutputError
            If the picture cannot be written.
        """
        case = result.case
        cells = np.flipud(case.snapshot().cells)
        comparison = compare(case.truth(result.truth), result.labels)
        panels = draw_panels(cells, comparison)
        title = f"{case.group}/{case.name}"
        picture = case_sheet(panels, comparison, result.scores, title, _which_truth(result))
        picture.save(case.image_in(self._folder), width_px=None)
        self._tiles.setdefault(case.group, []).append(_tile(panels[1:], result))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            return
        for group, tiles in self._tiles.items():
            for page, first in enumerate(range(0, len(tiles), COLUMNS * ROWS), start=1):
                sheet = tiled(tiles[first : first + COLUMNS * ROWS], min(COLUMNS, len(tiles)), GAP_PX)
                sheet.save(_sheet_file(self._folder, group, page), width_px=None)


def _which_truth(result: CaseResult) -> Truth | None:
    return None if result.case.rooms_other_path is None else result.truth


def _tile(panels: Sequence[Drawing], result: CaseResult) -> Drawing:
    """Draw panels of a case, small, without borders and numbers, under a line with its name and figures."""
    width, height = TILE_PX
    page, scores = Drawing(width * len(panels), height), result.scores
    for number, panel in enumerate(panels):
        scale = min(width / panel.width, height / panel.height)
        bare = Drawing(panel.width, panel.height)
        bare.add(*(shape for shape in panel.shapes if not _is_small(shape)))
        left = (number + 0.5) * width - scale * panel.width / 2
        page.lay(bare, left, (height - scale * panel.height) / 2, scale)
    # As pixels: the maps of all cases would take too much memory.
    tile = Drawing(page.width, page.height)
    tile.add(Picture(page.pixels(), np.eye(2, 3)))
    text = (
        f"{result.case.name}   iou_sym {scores.iou_sym:.1f}   (seg {scores.iou_seg:.1f}, "
        f"gt {scores.iou_gt:.1f})   rooms {scores.rooms_seg:.0f}/{scores.rooms_gt:.0f}"
    )
    if (truth := _which_truth(result)) is not None:
        text += f"   truth {truth}"
    return captioned(tile, text, TILE_CAPTION_PX)


def _is_small(shape: Shape) -> bool:
    return isinstance(shape, Text) or (isinstance(shape, Lines) and shape.color == BORDER_COLOR)
