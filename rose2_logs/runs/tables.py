"""The run as Parquet tables: snapshots, rooms, tracks, events, doorways."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from rose2_logs.runs.convergence_tables import write_convergence
from rose2_logs.runs.parquet_table import ParquetTable, Row
from rose2_logs.tracking.convergence import Convergence
from rose2_logs.tracking.track_history import SnapshotRef, TrackHistories, quality_of
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot


class Tables:
    """Sink that writes ``snapshots``, ``rooms``, ``tracks``, ``events``, ``doorways``, each ``.parquet``.

    The tables hold nothing but what the log and the parameters determine: the same run gives the same bytes.
    What only the last map tells is added at the end, by reading the rooms once more from the disk.

    Parameters
    ----------
    folder : path
        Where to; it is made.

    Attributes
    ----------
    histories : TrackHistories
        What is known of every room over the run.
    convergence : Convergence or None
        What the last map tells of the ones before, after `measure_convergence`.
    """

    def __init__(self, folder: Path) -> None:
        self.histories = TrackHistories()
        self.convergence: Convergence | None = None
        self._folder = folder
        self._stack = ExitStack()
        self._tables: dict[str, ParquetTable] = {}

    def __enter__(self) -> Self:
        from rose2_logs.runs import table_schemas

        # Snapshots get two columns more in the end, and are written anew.
        along = self._folder / ".snapshots.along.parquet.part"
        with ExitStack() as opening:
            for name, schema, part in (
                ("along", table_schemas.SNAPSHOTS_ALONG, along),
                ("snapshots", table_schemas.SNAPSHOTS, None),
                ("rooms", table_schemas.ROOMS, None),
                ("tracks", table_schemas.TRACKS, None),
                ("events", table_schemas.EVENTS, None),
                ("doorways", table_schemas.DOORWAYS, None),
            ):
                path = self._folder / f"{'snapshots' if name == 'along' else name}.parquet"
                self._tables[name] = opening.enter_context(ParquetTable(path, schema, part))
            self._stack = opening.pop_all()
        return self

    def write(self, step: TrackedSnapshot) -> None:
        """Take one snapshot.

        Raises
        ------
        OutputError
            If a file cannot be written.
        """
        self.histories.add(step)
        about = {"snapshot": step.snapshot.index, "log_time_ns": step.snapshot.log_time_ns}
        self._tables["along"].add([about | _snapshot_row(step, self.histories.snapshot_ref(step))])
        self._tables["rooms"].add([about | row for row in _room_rows(step)])
        self._tables["events"].add([about | row for row in _event_rows(step)])
        self._tables["doorways"].add([about | row for row in _doorway_rows(step)])

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with self._stack:
            if kind is None:
                self.measure_convergence()
                _, *tables = self._tables.values()
                for table in tables:
                    table.publish()

    def measure_convergence(self) -> None:
        """Find what the last map tells of the ones before: after the last snapshot; the end does it else.

        Raises
        ------
        OutputError
            If a file cannot be written or read back.
        """
        if self.convergence is not None:
            return
        for name in ("along", "rooms", "events", "doorways"):
            self._tables[name].close()
        self.convergence = write_convergence(
            self.histories,
            rooms_path=self._tables["rooms"].part,
            along_path=self._tables["along"].part,
            snapshots=self._tables["snapshots"],
            tracks=self._tables["tracks"],
        )


def _snapshot_row(step: TrackedSnapshot, snapshot_ref: SnapshotRef) -> Row:
    snapshot, analysis, geometry = step.snapshot, step.analysis, step.analysis.geometry
    structure, walls, plan = analysis.structure, analysis.walls, analysis.floor_plan
    change = step.change
    x, y, yaw = (0.0, 0.0, 0.0) if change is None else change.drift.pose
    return {
        "stamp_ns": snapshot.stamp_ns,
        "time_s": snapshot_ref.time_s,
        "coverage": step.coverage,
        "free_area_m2": analysis.free_area_m2,
        "rooms": len(analysis.rooms),
        "rooms_area_m2": float(analysis.rooms.areas_m2.sum()),
        "rooms_predicted_area_m2": float(analysis.rooms.predicted_areas_m2.sum()),
        "doorways": len(analysis.rooms.doorways),
        "directions_rad": [] if structure is None else structure.directions_rad.tolist(),
        "clean_threshold": None if structure is None else float(structure.threshold),
        "wall_segments": 0 if walls is None else len(walls.segments_m),
        "lines": 0 if walls is None else len(walls.lines_m),
        "faces": 0 if plan is None else len(plan.faces),
        "repeats_before": snapshot.repeats_before,
        "frame_id": geometry.frame_id,
        "resolution_m": geometry.resolution_m,
        "analyzed_resolution_m": step.analysis.resolution_m,
        "origin_x_m": geometry.origin_xy_m[0],
        "origin_y_m": geometry.origin_xy_m[1],
        "yaw_rad": geometry.yaw_rad,
        "height_cells": geometry.shape[0],
        "width_cells": geometry.shape[1],
        "frontier_m": None if step.quality is None else float(step.quality.frontier_m.sum()),
        "variation_bits": change and change.variation_bits,
        "changed_share": change and change.changed_share,
        "drift_x_m": x,
        "drift_y_m": y,
        "drift_yaw_rad": yaw,
    }


def _room_rows(step: TrackedSnapshot) -> list[Row]:
    rooms, tracks = step.analysis.rooms, step.track_ids
    rows = []
    points = rooms.label_points_m.tolist()
    for number, (track, polygon) in enumerate(zip(tracks, rooms.polygons, strict=True), start=1):
        x, y = (None, None) if polygon.is_empty else points[number - 1]
        wall_share, frontier_m = quality_of(step, number - 1)
        rows.append(
            {
                "track": track,
                "room": number,
                "area_m2": float(rooms.areas_m2[number - 1]),
                "predicted_area_m2": polygon.area,
                "label_x_m": x,
                "label_y_m": y,
                "neighbors": sorted(tracks[other - 1] for other in rooms.neighbors(number)),
                "wall_support": wall_share,
                "frontier_m": frontier_m,
                "polygon_wkb": polygon.wkb,
            }
        )
    return sorted(rows, key=lambda row: row["track"])


def _event_rows(step: TrackedSnapshot) -> list[Row]:
    rows = []
    for event in step.events:
        motion = event.motion
        x, y = (None, None) if motion is None else motion.shift_xy_m
        rows.append(
            {
                "kind": event.kind,
                "track": event.track,
                "others": list(event.others),
                "overlap_iou": event.overlap,
                "shift_x_m": x,
                "shift_y_m": y,
                "turn_rad": motion and motion.turn_rad,
            }
        )
    return rows


def _doorway_rows(step: TrackedSnapshot) -> list[Row]:
    rows = []
    for doorway in step.analysis.rooms.doorways:
        track_a, track_b = sorted(step.track_ids[room - 1] for room in doorway.rooms)
        (x0, y0), (x1, y1) = doorway.ends_m.tolist()
        rows.append(
            {
                "track_a": track_a,
                "track_b": track_b,
                "width_m": doorway.width_m,
                "x0_m": x0,
                "y0_m": y0,
                "x1_m": x1,
                "y1_m": y1,
            }
        )
    return rows


TABLES = ("snapshots", "rooms", "tracks", "events", "doorways")


BACK_PROJECTED = "back_projected"
"""Name of the table that a run has only where it was asked to back_project."""


SUMMARY = "summary.json"
