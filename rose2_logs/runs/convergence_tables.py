"""Tables of what is known only at the end: tracks, and how far each map's layout was the last one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rose2_logs.runs.parquet_table import ParquetTable, Row
from rose2_logs.system.files import writing
from rose2_logs.tracking.convergence import Hindsight, RoomRows, look_back
from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.tracking.track_history import Moment, RoomLife, RoomLives

ROWS_AT_ONCE = 2000
"""Rooms whose shapes are compared together; read by one thread, as each keeps some megabytes of its own."""


def write_hindsight(
    lives: RoomLives, *, rooms_path: Path, along_path: Path, snapshots: ParquetTable, tracks: ParquetTable
) -> Hindsight:
    """Fill two tables from two that are closed, and close them.

    Besides the lives of the rooms, some numbers a map are held.

    Parameters
    ----------
    lives : RoomLives
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
    moments: dict[int, Moment] = {}
    drifts: dict[int, RigidMotion] = {}
    for row in _rows(
        along_path, ["snapshot", "time_s", "coverage", "drift_x_m", "drift_y_m", "drift_yaw_rad"]
    ):
        snapshot, time_s, coverage, x, y, yaw = row.values()
        moments[snapshot] = Moment(snapshot, time_s, coverage)
        drifts[snapshot] = RigidMotion((0.0, 0.0), (x, y), yaw)
    hindsight = look_back(_room_rows(rooms_path), lives, moments, drifts)
    for row in _rows(along_path):
        snapshot = row["snapshot"]
        row |= {"final_iou": hindsight.final_iou[snapshot], "final_share": hindsight.final_share[snapshot]}
        snapshots.add([row])
    for track, life in sorted(lives.lives.items()):
        in_last_map = track in lives.in_last_map
        tracks.add([_track_row(track, life, hindsight) | {"in_last_map": in_last_map}])
    snapshots.close()
    tracks.close()
    return hindsight


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


def _track_row(track: int, life: RoomLife, hindsight: Hindsight) -> Row:
    return {
        "track": track,
        **_moment("first", life.first),
        **_moment("last", life.last),
        "maps": life.maps,
        "area_m2": life.area_m2,
        "predicted_area_m2": life.polygon.area,
        **_moment("area_settled", hindsight.area_settled[track]),
        **_moment("shape_right", hindsight.shape_right.get(track)),
        "shape_right_seen_share": hindsight.shape_right_seen.get(track),
        "outline_wall_share": life.outline_wall_share,
        "frontier_m": life.frontier_m,
        "splits": life.splits,
        "merges": life.merges,
        "losses": life.losses,
        "polygon_wkb": life.polygon.wkb,
    }


def _moment(name: str, moment: Moment | None) -> dict[str, Any]:
    return {
        f"{name}_snapshot": moment and moment.snapshot,
        f"{name}_time_s": moment and moment.time_s,
        f"{name}_coverage": moment and moment.coverage,
    }
