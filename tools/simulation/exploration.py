"""A robot that explores a simulated building by frontiers, and the maps it makes on the way."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label
from skimage.graph import MCP_Geometric

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.mapping.log_odds import MapBuilder
from rose2_logs.model.occupancy import GridGeometry
from simulation.building import Building, FloatArray
from simulation.lidar import Lidar


@dataclass(frozen=True)
class RobotSettings:
    """How the robot moves and errs.

    Attributes
    ----------
    radius_m : float
        Clearance that the robot keeps to everything.
    speed_m_s, turn_rate_rad_s : float
        Its velocities.
    scan_distance_m, scan_turn_rad : float
        A scan is mapped after moving or turning this much, as SLAM front ends do.
    pose_noise_m, pose_noise_rad : float
        Standard deviation of the error of the pose at which a scan is mapped.
    pose_memory : float
        Correlation of that error from scan to scan.
    odometry_drift : float
        Standard deviation of the odometry's error per meter moved and per radian turned.
    plan_cell_m : float
        Cell of the planner.
    greed : float
        Meters of way that one meter of frontier is worth: 0 always goes to the nearest frontier.
    """

    radius_m: float = 0.2
    speed_m_s: float = 0.45
    turn_rate_rad_s: float = 0.8
    scan_distance_m: float = 0.35
    scan_turn_rad: float = 0.35
    pose_noise_m: float = 0.012
    pose_noise_rad: float = 0.003
    pose_memory: float = 0.8
    odometry_drift: float = 0.02
    plan_cell_m: float = 0.2
    greed: float = 0.6


@dataclass(frozen=True, eq=False)
class PoseSample:
    """Where the robot was when a scan was mapped.

    Attributes
    ----------
    time_s : float
        Seconds since the start.
    estimate, odometry, truth : (3,) float
        x, y in meters and heading in radians: of the mapper in the map frame, of the wheels in the odometry
        frame, and the true one.
    """

    time_s: float
    estimate: FloatArray
    odometry: FloatArray
    truth: FloatArray


@dataclass(frozen=True, eq=False)
class ExplorationStep:
    """One map of an exploration, and the poses since the map before.

    Attributes
    ----------
    time_s : float
        Seconds since the start.
    cells : (H, W) int8
        The map as GMapping publishes it: -1 unknown, 0 free, 100 occupied; row 0 at the origin.
    percent : (H, W) int8
        The map as Cartographer publishes it: -1 unknown, 0..100.
    geometry : GridGeometry
        Where the map lies.
    poses : list of PoseSample
        Poses since the map before.
    last : bool
        True for the map at the end of the run.
    """

    time_s: float
    cells: NDArray[np.int8]
    percent: NDArray[np.int8]
    geometry: GridGeometry
    poses: list[PoseSample] = field(default_factory=list)
    last: bool = False


class Planner:
    """Ways to frontiers, on a coarse grid of where the robot can stand.

    The robot knows by its bumper what it cannot see, glass for one: ways are planned on ground that is both
    walkable in truth and known in the map. A frontier is such ground beside walkable ground that is unknown.
    """

    def __init__(self, building: Building, settings: RobotSettings) -> None:
        self._cell_m = settings.plan_cell_m
        self._greed = settings.greed
        x0, y0, x1, y1 = building.bounds(1.0)
        x, y = np.meshgrid(np.arange(x0, x1, self._cell_m), np.arange(y0, y1, self._cell_m))
        self._centers = np.stack([x, y], -1)
        floor = building.walkable(settings.radius_m)
        shapely.prepare(floor)
        self._walkable = shapely.contains_xy(floor, x, y)
        comfortable = building.walkable(2 * settings.radius_m)
        shapely.prepare(comfortable)
        self._price = np.where(shapely.contains_xy(comfortable, x, y), 1.0, 2.5)
        self._known = np.zeros(self._walkable.shape, bool)
        self._given_up = np.zeros(self._walkable.shape, bool)

    def update(self, mapper: MapBuilder) -> None:
        """Look up what the map knows by now."""
        todo = self._walkable & ~self._known
        self._known[todo] = mapper.known_at(self._centers[todo])

    def way_to_frontier(self, xy_m: FloatArray) -> FloatArray | None:
        """Points (N, 2) to the frontier that is worth most, or None where no frontier can be reached."""
        ground = self._walkable & self._known
        unknown = self._walkable & ~self._known & ~self._given_up
        frontier = ground & binary_dilation(unknown, np.ones((3, 3)))
        distance = np.hypot(*(self._centers - xy_m).transpose(2, 0, 1))
        here = np.unravel_index(np.argmin(np.where(ground, distance, np.inf)), distance.shape)
        router = MCP_Geometric(np.where(ground, self._price, -1.0))
        costs, _ = router.find_costs([here])
        groups, count = label(frontier & np.isfinite(costs), np.ones((3, 3)))
        if count == 0:
            return None
        index = groups[groups > 0]
        nearest = np.full(count + 1, np.inf)
        np.minimum.at(nearest, index, costs[groups > 0])
        size = np.bincount(index, minlength=count + 1)
        value = nearest - self._greed * np.minimum(size, 20)
        best = int(np.argmin(np.where(size > 0, value, np.inf)))
        goal = np.unravel_index(np.argmin(np.where(groups == best, costs, np.inf)), costs.shape)
        way: FloatArray = self._centers[tuple(np.array(router.traceback(goal)).T)]
        return way

    def give_up_near(self, xy_m: FloatArray) -> None:
        """Forget unknown ground around a point: the robot stood there and could not see it."""
        self._given_up |= np.hypot(*(self._centers - xy_m).transpose(2, 0, 1)) < 3 * self._cell_m


class _Robot:
    """The robot's true pose, its odometry, and its clock."""

    def __init__(
        self, start_xy_m: tuple[float, float], settings: RobotSettings, rng: np.random.Generator
    ) -> None:
        self.settings, self.rng, self.time_s = settings, rng, 0.0
        self.truth = np.array([*start_xy_m, float(rng.uniform(-np.pi, np.pi))])
        self.odometry = np.zeros(3)
        self.error = np.zeros(3)

    def move(self, distance_m: float, turn_rad: float) -> None:
        """Turn, then drive ahead."""
        s = self.settings
        self.time_s += abs(turn_rad) / s.turn_rate_rad_s + distance_m / s.speed_m_s
        self.truth = _ahead(self.truth, distance_m, turn_rad)
        slip = 1 + self.rng.normal(0, s.odometry_drift, 2)
        turn_error = self.rng.normal(0, 0.3 * s.odometry_drift) * distance_m
        self.odometry = _ahead(self.odometry, distance_m * slip[0], turn_rad * slip[1] + turn_error)

    def estimate(self) -> FloatArray:
        """The pose at which the next scan is mapped: the true one with a small error that varies slowly."""
        s = self.settings
        fresh = self.rng.normal(0, [s.pose_noise_m, s.pose_noise_m, s.pose_noise_rad])
        self.error = s.pose_memory * self.error + np.sqrt(1 - s.pose_memory**2) * fresh
        return self.truth + self.error


def explore(
    building: Building,
    seed: int,
    *,
    map_every_s: float = 15.0,
    lidar: Lidar | None = None,
    robot: RobotSettings | None = None,
    mapping: MappingParameters | None = None,
    max_time_s: float = 7200.0,
) -> Iterator[ExplorationStep]:
    """Explore a building until no frontier is left.

    Parameters
    ----------
    building : Building
        Where to explore.
    seed : int
        Decides on every error of the run; the same arguments give the same maps.
    map_every_s : float
        Time from map to map.
    lidar, robot, mapping
        Settings, with sensible defaults.
    max_time_s : float
        The run ends then at the latest.

    Yields
    ------
    ExplorationStep
        One map after the other; the last one is the map at the end of the run.
    """
    lidar, settings = lidar or Lidar(), robot or RobotSettings()
    rng = np.random.default_rng([seed, 1])
    mapper, planner = MapBuilder(mapping), Planner(building, settings)
    body = _Robot(building.start_xy_m, settings, rng)
    poses: list[PoseSample] = []
    next_map_s = map_every_s

    def look() -> None:
        estimate = body.estimate()
        mapper.add_scan(estimate, lidar.bearings_rad, lidar.scan(building, body.truth, rng))
        poses.append(PoseSample(body.time_s, estimate, body.odometry, body.truth))

    def step(*, last: bool) -> ExplorationStep:
        taken = poses.copy()
        poses.clear()
        time_s = body.time_s if last else next_map_s
        return ExplorationStep(
            time_s, mapper.trinary(), mapper.probabilities(), mapper.geometry(), taken, last
        )

    look()
    for distance, turn in _moves(planner, mapper, body):
        body.move(distance, turn)
        if body.time_s >= next_map_s:
            yield step(last=False)
            next_map_s += map_every_s * (1 + (body.time_s - next_map_s) // map_every_s)
        if body.time_s > max_time_s:
            break
        look()
    yield step(last=True)


def _moves(planner: Planner, mapper: MapBuilder, body: _Robot) -> Iterator[tuple[float, float]]:
    """Distances and turns, from scan to scan, that explore everything."""
    s = body.settings
    yield from _turn(2 * np.pi - 1e-6, s)
    while True:
        planner.update(mapper)
        way = planner.way_to_frontier(body.truth[:2])
        if way is None:
            return
        moved = yield from _follow(way, body)
        if not moved:  # at the frontier already: look around, then leave what stays unseen
            yield from _turn(2 * np.pi - 1e-6, s)
            planner.give_up_near(body.truth[:2])


def _follow(way: FloatArray, body: _Robot) -> Generator[tuple[float, float], None, float]:
    """Drive along a way, at most a few meters before the robot plans anew; returns the meters driven."""
    s = body.settings
    lengths = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    at = 0.0
    while at < min(lengths[-1], 8 * s.scan_distance_m) - 1e-9:
        at = min(at + s.scan_distance_m, float(lengths[-1]))
        target = np.array([np.interp(at, lengths, way[:, k]) for k in (0, 1)])
        offset = target - body.truth[:2]
        distance = float(np.hypot(*offset))
        if distance < 1e-6:
            continue
        turn = _wrapped(float(np.arctan2(offset[1], offset[0])) - body.truth[2])
        *before, final = _turn(turn, s)
        yield from before
        yield distance, final[1]
    return at


def _turn(angle_rad: float, settings: RobotSettings) -> list[tuple[float, float]]:
    """A turn on the spot, in pieces after each of which a scan is mapped."""
    pieces = max(1, int(np.ceil(abs(angle_rad) / settings.scan_turn_rad)))
    return [(0.0, angle_rad / pieces)] * pieces


def _ahead(pose: FloatArray, distance_m: float, turn_rad: float) -> FloatArray:
    heading = pose[2] + turn_rad
    return np.array(
        [pose[0] + distance_m * np.cos(heading), pose[1] + distance_m * np.sin(heading), _wrapped(heading)]
    )


def _wrapped(angle_rad: float) -> float:
    return float((angle_rad + np.pi) % (2 * np.pi) - np.pi)
