"""Pictures of evaluated maps: colors of partners, marked errors, readable size, contact sheets in pages."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.saved_maps import RESOLUTION_M, two_rooms

from rose2_logs.drawing.evaluation_pictures import (
    BORDER_COLOR,
    COLUMNS,
    MARK_COLORS,
    PANEL_PX,
    ROOM_OPACITY,
    ROWS,
    STRIPE_WIDTH,
    TILE_PX,
    CasePictures,
    case_sheet,
    draw_along,
    draw_panels,
)
from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.drawing.map_painter import FREE_GRAY, OCCUPIED_GRAY, UNKNOWN_GRAY, WHITE
from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.shapes import Lines, Picture, Text
from rose2_logs.evaluation.along import RunPoint
from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.case_errors import Mark, compare
from rose2_logs.evaluation.cases import Case
from rose2_logs.evaluation.scores import Scores, score

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
    """Color of a cell in a panel, which is cropped to rows 2..37 and columns 4..57."""
    pixels = panel.pixels()
    scale = pixels.shape[1] / 54
    return tuple(pixels[int((row - 2 + 0.5) * scale), int((column - 4 + 0.5) * scale)].tolist())


def tinted(room: int) -> tuple[int, ...]:
    """Color of a free cell of a room."""
    return tuple(round((1 - ROOM_OPACITY) * FREE_GRAY + ROOM_OPACITY * value) for value in track_color(room))


def test_partners_share_their_color_and_errors_are_marked(drawn):
    """Found 3 has the color of true room 1 also where it took cells of room 2, which are marked merged."""
    cells, truth, found = drawn
    plain, true_panel, found_panel, errors = draw_panels(cells, compare(truth, found))
    assert at(true_panel, 12, 14) == at(found_panel, 12, 14) == at(found_panel, 12, 48) == tinted(1)
    assert at(true_panel, 25, 34) == at(found_panel, 25, 34) == tinted(2)
    assert at(errors, 12, 14) == MARK_COLORS[Mark.RIGHT]
    assert at(errors, 12, 40) == MARK_COLORS[Mark.MERGED]
    assert at(errors, 25, 48) == MARK_COLORS[Mark.MISSED]
    assert at(errors, 9, 20) == at(plain, 9, 20) == at(true_panel, 9, 20) == (OCCUPIED_GRAY,) * 3
    assert at(plain, 4, 5) == at(errors, 4, 5) == (UNKNOWN_GRAY,) * 3


def test_a_found_room_without_partner_has_a_color_of_its_own_and_stripes(drawn):
    """Neither of the true rooms' colors, and white stripes that stay within it."""
    cells, truth, found = drawn
    found[18:30, 40:50] = 5
    found[18:30, 32:40] = 4
    found[10:18, 32:50] = 4
    _, true_panel, found_panel, errors = draw_panels(cells, compare(truth, found))
    (stripes,) = (each for each in found_panel.shapes if isinstance(each, Lines) and each.color == WHITE)
    assert stripes.width == STRIPE_WIDTH
    scale = found_panel.width / 54
    inside = ((40 - 4) * scale, (18 - 2) * scale, (50 - 4) * scale, (30 - 2) * scale)
    low, high = np.array(stripes.shape.bounds).reshape(2, 2)
    assert (low >= np.array(inside[:2]) - scale).all()
    assert (high <= np.array(inside[2:]) + scale).all()
    assert stripes.shape.length > 100
    assert not any(isinstance(each, Lines) and each.color == WHITE for each in true_panel.shapes)
    cell = found_panel.pixels().astype(int)[
        int(17 * scale) : int(27 * scale), int(37 * scale) : int(45 * scale)
    ]
    near = [
        (np.abs(cell - np.array(color)).max(axis=-1) <= 1).any() for color in (WHITE, *map(tinted, (3, 1, 2)))
    ]
    assert near == [True, True, False, False]
    assert at(errors, 24, 45) == MARK_COLORS[Mark.SPLIT]


def test_small_maps_are_scaled_up_and_large_ones_keep_to_a_screen(drawn):
    cells, truth, found = drawn
    (plain, *_) = draw_panels(cells, compare(truth, found))
    assert max(plain.width, plain.height) == pytest.approx(PANEL_PX[0], abs=1)
    none = np.zeros((1500, 400), int)
    (plain, *_) = draw_panels(np.zeros(none.shape, np.int8), compare(none, none))
    assert max(plain.width, plain.height) == pytest.approx(PANEL_PX[1], abs=3)


def test_borders_run_between_rooms_only(drawn):
    """Rooms 1 and 2 have a wall between them; found rooms 3 and 4 meet in row 18, 14 cells long."""
    cells, truth, found = drawn
    _, true_panel, found_panel, _ = draw_panels(cells, compare(truth, found))
    lengths = []
    for panel in (true_panel, found_panel):
        drawn_ones = [each for each in panel.shapes if isinstance(each, Lines) and each.color == BORDER_COLOR]
        lengths.append(sum(each.shape.length for each in drawn_ones) / (panel.width / 54))
    (borders,) = drawn_ones
    assert lengths == pytest.approx([0, 14], abs=0.1)
    scale = found_panel.width / 54
    expected = [(32 - 4) * scale, (18 - 2) * scale, (46 - 4) * scale, (18 - 2) * scale]
    assert borders.shape.bounds == pytest.approx(expected, abs=0.1)


def test_rooms_are_numbered_within_themselves(drawn):
    cells, truth, found = drawn
    _, true_panel, _, errors = draw_panels(cells, compare(truth, found))
    scale = true_panel.width / 54
    names = {
        each.text: (each.x / scale + 4, each.y / scale + 2)
        for each in true_panel.shapes
        if isinstance(each, Text)
    }
    assert {name: truth[int(y), int(x)] for name, (x, y) in names.items()} == {"1": 1, "2": 2}
    assert not any(isinstance(each, Text) for each in errors.shapes)


def test_the_whole_picture_tells_figures_counts_and_colors(drawn):
    """Title, captions, and a legend with each mark's color and share."""
    cells, truth, found = drawn
    comparison = compare(truth, found)
    page = case_sheet(draw_panels(cells, comparison), comparison, score(truth, found), "group/name")
    texts = [each.text for each in page.shapes if isinstance(each, Text)]
    assert any(text.startswith("group/name   iou_seg ") and text.endswith(" 2/2") for text in texts)
    assert {"map", "truth: 2 rooms", "errors"} <= set(texts)
    assert any(text.startswith("merged: the found room is another's (20.0%)") for text in texts)
    assert sum(isinstance(each, Picture) for each in page.shapes) == 4
    legend = {tuple(color) for color in page.pixels()[-60:].reshape(-1, 3).tolist()}
    assert set(MARK_COLORS.values()) <= legend
    rightmost = max(each.x for each in page.shapes if isinstance(each, Text))
    assert rightmost < page.width


def test_a_map_without_any_room_or_known_cell_is_drawn():
    """Nothing found, nothing true, nothing known: a picture all the same."""
    none = np.zeros((5, 4), int)
    comparison = compare(none, none)
    panels = draw_panels(np.full((5, 4), -1, np.int8), comparison)
    page = case_sheet(panels, comparison, score(none, none), "empty")
    assert page.pixels().dtype == np.uint8


@pytest.fixture
def result(tmp_path: Path) -> CaseResult:
    """Two rooms, found as one."""
    Image.fromarray(two_rooms()).save(tmp_path / "map.png")
    free = two_rooms() == 254
    truth = np.where(free, 1 + (np.arange(240) >= 117)[None], 0)
    write_label_image(tmp_path / "rooms.png", truth)
    case = Case("drawn", "flat", tmp_path / "map.png", tmp_path / "rooms.png", RESOLUTION_M)
    found = free.astype(np.int32)
    return CaseResult(case, found, score(truth, found), 50.0, 0.1)


def test_pictures_and_sheets_of_pages(result: CaseResult, tmp_path: Path):
    """One more case than a page holds makes a second page."""
    with CasePictures(tmp_path / "out") as pictures:
        for _ in range(COLUMNS * ROWS + 1):
            pictures.add(result)
    names = {path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*.png")}
    assert names == {"drawn/flat.png", "drawn.sheet_1.png", "drawn.sheet_2.png"}
    with (
        Image.open(tmp_path / "out/drawn.sheet_1.png") as one,
        Image.open(tmp_path / "out/drawn.sheet_2.png") as two,
    ):
        assert one.height > (ROWS - 0.5) * two.height
        assert one.width > COLUMNS * two.width
        assert two.width == pytest.approx(3 * TILE_PX[0], abs=1)


def test_the_truth_that_counted_is_shown_and_named(result: CaseResult, tmp_path: Path):
    """Found as one, which is what the second truth says: its panel has one room, and all of it is right."""
    write_label_image(tmp_path / "other.png", result.labels)
    case = dataclasses.replace(result.case, rooms_other_path=tmp_path / "other.png")
    scores = score(case.truth("rooms_other"), result.labels)
    better = dataclasses.replace(result, case=case, scores=scores, truth="rooms_other")
    shown = {}
    for name, each in (("one truth", result), ("two truths", better)):
        with CasePictures(tmp_path / name) as pictures:
            pictures.add(each)
        with Image.open(tmp_path / name / "drawn" / "flat.png") as image:
            shown[name] = {
                tuple(color) for color in np.unique(np.asarray(image).reshape(-1, 3), axis=0).tolist()
            }
    # Both legends show all marks once; only the map of the first has merged cells over a whole room.
    assert tinted(2) in shown["one truth"]
    assert tinted(2) not in shown["two truths"]


def test_a_second_truth_is_named_in_the_caption(drawn):
    """Only where there are two."""
    cells, truth, found = drawn
    comparison, scores = compare(truth, found), score(truth, found)
    panels = draw_panels(cells, comparison)
    for name, caption in (
        (None, "truth: 2 rooms"),
        ("rooms_other", "truth that agrees better (rooms_other): 2 rooms"),
    ):
        page = case_sheet(panels, comparison, scores, "group/name", name)
        assert caption in {each.text for each in page.shapes if isinstance(each, Text)}


def test_no_sheet_after_an_error(result: CaseResult, tmp_path: Path):
    """A run that breaks off leaves the pictures so far, and no sheet that looks whole."""

    def broken_off() -> None:
        with CasePictures(tmp_path / "out") as pictures:
            pictures.add(result)
            raise RuntimeError

    with pytest.raises(RuntimeError):
        broken_off()
    assert (tmp_path / "out" / "drawn" / "flat.png").exists()
    assert not list((tmp_path / "out").glob("*.sheet_*.png"))


def test_figures_along_a_run_of_one_map_are_drawn():
    """An axis of no length would divide by zero."""
    scores = Scores(1.0, 2.0, 3.0, 40.0, 50.0, 6.0, 0, 0)
    page = draw_along("one", [RunPoint("m", 1.0, scores)])
    texts = {each.text for each in page.shapes if isinstance(each, Text)}
    assert {"one", "iou_seg", "iou_gt", "iou_sym", "rooms found", "rooms true", "coverage, %"} <= texts
