"""The maps of a log with their rooms and the rooms' identity: reader -> workers -> tracker, as one stream."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import InvalidMapError
from rose2_logs.io.log import LogReader
from rose2_logs.io.poses import RobotPath
from rose2_logs.model.explored import coarser_for_its_size
from rose2_logs.model.occupancy import OccupancySnapshot, free_area_m2, is_same_to_analysis
from rose2_logs.runs.journal import Found, JournaledWorkers
from rose2_logs.runs.summary import RunTotals
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.system.warnings import log_warning
from rose2_logs.system.workers import Workers, give_back_freed_memory
from rose2_logs.tracking.layout_change import LayoutFollower
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot, map_motion
from rose2_logs.tracking.tracker import RoomTracker

logger = logging.getLogger(__name__)

GIVE_BACK_EVERY = 20
"""Maps after which freed memory is given back: it costs a map's page faults, and keeps a long run small."""
SnapshotWorkers = Workers[OccupancySnapshot, Found]


def start_workers(options: RunOptions) -> SnapshotWorkers:
    """Return what analyzes snapshots: a context manager, to be entered as early as possible."""
    work = partial(
        _analyze_or_refuse,
        parameters=options.parameters,
        method=options.method,
        voronoi="voronoi" in options.shown_layers,
    )
    return Workers(work, options.workers)


def tracked_snapshots(
    reader: LogReader,
    last: OccupancySnapshot,
    workers: SnapshotWorkers | JournaledWorkers,
    parameters: Parameters,
    totals: RunTotals,
    path: RobotPath | None = None,
) -> Iterator[TrackedSnapshot]:
    """Yield every map of a log with its rooms and their identity.

    Parameters
    ----------
    reader : LogReader
        The log.
    last : OccupancySnapshot
        The last map of the run, which coverage refers to.
    workers : Workers
        What analyzes the maps, started.
    parameters : Parameters
        Those that it was started with.
    totals : RunTotals
        Maps that cannot be analyzed are left out and counted as invalid here.
    path : RobotPath, optional
        Where the robot was, to be told with the maps.
    """
    final_free_m2 = free_area_m2(last, parameters.occupancy)
    tracker = RoomTracker(parameters.tracking, parameters.occupancy)
    layout = LayoutFollower()
    said = False
    is_same = partial(is_same_to_analysis, parameters=parameters.occupancy)
    for number, (snapshot, found) in enumerate(workers.map(reader.snapshots(), is_same), start=1):
        if number % GIVE_BACK_EVERY == 0:
            give_back_freed_memory()
        if isinstance(found, InvalidMapError):
            totals.invalid += 1
            text = f"{reader.info.path}: snapshot {snapshot.index} is left out: {found}"
            log_warning(logger, "snapshot_left_out", text, file=reader.info.path, topic=reader.topic)
            continue
        analysis = found
        note = coarser_for_its_size(snapshot.geometry, analysis.resolution_m, parameters.occupancy)
        if note is not None and not said:
            logger.warning("snapshot %d and those of its size: %s", snapshot.index, note)
            said = True
        if analysis.index != snapshot.index:
            analysis = analysis.again_for(snapshot)
            totals.unchanged += 1
        track_ids, events = tracker.update(snapshot, analysis)
        change = layout.update(analysis.rooms, track_ids, map_motion(events))
        coverage = min(analysis.free_area_m2 / final_free_m2, 1.0) if final_free_m2 > 0 else 0.0
        way = None if path is None else path.until(snapshot.log_time_ns)
        yield TrackedSnapshot(snapshot, analysis, coverage, track_ids, events, analysis.quality, change, way)


def _analyze_or_refuse(
    snapshot: OccupancySnapshot, parameters: Parameters, method: str, voronoi: bool
) -> Found:
    try:
        return analyze(snapshot, parameters, method, voronoi=voronoi)
    except InvalidMapError as error:
        return error
    except MemoryError:
        raise
    except Exception as error:  # a map that the method stumbles over does not cost the others of the run
        at = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(at.filename).name}:{at.lineno}"
        return InvalidMapError(f"{type(error).__name__}: {error} ({where}, a fault of rose2-logs)")
