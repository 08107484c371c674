"""The report's tables: rooms, doorways, events, parameters, files; long ones cut to what can be read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rose2_logs.config.parameters import describe_parameters
from rose2_logs.model.room_names import short_name
from rose2_logs.model.room_plan import RoomPlan
from rose2_logs.outputs.report.words import (
    MISSING,
    Cell,
    Column,
    Table,
    count,
    number,
    room,
    share,
    size,
    when,
)
from rose2_logs.runs.run import Run

ROWS_MOST = 300
"""Rows of a table: more are useful to programs only, and those are in the Parquet tables."""
EVENT_WORDS = {
    "part_begun": "the map was begun anew",
    "shifted": "the whole map shifted",
    "split": "split",
    "merged": "merged with",
    "returned": "came back",
    "lost": "was lost",
    "born": "was first seen",
}
"""Kinds of events in words, those first that are kept where there are too many."""


def room_table(results: Run, plan: RoomPlan) -> Table:
    """Every room of the run: where it is at the end, and since when it was right."""
    tracks = results.table("tracks").drop_columns(["polygon_wkb"]).to_pylist()
    neighbors = {each.number: each.neighbors for each in plan.rooms}
    tracks.sort(key=lambda row: (not row["in_last_map"], -row["area_m2"]))
    shown = sorted(tracks[:ROWS_MOST], key=lambda row: (not row["in_last_map"], row["track"]))
    rows = [
        (
            room(row["track"], results.name_of),
            Cell(row["kind_guess"] or MISSING),
            Cell("yes" if row["in_last_map"] else "no"),
            number(row["area_m2"]),
            number(row["predicted_area_m2"]),
            share(row["wall_support"]),
            number(row["frontier_m"]),
            Cell(_others(neighbors.get(row["track"], ()), results)),
            share(row["first_coverage"]),
            when(row["first_time_s"]),
            *(
                share(row[name] if row["in_last_map"] else None)
                for name in ("shape_right_coverage", "shape_right_seen_share", "area_settled_coverage")
            ),
            count(row["maps"]),
            count(row["splits"]),
            count(row["merges"]),
            count(row["losses"]),
        )
        for row in shown
    ]
    columns = (
        Column("room", "its number over the run, or the name that it was given", is_number=False),
        Column("kind?", "guessed from its shape alone", is_number=False),
        Column("last map", "whether the last map shows it", is_number=False),
        Column("area, m²", "as far as it was seen"),
        Column("with predicted, m²", "area of its shape, the unseen part included"),
        Column("wall support", "share of its outline supported by walls: how sure it is"),
        Column("frontier, m", "open border towards unknown floor"),
        Column("doorways to", "rooms behind its doorways in the last map", is_number=False),
        Column("first seen", "coverage when it was first seen"),
        Column("at time", "time into the run when it was first seen"),
        Column(
            "shape right",
            "coverage when its shape first overlapped the last one by 0.8; of rooms of the last map only",
        ),
        Column("of it seen", "how much of it had been seen by then: low is an early, right prediction"),
        Column(
            "area settled",
            "coverage from which on its area stayed within 10 % of the last; of rooms of the last map only",
        ),
        Column("maps", "number of maps that show it"),
        Column("splits", "how often it was split"),
        Column("merges", "how often another room merged into it"),
        Column("losses", "how often it was lost"),
    )
    return Table("Rooms", columns, tuple(rows), _cut(len(tracks), len(shown), "tracks.parquet"))


def _others(tracks: Sequence[int], results: Run) -> str:
    """List rooms in a narrow column."""
    return ", ".join(short_name(track, results.name_of) for track in tracks) or MISSING


def doorway_table(results: Run, plan: RoomPlan) -> Table:
    """Doorways of the last map, and since when their rooms were known as neighbors."""
    known = results.table("doorways", ["snapshot", "track_a", "track_b"])
    first: dict[tuple[int, int], int] = {}
    columns = (known[name].to_pylist() for name in ("snapshot", "track_a", "track_b"))
    for snapshot, *pair in zip(*columns, strict=True):
        first.setdefault((pair[0], pair[1]), snapshot)
    coverage = dict(
        zip(results.columns["snapshot"].tolist(), results.columns["coverage"].tolist(), strict=True)
    )
    doors = sorted(plan.doorways, key=lambda door: (door.rooms, door.ends_m.tolist()))
    rows = [
        (
            room(door.rooms[0], results.name_of),
            room(door.rooms[1], results.name_of),
            number(door.width_m, 2),
            number(float(door.ends_m[:, 0].mean()), 2),
            number(float(door.ends_m[:, 1].mean()), 2),
            share(coverage.get(first.get(door.rooms, -1))),
        )
        for door in doors[:ROWS_MOST]
    ]
    headings = (
        Column("room", is_number=False),
        Column("and room", is_number=False),
        Column("width, m", "clear width"),
        Column("x, m", "of its middle, in the map's frame"),
        Column("y, m", "of its middle, in the map's frame"),
        Column("known from", "coverage when a doorway between these rooms was first found"),
    )
    return Table("Doorways", headings, tuple(rows), _cut(len(doors), len(rows), "doorways.parquet"))


def unsure_border_table(results: Run, plan: RoomPlan) -> Table:
    """Borders of the last map that may be read otherwise, the least sure ones first."""
    unsure = sorted((each.strength, each.rooms, each) for each in plan.borders if each.is_unsure)
    rows = [
        (
            room(border.rooms[0], results.name_of),
            room(border.rooms[1], results.name_of),
            Cell(border.kind),
            number(border.width_m, 2),
            share(border.strength),
        )
        for _, _, border in unsure[:ROWS_MOST]
    ]
    headings = (
        Column("room", is_number=False),
        Column("and room", is_number=False),
        Column(
            "border", "wall: no doorway is known between them; opening: wider than a door", is_number=False
        ),
        Column("width, m", "clear width of the widest doorway between them"),
        Column("strength", "probability that they are different rooms"),
    )
    name = "Borders that may be read otherwise"
    return Table(name, headings, tuple(rows), _cut(len(unsure), len(rows), "borders.parquet"))


def event_table(results: Run) -> Table:
    """What happened to the rooms, without their mere going on."""
    import pyarrow.compute as pc

    table = results.table("events")
    table = table.filter(pc.not_equal(table["kind"], "continued"))
    events = table.to_pylist()
    ranks = {kind: rank for rank, kind in enumerate(EVENT_WORDS)}
    ranked = sorted(
        range(len(events)), key=lambda place: (ranks.get(events[place]["kind"], len(ranks)), place)
    )
    shown = [events[place] for place in sorted(ranked[:ROWS_MOST])]
    rows = [_event_row(results, event) for event in shown]
    columns = (
        Column("map"),
        Column("coverage"),
        Column("time"),
        Column("room", is_number=False),
        Column("what", is_number=False),
        Column("other rooms", "parts of a split, rooms that a merge ended", is_number=False),
        Column("overlap", "intersection over union with the room's shape before"),
    )
    return Table("Events", columns, tuple(rows), _cut(len(events), len(shown), "events.parquet"))


def _event_row(results: Run, event: dict[str, Any]) -> tuple[Cell, ...]:
    row = results.row(event["snapshot"])
    kind, text = event["kind"], EVENT_WORDS.get(event["kind"], event["kind"])
    if kind == "shifted":
        shift_m = math.hypot(event["shift_x_m"], event["shift_y_m"])
        text += f" by {shift_m:.2f} m and {math.degrees(event['turn_rad']):.2f}°"
    overlap = number(event["overlap_iou"], 2) if kind in ("split", "merged", "returned") else Cell(MISSING)
    return (
        count(event["snapshot"]),
        share(row["coverage"]),
        when(row["time_s"]),
        room(event["track"], results.name_of) if event["track"] else Cell("all"),
        Cell(text),
        Cell(_others(event["others"], results)),
        overlap,
    )


def parameter_table(results: Run) -> Table:
    """Every parameter with the value it had, and those that were changed first."""
    used = results.summary.get("parameters", {})
    rows: list[tuple[Cell, ...]] = []
    changed_rows: list[tuple[Cell, ...]] = []
    for about in describe_parameters():
        value = used.get(about["block"], {}).get(about["name"])
        if value is None:
            continue
        changed = value != about["default"]
        cells = (
            Cell(f"{about['block']}.{about['name']}"),
            _value(value),
            Cell(str(about["unit"])),
            Cell(f"changed from {_value(about['default']).text}" if changed else "default"),
            Cell(str(about["why"])),
        )
        (changed_rows if changed else rows).append(cells)
    columns = (
        Column("parameter", is_number=False),
        Column("value"),
        Column("unit", is_number=False),
        Column("set", is_number=False),
        Column("why", is_number=False),
    )
    return Table("Parameters", columns, (*changed_rows, *rows))


def _value(value: object) -> Cell:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return Cell(f"{value:.6g}", float(value))
    return Cell(str(value))


def software_table(results: Run) -> Table:
    """Log, fingerprint, software and times of the run."""
    summary = results.summary
    about = {"SHA-256 of the log": summary.get("input", {}).get("sha256", MISSING)}
    about |= summary.get("versions", {})
    seconds = summary.get("seconds", {})
    if "run" in seconds:
        about["time of the analysis"] = f"{seconds['run']:.1f} s, {seconds.get('workers', 1)} process(es)"
    for stage, total in seconds.get("stages", {}).items():
        about[f"stage {stage}"] = (
            f"{total:.2f} s in all, {seconds['stages_max'].get(stage, total):.2f} s at most for a map"
        )
    columns = (Column("what", is_number=False), Column("value", is_number=False))
    return Table(
        "Software and times", columns, tuple((Cell(name), Cell(str(text))) for name, text in about.items())
    )


def files_of(results: Run) -> list[tuple[str, str]]:
    """Names and sizes of the other results that are there."""
    names = [str(name) for name in results.summary["files"]] + ["summary.json"]
    paths = [results.folder / Path(name).name for name in names]
    return [(path.name, size(path.stat().st_size)) for path in paths if path.is_file()]


def _cut(of: int, shown: int, table: str) -> str:
    return f"{shown} of {of} are shown; all stand in {table}." if shown < of else ""


def changed_parameters(table: Table) -> Sequence[str]:
    """Names of the parameters in a table of them that have not their default."""
    return [row[0].text for row in table.rows if row[3].text != "default"]
