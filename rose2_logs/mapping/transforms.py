"""The tree of frames over time: poses of a sensor in a fixed frame, interpolated for each beam."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.model.occupancy import FARTHEST_ORIGIN_M, FloatArray

Link = tuple[str, str]
"""A parent frame and its child."""
QUATERNION_LENGTHS = (1e-3, 1e3)
"""Those of rotations are 1 up to rounding; numbers far from that are damage, and their squares overflow."""
KEPT_WAITS = 3
"""Transforms are kept for so many times as long as a scan may wait for them."""
PRUNED_FROM = 1024
"""Old transforms of a link are dropped, half of them or more at once, if there are more than this."""


@dataclass(frozen=True)
class Transform:
    """Pose of a child frame in its parent at a time.

    Attributes
    ----------
    stamp_ns : int
    parent, child : str
        Frames, without a leading slash.
    pose : tuple of 7 float
        x, y, z in meters and the quaternion x, y, z, w.
    """

    stamp_ns: int
    parent: str
    child: str
    pose: tuple[float, ...]

    @property
    def is_usable(self) -> bool:
        """Whether it consists of finite numbers, is a place on earth, and its quaternion is no damage."""
        # NaN compares false.
        is_place = all(abs(part) <= FARTHEST_ORIGIN_M for part in self.pose[:3])
        shortest, longest = QUATERNION_LENGTHS
        return is_place and shortest <= math.hypot(*self.pose[3:]) <= longest


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of a frame in another one: positions (N, 3) in meters and unit quaternions (N, 4) x, y, z, w.

    N is the number of times, or 1 if the pose is the same at all of them.
    """

    positions_m: FloatArray
    quaternions: FloatArray

    def then(self, inner: Poses) -> Poses:
        """Return the poses, in the outer frame, of a frame whose poses in this one are `inner`."""
        moved = self.positions_m + rotated(self.quaternions, inner.positions_m)
        return Poses(moved, _product(self.quaternions, inner.quaternions))

    @property
    def tilt_rad(self) -> float:
        """Largest angle between the x-y planes of the two frames; a frame upside down is not tilted."""
        x, y = self.quaternions[:, 0], self.quaternions[:, 1]
        upright = np.abs(1 - 2 * (x * x + y * y))
        return math.acos(min(float(upright.min()), 1.0))


class NotPlacedError(Exception):
    """A frame has no pose at a time; the text is the reason, in words that can be counted."""


class TransformTree:
    """Transforms as they come, and the poses of a frame between them.

    Parameters
    ----------
    parameters : MappingParameters
        Which steps are too large to interpolate, and how long transforms are kept.
    """

    def __init__(self, parameters: MappingParameters) -> None:
        self._parameters = parameters
        self._parents: dict[str, dict[str, None]] = defaultdict(dict)
        self._fixed: dict[Link, Poses] = {}
        self._moving: dict[Link, _Track] = {}
        self._kept_ns = round(KEPT_WAITS * parameters.transform_wait_s * 1e9)

    @property
    def frames(self) -> list[str]:
        """All frames, sorted."""
        return sorted({*self._parents, *(each for parents in self._parents.values() for each in parents)})

    def add(self, transform: Transform, *, is_fixed: bool = False) -> None:
        """Take one transform; a fixed one holds at all times. One that cannot be used is ignored."""
        if not transform.is_usable:
            return
        link = (transform.parent, transform.child)
        self._parents[transform.child][transform.parent] = None
        if is_fixed:
            self._fixed[link] = _poses_of(np.array([transform.pose]))
        else:
            self._moving.setdefault(link, _Track()).add(transform.stamp_ns, transform.pose, self._kept_ns)

    def above(self, frame: str) -> dict[str, tuple[Link, ...]]:
        """Frames above a frame, nearest first, each with the links that lead from it down to the frame."""
        found: dict[str, tuple[Link, ...]] = {frame: ()}
        for child in (todo := [frame]):
            for parent in self._parents.get(child, ()):
                if parent not in found:
                    found[parent] = ((parent, child), *found[child])
                    todo.append(parent)
        return found

    def last_ns(self, links: Sequence[Link]) -> int | None:
        """Until when all of the links are known; None if they hold at all times."""
        moving = [self._moving[link].times for link in links if link not in self._fixed]
        return min((times[-1] if times else -1 for times in moving), default=None)

    def poses(self, links: Sequence[Link], times_ns: NDArray[np.int64]) -> Poses:
        """Return the poses of a frame at some times.

        Parameters
        ----------
        links : sequence of Link
            From the outermost frame down, at least one.
        times_ns : (N,) int
            In any order.

        Raises
        ------
        NotPlacedError
            If a time is not between two transforms of each link, or they are too far apart.
        """
        found: Poses | None = None
        for link in links:
            fixed = self._fixed.get(link)
            here = self._moving[link].at(times_ns, self._parameters) if fixed is None else fixed
            found = here if found is None else found.then(here)
        assert found is not None
        if np.abs(found.positions_m).max() > FARTHEST_ORIGIN_M:
            raise NotPlacedError("at impossible places")
        return found


class _Track:
    """Poses of one link in the order of their stamps."""

    def __init__(self) -> None:
        self.times: list[int] = []
        self._poses: list[tuple[float, ...]] = []

    def add(self, time_ns: int, pose: tuple[float, ...], kept_ns: int) -> None:
        times = self.times
        if times and time_ns < times[-1] - kept_ns:  # the clock was set back
            times.clear()
            self._poses.clear()
        place = bisect_left(times, time_ns)
        if place < len(times) and times[place] == time_ns:
            self._poses[place] = pose
            return
        times.insert(place, time_ns)
        self._poses.insert(place, pose)
        if len(times) > PRUNED_FROM and times[len(times) // 2] < times[-1] - kept_ns:
            gone = bisect_left(times, times[-1] - kept_ns)
            del times[:gone], self._poses[:gone]

    def at(self, times_ns: NDArray[np.int64], parameters: MappingParameters) -> Poses:
        first, last = int(times_ns.min()), int(times_ns.max())
        begin, end = bisect_right(self.times, first) - 1, bisect_left(self.times, last)
        if begin < 0 or end >= len(self.times):
            raise NotPlacedError("without transforms of their time")
        knots = _poses_of(np.array(self._poses[begin : end + 1]))
        if begin == end:
            return knots
        steps = np.sqrt((np.diff(knots.positions_m, axis=0) ** 2).sum(1))
        cosines = np.abs((knots.quaternions[1:] * knots.quaternions[:-1]).sum(1))
        turns = 2 * np.arccos(np.minimum(cosines, 1.0))
        if steps.max() > parameters.max_step_m or turns.max() > parameters.max_turn_rad:
            raise NotPlacedError("between transforms that are too far apart")
        if first == last:
            times_ns = times_ns[:1]
        stamps = np.array(self.times[begin : end + 1], np.int64)
        after = np.clip(np.searchsorted(stamps, times_ns), 1, len(stamps) - 1)
        share = ((times_ns - stamps[after - 1]) / (stamps[after] - stamps[after - 1]))[:, None]
        positions = knots.positions_m[after - 1] * (1 - share) + knots.positions_m[after] * share
        one, other = knots.quaternions[after - 1], knots.quaternions[after]
        # A quaternion and its negative are the same rotation: the nearer one is meant.
        nearer = np.where((one * other).sum(1, keepdims=True) < 0, -other, other)
        between = one * (1 - share) + nearer * share
        return Poses(positions, between / np.sqrt((between**2).sum(1, keepdims=True)))


def rotated(quaternions: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return vectors (N, 3) or (1, 3), turned by unit quaternions (N, 4) or (1, 4)."""
    axis, w = quaternions[:, :3], quaternions[:, 3:]
    across = 2 * _cross(axis, vectors)
    turned: FloatArray = vectors + w * across + _cross(axis, across)
    return turned


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of rows; that of NumPy takes several times as long for a few hundred."""
    return np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ],
        1,
    )


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Products of quaternions."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + _cross(a[:, :3], b[:, :3])
    scalar = a[:, 3] * b[:, 3] - (a[:, :3] * b[:, :3]).sum(1)
    return np.concatenate([vector, scalar[:, None]], 1)


def _poses_of(rows: FloatArray) -> Poses:
    quaternions = rows[:, 3:]
    return Poses(rows[:, :3], quaternions / np.sqrt((quaternions**2).sum(1, keepdims=True)))
