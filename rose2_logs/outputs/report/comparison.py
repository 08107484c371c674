"""Two layouts compared, as a page."""

from __future__ import annotations

import math

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.comparison.layouts import LayoutComparison
from rose2_logs.comparison.room_changes import ROOM_STATUSES
from rose2_logs.drawing.comparison_picture import ROOM_COLORS, WALL_COLORS
from rose2_logs.drawing.drawing import Drawing
from rose2_logs.outputs.report.facts import Note, Tile
from rose2_logs.outputs.report.page import drawn, render
from rose2_logs.outputs.report.words import MISSING, Cell, Column, Table, css, number, share
from rose2_logs.system.text import percent


def comparison_page(comparison: LayoutComparison, drawing: Drawing) -> str:
    """Return the page about what differs between two layouts.

    Parameters
    ----------
    comparison : LayoutComparison
    drawing : Drawing
        Its picture, see `draw_comparison`.
    """
    doubts = [Note(f"{doubt[0].upper()}{doubt[1:]}.") for doubt in comparison.doubts]
    return render(
        "comparison.html.j2",
        title=f"{comparison.a.name} and {comparison.b.name}",
        a=comparison.a.name,
        b=comparison.b.name,
        tiles=_tiles(comparison),
        notes=doubts,
        picture=drawn(drawing.svg(is_inline=True)),
        rooms=_room_table(comparison),
        walls=_wall_table(comparison),
        meanings=[
            (status, meaning) for status, meaning in ROOM_STATUSES.items() if status in comparison.room_counts
        ],
    )


def changed_rooms(comparison: LayoutComparison) -> str:
    """Count the rooms by how they changed, in words."""
    return ", ".join(f"{count} {status}" for status, count in comparison.room_counts.items()) or "none"


def _tiles(comparison: LayoutComparison) -> list[Tile]:
    x, y, yaw = comparison.placement.motion.pose
    turn = math.degrees(math.remainder(yaw, 2 * math.pi))
    placement, walls = comparison.placement, comparison.walls
    lengths = {} if walls is None else walls.lengths_m
    return [
        Tile(
            "Rooms", f"{len(comparison.a.tracks)} and {len(comparison.b.tracks)}", changed_rooms(comparison)
        ),
        Tile("Floor in both", percent(comparison.floor_iou), "intersection over union of all rooms"),
        Tile("Rooms alike", percent(comparison.rooms_iou), "mean overlap, by area"),
        Tile(
            "Walls agree",
            percent(placement.agreement),
            f"where both explored: {percent(placement.common_share)} of the smaller map's walls",
        ),
        Tile(
            "Walls that differ",
            f"{sum(lengths.values()):.1f} m",
            ", ".join(f"{length:.1f} m {status}" for status, length in lengths.items()) or "none",
        ),
        Tile("B in A's frame", f"{turn:+.1f}\u00b0", f"x {x:+.2f} m, y {y:+.2f} m"),
    ]


def _room_table(comparison: LayoutComparison) -> Table:
    rows = [
        (
            Cell(change.status, color=css(ROOM_COLORS[change.status])),
            _rooms(comparison.a, change.tracks_a),
            _rooms(comparison.b, change.tracks_b),
            share(change.iou),
            share(change.explored_share),
            number(change.area_a_m2 if change.tracks_a else None),
            number(change.area_b_m2 if change.tracks_b else None),
        )
        for change in comparison.rooms
    ]
    columns = (
        Column("what", is_number=False),
        Column("in A", is_number=False),
        Column("in B", is_number=False),
        Column("overlap", "intersection over union of the shapes"),
        Column("both explored", "share of their place that both runs have explored"),
        Column("A, m\u00b2", "area seen"),
        Column("B, m\u00b2", "area seen"),
    )
    return Table("Rooms", columns, tuple(rows))


def _rooms(layout: FinalLayout, tracks: tuple[int, ...]) -> Cell:
    return Cell(
        ", ".join(layout.name_of(track) for track in tracks) or MISSING, float(min(tracks, default=0))
    )


def _wall_table(comparison: LayoutComparison) -> Table:
    changes = () if comparison.walls is None else comparison.walls.changes
    rows = []
    for change in sorted(changes, key=lambda each: -each.length_m):
        ends = change.ends_b_m if change.ends_a_m is None else change.ends_a_m
        middle = (None, None) if ends is None else tuple(ends.reshape(2, 2).mean(axis=0).tolist())
        rows.append(
            (
                Cell(change.status, color=css(WALL_COLORS[change.status])),
                number(change.length_m),
                number(change.shift_m, 2),
                number(middle[0]),
                number(middle[1]),
            )
        )
    columns = (
        Column("what", is_number=False),
        Column("length, m"),
        Column("moved by, m", "across the wall"),
        Column("x, m", "of its middle, in A's frame"),
        Column("y, m", "of its middle, in A's frame"),
    )
    return Table("Walls that differ", columns, tuple(rows))
