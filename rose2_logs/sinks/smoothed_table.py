"""How much of each room of the last map every map of a run shows, as a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from rose2_logs.occupancy import OccupancySnapshot
from rose2_logs.parameters import Parameters
from rose2_logs.sinks.parquet_table import ParquetTable
from rose2_logs.tracking.alignment import RigidMotion
from rose2_logs.tracking.frames import TrackedSnapshot
from rose2_logs.tracking.smoothing import Smoother, motions_to_last


def write_smoothed(
    path: Path,
    snapshots: Iterable[OccupancySnapshot],
    last: TrackedSnapshot,
    motions: Mapping[int, RigidMotion | None],
    parameters: Parameters,
) -> None:
    """Go through the maps of a run once more, now that its last layout is known.

    Parameters
    ----------
    path : path
        The table.
    snapshots : iterable of OccupancySnapshot
        The maps of the run.
    last : TrackedSnapshot
        The last one with its rooms.
    motions : mapping
        By index, in the order of the run, how the whole map moved since the one before. Maps that are not
        among them are left out.
    parameters : Parameters
        Of the run.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    from rose2_logs.sinks import table_schemas

    rooms = last.analysis.rooms
    smoother = Smoother(last.snapshot, rooms, parameters.tracking, parameters.occupancy)
    to_last = dict(zip(motions, motions_to_last(list(motions.values())), strict=True))
    with ParquetTable(path, table_schemas.SMOOTHED) as table:
        for snapshot in snapshots:
            if snapshot.index not in to_last:
                continue
            areas_m2 = smoother.rooms(snapshot, to_last[snapshot.index]).areas_m2
            table.add(
                [
                    {
                        "snapshot": snapshot.index,
                        "log_time_ns": snapshot.log_time_ns,
                        "track": last.track_ids[room],
                        "area_m2": areas_m2[room],
                        "last_area_share": areas_m2[room] / rooms.areas_m2[room],
                    }
                    for room in range(len(rooms))
                    if areas_m2[room] > 0
                ]
            )
        table.close()
        table.publish()
