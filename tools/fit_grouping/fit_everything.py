"""Remakes all that is fitted, step by step; a step whose file exists is not made again.

    python tools/fit_grouping/fit_everything.py WORK --cases CASES [--buildings 5000] [--tree-buildings 800]
        [--network-seconds 7200] [--fold-seconds 3600] [--trees 250] [--seed 0]

WORK holds the simulated maps, checkpoints, answers and samples, and in the end `borders.onnx`, `joins.npz`,
`outside.npz` (fitted on all maps), and `figures.md` (with the building left out).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from fit_grouping.figures import figures_table
from fit_grouping.fit_tree import (
    Example,
    TreeParameters,
    columns_of,
    examples_of,
    fit_trees,
    gather,
    left_out_scores,
    scores_at,
)
from fit_grouping.keeping import kept
from fit_grouping.maps_with_truth import FOLDS, load_benchmark
from fit_grouping.outside import fit_outside
from fit_grouping.preparing import PreparedMap, answered, prepared_benchmark, prepared_simulated
from fit_grouping.sampling import Samples, by_hand
from fit_grouping.scores import best_iou_sym
from fit_grouping.tree_files import write_trees
from rose2_logs.config.parameters import RegionParameters
from rose2_logs.segmentation.regions.features import REGION_FEATURES, SHAPE_FEATURES
from rose2_logs.segmentation.regions.joining import Strength, join_regions
from rose2_logs.segmentation.regions.outside import rooms_of
from rose2_logs.segmentation.regions.strengths import BoostedTrees, JoinStrength

HERE = Path(__file__).parent
MAPS_PER_FILE = 400
SIMULATED_WEIGHT = 0.15
"""Weight of a simulated map in the fit of the trees, beside 1 for a real building of one map."""
REGIONS = RegionParameters()
LEVELS = tuple(np.arange(-1.5, 1.51, 0.5).tolist())


def run_tool(script: str, *arguments: object) -> None:
    """Run one of the scripts beside this one."""
    subprocess.run([sys.executable, str(HERE / script), *map(str, arguments)], check=True)


def make_buildings(work: Path, count: int, tree_count: int, seed: int) -> None:
    """Simulated maps for the network, and others for the trees: those are fitted on its answers for them."""
    first = seed * 1_000_000 + 1
    for folder, wanted in (("buildings", count), ("tree_buildings", tree_count)):
        for number, done in enumerate(range(0, wanted, MAPS_PER_FILE)):
            maps = min(MAPS_PER_FILE, wanted - done)
            path = work / folder / f"{number:03d}.npz"
            if not path.exists():
                run_tool("buildings/make_buildings.py", path, "--count", maps, "--seed", first)
            first += maps


def train_networks(work: Path, cases: Path, seconds: float, fold_seconds: float, seed: int) -> None:
    """One network on simulated maps, from it one for each fold left out, and one on all maps."""
    common = ("--simulated", work / "buildings", "--keep", work / "rasters")
    base = work / "networks/simulated"
    run_tool("train_network.py", base, *common, "--seconds", seconds, "--seed", seed)
    real = (
        "--cases",
        cases,
        "--real-share",
        0.5,
        "--start",
        base.with_suffix(".pt"),
        "--seconds",
        fold_seconds,
    )
    for fold in (*range(FOLDS), -2):  # no map is in fold -2: it leaves out nothing
        out = work / f"networks/{f'fold{fold}' if fold >= 0 else 'all'}"
        run_tool("train_network.py", out, *common, *real, "--leave-out", fold, "--seed", seed)


def samples_of(examples: Sequence[Example], parameters: TreeParameters, seed: int) -> list[list[Samples]]:
    """Decisions of each map under the strength by hand, once without and once with noise."""
    return [
        [gather([e], by_hand, 0.0, seed), gather([e], by_hand, parameters.noise, seed + 1)] for e in examples
    ]


def fit_on(parts: Sequence[Sequence[Samples]], parameters: TreeParameters, seed: int) -> BoostedTrees:
    """Trees on shape features from the decisions of maps; each map's weigh as `gather` says."""
    flat = [s for part in parts for s in part]
    samples = Samples(
        *(np.concatenate([getattr(s, name) for s in flat]) for name in ("features", "right", "weight"))
    )
    return fit_trees(samples, columns_of(SHAPE_FEATURES), parameters, seed)


def summed(trees: BoostedTrees) -> JoinStrength:
    """The strength as the package uses it."""
    return JoinStrength(trees, REGIONS.answer_weight, REGIONS.answer_scale)


def room_of_atoms(example: Example, region: NDArray[np.int64], rule: BoostedTrees) -> NDArray[np.int64]:
    """Room 1.. of each atom, 0 for what is outside or too small."""
    regions, _ = example.graph.joined(region)
    return rooms_of(regions, rule, REGIONS)[0][region]


def regions_of(examples: Sequence[Example], strength: Strength) -> list[NDArray[np.int64]]:
    """Region of each atom of each map, joined as long as that is more likely right than wrong."""
    return [join_regions(e.graph, strength, 0.0).regions(0.0) for e in examples]


def main() -> None:
    """Make, train, fit, measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--cases", type=Path, required=True)
    parser.add_argument("--buildings", type=int, default=5000)
    parser.add_argument("--tree-buildings", type=int, default=800)
    parser.add_argument("--network-seconds", type=float, default=7200.0)
    parser.add_argument("--fold-seconds", type=float, default=3600.0)
    parser.add_argument("--trees", type=int, default=250)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    work, cases, seed = arguments.work, arguments.cases, arguments.seed
    make_buildings(work, arguments.buildings, arguments.tree_buildings, seed)
    train_networks(work, cases, arguments.network_seconds, arguments.fold_seconds, seed)
    maps = prepared_benchmark(load_benchmark(cases), work / "prepared/real.pkl")
    simulated: list[PreparedMap] = []
    for path in sorted((work / "tree_buildings").glob("*.npz")):
        simulated += prepared_simulated(path, work / f"prepared/simulated_{path.stem}.pkl")
    networks = {fold: work / f"networks/fold{fold}.onnx" for fold in range(FOLDS)}
    all_maps = work / "networks/all.onnx"
    answers: list[NDArray[np.float32]] = kept(work / "answers.pkl", lambda: answered(maps, networks))
    simulated_answers = kept(work / "tree_answers.pkl", lambda: answered(simulated, {-1: all_maps}))
    parameters = TreeParameters(trees=arguments.trees, leaves=16)
    real = examples_of(maps, answers)
    made = examples_of(simulated, simulated_answers, SIMULATED_WEIGHT)
    parts = kept(work / "samples.pkl", lambda: samples_of(real, parameters, seed))
    made_parts = kept(work / "tree_samples.pkl", lambda: samples_of(made, parameters, seed))
    fold_of = np.array([one.fold for one in maps])
    trees = [
        fit_on([p for p, f in zip(parts, fold_of, strict=True) if f != fold] + made_parts, parameters, seed)
        for fold in range(FOLDS)
    ]
    rows = {}
    for name, strengths in (
        ("network alone", [JoinStrength(None, 1.0, REGIONS.answer_scale)] * len(maps)),
        ("trees alone", [trees[f] for f in fold_of]),
        ("sum", [summed(trees[f]) for f in fold_of]),
    ):
        rows[name], _ = left_out_scores(maps, scores_at(real, strengths, LEVELS))
    rows["sum, rule for outside"] = np.zeros(len(maps))
    for fold in range(FOLDS):
        regions = regions_of(real, summed(trees[fold]))
        others = np.flatnonzero(fold_of != fold).tolist()
        rule = fit_outside([real[k] for k in others], [regions[k] for k in others], seed)
        for k in np.flatnonzero(fold_of == fold).tolist():
            rooms = room_of_atoms(real[k], regions[k], rule)
            rows["sum, rule for outside"][k] = best_iou_sym(maps[k].tables, rooms)
    (work / "figures.md").write_text(figures_table(maps, rows) + "\n", encoding="utf-8")
    final = fit_on(parts + made_parts, parameters, seed)
    write_trees(work / "joins.npz", final)
    regions = regions_of(real, summed(final))
    write_trees(work / "outside.npz", fit_outside(real, regions, seed), REGION_FEATURES)
    (work / "borders.onnx").write_bytes(all_maps.read_bytes())
    print((work / "figures.md").read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
