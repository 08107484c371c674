"""A whole run with equipment that varies from building to building: the way to many maps with truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rose2_logs.config.mapping import MappingParameters
from simulation.building import Building
from simulation.exploration import ExplorationStep, RobotSettings, explore
from simulation.lidar import Lidar


def random_equipment(seed: int) -> tuple[Lidar, RobotSettings, MappingParameters]:
    """A lidar, a robot, and a mapper as they come: old and new, exact and less exact."""
    rng = np.random.default_rng([seed, 2])
    beams, view_deg = [(181, 180.0), (361, 180.0), (541, 270.0), (361, 240.0)][int(rng.integers(4))]
    lidar = Lidar(
        beams=beams,
        field_of_view_rad=float(np.deg2rad(view_deg)),
        range_noise_m=float(rng.uniform(0.01, 0.03)),
        dropout=float(rng.uniform(0.0, 0.05)),
        mixed=float(rng.uniform(0.1, 0.5)),
    )
    robot = RobotSettings(
        pose_noise_m=float(rng.uniform(0.008, 0.03)),
        pose_noise_rad=float(rng.uniform(0.001, 0.006)),
        greed=float(rng.uniform(0.0, 2.0)),
    )
    return lidar, robot, MappingParameters(usable_range_m=float(rng.uniform(7.0, 12.0)))


def thinned_run(building: Building, seed: int, *, maps: int) -> list[ExplorationStep]:
    """Explore a building and keep a number of maps, evenly spread over the run; the last one is among them.

    Poses of maps that are left out go to the next map that is kept.
    """
    steps = list(equipped_run(building, seed, map_every_s=5.0))
    keep = np.unique(np.rint(np.linspace(0, len(steps) - 1, maps + 1)).astype(int)[1:])
    first = np.concatenate([[0], keep[:-1] + 1])
    return [
        replace(steps[last], poses=[pose for step in steps[start : last + 1] for pose in step.poses])
        for start, last in zip(first, keep, strict=True)
    ]


def equipped_run(building: Building, seed: int, *, map_every_s: float) -> Iterator[ExplorationStep]:
    """Explore a building with `random_equipment`."""
    lidar, robot, mapping = random_equipment(seed)
    return explore(building, seed, map_every_s=map_every_s, lidar=lidar, robot=robot, mapping=mapping)
