#!/usr/bin/env python3
"""Turn a CARMEN log (laser scans with corrected poses) into a robot's log of a growing occupancy map.

The scans are mapped at their poses by log-odds; every so often the map is written to /map, and every pose
to /tf and /odom. The poses have to be corrected already (`corrected`, `gfs` or similar in the log's name):
this tool does no SLAM.

Examples
--------
    python tools/carmen_to_bag.py intel-lab.log.gz intel.mcap           ROS 2, MCAP
    python tools/carmen_to_bag.py fr079.log.gz fr079.bag --every 30     ROS 1 bag, a map every 30 s
    python tools/carmen_to_bag.py belgioioso.log.gz belgioioso          rosbag2 directory
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from log_writing import NANOSECONDS, robot_log

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.errors import Rose2LogsError
from rose2_logs.io.carmen import EPOCH_OF_UNSTAMPED_S, CarmenScan, read_carmen
from rose2_logs.mapping.log_odds import MapBuilder

MAPS_BY_DEFAULT = 40


def rounds(scans: list[CarmenScan], every_s: float) -> Iterator[tuple[float, list[CarmenScan]]]:
    """Scans from map to map, each with the time of the map after them; times without a scan are left out."""
    start, end = scans[0].time_s, scans[-1].time_s
    last = max(0, math.ceil((end - start) / every_s) - 1)  # the scan at the very end has no round of its own
    for number, group in groupby(scans, key=lambda scan: min(int((scan.time_s - start) // every_s), last)):
        yield min(start + (number + 1) * every_s, end), list(group)


def convert(
    source: Path,
    target: Path,
    *,
    every_s: float | None = None,
    max_range_m: float | None = None,
    mapping: MappingParameters | None = None,
    probabilities: bool = False,
) -> int:
    """Write `target`, whose suffix chooses the kind of log, from the CARMEN log `source`.

    Parameters
    ----------
    source, target : Path
        See the module.
    every_s : float, optional
        Time from map to map in the log's time; by default what gives about `MAPS_BY_DEFAULT` maps.
    max_range_m : float, optional
        Readings from here on mean that nothing returned; by default what the log says.
    mapping : MappingParameters, optional
        Resolution and range cap of the map.
    probabilities : bool
        Write 0..100 instead of 0 and 100.

    Returns
    -------
    int
        Number of maps.

    Raises
    ------
    LogError
        If `source` is no CARMEN log with laser scans.
    ValueError
        If the suffix of `target` is none of a log.
    """
    scans, stamped = read_carmen(source, max_range_m=max_range_m)
    duration = scans[-1].time_s - scans[0].time_s
    every_s = every_s or max(duration / MAPS_BY_DEFAULT, 1e-3)
    # Times are written relative to a whole second, so that nanoseconds survive.
    zero_s = int(scans[0].time_s)
    start_ns = (zero_s if stamped else EPOCH_OF_UNSTAMPED_S) * NANOSECONDS
    builder, count = MapBuilder(mapping), 0
    with robot_log(
        target, start_ns, {"carmen log": source.name, "seconds from map to map": f"{every_s:g}"}
    ) as log:
        for map_time, taken in rounds(scans, every_s):
            for scan in taken:
                builder.add_scan(scan.laser_pose, scan.bearings_rad, scan.ranges_m)
                log.write_pose(scan.time_s - zero_s, scan.robot_pose, scan.odometry)
            cells = builder.probabilities() if probabilities else builder.trinary()
            log.write_map(map_time - zero_s, cells, builder.geometry())
            count += 1
    note = "" if stamped else "; its stamps are damaged: one second a scan was taken instead"
    print(f"{target}: {count} maps from {len(scans)} scans, {duration:.0f} s{note}")
    return count


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add, defaults = parser.add_argument, MappingParameters()
    add("source", type=Path, help="CARMEN log, plain or .gz, with ROBOTLASER1 or FLASER messages")
    add("target", type=Path, help="what to write: *.mcap, *.bag, or a directory (rosbag2)")
    add("--every", type=float, metavar="S", help="log time from map to map (default: for about 40 maps)")
    add("--max-range", type=float, metavar="M", help="readings from here on are no returns (default: by log)")
    add(
        "--usable-range",
        type=float,
        metavar="M",
        default=defaults.usable_range_m,
        help="longer rays mark free cells up to here only (%(default)s)",
    )
    add("--resolution", type=float, metavar="M", default=defaults.resolution_m, help="cell (%(default)s)")
    add("--probabilities", action="store_true", help="write 0..100, as Cartographer does, not 0 and 100 only")
    options = parser.parse_args(arguments)
    for name in ("every", "max_range", "usable_range", "resolution"):
        value = getattr(options, name)
        if value is not None and not value > 0:
            parser.error(f"--{name.replace('_', '-')} is {value:g}; it must be positive")
    mapping = MappingParameters(resolution_m=options.resolution, usable_range_m=options.usable_range)
    try:
        convert(
            options.source,
            options.target,
            every_s=options.every,
            max_range_m=options.max_range,
            mapping=mapping,
            probabilities=options.probabilities,
        )
    except (Rose2LogsError, ValueError) as error:
        print(f"carmen_to_bag: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
