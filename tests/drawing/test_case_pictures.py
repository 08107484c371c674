"""One picture a case, and contact sheets of each group in pages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rose2_logs.drawing.case_pictures import COLUMNS, ROWS, CasePictures
from saved_maps import RESOLUTION_M, two_rooms

from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.evaluation.benchmark import CaseResult
from rose2_logs.evaluation.cases import Case
from rose2_logs.evaluation.scores import score


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
        assert one.height == ROWS * two.height


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
