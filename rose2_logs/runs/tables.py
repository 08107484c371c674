"""Rows of a run's tables, made from its steps and its history."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import shapely
import zstandard
from numpy.typing import NDArray

from rose2_logs.config.kinds import KindParameters
from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.model.analysis import Walls
from rose2_logs.model.labels import known_window
from rose2_logs.model.occupancy import UNKNOWN, FloatArray, classify
from rose2_logs.model.per_shape import PerShape
from rose2_logs.model.room_kinds import guess_kinds
from rose2_logs.runs.parquet_table import Columns, Row
from rose2_logs.tracking.back_projection import BackProjectedSnapshot
from rose2_logs.tracking.convergence import Convergence
from rose2_logs.tracking.track_history import SnapshotRef, TrackHistory, quality_of
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

TABLES = ("snapshots", "rooms", "tracks", "events", "doorways", "borders", "walls", "lines", "maps")
"""The tables of every run, each a file ``<name>.parquet``."""
BACK_PROJECTED = "back_projected"
"""The table that only a run has that projects its last layout back."""
FREE, BETWEEN, OCCUPIED = 0, 50, 100
"""Classes of known cells in the stored maps, as map_server would publish them: free, between the thresholds,
occupied. Unknown cells are -1."""
COMPRESSION_LEVEL = 3
"""Of zstd, its default: what is gained above it takes longer than it is worth."""
ONLY_PART = 1
"""What the tables say of a log in one piece: a number and no null, so that queries over many logs that group
or select by part lose none of them."""
CELLS_AT_ONCE = 2**20
"""Cells of an image that are converted and compressed at once."""


def snapshot_key(step: TrackedSnapshot | BackProjectedSnapshot) -> Row:
    """Return what all tables with rows per map begin with."""
    return {
        "snapshot": step.snapshot.index,
        "log_time_ns": step.snapshot.log_time_ns,
        "part": step.part or ONLY_PART,
    }


def snapshot_row(step: TrackedSnapshot, ref: SnapshotRef) -> Row:
    """Give the row of a map, as far as it is known along the run."""
    snapshot, analysis, geometry = step.snapshot, step.analysis, step.analysis.geometry
    structure, walls, plan = analysis.structure, analysis.walls, analysis.floor_plan
    change = step.change
    x, y, yaw = (0.0, 0.0, 0.0) if change is None else change.drift.pose
    return {
        "stamp_ns": snapshot.stamp_ns,
        "time_s": ref.time_s,
        "coverage": step.coverage,
        "free_area_m2": analysis.free_area_m2,
        "outside_m2": analysis.outside_m2,
        "rooms": len(analysis.rooms),
        "rooms_area_m2": float(analysis.rooms.areas_m2.sum()),
        "rooms_predicted_area_m2": float(analysis.rooms.predicted_areas_m2.sum()),
        "doorways": len(analysis.rooms.doorways),
        "directions_rad": [] if structure is None else structure.directions_rad.tolist(),
        "clean_threshold": None if structure is None else float(structure.threshold),
        "wall_segments": 0 if walls is None else len(walls.segments_m),
        "lines": 0 if walls is None else len(walls.lines_m),
        "faces": 0 if plan is None else len(plan.faces_wkb),
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


def room_rows(step: TrackedSnapshot, kinds: PerShape[str]) -> list[Row]:
    """Give a row per room, by track; the guess of kinds is told shape by shape."""
    rooms, tracks = step.analysis.rooms, step.track_ids
    rows = []
    of_rooms = zip(
        tracks,
        rooms.label_points_m.tolist(),
        kinds(rooms.polygons),
        rooms.areas_m2.tolist(),
        rooms.predicted_areas_m2.tolist(),
        shapely.is_empty(rooms.polygons),
        shapely.to_wkb(np.array(rooms.polygons, object)),
        strict=True,
    )
    for number, (track, point, kind, area_m2, predicted_m2, is_empty, wkb) in enumerate(of_rooms, start=1):
        x, y = (None, None) if is_empty else point
        wall_share, frontier_m = quality_of(step, number - 1)
        rows.append(
            {
                "track": track,
                "room": number,
                "name": step.given_name(number - 1) or None,
                "kind_guess": kind or None,
                "area_m2": area_m2,
                "predicted_area_m2": predicted_m2,
                "label_x_m": x,
                "label_y_m": y,
                "neighbors": sorted(tracks[other - 1] for other in rooms.neighbors(number)),
                "wall_support": wall_share,
                "frontier_m": frontier_m,
                "polygon_wkb": wkb,
            }
        )
    return sorted(rows, key=lambda row: row["track"])


def event_rows(step: TrackedSnapshot) -> list[Row]:
    """Give a row per event."""
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


def doorway_rows(step: TrackedSnapshot) -> list[Row]:
    """Give a row per doorway."""
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


def border_rows(step: TrackedSnapshot) -> list[Row]:
    """Give a row per pair of neighboring rooms, by their tracks."""
    rows = []
    for border in step.analysis.borders:
        track_a, track_b = sorted(step.track_ids[room - 1] for room in border.rooms)
        rows.append(
            {
                "track_a": track_a,
                "track_b": track_b,
                "kind": border.kind,
                "width_m": border.width_m,
                "strength": border.strength,
            }
        )
    return sorted(rows, key=lambda row: (row["track_a"], row["track_b"]))


def wall_columns(walls: Walls) -> Columns:
    """Give the columns of the wall segments."""
    return _ends_of(walls.segments_m) | {"direction": walls.segment_direction, "line": walls.segment_cluster}


def line_columns(walls: Walls) -> Columns:
    """Give the columns of the representative lines."""
    return _ends_of(walls.lines_m) | {"direction": walls.line_direction, "weight": walls.line_weight}


def _ends_of(ends_m: FloatArray) -> Columns:
    """Columns for the ends x0, y0, x1, y1 (N, 4) of lines."""
    return dict(zip(("x0_m", "y0_m", "x1_m", "y1_m"), ends_m.T, strict=True))


def map_row(step: TrackedSnapshot, parameters: OccupancyParameters) -> Row:
    """Give the explored window of a map: the classes of its cells, and the track of each cell."""
    rows, columns = known_window(step.snapshot.cells != UNKNOWN)
    cells, labels = step.snapshot.cells[rows, columns], step.analysis.rooms.labels[rows, columns]
    track_of_room = np.array([0, *step.track_ids], "<i4")
    return {
        "first_row": rows.start,
        "first_column": columns.start,
        "rows": rows.stop - rows.start,
        "columns": columns.stop - columns.start,
        "cells_zstd": pack_image(cells, lambda part: cell_classes(part, parameters)),
        "labels_zstd": pack_image(labels, lambda part: track_of_room.take(part, mode="clip")),
    }


def cell_classes(cells: NDArray[np.int8], parameters: OccupancyParameters) -> NDArray[np.int8]:
    """Classes of cells: -1 unknown, `FREE`, `BETWEEN` the thresholds, `OCCUPIED`."""
    import cv2

    values = np.arange(256, dtype=np.uint8).view(np.int8)
    free, occupied = classify(values, parameters)
    classes = np.where(values == UNKNOWN, np.int8(UNKNOWN), np.int8(BETWEEN))
    classes[free], classes[occupied] = FREE, OCCUPIED
    found = cv2.LUT(np.ascontiguousarray(cells).view(np.uint8), classes.view(np.uint8))
    return np.asarray(found, np.uint8).view(np.int8)


def pack_image(image: NDArray[Any], convert: Callable[[NDArray[Any]], NDArray[Any]] = np.asarray) -> bytes:
    """Compress an image (H, W), converted some rows at a time, row by row as one Zstandard frame."""
    packer = zstandard.ZstdCompressor(COMPRESSION_LEVEL).compressobj()
    parts = np.array_split(image, max(1, image.size // CELLS_AT_ONCE))
    flat = (np.ascontiguousarray(convert(part)).reshape(-1) for part in parts)
    packed = [packer.compress(part.view("u1").data) for part in flat]
    return b"".join([*packed, packer.flush()])


def unpack_image(packed: bytes, shape: tuple[int, int], dtype: str) -> NDArray[Any]:
    """Undo `pack_image`.

    Raises
    ------
    ValueError
        If the bytes are not such an image of that shape.
    """
    size = shape[0] * shape[1] * np.dtype(dtype).itemsize
    try:
        # One byte more than wanted, so that data that is too long is noticed.
        data = zstandard.ZstdDecompressor().stream_reader(packed).read(size + 1)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from error
    if len(data) != size:
        raise ValueError(f"it does not hold {shape[0]} x {shape[1]} cells")
    return np.frombuffer(data, dtype).reshape(shape)


def back_projected_rows(found: BackProjectedSnapshot) -> list[Row]:
    """Give a row per room of the last map of which the map shows something."""
    areas_m2, last_m2 = found.rooms.areas_m2, found.last_rooms.areas_m2
    return [
        {"track": track, "area_m2": areas_m2[room], "last_area_share": areas_m2[room] / last_m2[room]}
        for room, track in enumerate(found.track_ids)
        if areas_m2[room] > 0
    ]


def track_row(
    track: int, history: TrackHistory, convergence: Convergence, kinds: KindParameters, *, in_last_map: bool
) -> Row:
    """Give the row of a track."""
    return {
        "track": track,
        "name": history.name or None,
        "kind_guess": guess_kinds([history.polygon], kinds)[0] or None,
        **_snapshot_ref_columns("first", history.first),
        **_snapshot_ref_columns("last", history.last),
        "maps": history.maps,
        "area_m2": history.area_m2,
        "predicted_area_m2": history.polygon.area,
        **_snapshot_ref_columns("area_settled", convergence.area_settled[track]),
        **_snapshot_ref_columns("shape_right", convergence.shape_right.get(track)),
        "shape_right_seen_share": convergence.shape_right_seen.get(track),
        "in_last_map": in_last_map,
        "wall_support": history.wall_support,
        "frontier_m": history.frontier_m,
        "splits": history.splits,
        "merges": history.merges,
        "losses": history.losses,
        "polygon_wkb": history.polygon.wkb,
    }


def _snapshot_ref_columns(name: str, snapshot_ref: SnapshotRef | None) -> dict[str, Any]:
    return {
        f"{name}_snapshot": snapshot_ref and snapshot_ref.snapshot,
        f"{name}_time_s": snapshot_ref and snapshot_ref.time_s,
        f"{name}_coverage": snapshot_ref and snapshot_ref.coverage,
    }
