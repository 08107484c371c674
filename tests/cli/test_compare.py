"""`rose2-logs compare` on results of the real command: what it writes, prints and refuses."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from numpy.typing import NDArray
from PIL import Image
from saved_maps import FREE, UNKNOWN, WALL, save_map

import rose2_logs as rl
from rose2_logs.errors import OutputError
from rose2_logs.workflows.compare import FILES

BIN = Path(sys.executable).parent


def three_rooms() -> NDArray[np.uint8]:
    """Gray image of three rooms, 4, 6 and 8 m long and 5 m wide, with doors of 1 m between them."""
    image = np.full((120, 400), UNKNOWN, np.uint8)
    left = 10
    for length in (80, 120, 160):
        image[8:112, left : left + length + 4] = WALL
        image[10:110, left + 2 : left + length + 2] = FREE
        left += length + 2
    for x in (92, 214):
        image[70:90, x - 4 : x + 4] = FREE
    return image


@pytest.fixture
def results(cli, tmp_path: Path) -> tuple[Path, Path]:
    """Results of two runs: three rooms; then upside down, two of them joined, the third seen in part."""
    image = three_rooms()
    before = save_map(tmp_path / "maps", "before", image)
    image[10:110, 88:98] = FREE
    image[:, 280:] = UNKNOWN
    after = save_map(tmp_path / "maps", "after", image[::-1, ::-1].copy())
    assert cli("analyze", before, after, "-o", tmp_path / "results", "--no-rrd")[0] == 0
    return tmp_path / "results" / "before", tmp_path / "results" / "after"


def test_compare_tells_what_differs(cli, results, tmp_path: Path):
    """The second map is laid over the first; the first two rooms are one now, the third was half seen."""
    code, out, err = cli("compare", *results, "-o", tmp_path / "out")
    assert (code, err) == (0, "")
    assert "1 partly seen, 1 merged" in out
    summary = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert summary["same_building"]
    assert abs(summary["b_in_a"]["yaw_rad"]) == pytest.approx(3.1416, abs=0.01)
    assert summary["rooms"] == {"partly seen": 1, "merged": 1}
    seen, merged = pq.read_table(tmp_path / "out" / "room_changes.parquet").to_pylist()
    assert (len(merged["tracks_a"]), len(merged["tracks_b"])) == (2, 1)
    assert (len(seen["tracks_a"]), len(seen["tracks_b"])) == (1, 1)
    assert seen["explored_iou"] > 0.9 > 0.7 > seen["explored_share"]
    # In the frame of the first run, whose map begins at 1, 2.
    assert shapely.from_wkb(merged["shape_b_wkb"]).bounds == pytest.approx((1.5, 2.4, 11.7, 7.6), abs=0.3)
    assert shapely.from_wkb(seen["shape_a_wkb"]).bounds == pytest.approx((11.7, 2.4, 19.8, 7.6), abs=0.3)
    walls = pq.read_table(tmp_path / "out" / "wall_changes.parquet").to_pylist()
    missing = [row["length_m"] for row in walls if row["status"] == "missing"]
    # Five meters with a door of one.
    assert sum(missing) == pytest.approx(4, abs=0.6)
    with Image.open(tmp_path / "out" / "comparison.png") as picture:
        assert picture.width >= 900
    page = (tmp_path / "out" / "comparison.html").read_text(encoding="utf-8")
    assert page.count("<tr>") == 2 + len(walls) + 2  # rooms, walls, and the headings of both tables
    assert "<strong>merged</strong>: several rooms of A are one of B" in page
    assert not re.search(r"@import|url\(|https?://(?!www\.w3\.org/(?:2000/svg|1999/xlink)\b)", page)
    verified = subprocess.run(
        [BIN / "rerun", "rrd", "verify", tmp_path / "out" / "comparison.rrd"],
        capture_output=True,
        check=False,
    )
    assert verified.returncode == 0


def test_the_same_comparison_gives_the_same_tables(cli, results, tmp_path: Path):
    """Byte for byte."""
    for name in ("one", "two"):
        assert cli("compare", *results, "-o", tmp_path / name, "--no-rrd")[0] == 0
    for table in ("room_changes.parquet", "wall_changes.parquet"):
        assert (tmp_path / "one" / table).read_bytes() == (tmp_path / "two" / table).read_bytes()


def test_what_is_not_moved_has_no_sign(cli, results, tmp_path: Path):
    """Not even where the place that was found is too little below zero to be shown."""
    code, out, _ = cli("compare", results[0], results[0], "-o", tmp_path / "same")
    assert code == 0
    assert re.search(r"^B's frame in A's +\+0\.00, \+0\.00 m, turned by \+0\.00 deg", out, re.MULTILINE)


def test_a_comparison_needs_neither_the_annotated_log_nor_the_log(cli, results, tmp_path: Path):
    """The last maps, rooms and walls are stored with the results, and nothing is analyzed again."""
    assert cli("compare", *results, "-o", tmp_path / "with", "--no-rrd")[0] == 0
    for result in results:
        (result / f"{result.name}.rose2.mcap").unlink()
    for file in (tmp_path / "maps").iterdir():
        file.unlink()
    assert cli("compare", *results, "-o", tmp_path / "without", "--no-rrd")[0] == 0
    for table in ("room_changes.parquet", "wall_changes.parquet"):
        assert (tmp_path / "with" / table).read_bytes() == (tmp_path / "without" / table).read_bytes()


def test_what_cannot_be_compared_is_told_in_a_line(cli, results, tmp_path: Path):
    """No results, the folder above them, an earlier comparison."""
    code, _, err = cli("compare", tmp_path / "nowhere", results[1], "-o", tmp_path / "out")
    assert (code, "holds no summary.json; an analysis writes" in err) == (2, True)
    code, _, err = cli("compare", results[0].parent, results[1], "-o", tmp_path / "out")
    assert (code, f"did you mean {results[1]}" in err) == (2, True)
    assert cli("compare", *results, "-o", tmp_path / "out", "--no-rrd")[0] == 0
    code, _, err = cli("compare", *results, "-o", tmp_path / "out", "--no-rrd")
    assert (code, "--overwrite" in err) == (2, True)
    assert cli("compare", *results, "-o", tmp_path / "out", "--no-rrd", "--overwrite")[0] == 0


def test_a_comparison_that_replaces_one_leaves_nothing_of_it(cli, results, tmp_path: Path):
    """Its recording would be taken for that of the new one."""
    out = tmp_path / "out"
    assert cli("compare", *results, "-o", out)[0] == 0
    assert (out / "comparison.rrd").exists()
    code, said, _ = cli("compare", *results[::-1], "-o", out, "--no-rrd", "--overwrite")
    assert (code, "comparison.rrd" in said) == (0, False)
    assert sorted(file.name for file in out.iterdir()) == sorted(FILES[:-1])


def test_a_comparison_is_not_mixed_into_the_results_of_a_run(cli, results):
    """Whichever run it is, and even if an earlier comparison may be replaced."""
    before, after = results
    files = sorted(after.iterdir())
    code, out, err = cli("compare", before, after, "-o", after, "--overwrite")
    assert (code != 0, out) == (True, "")
    told = "holds the results of a run; write the comparison to another folder"
    assert told in " ".join(err.split())
    with pytest.raises(OutputError, match=told):
        rl.compare(before, after, out=after, overwrite=True)
    assert sorted(after.iterdir()) == files
