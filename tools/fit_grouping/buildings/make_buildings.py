"""Makes simulated maps with true rooms and keeps them in a file.

python tools/fit_grouping/buildings/make_buildings.py OUT.npz --count 400 --seed 1 [--kinds suites,loop]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from fit_grouping.buildings.bending import bent
from fit_grouping.buildings.furniture import STYLES, Furnisher
from fit_grouping.buildings.makers import KINDS, make_plan
from fit_grouping.buildings.sensing import SimulatedMap, make_map
from fit_grouping.buildings.walls import build_walls
from rose2_logs.system.files import replacing

FURNISHING = {
    "villa": [0.06, 0.02, 0.77, 0.0, 0.15, 0.0],
    "home": [0.12, 0.08, 0.6, 0.0, 0.2, 0.0],
    "office": [0.13, 0.2, 0.0, 0.45, 0.22, 0.0],
    "cubicles": [0.25, 0.55, 0.0, 0.2, 0.0, 0.0],
    "campus": [0.2, 0.05, 0.0, 0.58, 0.17, 0.0],
    "passage": [0.5, 0.0, 0.0, 0.4, 0.1, 0.0],
    "offices": [0.04, 0.0, 0.0, 0.14, 0.12, 0.7],
    "faculty": [0.06, 0.0, 0.0, 0.2, 0.14, 0.6],
    "depot": [0.05, 0.0, 0.0, 0.6, 0.35, 0.0],
    "arena": [0.1, 0.0, 0.55, 0.15, 0.2, 0.0],
    "shop": [0.0, 0.0, 0.0, 0.6, 0.4, 0.0],
    "hall": [0.1, 0.0, 0.0, 0.6, 0.3, 0.0],
    "suites": [0.05, 0.04, 0.0, 0.16, 0.1, 0.45, 0.2],
    "loop": [0.05, 0.05, 0.0, 0.1, 0.1, 0.35, 0.35],
    "openhome": [0.08, 0.02, 0.72, 0.0, 0.12, 0.0, 0.06],
    "wings": [0.06, 0.02, 0.0, 0.17, 0.1, 0.5, 0.15],
    "gallery": [0.1, 0.0, 0.0, 0.5, 0.25, 0.0, 0.15],
    "warehouse": [0.05, 0.0, 0.0, 0.6, 0.35],
    "hallways": [0.08, 0.02, 0.75, 0.0, 0.15],
    "cellular": [0.02, 0.04, 0.0, 0.2, 0.1, 0.44, 0.2],
    "partitions": [0.25, 0.05, 0.0, 0.5, 0.2],
}
"""Shares of the furnishing styles for each kind of plan, in the order of `furniture.STYLES`; none of the last
ones where the list is shorter."""


def simulate(seed: int, kinds: Collection[str] = KINDS) -> SimulatedMap:
    """One map of a kind of the given ones; the same for the same seed and kinds."""
    rng = np.random.default_rng(seed)
    while True:
        plan = make_plan(rng, kinds)
        if not plan.rooms.any():
            continue
        walled = build_walls(rng, plan)
        shares = FURNISHING[plan.kind]
        style = str(rng.choice(STYLES[: len(shares)], p=shares))
        furniture = Furnisher(rng, walled, style).furnish()
        if plan.things is not None:
            furniture |= plan.things
        walled, furniture = bent(rng, walled, furniture)
        made = make_map(rng, walled, furniture, style)
        if made is not None:
            return made


def write_maps(path: Path, maps: list[SimulatedMap]) -> None:
    """Keep maps in one compressed file."""
    arrays = {}
    for number, made in enumerate(maps):
        arrays[f"map_{number}"] = made.gray
        for which, truth in enumerate(made.truths):
            arrays[f"rooms_{number}_{which}"] = truth.astype(np.uint16)
    arrays["kinds"] = np.array([made.kind for made in maps])
    with replacing(path) as part, part.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def read_maps(path: Path) -> Iterator[SimulatedMap]:
    """Maps of a file in the order in which they were made."""
    with np.load(path) as arrays:
        names = set(arrays.files)
        for number, kind in enumerate(arrays["kinds"]):
            truths = [
                arrays[f"rooms_{number}_{k}"].astype(np.int32)
                for k in (0, 1)
                if f"rooms_{number}_{k}" in names
            ]
            yield SimulatedMap(str(kind), arrays[f"map_{number}"], tuple(truths))


def main() -> None:
    """Make the maps and say what they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1, help="number of the first map's seed")
    parser.add_argument(
        "--kinds",
        type=lambda text: text.split(","),
        default=KINDS,
        metavar="KIND,...",
        help=f"kinds of plans to make, in their usual shares (all): {', '.join(KINDS)}",
    )
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.kinds) - set(KINDS))
    if unknown:
        parser.error(f"no such kind of plan: {', '.join(unknown)}; there are {', '.join(KINDS)}")
    cv2.setNumThreads(1)
    start = time.perf_counter()
    seeds = range(arguments.seed, arguments.seed + arguments.count)
    maps = [simulate(seed, arguments.kinds) for seed in seeds]
    write_maps(arguments.out, maps)
    counts = Counter(made.kind.split("/")[0] for made in maps)
    print(f"{len(maps)} maps in {time.perf_counter() - start:.0f} s: {dict(counts)}")


if __name__ == "__main__":
    main()
