"""Measures what perfect grouping of atoms would give.

python tools/fit_grouping/upper_bounds.py CASES [--every N]
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from fit_grouping.maps_with_truth import load_benchmark
from fit_grouping.preparing import atoms_of
from fit_grouping.scores import overlap_table, upper_bound
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.regions import RegionParameters


def main() -> None:
    """Print the bound by group, the number of atoms, and the time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=Path)
    parser.add_argument("--every", type=int, default=1, help="take every n-th map")
    parser.add_argument("--atom-min-m2", type=float, nargs="+", default=[RegionParameters.atom_min_m2])
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    maps = load_benchmark(arguments.cases)[:: arguments.every]
    groups = list(dict.fromkeys(m.group for m in maps))
    print(" " * 24 + " ".join(f"{g[-9:]:>9s}" for g in groups) + "   mean | atoms median, max | s")
    for least_m2 in arguments.atom_min_m2:
        parameters = Parameters.from_any({"regions.atom_min_m2": least_m2})
        bounds: dict[str, list[float]] = {}
        counts, seconds = [], []
        for truth_map in maps:
            start = time.perf_counter()
            atoms = atoms_of(truth_map, parameters).cells
            seconds.append(time.perf_counter() - start)
            counts.append(int(atoms.max()))
            bound = upper_bound(overlap_table(atoms, truth) for truth in truth_map.truths)
            bounds.setdefault(truth_map.group, []).append(bound)
        means = [float(np.mean(bounds[g])) for g in groups]
        print(
            f"atoms of {least_m2:.2f} m2".ljust(24)
            + " ".join(f"{m:9.1f}" for m in means)
            + f" {np.mean(means):6.2f} | {np.median(counts):.0f} {max(counts)} | "
            + f"{np.mean(seconds):.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
