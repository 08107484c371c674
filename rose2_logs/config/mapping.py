"""Parameters of maps that are built from laser scans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from rose2_logs.config.fields import ParameterBlock, number


@dataclass(frozen=True, repr=False)
class MappingParameters(ParameterBlock):
    """How laser scans at known poses become an occupancy map, by log-odds."""

    block: ClassVar[str] = "mapping"

    resolution_m: float = number(0.05, "m", "Side of a cell: what SLAM packages use indoors.", 0.005, 1.0)
    map_every_s: float = number(
        10.0,
        "s",
        "Minimum time from map to map where the run names none: a robot looks into a few rooms in this time.",
        0.01,
        86_400.0,
    )
    min_travel_m: float = number(
        0.2,
        "m",
        "A scan is used if the lidar has moved this far since the last one that was: four cells of the usual "
        "size. 0 uses all scans.",
        0.0,
        100.0,
    )
    min_turn_rad: float = number(
        0.2, "rad", "The same for turns: about 11 degrees, see min_travel_m.", 0.0, 6.3
    )
    scan_at_least_every_s: float = number(
        5.0, "s", "A lidar that stands still sees doors open and people go: a scan this often.", 0.0, 86_400.0
    )
    hit_log_odds: float = number(
        0.9,
        "1",
        "What a scan adds to a cell in which a beam ends. With the defaults a cell is occupied if more than "
        "a quarter of its beams end in it, the usual threshold of GMapping.",
        0.01,
    )
    miss_log_odds: float = number(
        -0.32, "1", "What a scan adds to a cell that beams only cross, see hit_log_odds.", -100.0, -0.001
    )
    max_log_odds: float = number(
        6.0,
        "1",
        "Bound of a cell on both sides: 19 scans can free a cell again where a door was opened.",
        0.1,
    )
    usable_range_m: float = number(
        20.0,
        "m",
        "Longer beams mark free cells up to here, and no occupied one: far ends are uncertain.",
        0.1,
        1000.0,
    )
    no_return_m: float = number(
        0.0,
        "m",
        "Free length of a beam from which nothing returned. Dark and shiny walls return nothing either, so "
        "by default such a beam says nothing; for short lidars in large halls, their range.",
        0.0,
        1000.0,
    )
    canvas_step_m: float = number(
        3.2, "m", "The grid grows by multiples of this: 64 cells of the usual size.", 0.1
    )
    max_tilt_rad: float = number(
        0.1,
        "rad",
        "A scan whose plane is tilted more than this meets the floor within 10 m and is left out.",
        0.0,
        1.6,
    )
    max_step_m: float = number(
        1.0,
        "m",
        "Poses are not interpolated where a frame moves further from one transform to the next: this is a "
        "gap of the log or a correction by the SLAM.",
        0.01,
    )
    max_turn_rad: float = number(0.5, "rad", "The same for turns, see max_step_m.", 0.01)
    transform_wait_s: float = number(
        10.0,
        "s",
        "A scan waits this long, in log time, for the transforms of its time: chunks of logs overlap, and "
        "slow transforms come every few seconds.",
        0.0,
        3600.0,
    )
