"""Report, figures, exports and comparisons are made of stored data, without the log and its outputs."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from finished_runs import SAMPLE_LOGS

import rose2_logs as rl
from rose2_logs.errors import OutputError, ResultsError
from rose2_logs.outputs.exports.formats import FORMATS
from rose2_logs.outputs.report.page import write_report
from rose2_logs.runs.run import Run
from rose2_logs.workflows.compare import FILES, compare_runs
from rose2_logs.workflows.figure import export_plan, write_figure

OPTIONS = {"max_snapshots": 4, "back_project": True}


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> tuple[Path, Path]:
    """Results with recording and annotated MCAP, and results without, whose log is gone."""
    place = tmp_path_factory.mktemp("stored")
    log = shutil.copy(SAMPLE_LOGS / "office.mcap", place / "office.mcap")
    full = rl.analyze(log, place / "full" / "office", layers=(), **OPTIONS).folder
    bare = rl.analyze(log, place / "bare" / "office", recording=False, annotated_log=False, **OPTIONS).folder
    log.unlink()
    assert (full / "office.rrd").exists()
    assert (full / "office.rose2.mcap").exists()
    assert not [file for file in bare.iterdir() if file.suffix not in (".parquet", ".json")]
    return full, bare


MAKERS: dict[str, Callable[[Path, Path], object]] = {
    "figure": lambda folder, out: write_figure(folder, out / "figure.png"),
    "figure of a map": lambda folder, out: write_figure(folder, out / "figure.svg", 1),
    "figure at a coverage": lambda folder, out: write_figure(folder, out / "half.png", coverage=0.5),
    "back-projected": lambda folder, out: write_figure(folder, out / "b.svg", 1, back_projected=True),
    "exports": lambda folder, out: export_plan(folder, list(FORMATS), out),
    "exports of a map": lambda folder, out: export_plan(folder, list(FORMATS), out, 1),
}


@pytest.mark.parametrize("kind", MAKERS)
def test_the_same_is_made_without_recording_and_annotated_log(folders, tmp_path: Path, kind: str):
    made = []
    for name, folder in zip(("full", "bare"), folders, strict=True):
        out = tmp_path / name
        out.mkdir()
        MAKERS[kind](folder, out)
        made.append({file.name: file.read_bytes() for file in out.iterdir()})
    assert made[0]
    assert made[0] == made[1]


def test_the_report_differs_in_times_and_names_of_files_alone(folders, tmp_path: Path):
    full, bare = (shutil.copytree(folder, tmp_path / folder.parent.name / "office") for folder in folders)
    seconds = json.loads((full / "summary.json").read_text())["seconds"]
    summary = json.loads((bare / "summary.json").read_text())
    (bare / "summary.json").write_text(json.dumps(summary | {"seconds": seconds}))
    one, other = (
        write_report(folder, tmp_path / "page.html", overwrite=True).read_text() for folder in (full, bare)
    )
    listed = "<li>office.*</li>|<li>[a-z_]+[.](json|parquet).*</li>"
    of_files = re.compile(f"{listed}|<p [^>]*>[^<]*<code>rose2-logs view office.rrd</code></p>")
    assert of_files.sub("", one).split() == of_files.sub("", other).split()
    assert len(one) > 10_000


def test_tables_do_not_depend_on_the_outputs(folders):
    full, bare = folders
    names = sorted(file.name for file in bare.glob("*.parquet"))
    assert names == sorted(file.name for file in full.glob("*.parquet"))
    for name in names:
        assert (full / name).read_bytes() == (bare / name).read_bytes(), name


@pytest.fixture
def no_analysis(monkeypatch):
    """Whatever analyzes a map or opens a log fails."""

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("maps are neither read nor analyzed once more")

    for name in (
        "rose2_logs.segmentation.pipeline.analyze",
        "rose2_logs.runs.stream.analyze",
        "rose2_logs.io.opening.open_log",
        "rose2_logs.workflows.analyze.open_log",
    ):
        monkeypatch.setattr(name, refuse)


@pytest.mark.usefixtures("no_analysis")
def test_runs_are_compared_by_their_stored_walls_and_maps(folders, tmp_path: Path):
    """A run with itself: everything is the same, and lies where it lay."""
    full, bare = folders
    for number, (a, b) in enumerate([(full, bare), (bare, full)]):
        compare_runs(Run(a), Run(b), tmp_path / str(number), recording=False)
    for name in FILES[:2]:
        assert (tmp_path / "0" / name).read_bytes() == (tmp_path / "1" / name).read_bytes()
    found = rl.compare(full, bare)
    rooms = len(rl.load(full)[-1].rooms)
    assert found.room_counts == {"same": rooms}
    assert found.placement.motion.pose == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    assert found.walls is not None
    assert rl.compare(rl.load(full), str(bare)).room_counts == found.room_counts


@pytest.mark.usefixtures("no_analysis")
def test_a_comparison_is_written_and_not_replaced_unasked(folders, tmp_path: Path):
    full, bare = folders
    found = rl.compare(full, bare, tmp_path / "out")
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == sorted(FILES)
    with pytest.raises(OutputError, match="overwrite=True"):
        rl.compare(full, bare, tmp_path / "out")
    again = rl.compare(full, bare, tmp_path / "out", overwrite=True)
    assert again.room_counts == found.room_counts


def test_what_cannot_be_compared_is_one_line(folders, tmp_path: Path):
    with pytest.raises(ResultsError, match="holds no summary"):
        rl.compare(folders[0], tmp_path)
