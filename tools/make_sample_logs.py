#!/usr/bin/env python3
"""Make the sample logs, or a benchmark of simulated maps: simulated robots explore simulated buildings.

Examples
--------
    # remake sample_logs/
    python tools/make_sample_logs.py
    # logs of the same kind, of other buildings
    python tools/make_sample_logs.py --output DIR --seed 7
    # maps with true rooms of 20 buildings, for `rose2-logs evaluate DIR/cases.json`
    python tools/make_sample_logs.py --cases DIR --count 20 --seed 100
    # every map of 20 whole runs, for `rose2-logs evaluate DIR/cases.json --along`
    python tools/make_sample_logs.py --runs DIR --count 20 --seed 100

The same options give the same bytes.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from log_writing import NANOSECONDS, robot_log
from simulation.layout import STYLES
from simulation.make_building import simulate_building
from simulation.runs import thinned_run
from simulation.truth import write_case, write_truth

START_NS = 1_700_000_000 * NANOSECONDS
"""The runs' first moment: any fixed time, so that remade files are the same."""
MAPS_PER_LOG = 40
MAPS_PER_RUN = 20
SAMPLES = (
    ("office.mcap", "straight", 1.0, False),
    ("wing.bag", "bent", 0.0, False),
    ("ring", "ring", -1.5, True),
)
"""File, style of the building, its turn against the map in degrees, and whether the maps hold probabilities
as Cartographer's do, or three values as GMapping's do."""
PARTIAL_SHARES = (0.2, 0.5)
"""Parts of a run whose maps become partial benchmark cases."""


def make_sample_logs(output: Path, seed: int) -> None:
    """Write one log of each kind, with the true rooms beside it."""
    output.mkdir(parents=True, exist_ok=True)
    for number, (file_name, style, turn_deg, probabilities) in enumerate(SAMPLES):
        building = simulate_building(seed + number, style, turn_rad=float(np.deg2rad(turn_deg)))
        origin = {"simulated building": building.name, "rooms": str(len(building.rooms))}
        start_ns = START_NS + number * 86_400 * NANOSECONDS
        with robot_log(output / file_name, start_ns, origin) as log:
            maps = thinned_run(building, seed + number, maps=MAPS_PER_LOG)
            for step in maps:
                for pose in step.poses:
                    log.write_pose(pose.time_s, pose.estimate, pose.odometry)
                log.write_map(step.time_s, step.percent if probabilities else step.cells, step.geometry)
        write_truth(output, Path(file_name).stem, building, maps[0].geometry.resolution_m)
        print(f"{output / file_name}: {len(maps)} maps, {maps[-1].time_s:.0f} s, {len(building.rooms)} rooms")


def make_cases(directory: Path, count: int, seed: int, style: str | None) -> None:
    """Write benchmark cases of `count` buildings: the last map of each run, and partial ones."""
    directory.mkdir(parents=True, exist_ok=True)
    cases = []
    for number in range(seed, seed + count):
        building = simulate_building(number, style or STYLES[number % len(STYLES)])
        name = building.name.replace(" ", "_")
        maps = thinned_run(building, number, maps=20)
        chosen = [
            (f"{name}_{round(share * 100):02d}", "simulated_partial", share) for share in PARTIAL_SHARES
        ]
        for case, group, share in [*chosen, (name, "simulated_full", 1.0)]:
            step = maps[int(np.rint(share * (len(maps) - 1)))]
            cases.append(write_case(directory, group, case, building, step.cells, step.geometry))
        print(f"{name}: {cases[-1]['n_rooms']} rooms, {maps[-1].time_s:.0f} s")
    (directory / "cases.json").write_text(json.dumps({"cases": cases}, indent=1) + "\n", encoding="utf-8")
    print(f"{directory / 'cases.json'}: {len(cases)} cases")


def make_runs(directory: Path, count: int, seed: int, style: str | None) -> None:
    """Write benchmark cases of `count` buildings: every map of each run, a group each."""
    directory.mkdir(parents=True, exist_ok=True)
    cases = []
    for number in range(seed, seed + count):
        building = simulate_building(number, style or STYLES[number % len(STYLES)])
        group = f"run_{building.name.replace(' ', '_')}"
        maps = thinned_run(building, number, maps=MAPS_PER_RUN)
        for index, step in enumerate(maps):
            cases.append(write_case(directory, group, f"map{index:02d}", building, step.cells, step.geometry))
        print(f"{group}: {cases[-1]['n_rooms']} rooms, {maps[-1].time_s:.0f} s")
    (directory / "cases.json").write_text(json.dumps({"cases": cases}, indent=1) + "\n", encoding="utf-8")
    print(f"{directory / 'cases.json'}: {len(cases)} cases")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("-o", "--output", type=Path, default=Path("sample_logs"), help="directory of the logs (%(default)s)")
    add("--seed", type=int, default=1, help="decides on buildings and runs (%(default)s)")
    add("--cases", type=Path, metavar="DIR", help="write benchmark cases to DIR instead of logs")
    add("--runs", type=Path, metavar="DIR", help="write every map of whole runs as cases to DIR")
    add("--count", type=int, default=10, help="number of buildings for --cases and --runs (%(default)s)")
    add("--style", choices=STYLES, help="style of all these buildings (default: all in turn)")
    options = parser.parse_args(arguments)
    if options.runs is not None:
        make_runs(options.runs, options.count, options.seed, options.style)
    elif options.cases is None:
        make_sample_logs(options.output, options.seed)
    else:
        make_cases(options.cases, options.count, options.seed, options.style)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
