"""Measures maps that are built from laser scans: how well they agree with recorded ones, and how fast.

OMP_NUM_THREADS=1 python tools/measure_scan_maps.py --seeds 1 2 3 4 5 --carmen ../shared/carmen/*.log.gz

For each seed a robot explores a simulated building. Its log holds the maps of the run as its mapper made
them, the transforms, and the scans of its lidar: 360 beams, ten times a second, each beam measured from where
the robot was at that moment. The mapper uses one scan every 35 cm, as those of SLAM packages do; the maps
built from scans use one every 20 cm or less, so the two maps are of the same run, but not of the same
measurements.

The columns of the table, for the last map of each log:

- `agree`: cells known in both maps that are free in both or occupied in both, %
- `walls`: occupied cells of the recorded map that are, within one cell, occupied in the built one, %
- `known`: cells known in the recorded map that are known in the built one, too, %
- `rooms`: found in the recorded map and in the built one, and their `iou_sym` in %
- `entered`: the same of the rooms that the robot has been in. What it only looked into, through a door or a
  window, is stray rays in the recorded map and a floor in the built one, which has many more beams there
- `scans/s`: scans per second of processor time that is needed to open the log and build all of its maps
- `speed`: how many times as long the log lasts as this takes

CARMEN logs hold no map: of these the table has the rooms in the last built map and the speed. Where the
stamps of a log are damaged, its scans count as one second apart, and its speed says nothing.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

sys.path.insert(0, str(Path(__file__).parent))

from log_writing import MAP, SCAN, TOPICS_WITH_SCANS, robot_log
from simulation.building import Building, FloatArray
from simulation.exploration import PoseSample, RobotSettings, explore
from simulation.layout import STYLES
from simulation.lidar import Lidar
from simulation.make_building import simulate_building

import rose2_logs as rl
from rose2_logs.evaluation.scores import Scores, score
from rose2_logs.io.carmen import SCAN_TOPIC
from rose2_logs.model.occupancy import OccupancySnapshot

LIDAR = Lidar(beams=360)
SCAN_PERIOD_S = 0.1
SWEEP_S = SCAN_PERIOD_S * LIDAR.field_of_view_rad / (2 * np.pi)
"""A lidar that turns once per scan and measures during a part of the turn."""
SECTORS = 8
"""Parts of a scan that are measured from one place each: the robot moves less than half a cell in a scan."""
TRANSFORM_PERIOD_S = 0.05
START_NS = 1_700_000_000_000_000_000


@dataclass(frozen=True)
class Row:
    """One log.

    Attributes
    ----------
    name : str
    cost : Cost
        Of building its maps.
    rooms : int
        In the last built map.
    agreement : Agreement or None
        With the recorded map, where there is one.
    """

    name: str
    cost: Cost
    rooms: int
    agreement: Agreement | None = None

    @property
    def cells(self) -> tuple[str, ...]:
        """What stands in the table."""
        a = self.agreement
        compared = ["", "", "", str(self.rooms), "", "", ""]
        if a is not None:
            compared = [f"{a.agree:.2f}", f"{a.walls:.1f}", f"{a.known:.1f}"]
            for scores in (a.rooms, a.entered):
                compared += [f"{scores.rooms_gt:.0f} / {scores.rooms_seg:.0f}", f"{scores.iou_sym:.1f}"]
        cost = self.cost
        rates = (f"{rate / cost.processor_s:.0f}" for rate in (cost.scans, cost.duration_s))
        return (self.name, f"{cost.duration_s:.0f}", *compared, *rates)


@dataclass(frozen=True)
class Cost:
    """What building the maps of a log takes: scans, seconds that the log lasts, seconds of processor time."""

    scans: int
    duration_s: float
    processor_s: float


@dataclass(frozen=True)
class Agreement:
    """How a built map agrees with the recorded one, in percent; see the module."""

    agree: float
    walls: float
    known: float
    rooms: Scores
    entered: Scores


class Trajectory:
    """Where the robot was at every moment of a run: between two scans of its mapper it turned, then drove."""

    def __init__(self, samples: Sequence[PoseSample], robot: RobotSettings) -> None:
        times, rows = [samples[0].time_s], [_row(samples[0])]
        for one, other in pairwise(samples):
            before, after = rows[-1], _row(other)
            for heading in (2, 8):  # of the truth and of the odometry, without jumps by whole turns
                turns = np.round((after[heading] - before[heading]) / (2 * np.pi))
                after[heading] -= 2 * np.pi * turns
            turned_s = one.time_s + abs(after[2] - before[2]) / robot.turn_rate_rad_s
            share = (turned_s - one.time_s) / max(other.time_s - one.time_s, 1e-9)
            turned = before + share * (after - before)
            turned[[0, 1, 6, 7]] = before[[0, 1, 6, 7]]
            turned[[2, 8]] = after[[2, 8]]
            times += [turned_s, other.time_s]
            rows += [turned, after]
        self._times, self._rows = np.array(times), np.array(rows)

    @property
    def end_s(self) -> float:
        """Time of the last pose."""
        return float(self._times[-1])

    def at(self, times_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """True poses, those in the map, and those by odometry, each (N, 3)."""
        found = np.stack([np.interp(times_s, self._times, column) for column in self._rows.T], 1)
        return found[:, :3], found[:, :3] + found[:, 3:6], found[:, 6:]


def _row(sample: PoseSample) -> FloatArray:
    """True pose, error of the pose in the map, and odometry (9,)."""
    return np.concatenate([sample.truth, sample.estimate - sample.truth, sample.odometry])


def write_run(path: Path, building: Building, seed: int, max_time_s: float) -> None:
    """Explore a building and write what the robot records: maps, transforms and scans."""
    robot = RobotSettings()
    steps = list(explore(building, seed, lidar=LIDAR, robot=robot, max_time_s=max_time_s))
    way = Trajectory([pose for step in steps for pose in step.poses], robot)
    rng = np.random.default_rng([seed, 3])
    pose_times = np.arange(0, way.end_s, TRANSFORM_PERIOD_S)
    scan_times = np.arange(0, way.end_s - SCAN_PERIOD_S, SCAN_PERIOD_S)
    within = (np.arange(SECTORS) + 0.5) * SWEEP_S / SECTORS
    # In the order of time; of the same time, transforms come first.
    events = sorted(
        [(at, 0, k) for k, at in enumerate(pose_times)]
        + [(at, 1, k) for k, at in enumerate(scan_times)]
        + [(step.time_s, 2, k) for k, step in enumerate(steps)]
    )
    _, in_map, odometry = way.at(pose_times)
    with robot_log(path, START_NS, {"seed": str(seed)}, topics=TOPICS_WITH_SCANS) as log:
        for at, kind, k in events:
            if kind == 0:
                log.write_pose(at, in_map[k], odometry[k])
            elif kind == 1:
                ranges_m = LIDAR.scan(building, way.at(at + within)[0], rng)
                log.write_scan(at, LIDAR, ranges_m, sweep_s=SWEEP_S, period_s=SCAN_PERIOD_S)
            else:
                log.write_map(at, steps[k].cells, steps[k].geometry)


def built_map(path: Path, topic: str) -> tuple[OccupancySnapshot, Cost]:
    """Build all maps of a log and return the last one."""
    begin = time.process_time()
    with rl.open_log(path, map_from=topic) as reader:
        *_, last = reader.snapshots()
        info = reader.info
    assert info.start_ns is not None
    assert info.end_ns is not None
    processor_s = time.process_time() - begin
    scans = next(each.message_count for each in info.topics if each.name == topic)
    return last, Cost(scans or 0, (info.end_ns - info.start_ns) / 1e9, processor_s)


def agreement(recorded: OccupancySnapshot, built: OccupancySnapshot, way_m: FloatArray) -> Agreement:
    """Compare two maps of one run, and the rooms that are found in them; the robot's way is (N, 2)."""
    on_recorded = _moved(built.cells, built, recorded, nothing=-1)
    is_known, is_wall = recorded.cells != -1, recorded.cells == 100
    both = is_known & (on_recorded != -1)
    built_walls = binary_dilation(on_recorded == 100, np.ones((3, 3)))
    truth, found = (rl.segment(each).labels for each in (recorded, built))
    found = _moved(found, built, recorded, nothing=0)
    way = recorded.geometry.world_to_cell(way_m)
    entered = (_entered(*rooms, way) for rooms in ((truth, found), (found, truth)))
    return Agreement(
        agree=100 * float((recorded.cells == on_recorded)[both].mean()),
        walls=100 * float(built_walls[is_wall].mean()),
        known=100 * float(both.sum() / is_known.sum()),
        rooms=score(truth, found),
        entered=score(*entered),
    )


def _entered(rooms: NDArray[np.int32], others: NDArray[np.int32], way: NDArray[np.intp]) -> NDArray[np.int32]:
    """The rooms (H, W) that the robot has been in, or in the room that they mostly are of the other map.

    The cells of its way are (N, 2); which room has those in a doorway may differ between the maps.
    """
    counts = (int(rooms.max()) + 1, int(others.max()) + 1)
    pairs = rooms.astype(np.int64) * counts[1] + others
    shared = np.bincount(pairs.ravel(), minlength=counts[0] * counts[1]).reshape(counts)
    counterpart = np.where(2 * shared.max(axis=1) > shared.sum(axis=1), shared.argmax(axis=1), 0)
    been, been_there = (np.zeros(count, bool) for count in counts)
    been[rooms[tuple(way.T)]] = been_there[others[tuple(way.T)]] = True
    been_there[0] = False
    return np.where((been | been_there[counterpart])[rooms], rooms, 0)


def _moved(
    cells: NDArray[np.signedinteger], of: OccupancySnapshot, to: OccupancySnapshot, *, nothing: int
) -> NDArray[np.signedinteger]:
    """The cells of one map at the places of those of another one; `nothing` outside."""
    places = of.geometry.world_to_cell(to.geometry.cell_centers(*np.indices(to.cells.shape)))
    inside = ((places >= 0) & (places < cells.shape)).all(-1)
    moved = np.full(to.cells.shape, nothing, cells.dtype)
    moved[inside] = cells[tuple(places[inside].T)]
    return moved


def measure_simulated(seed: int, style: str, folder: Path, max_time_s: float) -> Row:
    """Simulate a run and measure its maps."""
    path = folder / f"{style}_{seed}.mcap"
    write_run(path, simulate_building(seed, style), seed, max_time_s)
    built, cost = built_map(path, SCAN)
    with rl.open_log(path, topic=MAP) as reader:
        recorded = reader.last()
        way = reader.robot_path(recorded.geometry.frame_id).until(recorded.log_time_ns)
    found = agreement(recorded, built, way[:, :2])
    return Row(f"{style}, seed {seed}", cost, round(found.rooms.rooms_seg), found)


def measure_carmen(path: Path) -> Row:
    """Measure the maps of a CARMEN log."""
    built, cost = built_map(path, SCAN_TOPIC)
    return Row(path.name, cost, len(rl.segment(built).rooms))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, nargs="*", default=[], help="simulated runs")
    parser.add_argument(
        "--styles", nargs="+", default=STYLES[:5], choices=STYLES, help="of the buildings, in turn"
    )
    parser.add_argument(
        "--max-time", type=float, default=3600, help="of a simulated run, s; by default all is explored"
    )
    parser.add_argument("--carmen", type=Path, nargs="*", default=[], help="CARMEN logs")
    parser.add_argument("--logs", type=Path, help="folder that keeps the simulated logs")
    given = parser.parse_args(arguments)
    print(
        "| log | s | agree, % | walls, % | known, % | rooms | iou_sym | entered | iou_sym | scans/s | speed |"
    )
    print(f"|---|{'---:|' * 10}")
    with TemporaryDirectory(prefix="rose2_logs_") as temporary:
        folder = given.logs or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for k, seed in enumerate(given.seeds):
            style = given.styles[k % len(given.styles)]
            _print(measure_simulated(seed, style, folder, given.max_time))
    for path in given.carmen:
        _print(measure_carmen(path))
    return 0


def _print(row: Row) -> None:
    print(f"| {' | '.join(row.cells)} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
