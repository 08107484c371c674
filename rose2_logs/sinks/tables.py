"""The run as Parquet tables: snapshots, rooms, events, doorways."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from rose2_logs.errors import OutputError
from rose2_logs.tracking.frames import TrackedSnapshot

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq
    from shapely.geometry.base import BaseGeometry

ROWS_PER_GROUP = 2000
"""Rows held back until they are written as one row group: some hundred kilobytes with polygons."""
POINT_TOLERANCE_M = 0.05
"""A label's point is the deepest of its room to this; one cell of usual maps."""
COMPRESSION = "zstd"

Row = dict[str, Any]


class Tables:
    """Sink that writes ``snapshots.parquet``, ``rooms.parquet``, ``events.parquet``, ``doorways.parquet``.

    The tables hold nothing but what the log and the parameters determine: the same run gives the same bytes.

    Parameters
    ----------
    folder : path
        Where to; it is made.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._stack = ExitStack()
        self._tables: dict[str, _Table] = {}
        self._first_time_ns: int | None = None

    def __enter__(self) -> Self:
        from rose2_logs.sinks import table_schemas

        schemas = {
            "snapshots": table_schemas.SNAPSHOTS,
            "rooms": table_schemas.ROOMS,
            "events": table_schemas.EVENTS,
            "doorways": table_schemas.DOORWAYS,
        }
        with ExitStack() as opening:
            for name, schema in schemas.items():
                path = self._folder / f"{name}.parquet"
                self._tables[name] = opening.enter_context(_Table(path, schema))
            self._stack = opening.pop_all()
        return self

    def write(self, frame: TrackedSnapshot) -> None:
        """Take one snapshot.

        Raises
        ------
        OutputError
            If a file cannot be written.
        """
        if self._first_time_ns is None:
            self._first_time_ns = frame.snapshot.log_time_ns
        about = {"snapshot": frame.snapshot.index, "log_time_ns": frame.snapshot.log_time_ns}
        self._tables["snapshots"].add([about | _snapshot_row(frame, self._first_time_ns)])
        self._tables["rooms"].add([about | row for row in _room_rows(frame)])
        self._tables["events"].add([about | row for row in _event_rows(frame)])
        self._tables["doorways"].add([about | row for row in _doorway_rows(frame)])

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, traceback)


class _Table:
    """One Parquet file, written row group by row group beside its name and renamed when whole."""

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        self._path = path
        self._part = path.with_name(f".{path.name}.part")
        self._schema = schema
        self._rows: list[Row] = []
        self._writer: pq.ParquetWriter | None = None

    def __enter__(self) -> Self:
        import pyarrow.parquet as pq

        with _writing(self._path):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(self._part, self._schema, compression=COMPRESSION)
        return self

    def add(self, rows: list[Row]) -> None:
        self._rows += rows
        if len(self._rows) >= ROWS_PER_GROUP:
            self._flush()

    def _flush(self) -> None:
        import pyarrow as pa

        if self._writer is not None and self._rows:
            with _writing(self._path):
                self._writer.write_table(pa.Table.from_pylist(self._rows, self._schema))
            self._rows.clear()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._flush()
            if self._writer is not None:
                with _writing(self._path):
                    self._writer.close()
            if kind is None:
                with _writing(self._path):
                    self._part.replace(self._path)
        finally:
            self._part.unlink(missing_ok=True)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error}") from error


def _snapshot_row(frame: TrackedSnapshot, first_time_ns: int) -> Row:
    snapshot, analysis, geometry = frame.snapshot, frame.analysis, frame.analysis.geometry
    structure, walls, plan = analysis.structure, analysis.walls, analysis.floor_plan
    return {
        "stamp_ns": snapshot.stamp_ns,
        "time_s": (snapshot.log_time_ns - first_time_ns) / 1e9,
        "coverage": frame.coverage,
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
        "origin_x_m": geometry.origin_xy_m[0],
        "origin_y_m": geometry.origin_xy_m[1],
        "yaw_rad": geometry.yaw_rad,
        "height_cells": geometry.shape[0],
        "width_cells": geometry.shape[1],
    }


def _room_rows(frame: TrackedSnapshot) -> list[Row]:
    rooms, tracks = frame.analysis.rooms, frame.track_ids
    rows = []
    for number, (track, polygon) in enumerate(zip(tracks, rooms.polygons, strict=True), start=1):
        x, y = _label_point(polygon)
        rows.append(
            {
                "track": track,
                "room": number,
                "area_m2": float(rooms.areas_m2[number - 1]),
                "predicted_area_m2": polygon.area,
                "label_x_m": x,
                "label_y_m": y,
                "neighbours": sorted(tracks[other - 1] for other in rooms.neighbours(number)),
                "polygon_wkb": polygon.wkb,
            }
        )
    return sorted(rows, key=lambda row: row["track"])


def _label_point(polygon: BaseGeometry) -> tuple[float | None, float | None]:
    import shapely

    if polygon.is_empty:
        return None, None
    radius = shapely.maximum_inscribed_circle(polygon, tolerance=POINT_TOLERANCE_M)
    x, y = shapely.get_coordinates(radius)[0].tolist()
    return x, y


def _event_rows(frame: TrackedSnapshot) -> list[Row]:
    return [
        {
            "kind": event.kind,
            "track": event.track,
            "others": list(event.others),
            "overlap_iou": event.overlap,
        }
        for event in frame.events
    ]


def _doorway_rows(frame: TrackedSnapshot) -> list[Row]:
    rows = []
    for doorway in frame.analysis.rooms.doorways:
        track_a, track_b = sorted(frame.track_ids[room - 1] for room in doorway.rooms)
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
