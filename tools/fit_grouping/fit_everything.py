"""Remakes all that is fitted, step by step; a step whose file exists is not made again.

    python tools/fit_grouping/fit_everything.py WORK --cases CASES [--buildings 5000] [--tree-buildings 800]
        [--network-seconds 7200] [--fold-seconds 3600] [--trees 250] [--seeds 3] [--processes 1]

WORK holds simulated maps, checkpoints, prepared maps, and for each seed folders `seedS/foldK` with what
was fitted without the buildings of fold K. `seed0/all` holds what was fitted on all maps, and its
`manifest.json`: that is what the package ships.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from fit_grouping.fit_tree import Example, TreeParameters, columns_of, examples_of, fit_trees, gather
from fit_grouping.keeping import kept
from fit_grouping.maps_with_truth import FOLDS, load_benchmark
from fit_grouping.outside import fit_outside
from fit_grouping.own_rooms import fit_own_rooms
from fit_grouping.preparing import PreparedMap, answered, prepared_benchmark, prepared_simulated
from fit_grouping.sampling import Samples, by_hand
from fit_grouping.tree_files import write_trees
from rose2_logs.config.regions import RegionParameters
from rose2_logs.segmentation.regions.features import REGION_FEATURES, SHAPE_FEATURES
from rose2_logs.segmentation.regions.fitted import (
    FILES,
    JOINS,
    MANIFEST,
    NETWORK,
    OUTSIDE,
    OWN_ROOMS,
    sha256_of,
)
from rose2_logs.segmentation.regions.joining import join_regions
from rose2_logs.segmentation.regions.own_rooms import OWN_ROOM_FEATURES
from rose2_logs.segmentation.regions.strengths import BoostedTrees, FittedStrength

HERE = Path(__file__).parent
MAPS_PER_FILE = 400
SIMULATED_WEIGHT = 0.15
"""Weight of a simulated map in the fit of the trees, beside 1 for a real building of one map."""
REAL_SHARE = 0.5
"""Share of the crops that come from real maps when a network goes on from simulated ones."""
ALL = -2
"""Instead of the number of a fold: no map is in it, so that nothing is left out."""
REGIONS = RegionParameters()


def run_tool(script: str, *arguments: object) -> None:
    """Run one of the scripts beside this one."""
    subprocess.run([sys.executable, str(HERE / script), *map(str, arguments)], check=True)


def make_buildings(work: Path, count: int, tree_count: int) -> None:
    """Simulated maps for the network, and others for the trees: those are fitted on its answers for them."""
    first = 1
    for folder, wanted in (("buildings", count), ("tree_buildings", tree_count)):
        for number, done in enumerate(range(0, wanted, MAPS_PER_FILE)):
            maps = min(MAPS_PER_FILE, wanted - done)
            path = work / folder / f"{number:03d}.npz"
            if not path.exists():
                run_tool("buildings/make_buildings.py", path, "--count", maps, "--seed", first)
            first += maps


def network_file(work: Path, seed: int, fold: int) -> Path:
    """Network of a seed that did not see a fold."""
    return work / f"networks/seed{seed}_{'all' if fold == ALL else f'fold{fold}'}"


def train_networks(
    work: Path, cases: Path, seconds: float, fold_seconds: float, seeds: int, how: Sequence[object]
) -> None:
    """One network on simulated maps, and from it for each seed one for each fold left out, and one on all."""
    common: tuple[object, ...] = ("--simulated", work / "buildings", "--keep", work / "rasters")
    common += tuple(how)
    base = work / "networks/simulated"
    run_tool("train_network.py", base, *common, "--seconds", seconds)
    real = ("--cases", cases, "--real-share", REAL_SHARE, "--start", base.with_suffix(".pt"))
    for seed in range(seeds):
        for fold in (*range(FOLDS), *([ALL] if seed == 0 else [])):
            options = ("--seconds", fold_seconds, "--leave-out", fold, "--seed", seed)
            run_tool("train_network.py", network_file(work, seed, fold), *common, *real, *options)


def take_network(work: Path, network: Path, seeds: int) -> None:
    """Take a network that there is instead of training any."""
    for seed in range(seeds):
        for fold in (*range(FOLDS), *([ALL] if seed == 0 else [])):
            path = network_file(work, seed, fold).with_suffix(".onnx")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(network.read_bytes())


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


def regions_of(examples: Sequence[Example], trees: BoostedTrees) -> list[NDArray[np.int64]]:
    """Region of each atom of each map, joined as the package does."""
    strength = FittedStrength.of_joins(trees, REGIONS)
    return [join_regions(e.graph, strength, REGIONS.detail).regions(REGIONS.detail) for e in examples]


def fit_seed(
    work: Path,
    maps: list[PreparedMap],
    simulated: list[PreparedMap],
    parameters: TreeParameters,
    seed: int,
) -> None:
    """Fit the trees and the rule for outside of a seed, for each fold and on all maps."""
    networks = {fold: network_file(work, seed, fold).with_suffix(".onnx") for fold in range(FOLDS)}
    everything = network_file(work, 0, ALL).with_suffix(".onnx")
    answers = kept(work / f"answers/seed{seed}.pkl", lambda: answered(maps, networks))
    made_answers = kept(work / "answers/simulated.pkl", lambda: answered(simulated, {-1: everything}))
    real = examples_of(maps, answers)
    made = examples_of(simulated, made_answers, SIMULATED_WEIGHT)
    parts = kept(work / f"samples/seed{seed}.pkl", lambda: samples_of(real, parameters, seed))
    made_parts = kept(work / f"samples/simulated{seed}.pkl", lambda: samples_of(made, parameters, seed))
    for fold in (*range(FOLDS), *([ALL] if seed == 0 else [])):
        folder = work / f"seed{seed}/{'all' if fold == ALL else f'fold{fold}'}"
        if (folder / NETWORK).exists():
            continue
        seen = [k for k, one in enumerate(maps) if one.fold != fold]
        trees = fit_on([parts[k] for k in seen] + made_parts, parameters, seed)
        write_trees(folder / JOINS, trees)
        examples = [real[k] for k in seen] + made
        regions = regions_of(examples, trees)
        write_trees(folder / OUTSIDE, fit_outside(examples, regions, seed), REGION_FEATURES)
        own_rooms = fit_own_rooms(examples, regions, FittedStrength.of_joins(trees, REGIONS), REGIONS, seed)
        write_trees(folder / OWN_ROOMS, own_rooms, OWN_ROOM_FEATURES)
        network = everything if fold == ALL else networks[fold]
        (folder / NETWORK).write_bytes(network.read_bytes())


def write_manifest(folder: Path, facts: dict[str, object]) -> None:
    """Name the files of a folder and how they were made."""
    hashes = {name: sha256_of(folder / name) for name in FILES}
    text = json.dumps({"sha256": hashes, **facts}, indent=2)
    (folder / MANIFEST).write_text(text + "\n", encoding="utf-8")


def main() -> None:
    """Make, train, fit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--cases", type=Path, required=True)
    parser.add_argument("--buildings", type=int, default=5000)
    parser.add_argument("--tree-buildings", type=int, default=800)
    parser.add_argument("--network-seconds", type=float, default=7200.0)
    parser.add_argument("--fold-seconds", type=float, default=3600.0)
    parser.add_argument("--processes", type=int, default=1, help="CPU cores that train a network together")
    parser.add_argument("--bfloat16", action="store_true", help="train in 16 bits, see train_network.py")
    parser.add_argument("--network", type=Path, help="ONNX file to take instead of training one")
    parser.add_argument("--trees", type=int, default=250)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    work, cases = arguments.work, arguments.cases
    make_buildings(work, arguments.buildings, arguments.tree_buildings)
    if arguments.network:
        take_network(work, arguments.network, arguments.seeds)
    else:
        seconds = arguments.network_seconds, arguments.fold_seconds
        how = ["--processes", arguments.processes, *(["--bfloat16"] if arguments.bfloat16 else [])]
        train_networks(work, cases, *seconds, arguments.seeds, how)
    maps = prepared_benchmark(load_benchmark(cases), work / "prepared/real.pkl")
    simulated: list[PreparedMap] = []
    for path in sorted((work / "tree_buildings").glob("*.npz")):
        simulated += prepared_simulated(path, work / f"prepared/simulated_{path.stem}.pkl")
    parameters = TreeParameters(trees=arguments.trees, leaves=16)
    for seed in range(arguments.seeds):
        fit_seed(work, maps, simulated, parameters, seed)
    facts: dict[str, object] = {
        "simulated maps for the network": arguments.buildings,
        "simulated maps for the trees": len(simulated),
        "real maps": len(maps),
        "real buildings": len({one.building for one in maps}),
        "folds": FOLDS,
        "seeds": arguments.seeds,
        "trees": arguments.trees,
    }
    write_manifest(work / "seed0/all", facts)


if __name__ == "__main__":
    main()
