"""Measures what perfect grouping of atoms would give.

python tools/fit_grouping/upper_bounds.py CASES [--every N]
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from fit_grouping.atoms import AtomParameters, PlanFrame, cut_atoms, find_generous_structure
from fit_grouping.maps_with_truth import load_benchmark
from fit_grouping.scores import overlap_table, upper_bound


def main() -> None:
    """Print the bound by group, the number of atoms, and the time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=Path)
    parser.add_argument("--every", type=int, default=1, help="take every n-th map")
    parser.add_argument("--atom-min-m2", type=float, nargs="+", default=[AtomParameters.atom_min_m2])
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    maps = load_benchmark(arguments.cases)[:: arguments.every]
    groups = list(dict.fromkeys(m.group for m in maps))
    print(
        " " * 24
        + " ".join(f"{g[-9:]:>9s}" for g in groups)
        + "   mean | atoms median, max | s structure, atoms"
    )
    for least_m2 in arguments.atom_min_m2:
        parameters = replace(AtomParameters(), atom_min_m2=least_m2)
        bounds: dict[str, list[float]] = {}
        counts, seconds = [], []
        for truth_map in maps:
            start = time.perf_counter()
            free, occupied, cell = truth_map.free, truth_map.occupied, truth_map.resolution_m
            structure = find_generous_structure(free, occupied, cell, parameters)
            middle = time.perf_counter()
            frame = PlanFrame.of(free | occupied, structure.direction_rad, cell, parameters.plan_cell_m)
            atoms = cut_atoms(free, occupied, structure.faces, frame, cell, parameters)
            seconds.append((middle - start, time.perf_counter() - middle))
            counts.append(int(atoms.max()))
            bound = upper_bound(overlap_table(atoms, truth) for truth in truth_map.truths)
            bounds.setdefault(truth_map.group, []).append(bound)
        means = [float(np.mean(bounds[g])) for g in groups]
        print(
            f"atoms of {least_m2:.2f} m2".ljust(24)
            + " ".join(f"{m:9.1f}" for m in means)
            + f" {np.mean(means):6.2f} | {np.median(counts):.0f} {max(counts)} | "
            + " ".join(f"{s:.3f}" for s in np.mean(seconds, 0)),
            flush=True,
        )


if __name__ == "__main__":
    main()
