"""Pictures of evaluated cases: one a case, and a contact sheet of each group."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rose2_logs.drawing.case_picture import (
    PAPER,
    Image,
    draw_comparison,
    draw_panels,
    text_line,
    tiled,
)
from rose2_logs.drawing.image_files import write_image
from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.case_errors import Comparison, compare

TILE_PX = (230, 190)
"""Width and height of one panel on a contact sheet."""
CAPTION_PX = 14
COLUMNS, ROWS = 3, 8
"""Cases on one page of a contact sheet."""


class CasePictures:
    """Writes ``<group>/<name>.png`` for each case, and ``<group>.sheet_<page>.png`` at the end.

    Parameters
    ----------
    folder : path
        Where to; it is made.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._tiles: dict[str, list[Image]] = {}

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
        comparison = compare(case.truth(), result.labels)
        picture = draw_comparison(cells, comparison, result.scores, f"{case.group}/{case.name}")
        write_image(self._folder / case.group / f"{case.name}.png", picture)
        self._tiles.setdefault(case.group, []).append(_tile(cells, comparison, result))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            return
        for group, tiles in self._tiles.items():
            for page, first in enumerate(range(0, len(tiles), COLUMNS * ROWS), start=1):
                sheet = tiled(tiles[first : first + COLUMNS * ROWS], min(COLUMNS, len(tiles)))
                write_image(self._folder / f"{group}.sheet_{page}.png", sheet)


def _tile(cells: NDArray[np.int8], comparison: Comparison, result: CaseResult) -> Image:
    """Draw truth, found and errors of a case, small, under a line with its name and figures."""
    scores = result.scores
    panels = draw_panels(cells, comparison, numbered=False)[1:]
    body = np.concatenate([_fitted(panel) for panel in panels], axis=1)
    text = (
        f"{result.case.name}   iou_sym {scores.iou_sym:.1f}   (seg {scores.iou_seg:.1f}, "
        f"gt {scores.iou_gt:.1f})   rooms {scores.rooms_seg:.0f}/{scores.rooms_gt:.0f}"
    )
    return np.concatenate([text_line(text, body.shape[1], CAPTION_PX), body])


def _fitted(panel: Image) -> Image:
    """Shrink a panel to a tile's part, centered on white."""
    import cv2

    width, height = TILE_PX
    share = min(width / panel.shape[1], height / panel.shape[0])
    size = (max(1, int(panel.shape[1] * share)), max(1, int(panel.shape[0] * share)))
    small = cv2.resize(panel, size, interpolation=cv2.INTER_AREA)
    tile = np.full((height, width, 3), PAPER, np.uint8)
    top, left = (height - small.shape[0]) // 2, (width - small.shape[1]) // 2
    tile[top : top + small.shape[0], left : left + small.shape[1]] = small
    return tile
