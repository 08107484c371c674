"""Measures how well the shapes of half seen rooms are predicted, along runs whose rooms are known.

python tools/measure_shapes.py CASES.json --groups incremental_fr79 incremental_intel --simulated 20

For each map of a run and each room that is found in it, the table compares two answers to "what will this
room be in the end?": its shape with the predicted part, and its seen cells alone. Both are measured by their
IoU with the true room: of the run's last map, or of the simulated building. Rooms are sorted by the share of
the true room that the map knows. A room counts for the true room that it holds most of, if most of the room
lies in it; so rooms that were grouped wrongly are left out. Cells of walls do not count: a shape ends in the
middle of a wall, a true room at its face.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.signal import fftconvolve
from shapely.affinity import affine_transform

sys.path.insert(0, str(Path(__file__).parent))

from simulation.building import Building
from simulation.exploration import explore
from simulation.layout import STYLES
from simulation.make_building import simulate_building
from simulation.runs import random_equipment

from rose2_logs.evaluation.cases import Case, load_cases
from rose2_logs.model.occupancy import BoolArray, GridGeometry, OccupancySnapshot
from rose2_logs.segmentation.floor_plan.faces import rasterize
from rose2_logs.segmentation.pipeline import analyze

MAPS_PER_RUN = 8
"""Maps that are kept of a simulated run, evenly spread."""
WALL_REACH_M = 0.35
"""Cells outside true rooms that are this near to one are taken for walls: the thickest outer wall."""
FIRST_SEED = 500
"""Of the simulated buildings."""


@dataclass(frozen=True, eq=False)
class Run:
    """Successive maps of one building, on one grid, and its rooms.

    Attributes
    ----------
    name : str
    maps : tuple of OccupancySnapshot
    rooms : (H, W) int32
        The true rooms, 0 for none.
    counts : (H, W) bool
        Cells that count: not walls.
    """

    name: str
    maps: tuple[OccupancySnapshot, ...]
    rooms: NDArray[np.int32]
    counts: BoolArray


@dataclass(frozen=True)
class RoomSeen:
    """One room in one map.

    Attributes
    ----------
    run : str
        Name of its run.
    share : float
        How much of the true room the map knows.
    seen, predicted : float
        IoU with the true room of its cells and of its shape.
    """

    run: str
    share: float
    seen: float
    predicted: float


def compare(labels: NDArray[np.int32], shapes: Sequence[NDArray[np.bool_]], run: Run) -> Iterator[RoomSeen]:
    """Compare the rooms of one map with the true ones.

    Parameters
    ----------
    labels : (H, W) int32
        Rooms of the free cells.
    shapes : sequence of (H, W) bool
        Cells of the shape of each room.
    """
    truth = np.where(run.counts, run.rooms, 0)
    known = np.bincount(truth[labels > 0], minlength=truth.max() + 1)
    whole = np.bincount(truth.ravel())
    common = np.zeros((labels.max() + 1, len(whole)), int)
    np.add.at(common, (labels[run.counts], truth[run.counts]), 1)
    for number, shape in enumerate(shapes, start=1):
        partner = int(common[number, 1:].argmax()) + 1
        overlap = common[number, partner]
        if overlap < common[number].sum() / 2 or common[1:, partner].argmax() + 1 != number or overlap == 0:
            continue
        target = truth == partner
        yield RoomSeen(
            run.name,
            known[partner] / whole[partner],
            _iou((labels == number) & run.counts, target),
            _iou(shape & run.counts, target),
        )


def _iou(one: BoolArray, other: BoolArray) -> float:
    return float((one & other).sum()) / max(1.0, float((one | other).sum()))


def measure(run: Run) -> Iterator[RoomSeen]:
    """Find the rooms in every map of a run and compare them."""
    for snapshot in run.maps:
        rooms = analyze(snapshot).rooms
        resolution_m = snapshot.geometry.resolution_m
        polygons = [
            shapely.transform(shape, lambda xy, origin=snapshot.geometry.origin_xy_m: xy - origin)
            for shape in rooms.polygons
        ]
        cells = [_cells_of(shape, rooms.labels.shape, resolution_m) for shape in polygons]
        yield from compare(rooms.labels, cells, run)


def _cells_of(shape: shapely.Geometry, size: tuple[int, int], resolution_m: float) -> BoolArray:
    return rasterize(np.array([shape]), np.array([1], np.int32), size, resolution_m) > 0


def benchmark_run(name: str, cases: Sequence[Case]) -> Run:
    """Make a run of the maps of a group; its rooms are those of the last one.

    A mapper that makes its canvas larger moves its corner, which the images do not tell: each map is put
    where its occupied cells fit those of the next one best.
    """
    snapshots = [case.snapshot() for case in cases]
    truth = np.flipud(cases[-1].truth()).astype(np.int32)
    corners = [np.zeros(2, int)]
    for before, after in zip(snapshots[-2::-1], snapshots[:0:-1], strict=True):
        corners.append(corners[-1] + _shift(before.cells > 0, after.cells > 0))
    corners.reverse()
    corner = np.array(corners)
    sizes = np.array([snapshot.cells.shape for snapshot in snapshots])
    low, high = corner.min(0), (corner + sizes).max(0)
    moved = []
    for snapshot, (row, column) in zip(snapshots, corner - low, strict=True):
        cells = np.full(high - low, -1, np.int8)
        cells[row : row + snapshot.cells.shape[0], column : column + snapshot.cells.shape[1]] = snapshot.cells
        moved.append(_on_canvas(snapshot, cells, snapshot.geometry.resolution_m, (0.0, 0.0)))
    rooms = np.zeros(high - low, np.int32)
    row, column = (corner - low)[-1]
    rooms[row : row + truth.shape[0], column : column + truth.shape[1]] = truth
    return Run(name, tuple(moved), rooms, _apart_from_walls(rooms, snapshots[-1].geometry.resolution_m))


def _shift(before: BoolArray, after: BoolArray) -> NDArray[np.int64]:
    """Row and column in `after` at which the corner of `before` lies."""
    match = fftconvolve(after.astype(np.float32), before[::-1, ::-1].astype(np.float32))
    return np.array(np.unravel_index(int(match.argmax()), match.shape)) - before.shape + 1


def _on_canvas(
    snapshot: OccupancySnapshot,
    cells: NDArray[np.int8],
    resolution_m: float,
    origin_xy_m: tuple[float, float],
) -> OccupancySnapshot:
    geometry = GridGeometry(resolution_m, origin_xy_m, 0.0, "map", (cells.shape[0], cells.shape[1]))
    return replace(snapshot, cells=np.ascontiguousarray(cells), geometry=geometry)


def simulated_run(number: int) -> Run:
    """Simulate a building and explore it."""
    seed, style = FIRST_SEED + number, STYLES[number % len(STYLES)]
    building = simulate_building(seed, style)
    lidar, robot, mapping = random_equipment(seed)
    coarse = replace(robot, scan_distance_m=0.7, scan_turn_rad=0.7)
    steps = list(explore(building, seed, map_every_s=20.0, lidar=lidar, robot=coarse, mapping=mapping))
    keep = np.unique(np.rint(np.linspace(0, len(steps) - 1, MAPS_PER_RUN + 1)).astype(int)[1:])
    return run_of_maps(f"{style} {seed}", building, [(steps[i].cells, steps[i].geometry) for i in keep])


def run_of_maps(name: str, building: Building, maps: Sequence[tuple[NDArray[np.int8], GridGeometry]]) -> Run:
    """Put maps of a simulated building on one grid with its true rooms."""
    resolution_m = maps[0][1].resolution_m
    corners = np.array([np.rint(np.array(g.origin_xy_m)[::-1] / resolution_m) for _, g in maps]).astype(int)
    sizes = np.array([cells.shape for cells, _ in maps])
    low, high = corners.min(0), (corners + sizes).max(0)
    labels, origin_xy_m = building.room_labels(resolution_m)
    corner = np.rint(np.array(origin_xy_m)[::-1] / resolution_m).astype(int)
    low, high = np.minimum(low, corner), np.maximum(high, corner + labels.shape)
    origin = float(low[1] * resolution_m), float(low[0] * resolution_m)
    snapshots = []
    for index, ((cells, _), (row, column)) in enumerate(zip(maps, corners - low, strict=True)):
        canvas = np.full(high - low, -1, np.int8)
        canvas[row : row + cells.shape[0], column : column + cells.shape[1]] = cells
        geometry = GridGeometry(resolution_m, origin, 0.0, "map", canvas.shape)
        snapshots.append(OccupancySnapshot(index, 0, 0, "/map", canvas, geometry))
    shift = 1, 0, 0, 1, -origin[0], -origin[1]
    polygons = [affine_transform(room.polygon, shift) for room in building.rooms]
    numbers = np.array([room.number for room in building.rooms], np.int32)
    rooms = rasterize(np.array(polygons), numbers, canvas.shape, resolution_m)
    return Run(name, tuple(snapshots), rooms, _apart_from_walls(rooms, resolution_m))


def _apart_from_walls(rooms: NDArray[np.int32], resolution_m: float) -> BoolArray:
    away = cv2.distanceTransform((rooms == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    counts: BoolArray = (rooms > 0) | (away * resolution_m > WALL_REACH_M)
    return counts


def table(rows: Sequence[RoomSeen]) -> str:
    """Mean IoU by tenths of the room that was seen."""
    lines = ["| share seen | rooms | seen part | predicted | gain |", "|---|---|---|---|---|"]
    tenth = np.minimum((10 * np.array([row.share for row in rows])).astype(int), 9)
    figures = np.array([(row.seen, row.predicted) for row in rows]) * 100
    for number in range(10):
        chosen = figures[tenth == number]
        if len(chosen):
            seen, predicted = chosen.mean(0)
            lines.append(
                f"| {number / 10:.1f} to {(number + 1) / 10:.1f} | {len(chosen)} "
                f"| {seen:.1f} | {predicted:.1f} | {predicted - seen:+.1f} |"
            )
    return "\n".join(lines)


def main() -> None:
    """Print a table for the benchmark's runs and one for the simulated ones."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("cases", type=Path, nargs="?")
    parser.add_argument("--groups", nargs="*", default=[], help="groups of cases whose maps are runs")
    parser.add_argument("--simulated", type=int, default=20, help="number of simulated runs")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    real = (benchmark_run(group, load_cases(arguments.cases, group)) for group in arguments.groups)
    simulated = (simulated_run(number) for number in range(arguments.simulated))
    for kind, runs in (("explorations of the benchmark", real), ("simulated runs", simulated)):
        rows = [row for run in runs for row in measure(run)]
        if rows:
            print(f"\n{kind}\n\n{table(rows)}")


if __name__ == "__main__":
    main()
