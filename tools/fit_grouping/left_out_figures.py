"""Measures the whole analysis with the building left out: every map by what was fitted without its fold.

    python tools/fit_grouping/left_out_figures.py WORK --cases CASES [--seeds 3]

WORK is that of `fit_everything.py`. `WORK/left_out.csv` holds a row per map, `WORK/figures.md` the table, and
`WORK/seedS/predictions` the label images, which `tools/benchmark.py tables` takes as a method of its own.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1]))

from fit_grouping.figures import figures_table
from fit_grouping.maps_with_truth import FOLDS, TruthMap, load_benchmark, on_blocks
from fit_grouping.scores import iou_sym, overlap_table
from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.evaluation.cases import load_cases
from rose2_logs.model.explored import ExploredPart
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.segmentation.regions import fitted


@contextmanager
def fitted_from(folder: Path) -> Iterator[None]:
    """Let the analysis take what was fitted from another folder."""
    shipped = fitted.FOLDER
    readers = (fitted.answering_network, fitted.join_trees, fitted.outside_trees, fitted.own_room_trees)
    try:
        fitted.FOLDER = folder
        for read in readers:
            read.cache_clear()
        yield
    finally:
        fitted.FOLDER = shipped
        for read in readers:
            read.cache_clear()


def scores_of_fold(
    maps: list[TruthMap], cases: Path, fold: int, folder: Path, predictions: Path
) -> dict[int, float]:
    """iou_sym by number of the maps of a fold; their labels are kept as images."""
    scores = {}
    with fitted_from(folder):
        for number, (one, case) in enumerate(zip(maps, load_cases(cases), strict=True)):
            if one.fold != fold:
                continue
            snapshot = case.snapshot()
            found = analyze(snapshot)
            image = predictions / one.group / f"{one.name}.png"
            image.parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(np.flipud(found.labels).astype(np.uint16)).save(image)
            part = ExploredPart.of(snapshot.cells, snapshot.geometry, OccupancyParameters())
            labels = on_blocks(part, found.labels)
            scores[number] = max(iou_sym(overlap_table(labels, truth)) for truth in one.truths)
    return scores


def main() -> None:
    """Print and keep the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--cases", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    maps = load_benchmark(arguments.cases)
    rows = {}
    for seed in range(arguments.seeds):
        scores: dict[int, float] = {}
        for fold in range(FOLDS):
            own = arguments.work / f"seed{seed}"
            folder, predictions = own / f"fold{fold}", own / "predictions"
            scores |= scores_of_fold(maps, arguments.cases, fold, folder, predictions)
        rows[f"seed {seed}"] = np.array([scores[k] for k in range(len(maps))])
    rows["mean of the seeds"] = np.mean(list(rows.values()), axis=0)
    with (arguments.work / "left_out.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["group", "map", "building", "fold", *rows])
        for k, one in enumerate(maps):
            values = [f"{row[k]:.2f}" for row in rows.values()]
            writer.writerow([one.group, one.name, one.building, one.fold, *values])
    table = figures_table(maps, rows)
    (arguments.work / "figures.md").write_text(table + "\n", encoding="utf-8")
    print(table)


if __name__ == "__main__":
    main()
