"""Takes what was fitted into the package, its tests and its documentation.

    python tools/fit_grouping/adopt_fits.py WORK --cases CASES

WORK is that of `fit_everything.py`, measured by `left_out_figures.py`. What was fitted on all maps goes to
the package, what was fitted without the second fold to the tests, together with its figures. Golden maps are
made anew, and the tables of the pages that show figures. Sentences with figures in them are left to a
person: `git diff` shows which tables moved.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarking.markdown import percent
from benchmarking.page import (
    NamedMethod,
    PageFigures,
    building_means,
    figures_lines,
    measure_page,
    methods_lines,
)
from benchmarking.robustness import Robustness, check_robustness, robustness_table, sampled

from rose2_logs.config.parameters import Parameters
from rose2_logs.evaluation.cases import load_cases
from rose2_logs.segmentation.regions import fitted

PROJECT = Path(__file__).resolve().parents[2]
TESTS = PROJECT / "tests" / "segmentation"
TESTED_FOLD = 1
"""The tests hold what was fitted without this fold."""
TESTED_MAPS = (
    "full/freiburg_building79",
    "full/map15",
    "full/map_with_clutter",
    "survey_empty/NLB",
    "survey_furnished/Freiburg79_scan_furnitures",
    "incremental_fr79/map06",
    "incremental_fr79/map12",
    "campus/floor1",
    "homes/a03",
    "homes/b09",
    "homes/b27",
    "places/cic",
    "places/bookstore",
)
"""Maps of this fold whose figures the tests hold."""
CHANGED_MAPS = 2
"""Of each group so many maps are changed in ways that should not matter."""
LEFT_OUT = "**rose2**, building left out"
GROUP_NAMES = {
    "survey_empty": "survey, empty",
    "survey_furnished": "survey, furnished",
    "incremental_fr79": "exploration, Freiburg 079",
    "incremental_intel": "exploration, Intel Research Lab",
}
SHORT_GROUP_NAMES = GROUP_NAMES | {"incremental_fr79": "fr79", "incremental_intel": "intel"}


def take_fits(work: Path) -> None:
    """Copy what was fitted; the manifest tells the hashes of the files beside it."""
    for name in (*fitted.FILES, fitted.MANIFEST):
        shutil.copyfile(work / "seed0/all" / name, fitted.FOLDER / name)
    for name in fitted.FILES:
        tested = TESTS / "regions" / f"without_fold_{TESTED_FOLD}" / name
        shutil.copyfile(work / f"seed0/fold{TESTED_FOLD}" / name, tested)


def take_figures(work: Path) -> None:
    """Write the figures that the tests hold."""
    with (work / "left_out.csv").open(encoding="utf-8") as file:
        found = {f"{row['group']}/{row['map']}": float(row["seed 0"]) for row in csv.DictReader(file)}
    path = TESTS / "regions" / "left_out.json"
    path.write_text(json.dumps({name: found[name] for name in TESTED_MAPS}, indent=2) + "\n", "utf-8")


def write_pages(work: Path, cases: Path) -> None:
    """Write the tables of the accuracy page, the model card and the readme of this folder."""
    method = NamedMethod(LEFT_OUT, "rose2", Parameters(), work / "seed0/predictions")
    figures = measure_page([cases], [method], sample=0)
    accuracy = PROJECT / "docs" / "accuracy.md"
    text = accuracy.read_text("utf-8")
    text = with_rows(text, "| group | maps | precision", renamed(rows_of(figures_lines(figures, LEFT_OUT))))
    text = with_row(text, f"| {LEFT_OUT} |", rows_of(methods_lines(figures))[0])
    changed = rows_of(robustness_table(_changed(cases)))
    text = with_rows(text, "| group (maps) | quarter turn", renamed(changed, SHORT_GROUP_NAMES))
    accuracy.write_text(text, "utf-8")
    card = PROJECT / "docs" / "model_card.md"
    text = card.read_text("utf-8")
    text = with_rows(text, "| building | maps | left out", _building_rows(figures, text))
    card.write_text(text, "utf-8")
    readme = Path(__file__).with_name("README.md")
    text = readme.read_text("utf-8")
    for row in (work / "figures.md").read_text("utf-8").splitlines():
        if row.startswith("| seed"):
            text = with_row(text, row[: row.index("|", 2) + 1], row)
    readme.write_text(text, "utf-8")


def _changed(cases: Path) -> list[Robustness]:
    """Rooms of some maps that are changed in ways that should not matter, with the defaults."""
    chosen = sampled(load_cases(cases), CHANGED_MAPS)
    return list(check_robustness(chosen, "rose2", Parameters()))


def _building_rows(figures: PageFigures, text: str) -> list[str]:
    """Rows of the buildings; those of `walls` stay as they are."""
    by_walls = dict(re.findall(r"^\| (\S[^|]*?) \| \d+ \| [\d.]+ \| ([\d.]+) \|$", text, re.MULTILINE))
    return [
        f"| {name} | {figures.buildings.count(name)} | {percent(mean)} | {by_walls.get(name, '')} |"
        for name, mean in building_means(figures, LEFT_OUT).items()
    ]


def rows_of(lines: Sequence[str]) -> list[str]:
    """Rows of a table below its head."""
    return [line for line in lines if line.startswith("|")][2:]


def renamed(rows: Sequence[str], names: dict[str, str] = GROUP_NAMES) -> list[str]:
    """Rows whose groups have the names that people read."""
    return [
        re.sub(r"^\| (\w+)", lambda found: f"| {names.get(found[1], found[1])}", row, count=1) for row in rows
    ]


def with_rows(text: str, head: str, rows: Sequence[str]) -> str:
    """A page whose first table with a head that begins so has these rows."""
    begin = text.index("\n" + head) + 1
    begin = text.index("\n", text.index("\n", begin) + 1) + 1
    end = begin
    while text.startswith("|", end):
        end = text.index("\n", end) + 1
    return text[:begin] + "".join(f"{row}\n" for row in rows) + text[end:]


def with_row(text: str, start: str, row: str) -> str:
    """A page whose first line that begins so is a row."""
    begin = text.index("\n" + start) + 1
    return text[:begin] + row + text[text.index("\n", begin) :]


def main() -> None:
    """Take it all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--cases", type=Path, required=True)
    arguments = parser.parse_args()
    take_fits(arguments.work)
    take_figures(arguments.work)
    subprocess.run([sys.executable, str(PROJECT / "tools" / "make_golden_maps.py")], check=True)
    write_pages(arguments.work, arguments.cases)


if __name__ == "__main__":
    main()
