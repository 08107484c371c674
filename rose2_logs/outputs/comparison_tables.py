"""What differs between two layouts as Parquet tables and as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import shapely

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.comparison.layouts import LayoutComparison
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.runs.parquet_table import ParquetTable, Row
from rose2_logs.runs.run import Run
from rose2_logs.runs.summary import write_json

ENDS = ("x0_m", "y0_m", "x1_m", "y1_m")


def write_comparison_tables(rooms_path: Path, walls_path: Path, comparison: LayoutComparison) -> None:
    """Write how the rooms changed, one row per group of rooms, and the walls that differ.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    from rose2_logs.runs import table_schemas

    for path, schema, rows in (
        (rooms_path, table_schemas.ROOM_CHANGES, _room_rows(comparison)),
        (walls_path, table_schemas.WALL_CHANGES, _wall_rows(comparison)),
    ):
        with ParquetTable(path, schema) as table:
            table.add(rows)
            table.close()
            table.publish()


def _room_rows(comparison: LayoutComparison) -> list[Row]:
    return [
        {
            "status": change.status,
            "tracks_a": list(change.tracks_a),
            "tracks_b": list(change.tracks_b),
            "names_a": [comparison.a.name_of(track) for track in change.tracks_a],
            "names_b": [comparison.b.name_of(track) for track in change.tracks_b],
            "iou": change.iou,
            "explored_iou": change.explored_iou,
            "explored_share": change.explored_share,
            "area_a_m2": change.area_a_m2,
            "area_b_m2": change.area_b_m2,
            "predicted_area_a_m2": change.shape_a.area,
            "predicted_area_b_m2": change.shape_b.area,
            "shape_a_wkb": None if change.shape_a.is_empty else change.shape_a.wkb,
            "shape_b_wkb": None if change.shape_b.is_empty else change.shape_b.wkb,
        }
        for change in comparison.rooms
    ]


def _wall_rows(comparison: LayoutComparison) -> list[Row]:
    changes = () if comparison.walls is None else comparison.walls.changes
    return [
        {
            "status": change.status,
            "length_m": change.length_m,
            "shift_m": change.shift_m,
            **_ends("a", change.ends_a_m),
            **_ends("b", change.ends_b_m),
        }
        for change in changes
    ]


def _ends(layout: str, ends_m: FloatArray | None) -> Row:
    values = [None] * 4 if ends_m is None else ends_m.tolist()
    return {f"{layout}_{name}": value for name, value in zip(ENDS, values, strict=True)}


def write_comparison_summary(path: Path, comparison: LayoutComparison, run_a: Run, run_b: Run) -> None:
    """Write how the last layouts of two runs are aligned and how much they have in common.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    placement, walls = comparison.placement, comparison.walls
    x, y, yaw = placement.motion.pose
    summary = {
        "a": {"results": str(run_a.folder), "part": run_a.part, **_layout(comparison.a)},
        "b": {"results": str(run_b.folder), "part": run_b.part, **_layout(comparison.b)},
        "same_building": comparison.same_building,
        "ambiguous": comparison.ambiguous,
        "b_fits_if_scaled_by": comparison.scale,
        "b_in_a": {"x_m": x, "y_m": y, "yaw_rad": float(np.remainder(yaw + np.pi, 2 * np.pi) - np.pi)},
        "alignment": {
            "agreement": placement.agreement,
            "common_share": placement.common_share,
            "score": placement.score,
            "runner_up_score": placement.runner_up_score,
        },
        "floor_iou": comparison.floor_iou,
        "rooms_iou": comparison.rooms_iou,
        "rooms": comparison.room_counts,
        "walls": walls
        and {
            "compared_m": walls.compared_m,
            "kept_m": walls.kept_m,
            **{f"{status}_m": length for status, length in walls.lengths_m.items()},
        },
    }
    write_json(path, summary)


def _layout(layout: FinalLayout) -> dict[str, Any]:
    return {
        "name": layout.name,
        "rooms": len(layout.tracks),
        "area_m2": float(layout.areas_m2.sum()),
        "predicted_area_m2": float(np.sum(shapely.area(layout.shapes))),
    }
