"""Comparison pictures: colors of partners, marked errors, readable size, text that fits."""

from __future__ import annotations

import numpy as np
import pytest
from rose2_logs.drawing.case_picture import (
    MARK_COLORS,
    SIDE_MIN_PX,
    draw_comparison,
    draw_panels,
    room_colors,
    text_line,
)

from rose2_logs.evaluation.case_errors import Mark, compare
from rose2_logs.evaluation.scores import score

WALL, FREE = 100, 0


@pytest.fixture
def drawn():
    """Cells, truth, found: true rooms 1 and 2; found 3 is room 1 and a half of room 2, found 4 the rest."""
    cells = np.full((40, 62), -1, np.int8)
    cells[8:32, 10:52] = WALL
    cells[10:30, 12:30] = cells[10:30, 32:50] = FREE
    truth, found = np.zeros(cells.shape, int), np.zeros(cells.shape, int)
    truth[10:30, 12:30], truth[10:30, 32:50] = 1, 2
    found[10:30, 12:30] = found[10:18, 32:50] = 3
    found[18:30, 32:46] = 4
    return cells, truth, found


def at(panel, row: int, column: int) -> tuple[int, ...]:
    """Color of a cell of the drawing in a panel, which is cropped to rows 2..37 and columns 4..57."""
    scale = panel.shape[1] // 54
    assert panel.shape == (36 * scale, 54 * scale, 3)
    y, x = int((row - 2 + 0.5) * scale), int((column - 4 + 0.5) * scale)
    return tuple(panel[y, x].tolist())


def test_partners_share_their_color_and_errors_are_marked(drawn):
    """Found 3 has the color of true room 1 also where it took cells of room 2, which are marked merged."""
    cells, truth, found = drawn
    plain, true_panel, found_panel, errors = draw_panels(cells, compare(truth, found), numbered=False)
    colors = [tuple(color) for color in room_colors(2).tolist()]
    assert at(true_panel, 12, 14) == at(found_panel, 12, 14) == at(found_panel, 12, 40) == colors[1]
    assert at(true_panel, 25, 40) == at(found_panel, 25, 40) == colors[2]
    assert at(errors, 12, 14) == MARK_COLORS[Mark.RIGHT]
    assert at(errors, 12, 40) == MARK_COLORS[Mark.MERGED]
    assert at(errors, 25, 48) == MARK_COLORS[Mark.MISSED]
    assert at(errors, 9, 20) == at(plain, 9, 20) == at(true_panel, 9, 20) == (0, 0, 0)
    assert at(plain, 4, 5) == at(errors, 4, 5) == (205, 205, 205)


def test_a_found_room_without_partner_has_a_color_of_its_own_and_stripes(drawn):
    """Neither of the true rooms' colors, and white stripes on it."""
    cells, truth, found = drawn
    found[18:30, 40:50] = 5
    found[18:30, 32:40] = 4
    found[10:18, 32:50] = 4
    _, _, found_panel, errors = draw_panels(cells, compare(truth, found), numbered=False)
    scale = found_panel.shape[1] // 54
    alone = found_panel[(20 - 2) * scale : (28 - 2) * scale, (42 - 4) * scale : (48 - 4) * scale]
    kinds = {tuple(color) for color in alone.reshape(-1, 3).tolist()}
    assert len(kinds) == 2
    assert (255, 255, 255) in kinds
    assert not kinds & {tuple(color) for color in room_colors(2).tolist()}
    assert at(errors, 24, 45) == MARK_COLORS[Mark.SPLIT]


def test_small_maps_are_scaled_up_and_numbers_written(drawn):
    """The panel is long enough to read; with numbers, pixels within the room change."""
    cells, truth, found = drawn
    comparison = compare(truth, found)
    bare, numbered = draw_panels(cells, comparison, numbered=False), draw_panels(cells, comparison)
    assert max(bare[0].shape) >= SIDE_MIN_PX
    assert (bare[1] != numbered[1]).any()
    assert np.array_equal(bare[3], numbered[3])


def test_the_whole_picture_holds_title_panels_and_legend(drawn):
    """Larger than its four panels; the legend shows each mark's color."""
    cells, truth, found = drawn
    comparison = compare(truth, found)
    picture = draw_comparison(cells, comparison, score(truth, found), "group/name")
    panel = draw_panels(cells, comparison)[0]
    assert picture.shape[0] * picture.shape[1] > 4 * panel.shape[0] * panel.shape[1]
    legend = {tuple(color) for color in picture[-60:].reshape(-1, 3).tolist()}
    assert set(MARK_COLORS.values()) <= legend


def test_a_map_without_any_room_or_known_cell_is_drawn():
    """Nothing found, nothing true, nothing known: a picture all the same."""
    none = np.zeros((5, 4), int)
    picture = draw_comparison(np.full((5, 4), -1, np.int8), compare(none, none), score(none, none), "empty")
    assert picture.dtype == np.uint8


@pytest.mark.parametrize("width", [120, 2000])
def test_text_fits_its_width(width: int):
    """A long title on a narrow picture is set smaller instead of running out of it."""
    line = text_line("a title that is much longer than 120 pixels", width, 20)
    assert line.shape == (32, width, 3)
    assert (line[:, -8:] == 255).all()
    assert (line < 128).any()
