"""The benchmark's command line on two tiny cases, and its parts."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from saved_maps import RESOLUTION_M, two_rooms

from rose2_logs.drawing.image_files import write_label_image
from rose2_logs.errors import CasesError, ParameterError
from rose2_logs.evaluation.cases import Case
from rose2_logs.segmentation.pipeline import METHODS

PROJECT = Path(__file__).parents[2]


def write_cases(folder: Path, group: str = "incremental_drawn") -> Path:
    """Two maps of a run through two rooms, with their true rooms, as a file of cases."""
    folder.mkdir(parents=True, exist_ok=True)
    listed = []
    for name, seen in (("half", 180), ("whole", 240)):
        image = two_rooms(seen)
        Image.fromarray(image).save(folder / f"{name}.png")
        truth = np.where(image == 254, 1 + (np.arange(240) >= 117)[None], 0)
        write_label_image(folder / f"{name}.rooms.png", truth)
        files = {"map": f"{name}.png", "rooms": f"{name}.rooms.png"}
        listed.append({"group": group, "name": name, "resolution_m": RESOLUTION_M} | files)
    (folder / "cases.json").write_text(json.dumps({"cases": listed}))
    return folder / "cases.json"


@pytest.fixture
def ablations(tmp_path: Path) -> Path:
    path = tmp_path / "ablations.toml"
    path.write_text(
        '[[ablation]]\nname = "no rooms"\nsentence = "No room is large enough."\n'
        'set = ["regions.room_min_area_m2 = 1e4"]\n'
    )
    return path


def test_accuracy_writes_one_report(tmp_path: Path, ablations: Path):
    """The real command: figures, curves, pictures, one ablation and robustness of two tiny maps."""
    cases, out = write_cases(tmp_path / "cases"), tmp_path / "out"
    command = [sys.executable, PROJECT / "tools" / "benchmark.py", "accuracy", "--cases", cases]
    command += ["--methods", METHODS[0], "--ablations", ablations, "-o", out]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, str(out / "report.md")), done.stderr
    report = json.loads((out / "report.json").read_text())
    method = report["methods"][METHODS[0]]
    assert method["groups"]["incremental_drawn"]["iou_sym"] > 90
    assert [point["name"] for point in method["along"]["incremental_drawn"]] == ["half", "whole"]
    (ablation,) = report["ablations"]
    assert ablation["groups"]["incremental_drawn"]["iou_sym"] == 0
    rows = report["robustness"][METHODS[0]]
    assert [row["name"] for row in rows] == ["half", "whole"]
    assert rows[1]["iou_sym"]["padding"] == pytest.approx(100)
    assert all(value > 80 for row in rows for value in row["iou_sym"].values())
    text = (out / "report.md").read_text()
    gain = method["groups"]["incremental_drawn"]["iou_sym"]
    assert f"| no rooms | **\N{MINUS SIGN}{gain:.1f}**" in text
    for link in ("along/incremental_drawn.png", "pictures/rose2/incremental_drawn.sheet_1.png"):
        assert f"]({link})" in text
        assert (out / link).exists()
    assert "[whole](pictures/rose2/incremental_drawn/whole.png)" in text


def test_a_wrong_ablation_is_named_before_anything_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """One line with the entry's name and the parameter that does not exist."""
    from benchmark import main

    path = tmp_path / "ablations.toml"
    path.write_text('[[ablation]]\nname = "gone"\nsentence = "s"\nset = ["walls.nothing = 1"]\n')
    cases = write_cases(tmp_path / "cases")
    arguments = ["--cases", str(cases), "--ablations", str(path), "-o", str(tmp_path / "out")]
    assert main(["accuracy", *arguments]) == 2
    assert "ablation 'gone'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_parts_can_be_left_out(tmp_path: Path):
    """Without pictures, ablations and robustness the report holds the figures alone."""
    from benchmark import main

    arguments = ["--cases", str(write_cases(tmp_path, "drawn")), "-o", str(tmp_path / "out")]
    arguments += ["--methods", METHODS[0], "--skip", "ablations", "robustness", "pictures"]
    assert main(["accuracy", *arguments]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["report.json", "report.md"]
    text = (tmp_path / "out" / "report.md").read_text()
    assert "Ablations" not in text
    assert "Robustness" not in text


def test_groups_of_one_name_in_two_files_are_refused(tmp_path: Path):
    """Their means would mix."""
    from benchmarking.accuracy import load_all_cases

    one, two = write_cases(tmp_path / "one", "a"), write_cases(tmp_path / "two", "b")
    assert len(load_all_cases([one, two])) == 4
    with pytest.raises(CasesError, match="'a'"):
        load_all_cases([one, one])


def test_the_data_files_beside_the_tool_can_be_used():
    """Every ablation changes the defaults; targets and published figures are as they are defined."""
    from benchmarking.references import load_ablations, load_published

    from rose2_logs.config.parameters import Parameters

    ablations = load_ablations()
    assert len({ablation.name for ablation in ablations}) == len(ablations)
    assert all(ablation.parameters(None, ()) != Parameters() for ablation in ablations)
    published = load_published()
    listed = [figures for group in published.groups.values() for figures in group.values()]
    for figures in [*published.targets.values(), *listed, *published.elsewhere.values()]:
        assert figures["iou_sym"] == pytest.approx((figures["iou_seg"] + figures["iou_gt"]) / 2, abs=0.51)


@pytest.mark.parametrize("text", ["groups = 3", "[groups.full]\ntarget = {magic = 1.0}", "[["])
def test_published_figures_that_cannot_be_read_are_one_line(tmp_path: Path, text: str):
    """The file is named."""
    from benchmarking.references import load_published

    (tmp_path / "published.toml").write_text(text)
    with pytest.raises(ParameterError, match=r"published\.toml"):
        load_published(tmp_path / "published.toml")


def test_samples_are_spread_over_each_group():
    """First and last of a group, and no more than there are."""
    from benchmarking.robustness import sampled

    cases = [Case(group, str(i), Path("m"), Path("r"), 0.05) for group in "ab" for i in range(5)]
    assert [case.name for case in sampled(cases, 3)] == ["0", "2", "4"] * 2
    assert sampled(cases[:1], 3) == (cases[0],)
    assert sampled(cases, None) == tuple(cases)
