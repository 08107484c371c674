"""A planar lidar: rays against the segments of a building, with the errors of a real sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulation.building import Building, FloatArray

EDGE_STEP_M = 0.3
"""A step between neighboring ranges that counts as a depth edge."""


@dataclass(frozen=True)
class Lidar:
    """A lidar's data sheet; the defaults are those of the common indoor sensors (SICK LMS, Hokuyo).

    Attributes
    ----------
    beams : int
        Rays in a scan.
    field_of_view_rad : float
        Angle from the first ray to the last, symmetric about the heading.
    max_range_m : float
        Nothing returns from further away.
    range_noise_m : float
        Standard deviation of a range.
    dropout : float
        Probability that a ray gets lost (dark or shiny surfaces).
    mixed : float
        Probability that a ray at a depth edge returns from somewhere between the two surfaces.
    speckle : float
        Probability of a short return from nothing (dust, a person's leg).
    """

    beams: int = 361
    field_of_view_rad: float = float(np.deg2rad(240))
    max_range_m: float = 25.0
    range_noise_m: float = 0.015
    dropout: float = 0.01
    mixed: float = 0.3
    speckle: float = 0.0006

    @property
    def bearings_rad(self) -> FloatArray:
        """Angle (B,) of each ray to the heading."""
        return np.linspace(-0.5, 0.5, self.beams) * self.field_of_view_rad

    def scan(self, building: Building, pose: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Measure once: at one pose, or while the robot moves.

        Parameters
        ----------
        building : Building
            Where the lidar is.
        pose : (3,) or (P, 3) float
            x, y in meters and heading in radians; of several, each holds for an equal share of the beams,
            in their order.
        rng : numpy Generator
            Source of the sensor's errors.

        Returns
        -------
        (B,) float
            Ranges in meters; NaN where nothing returned.
        """
        poses = np.atleast_2d(pose)
        sectors = zip(poses, np.array_split(self.bearings_rad, len(poses)), strict=True)
        ranges = np.concatenate(
            [cast_rays(building, at[:2], at[2] + part, self.max_range_m, rng) for at, part in sectors]
        )
        hit = np.isfinite(ranges)
        beside = np.roll(ranges, 1)
        edge = hit & np.isfinite(beside)
        edge[0] = False
        edge[edge] = np.abs(ranges[edge] - beside[edge]) > EDGE_STEP_M
        between = edge & (rng.random(self.beams) < self.mixed)
        share = rng.random(self.beams)[between]
        ranges[between] = share * ranges[between] + (1 - share) * beside[between]
        ranges = ranges + rng.normal(0, self.range_noise_m, self.beams)
        speckle = rng.random(self.beams) < self.speckle
        ranges = np.where(speckle & hit, ranges * rng.random(self.beams), ranges)
        ranges[rng.random(self.beams) < self.dropout] = np.nan
        ranges[~(ranges < self.max_range_m)] = np.nan
        return ranges


def cast_rays(
    building: Building,
    origin_xy_m: FloatArray,
    angles_rad: FloatArray,
    max_range_m: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Distances (B,) to the nearest thing on each ray; infinite where there is none in range.

    Glass lets a ray pass with the transmission of its pane.
    """
    start = building.segments[:, :2] - origin_xy_m
    along = building.segments[:, 2:] - building.segments[:, :2]
    # Segments that are out of reach are left out: distance from the origin to the nearest point of each.
    length2 = np.maximum((along**2).sum(1), 1e-12)
    nearest = start + np.clip(-(start * along).sum(1) / length2, 0, 1)[:, None] * along
    close = (nearest**2).sum(1) < max_range_m**2
    start, along, transmission = start[close], along[close], building.transmission[close]
    is_glass = transmission > 0
    passes = rng.random((len(angles_rad), int(is_glass.sum()))) < transmission[is_glass]
    met = _within(start, start + along, angles_rad)
    start, along, is_glass, passes = start[met], along[met], is_glass[met], passes[:, met[is_glass]]
    rays = np.stack([np.cos(angles_rad), np.sin(angles_rad)], 1)

    across = rays[:, :1] * along[:, 1] - rays[:, 1:] * along[:, 0]  # (B, S)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / across
        share = (start[:, 0] * rays[:, 1:] - start[:, 1] * rays[:, :1]) / across
    distance[~((share >= 0) & (share <= 1) & (distance > 1e-6))] = np.inf
    distance[:, is_glass] = np.where(passes, np.inf, distance[:, is_glass])
    result: FloatArray = distance.min(axis=1, initial=np.inf)
    result[result > max_range_m] = np.inf
    return result


def _within(starts: FloatArray, ends: FloatArray, angles_rad: FloatArray) -> NDArray[np.bool_]:
    """Whether segments (S, 2) may be seen from the origin between the first and the last of sorted angles."""
    first, last = angles_rad[0] - 1e-6, angles_rad[-1] + 1e-6
    if not 0 < last - first < np.pi:
        return np.ones(len(starts), bool)
    inward = np.array([[-np.sin(first), np.cos(first)], [np.sin(last), -np.cos(last)]])
    seen: NDArray[np.bool_] = ((starts @ inward.T >= 0) | (ends @ inward.T >= 0)).all(1)
    return seen
