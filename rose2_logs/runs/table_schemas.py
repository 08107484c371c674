"""What the columns of the tables are: name, type, unit and meaning, as written into the files."""

from __future__ import annotations

import json
from typing import Any

import pyarrow as pa


def _table(columns: dict[str, tuple[pa.DataType, str]], metadata: dict[str, str] | None = None) -> pa.Schema:
    """Build a schema; each column's meaning is its field metadata ``description``."""
    fields = [
        pa.field(name, kind, nullable=name in _NULLABLE, metadata={"description": meaning})
        for name, (kind, meaning) in columns.items()
    ]
    return pa.schema(fields, metadata=metadata)


_NULLABLE = frozenset(
    {
        "name",
        "kind_guess",
        "label_x_m",
        "label_y_m",
        "clean_threshold",
        "wall_support",
        "frontier_m",
        "variation_bits",
        "changed_share",
        "final_iou",
        "final_share",
        "known_final_share",
        "shift_x_m",
        "shift_y_m",
        "turn_rad",
        "shape_right_snapshot",
        "shape_right_time_s",
        "shape_right_coverage",
        "shape_right_seen_share",
        "explored_iou",
        "shape_a_wkb",
        "shape_b_wkb",
        "shift_m",
        *(f"{layout}_{end}_m" for layout in "ab" for end in ("x0", "y0", "x1", "y1")),
    }
)

_PART: dict[str, tuple[pa.DataType, str]] = {
    "part": (
        pa.int32(),
        "part of the log, from 1, whose maps grow from each other; 1 in a log in one piece",
    ),
}

_SNAPSHOT: dict[str, tuple[pa.DataType, str]] = {
    "snapshot": (pa.int32(), "number of the snapshot among the distinct maps, from 0"),
    "log_time_ns": (pa.int64(), "when the map was recorded, nanoseconds since the epoch"),
    **_PART,
}

_EVIDENCE: dict[str, tuple[pa.DataType, str]] = {
    "wall_support": (
        pa.float64(),
        "share of the outline, including its predicted part, supported by occupied cells; doorways are not",
    ),
    "frontier_m": (pa.float64(), "open frontier: border of its free cells to unknown ones, meters"),
}

_CALLED: dict[str, tuple[pa.DataType, str]] = {
    "name": (pa.string(), "name that a person gave it; null for none"),
    "kind_guess": (
        pa.string(),
        "corridor, hall, closet or room: a guess from its shape, by the parameters kinds; null without one",
    ),
}

_SNAPSHOTS_ALONG: dict[str, tuple[pa.DataType, str]] = {
    **_SNAPSHOT,
    "stamp_ns": (pa.int64(), "header stamp of the map, nanoseconds"),
    "time_s": (pa.float64(), "log time since the first snapshot, seconds"),
    "coverage": (pa.float64(), "known free area divided by that of the run's last map, in [0, 1]"),
    "free_area_m2": (pa.float64(), "known free area, square meters"),
    "outside_m2": (pa.float64(), "free area left out as outside the building, square meters"),
    "rooms": (pa.int32(), "number of rooms"),
    "rooms_area_m2": (pa.float64(), "area seen of all rooms, square meters"),
    "rooms_predicted_area_m2": (
        pa.float64(),
        "area of all rooms including their predicted parts, square meters",
    ),
    "doorways": (pa.int32(), "number of doorways between rooms"),
    "directions_rad": (
        pa.list_(pa.float64()),
        "dominant directions, world frame, strongest first, radians",
    ),
    "clean_threshold": (pa.float64(), "structure score from which cells are in the clean map"),
    "wall_segments": (pa.int32(), "number of wall segments"),
    "lines": (pa.int32(), "number of representative lines"),
    "faces": (pa.int32(), "number of faces"),
    "repeats_before": (pa.int32(), "identical maps dropped since the previous snapshot"),
    "frame_id": (pa.string(), "name of the world frame"),
    "resolution_m": (pa.float64(), "side of a cell, meters"),
    "analyzed_resolution_m": (
        pa.float64(),
        "cell size at which the map was analyzed, meters; larger than resolution_m if that is very fine, "
        "or the map very large",
    ),
    "origin_x_m": (pa.float64(), "world x of the grid's origin, meters"),
    "origin_y_m": (pa.float64(), "world y of the grid's origin, meters"),
    "yaw_rad": (pa.float64(), "rotation of the grid in the world, radians counter-clockwise"),
    "height_cells": (pa.int32(), "rows of the grid"),
    "width_cells": (pa.int32(), "columns of the grid"),
    "frontier_m": (pa.float64(), "open frontier of all rooms, meters"),
    "variation_bits": (
        pa.float64(),
        "variation of information between the rooms of the map before and of this one, over the floor in "
        "a room in both, bits; 0 for the same rooms, null without a map before",
    ),
    "changed_share": (
        pa.float64(),
        "share of this floor whose track is not the one of the previous map",
    ),
    "drift_x_m": (pa.float64(), "position of the first map's frame in this map: x of its origin, meters"),
    "drift_y_m": (pa.float64(), "y of its origin, meters"),
    "drift_yaw_rad": (
        pa.float64(),
        "rotation of that frame, radians counter-clockwise; changes with shifted events",
    ),
}

SNAPSHOTS_ALONG = _table(_SNAPSHOTS_ALONG)
"""Snapshots as far as they are known along the run."""

SNAPSHOTS = _table(
    {
        **_SNAPSHOTS_ALONG,
        "final_iou": (
            pa.float64(),
            "mean intersection over union of the last map's rooms with the rooms of this map that are most "
            "like them, weighted by area; 0 for a room that does not exist yet",
        ),
        "final_share": (
            pa.float64(),
            "share of the last layout, by area, in rooms that a room of this map overlaps by "
            "tracking.final_room_min_iou",
        ),
        "known_final_share": (
            pa.float64(),
            "the same of the floor that is in a room in this map and in the last one, compared on this floor "
            "alone; null without such floor",
        ),
    }
)

GEOPARQUET: dict[str, Any] = {
    "version": "1.1.0",
    "primary_column": "polygon_wkb",
    "columns": {
        "polygon_wkb": {"encoding": "WKB", "geometry_types": ["Polygon", "MultiPolygon"], "crs": None}
    },
}
"""Lets GeoPandas, DuckDB and QGIS read the polygons; the frame is the map's, so there is no CRS."""

ROOMS = _table(
    {
        **_SNAPSHOT,
        "track": (pa.int32(), "number of the room over the run, from 1"),
        "room": (pa.int32(), "number of the room in this snapshot, from 1"),
        **_CALLED,
        "area_m2": (pa.float64(), "area seen, square meters"),
        "predicted_area_m2": (
            pa.float64(),
            "area of the polygon, including the predicted part, square meters",
        ),
        "label_x_m": (pa.float64(), "world x of a point well inside the part seen, meters"),
        "label_y_m": (pa.float64(), "world y of the same point, meters"),
        "neighbors": (pa.list_(pa.int32()), "tracks of the rooms behind its doorways, ascending"),
        **_EVIDENCE,
        "polygon_wkb": (pa.binary(), "shape with the predicted part, well-known binary, world meters"),
    },
    {"geo": json.dumps(GEOPARQUET, sort_keys=True)},
)

EVENTS = _table(
    {
        **_SNAPSHOT,
        "kind": (pa.string(), "part_begun, shifted, continued, returned, born, split, merged or lost"),
        "track": (
            pa.int32(),
            "the track concerned; for a merge the one that remains; 0 if the whole map shifted or was begun "
            "anew",
        ),
        "others": (pa.list_(pa.int32()), "tracks of the parts of a split, tracks that a merge ended"),
        "overlap_iou": (
            pa.float64(),
            "intersection over union with the track's last shape, share; 0 for none",
        ),
        "shift_x_m": (pa.float64(), "for a shift, how far the center of the walls moved in x, meters"),
        "shift_y_m": (pa.float64(), "y, meters"),
        "turn_rad": (pa.float64(), "rotation of the map about that center, radians counter-clockwise"),
    }
)

DOORWAYS = _table(
    {
        **_SNAPSHOT,
        "track_a": (pa.int32(), "track of the room on one side, the smaller number"),
        "track_b": (pa.int32(), "track of the room on the other side"),
        "width_m": (pa.float64(), "clear width, meters"),
        "x0_m": (pa.float64(), "world x of one end, meters"),
        "y0_m": (pa.float64(), "world y of one end, meters"),
        "x1_m": (pa.float64(), "world x of the other end, meters"),
        "y1_m": (pa.float64(), "world y of the other end, meters"),
    }
)

BORDERS = _table(
    {
        **_SNAPSHOT,
        "track_a": (pa.int32(), "track of the room on one side, the smaller number"),
        "track_b": (pa.int32(), "track of the room on the other side"),
        "kind": (
            pa.string(),
            "wall (no doorway is known between them), door, or opening (a doorway wider than a door)",
        ),
        "width_m": (pa.float64(), "clear width of the widest doorway between them, meters; 0 for a wall"),
        "strength": (
            pa.float64(),
            "probability that they are different rooms, by the fitted strength; 1 where all between "
            "them is wall",
        ),
    }
)
"""What lies between neighboring rooms."""

BACK_PROJECTED = _table(
    {
        **_SNAPSHOT,
        "track": (pa.int32(), "a room of the run's last map"),
        "area_m2": (pa.float64(), "area of it that this map shows, square meters"),
        "last_area_share": (
            pa.float64(),
            "this area divided by the room's area in the last map; above 1 if later maps lost some of it",
        ),
    }
)
"""The last map's rooms on all maps, of `analyze --back-project`."""

TRACKS = _table(
    {
        "track": (pa.int32(), "number of the room over the run, from 1"),
        **_PART,
        **_CALLED,
        "first_snapshot": (pa.int32(), "first map that shows it"),
        "first_time_s": (pa.float64(), "when that was, log time since the first map, seconds"),
        "first_coverage": (pa.float64(), "coverage then, share in [0, 1]"),
        "last_snapshot": (pa.int32(), "last map that shows it"),
        "last_time_s": (pa.float64(), "when that was, seconds"),
        "last_coverage": (pa.float64(), "coverage then, share in [0, 1]"),
        "maps": (pa.int32(), "number of maps that show it"),
        "in_last_map": (pa.bool_(), "whether the last map of its part shows it"),
        "area_m2": (pa.float64(), "its last area, as far as it was seen, square meters"),
        "predicted_area_m2": (pa.float64(), "area of its last shape, with the predicted part, square meters"),
        "area_settled_snapshot": (pa.int32(), "map from which on its area was within 10 % of the last"),
        "area_settled_time_s": (pa.float64(), "when that was, seconds"),
        "area_settled_coverage": (pa.float64(), "coverage then, share in [0, 1]"),
        "shape_right_snapshot": (
            pa.int32(),
            "first map whose shape, with the predicted part, overlaps the last by 0.8; null without a shape",
        ),
        "shape_right_time_s": (pa.float64(), "when that was, seconds"),
        "shape_right_coverage": (pa.float64(), "coverage then, share in [0, 1]"),
        "shape_right_seen_share": (
            pa.float64(),
            "area seen by then divided by its last area: the lower, the earlier the prediction was right",
        ),
        **_EVIDENCE,
        "splits": (pa.int32(), "how often it was split"),
        "merges": (pa.int32(), "how often it absorbed other tracks"),
        "losses": (pa.int32(), "how often it was lost"),
        "polygon_wkb": (pa.binary(), "its last shape, well-known binary, world meters"),
    },
    {"geo": json.dumps(GEOPARQUET, sort_keys=True)},
)

_ENDS: dict[str, tuple[pa.DataType, str]] = {
    "x0_m": (pa.float64(), "world x of one end, meters"),
    "y0_m": (pa.float64(), "world y of one end, meters"),
    "x1_m": (pa.float64(), "world x of the other end, meters"),
    "y1_m": (pa.float64(), "world y of the other end, meters"),
}

WALLS = _table(
    {
        **_SNAPSHOT,
        **_ENDS,
        "direction": (
            pa.int32(),
            "the segment's direction: index into directions_rad of the map; greater for a local direction",
        ),
        "line": (
            pa.int32(),
            "number of the wall cluster's representative line among the map's lines, from 0; -1 for none",
        ),
    }
)
"""Wall segments of every map."""

LINES = _table(
    {
        **_SNAPSHOT,
        **_ENDS,
        "direction": (
            pa.int32(),
            "its direction: index into directions_rad of the map; greater for a local one",
        ),
        "weight": (pa.float64(), "share of the line that wall segments cover, in [0, 1]"),
    }
)
"""Representative lines of every map."""

MAPS = _table(
    {
        **_SNAPSHOT,
        "first_row": (pa.int32(), "first row of the explored window in the grid"),
        "first_column": (pa.int32(), "first column of the explored window in the grid"),
        "rows": (pa.int32(), "number of rows of the window"),
        "columns": (pa.int32(), "number of columns of the window"),
        "cells_zstd": (
            pa.binary(),
            "Zstandard frame of int8 for each cell of the window, row by row from the origin: -1 unknown, "
            "0 free, 50 between the thresholds, 100 occupied",
        ),
        "labels_zstd": (
            pa.binary(),
            "label image: Zstandard frame of little-endian int32 for each cell of the window, row by row "
            "from the origin: track of its room, 0 for none",
        ),
    }
)
"""The map and the label image of every snapshot."""

SCHEMAS = {
    "snapshots_along": SNAPSHOTS_ALONG,
    "snapshots": SNAPSHOTS,
    "rooms": ROOMS,
    "tracks": TRACKS,
    "events": EVENTS,
    "doorways": DOORWAYS,
    "borders": BORDERS,
    "walls": WALLS,
    "lines": LINES,
    "maps": MAPS,
    "back_projected": BACK_PROJECTED,
}
"""The schema of each table of a run."""

ROOM_CHANGES = _table(
    {
        "status": (
            pa.string(),
            "same, partly seen, changed, split, merged, regrouped, missing, new or unseen",
        ),
        "tracks_a": (pa.list_(pa.int32()), "tracks of the rooms of A, ascending; none for a new room"),
        "tracks_b": (pa.list_(pa.int32()), "tracks of the rooms of B, ascending; none for a missing room"),
        "names_a": (pa.list_(pa.string()), "what these rooms are called in A"),
        "names_b": (pa.list_(pa.string()), "what these rooms are called in B"),
        "iou": (pa.float64(), "intersection over union of A's and B's shapes, share"),
        "explored_iou": (
            pa.float64(),
            "the same where both runs have explored, share; null where they nowhere have",
        ),
        "explored_share": (pa.float64(), "share of the place of both shapes that both runs have explored"),
        "area_a_m2": (pa.float64(), "area in A as far as it was seen, square meters"),
        "area_b_m2": (pa.float64(), "area in B as far as it was seen, square meters"),
        "predicted_area_a_m2": (pa.float64(), "area of A's shape, with the predicted part, square meters"),
        "predicted_area_b_m2": (pa.float64(), "area of B's shape, with the predicted part, square meters"),
        "shape_a_wkb": (
            pa.binary(),
            "shape in A with the predicted part, well-known binary, A's frame, meters",
        ),
        "shape_b_wkb": (pa.binary(), "shape in B, likewise, also in A's frame"),
    },
)
"""Rooms of two layouts, of `compare`."""

WALL_CHANGES = _table(
    {
        "status": (pa.string(), "missing, new or moved"),
        "length_m": (pa.float64(), "length of the stretch, of a moved wall the longer of the two, meters"),
        "shift_m": (pa.float64(), "of a moved wall, how far it is from where it was, across it, meters"),
        "a_x0_m": (pa.float64(), "x of one end in A, A's frame, meters; null for a new wall"),
        "a_y0_m": (pa.float64(), "y of it"),
        "a_x1_m": (pa.float64(), "x of the other end in A"),
        "a_y1_m": (pa.float64(), "y of it"),
        "b_x0_m": (pa.float64(), "x of one end in B, A's frame, meters; null for a missing wall"),
        "b_y0_m": (pa.float64(), "y of it"),
        "b_x1_m": (pa.float64(), "x of the other end in B"),
        "b_y1_m": (pa.float64(), "y of it"),
    }
)
"""Walls that differ between two layouts, of `compare`."""
