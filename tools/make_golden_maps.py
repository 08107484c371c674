#!/usr/bin/env python3
"""Make the maps and rooms that the tests of the segmentation hold it to, in tests/segmentation/golden.

    python tools/make_golden_maps.py           # segment the maps that are there again, say what changed
    python tools/make_golden_maps.py --maps    # draw and simulate the maps anew as well

Each file holds the ``cells`` (H, W) int8 of a map, its ``resolution_m``, and labels (H, W) of its rooms by
each grouping of the floor: ``fitted`` and ``walls``.
Run it after a change that is meant to change rooms, look at what changed, and commit the files with it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import Parameters
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.segmentation.pipeline import analyze

PROJECT = Path(__file__).resolve().parents[1]
GOLDEN = PROJECT / "tests" / "segmentation" / "golden"
GROUPINGS = ("fitted", "walls")
MARGIN_CELLS = 10
"""Unknown cells that stay around a map when it is cut out."""
SIMULATED = (
    ("straight", 3, 1.0),
    ("straight", 11, 0.5),
    ("bent", 2, 1.0),
    ("ring", 5, 1.0),
    ("ring", 7, 0.5),
    ("hall", 4, 1.0),
    ("flat", 2, 1.0),
    ("campus", 8, 1.0),
    ("campus", 9, 0.6),
)
"""Style and seed of a building, and the share of its exploration after which the map is taken."""


def drawn() -> Iterator[tuple[str, NDArray[np.int8], float]]:
    """Name, cells and resolution of offices drawn by hand: turned, cluttered, coarse, half seen."""
    sys.path.append(str(PROJECT / "tests" / "support"))
    from drawn_maps import office  # type: ignore[import-not-found]

    yield "office_turned", office(turn_rad=0.4, clutter=25)[0], 0.05
    yield "office_coarse", office(resolution_m=0.1, clutter=10)[0], 0.1
    cells, _ = office(turn_rad=0.1, clutter=8)
    cells[:, 170:] = -1
    yield "office_half_seen", cells, 0.05


def simulated() -> Iterator[tuple[str, NDArray[np.int8], float]]:
    """Name, cells and resolution of maps that robots make of furnished buildings."""
    from simulation.make_building import simulate_building
    from simulation.runs import equipped_run

    for style, seed, share in SIMULATED:
        steps = list(equipped_run(simulate_building(seed, style), seed, map_every_s=20.0))
        step = steps[round(share * (len(steps) - 1))]
        row, column = np.nonzero(step.cells != -1)
        low = np.maximum([row.min() - MARGIN_CELLS, column.min() - MARGIN_CELLS], 0)
        window = step.cells[low[0] : row.max() + MARGIN_CELLS, low[1] : column.max() + MARGIN_CELLS]
        yield f"{style}_{seed}_{100 * share:.0f}", window, step.geometry.resolution_m


def kept() -> Iterator[tuple[str, NDArray[np.int8], float]]:
    """Name, cells and resolution of the maps that are there."""
    for path in sorted(GOLDEN.glob("*.npz")):
        with np.load(path) as file:
            yield path.stem, file["cells"], float(file["resolution_m"])


def rooms_of(cells: NDArray[np.int8], resolution_m: float, grouping: str) -> NDArray[np.int16]:
    """Segment a map (H, W)."""
    parameters = Parameters.from_any({"floor_plan.grouping": grouping})
    geometry = GridGeometry(resolution_m, (0.0, 0.0), 0.0, "map", (cells.shape[0], cells.shape[1]))
    snapshot = OccupancySnapshot(0, 1, 1, "/map", cells, geometry)
    return analyze(snapshot, parameters).rooms.labels.astype(np.int16)


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--maps", action="store_true", help="make the maps anew too, not only their rooms")
    arguments = parser.parse_args()
    GOLDEN.mkdir(exist_ok=True)
    maps = [*drawn(), *simulated()] if arguments.maps else list(kept())
    for name, cells, resolution_m in maps:
        path = GOLDEN / f"{name}.npz"
        labels = {grouping: rooms_of(cells, resolution_m, grouping) for grouping in GROUPINGS}
        before = dict(np.load(path)) if path.exists() else {}
        np.savez_compressed(path, cells=cells, resolution_m=resolution_m, **labels)  # type: ignore[arg-type]
        for grouping, rooms in labels.items():
            same = grouping in before and np.array_equal(before[grouping], rooms)
            print(f"{name}, {grouping}: {rooms.max()} rooms, {'the same' if same else 'CHANGED'}")


if __name__ == "__main__":
    main()
