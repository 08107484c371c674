"""Tables of what is known only at the end: tracks, and how far each map's layout was the last one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rose2_logs.runs.parquet_table import ParquetTable, Row
from rose2_logs.system.files import writing
from rose2_logs.tracking.convergence import Convergence, RoomRows, measure_convergence
from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.track_history import SnapshotRef, TrackHistories, TrackHistory

ROWS_AT_ONCE = 2000
"""Rooms whose shapes are compared together; read by one thread, as each keeps some megabytes of its own."""


def write_convergence(
    histories: TrackHistories,
    *,
    rooms_path: Path,
    along_path: Path,
    snapshots: ParquetTable,
    tracks: ParquetTable,
) -> Convergence:
    """Fill two tables from two that are closed, and close them.

    Besides the histories of the rooms, some numbers a map are held.

    Parameters
    ----------
    histories : TrackHistories
        Every room of the run.
    rooms_path, along_path : path
        The table of rooms, and that of snapshots as far as they are known along the run.
    snapshots, tracks : ParquetTable
        Receive the rows.

    Raises
    ------
    OutputError
        If a file cannot be written or read back.
    """
    snapshot_refs: dict[int, SnapshotRef] = {}
    drifts: dict[int, RigidMotion] = {}
    for row in _rows(
        along_path, ["snapshot", "time_s", "coverage", "drift_x_m", "drift_y_m", "drift_yaw_rad"]
    ):
        snapshot, time_s, coverage, x, y, yaw = row.values()
        snapshot_refs[snapshot] = SnapshotRef(snapshot, time_s, coverage)
        drifts[snapshot] = RigidMotion((0.0, 0.0), (x, y), yaw)
    convergence = measure_convergence(_room_rows(rooms_path), histories, snapshot_refs, drifts)
    for row in _rows(along_path):
        snapshot = row["snapshot"]
        row |= {
            "final_iou": convergence.final_iou[snapshot],
            "final_share": convergence.final_share[snapshot],
        }
        snapshots.add([row])
    for track, history in sorted(histories.tracks.items()):
        in_last_map = track in histories.in_last_map
        tracks.add([_track_row(track, history, convergence) | {"in_last_map": in_last_map}])
    snapshots.close()
    tracks.close()
    return convergence


def _rows(path: Path, columns: list[str] | None = None) -> Iterator[Row]:
    import pyarrow.parquet as pq

    with writing(path), pq.ParquetFile(path) as file:
        for batch in file.iter_batches(ROWS_AT_ONCE, columns=columns, use_threads=False):
            yield from batch.to_pylist()


def _room_rows(path: Path) -> Iterator[RoomRows]:
    import pyarrow.parquet as pq
    import shapely

    columns = ["snapshot", "track", "area_m2", "polygon_wkb"]
    with writing(path), pq.ParquetFile(path) as file:
        for batch in file.iter_batches(ROWS_AT_ONCE, columns=columns, use_threads=False):
            snapshot, track, area_m2, polygons = (
                batch[name].to_numpy(zero_copy_only=False) for name in columns
            )
            yield RoomRows(snapshot, track, area_m2, np.asarray(shapely.from_wkb(polygons), object))


def _track_row(track: int, history: TrackHistory, convergence: Convergence) -> Row:
    return {
        "track": track,
        **_moment("first", history.first),
        **_moment("last", history.last),
        "maps": history.maps,
        "area_m2": history.area_m2,
        "predicted_area_m2": history.polygon.area,
        **_moment("area_settled", convergence.area_settled[track]),
        **_moment("shape_right", convergence.shape_right.get(track)),
        "shape_right_seen_share": convergence.shape_right_seen.get(track),
        "wall_support": history.wall_support,
        "frontier_m": history.frontier_m,
        "splits": history.splits,
        "merges": history.merges,
        "losses": history.losses,
        "polygon_wkb": history.polygon.wkb,
    }


def _moment(name: str, snapshot_ref: SnapshotRef | None) -> dict[str, Any]:
    return {
        f"{name}_snapshot": snapshot_ref and snapshot_ref.snapshot,
        f"{name}_time_s": snapshot_ref and snapshot_ref.time_s,
        f"{name}_coverage": snapshot_ref and snapshot_ref.coverage,
    }
