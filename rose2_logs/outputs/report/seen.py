"""When the rooms of the last map were seen: the layout's growth by `analyze --back-project`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.drawing.chart import ShareLane, share_lanes
from rose2_logs.drawing.palette import track_color
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.outputs.report.charts import LANES_MOST, run_axes
from rose2_logs.outputs.report.words import Cell, Column, Table, number, room, share, when
from rose2_logs.runs.run import Run
from rose2_logs.runs.tables import BACK_PROJECTED

MOSTLY = 0.9
"""A room counts as seen once this share of its floor is: the rest is mostly behind furniture."""


@dataclass(frozen=True)
class SeenRooms:
    """A lane for each room, as SVG over coverage, and the same as a table; what was left out of the lanes."""

    lanes: str
    table: Table
    note: str


def seen_rooms(results: Run) -> SeenRooms | None:
    """Find when each room of the last map was first, and mostly, seen; None without back projection."""
    tracks, shares, areas_m2 = _shares(results)
    if not len(tracks) or shares.shape[1] < 2:
        return None
    first, mostly = _first_at_least(shares, np.finfo(float).tiny), _first_at_least(shares, MOSTLY)
    order = np.lexsort((tracks, mostly, first)).tolist()
    coverage, time_s = (results.columns[name].astype(float).tolist() for name in ("coverage", "time_s"))
    rows = {
        each: (
            room(int(tracks[each]), results.name_of),
            number(float(areas_m2[each])),
            *_seen_at(int(first[each]), coverage, time_s),
            *_seen_at(int(mostly[each]), coverage, time_s),
        )
        for each in order
    }
    largest = set(np.argsort(-areas_m2, kind="stable")[:LANES_MOST].tolist())
    axis, _ = run_axes(results)
    lanes = [
        ShareLane(
            str(tracks[each]),
            f"{row[0].text}: first seen at {row[2].text}, {MOSTLY:.0%} of it at {row[4].text} coverage",
            np.minimum(shares[each], 1.0),
            track_color(int(tracks[each])),
            int(mostly[each]) if mostly[each] < len(axis.x) else None,
        )
        for each, row in rows.items()
        if each in largest
    ]
    drawn = share_lanes(
        axis.x,
        lanes,
        title="How much of each room of the last map was seen",
        x_label=axis.label,
        x_range=axis.ends,
    ).svg(is_inline=True)
    columns = (
        Column("room", "its number over the run", is_number=False),
        Column("area, m²", "in the last map"),
        Column("first seen", "coverage when some of it was first seen"),
        Column("at time", "time into the run when some of it was first seen"),
        Column(f"{MOSTLY:.0%} seen", f"coverage when {MOSTLY:.0%} of it were seen"),
        Column("at time", f"time into the run when {MOSTLY:.0%} of it were seen"),
    )
    note = f"The {len(lanes)} largest rooms are drawn; the table has all." if len(lanes) < len(rows) else ""
    return SeenRooms(drawn, Table("When each room was seen", columns, tuple(rows.values())), note)


def _shares(results: Run) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Tracks (R,) of the last map's rooms, the share (R, N) that each map shows, their areas (R,)."""
    if not results.is_back_projected:
        return np.zeros(0, np.int64), np.zeros((0, 0)), np.zeros(0)
    table = results.table(BACK_PROJECTED)
    snapshot, track, seen = (table[name].to_numpy() for name in ("snapshot", "track", "last_area_share"))
    tracks, row = np.unique(track, return_inverse=True)
    shares = np.zeros((len(tracks), len(results.columns["snapshot"])))
    shares[row, np.searchsorted(results.columns["snapshot"], snapshot)] = seen
    last = results.table("rooms", ["snapshot", "track", "area_m2"], snapshot=results.choose())
    areas = dict(zip(last["track"].to_pylist(), last["area_m2"].to_pylist(), strict=True))
    return tracks.astype(np.int64), shares, np.array([areas.get(each, 0.0) for each in tracks.tolist()])


def _first_at_least(shares: FloatArray, least: float) -> NDArray[np.intp]:
    """Place (R,) of the first map that shows this share; the number of maps where none does."""
    reached = shares >= least
    places: NDArray[np.intp] = np.where(reached.any(axis=1), reached.argmax(axis=1), shares.shape[1])
    return places


def _seen_at(place: int, coverage: list[float], time_s: list[float]) -> tuple[Cell, Cell]:
    if place == len(coverage):
        return share(None), when(None)
    return share(coverage[place]), when(time_s[place])
