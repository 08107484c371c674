"""What the report says of a run in words: the figures at its head, and what is worth a look."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rose2_logs.model.analysis import left_out_note
from rose2_logs.model.borders import UNSURE_BORDER_BELOW
from rose2_logs.model.room_plan import RoomPlan
from rose2_logs.model.room_quality import UNSURE_BELOW
from rose2_logs.outputs.report.words import MISSING, date_of, duration, size
from rose2_logs.runs.run import Run, is_last
from rose2_logs.system.text import listed, percent

LATE_COVERAGE = 0.95
"""A layout that became final only beyond would likely have changed if the run had gone on."""
FRONTIER_MIN_M = 2.0
"""Open frontiers from this length on are reported: a doorway's width and more."""
PREDICTED_SHARE = 0.25
"""Rooms of whose shape more than this share was not seen are reported."""
NAMED_MOST = 6
"""Rooms named in one sentence."""
NOT_FINAL = "still changing"


@dataclass(frozen=True)
class Tile:
    """One figure at the head: what, how much, and a few words more."""

    name: str
    value: str
    more: str = ""


@dataclass(frozen=True)
class Note:
    """A sentence about what is worth a look; a warning or merely good to know."""

    text: str
    is_warning: bool = True


def subtitle(results: Run) -> list[tuple[str, str]]:
    """Log, time, topic and method, by name."""
    summary, found = results.summary, results.summary["results"]
    time_s = results.columns["time_s"]
    span = time_s[-1] - time_s[0]
    date = date_of(found.get("first_log_time_ns"))
    began = f"{date}, " if date else ""
    source = summary.get("input", {})
    length = size(source["size_bytes"]) if "size_bytes" in source else ""
    about = ", ".join(part for part in (source.get("format", ""), length) if part)
    return [
        ("Log", f"{summary['log']} ({about})" if about else str(summary["log"])),
        ("Recorded", f"{began}{duration(span)} from the first to the last map"),
        ("Map topic", f"{summary['topic']} in frame {results.columns['frame_id'][-1]}"),
        ("Method", f"{summary['method']}, rose2-logs {summary['versions'].get('rose2-logs', '')}".strip()),
        *_part(results),
    ]


def _part(results: Run) -> list[tuple[str, str]]:
    """Say which part of the log the page is about, where the log has several."""
    if results.part is None:
        return []
    numbers = results.columns["snapshot"]
    others = [number for number in results.parts if number != results.part]
    more = "".join(f"; part {number} can have a report of its own" for number in others[:1])
    count = results.summary.get("decided", {}).get("parts", {}).get("count", len(results.parts))
    return [("Part of the log", f"{results.part} of {count}, maps {numbers[0]} to {numbers[-1]}{more}")]


def tiles(results: Run, plan: RoomPlan) -> list[Tile]:
    """Figures of the whole run."""
    found, layout = results.summary["results"], results.summary.get("layout", {})
    seen = sum(room.area_m2 for room in plan.rooms)
    shapes = sum(room.predicted_area_m2 for room in plan.rooms)
    sure = layout.get("wall_support_median")
    return [
        Tile(
            "Maps",
            str(found["snapshots"]),
            f"{percent(found['coverage_first'])} to {percent(found['coverage_last'])} coverage",
        ),
        Tile("Rooms at the end", str(found["rooms_last"]), _followed(found)),
        Tile("Floor in rooms", f"{seen:.0f} m²", f"{shapes:.0f} m² with predicted parts"),
        Tile("Doorways", str(len(plan.doorways)), "between rooms, last map"),
        Tile("Layout final from", *_final(layout.get("final_since"), results.choose())),
        Tile("Known part final from", *_final(layout.get("known_final_since"), results.choose())),
        Tile(
            "Outlines supported by walls",
            MISSING if sure is None else percent(sure),
            "median of the last map's rooms",
        ),
    ]


def _followed(found: dict[str, Any]) -> str:
    """Say how many rooms had a number, and how many of them were soon gone."""
    brief = found["brief_tracks"]
    return f"{found['tracks']} followed over the run" + (f", {brief} only briefly" if brief else "")


def _final(final: dict[str, Any] | None, last: int) -> tuple[str, str]:
    """Say from what map on the layout was final; if that is the last, it never was for sure."""
    if final is None or is_last(final, last):
        return NOT_FINAL, "rooms changed up to the last map"
    snapshot_ref = f"map {final['snapshot']}, {duration(final['time_s'])} into the run"
    return f"{percent(final['coverage'])} coverage", snapshot_ref


def notes(results: Run, plan: RoomPlan) -> list[Note]:
    """List what is not as it should be, or is unsure."""
    summary = results.summary
    found, messages = summary["results"], summary.get("messages", {})
    found_notes: list[Note] = []
    if found.get("invalid_maps"):
        found_notes.append(Note(f"{found['invalid_maps']} maps could not be analyzed and were left out."))
    if messages.get("damaged"):
        found_notes.append(Note(f"{messages['damaged']} messages of the log were damaged and were left out."))
    if found["snapshots"] > 1:
        found_notes += _layout_notes(summary.get("layout", {}), results.choose())
    found_notes += _room_notes(plan)
    found_notes += _border_notes(plan)
    found_notes += _shift_notes(results)
    if messages.get("skipped"):
        taken = f"{messages['skipped']} of {messages['messages']} map messages were skipped, as requested."
        found_notes.append(Note(taken, is_warning=False))
    row = results.row(results.choose())
    left_out = left_out_note(float(row["outside_m2"]), float(row["free_area_m2"]))
    if left_out is not None:
        found_notes.append(Note(f"In the last map, {left_out}."))
    if row["analyzed_resolution_m"] > row["resolution_m"] * 1.001:
        cells = f"{row['analyzed_resolution_m']:g} m instead of {row['resolution_m']:g} m"
        coarse = f"The maps were analyzed in cells of {cells}."
        found_notes.append(Note(coarse, is_warning=False))
    return sorted(found_notes, key=lambda note: not note.is_warning)


def _layout_notes(layout: dict[str, Any], last: int) -> list[Note]:
    final = layout.get("final_since")
    if _final(final, last)[0] == NOT_FINAL:
        said = "The layout still changed up to the last map: take the rooms as preliminary."
    elif final is not None and final["coverage"] > LATE_COVERAGE:
        said = (
            f"The layout became final only at {percent(final['coverage'])} coverage: "
            "with more exploration it might change again."
        )
    else:
        return []
    known = layout.get("known_final_since")
    if known is not None and not is_last(known, last) and known["coverage"] <= LATE_COVERAGE:
        said += (
            f" What was known of it was right from {percent(known['coverage'])} coverage on: "
            "what came late are rooms that were seen late."
        )
    return [Note(said)]


def _room_notes(plan: RoomPlan) -> list[Note]:
    found_notes = []
    unsure = sorted(
        (room.wall_support, room.name)
        for room in plan.rooms
        if room.wall_support is not None and room.is_unsure
    )
    if unsure:
        names = listed([f"{name} ({percent(sure)})" for sure, name in unsure], NAMED_MOST)
        found_notes.append(
            Note(f"Rooms with little of their outline supported by walls, hence unsure (?): {names}.")
        )
    open_ends = sorted(
        (
            (room.frontier_m, room.name)
            for room in plan.rooms
            if room.frontier_m is not None and room.frontier_m >= FRONTIER_MIN_M
        ),
        reverse=True,
    )
    if open_ends:
        names = listed([f"{name} ({length:.1f} m)" for length, name in open_ends], NAMED_MOST)
        found_notes.append(
            Note(f"Rooms with open frontier, not explored to the end: {names}.", is_warning=False)
        )
    unseen = sorted(
        (
            (1 - room.area_m2 / room.predicted_area_m2, room.name)
            for room in plan.rooms
            if room.predicted_area_m2 > 0 and 1 - room.area_m2 / room.predicted_area_m2 > PREDICTED_SHARE
        ),
        reverse=True,
    )
    if unseen:
        names = listed([f"{name} ({percent(part)})" for part, name in unseen], NAMED_MOST)
        found_notes.append(
            Note(
                f"Rooms of which a good part was never seen (predicted, or behind furniture): {names}.",
                False,
            )
        )
    return found_notes


def _border_notes(plan: RoomPlan) -> list[Note]:
    unsure = sorted((border.strength, border.rooms) for border in plan.borders if border.is_unsure)
    if not unsure:
        return []
    names = listed(
        [f"{one} and {other} ({percent(strength)})" for strength, (one, other) in unsure], NAMED_MOST
    )
    return [Note(f"Rooms that may be one, with how sure their border is: {names}.", is_warning=False)]


def _shift_notes(results: Run) -> list[Note]:
    events = results.table("events", ["snapshot", "kind", "shift_x_m", "shift_y_m"]).to_pylist()
    shifts = [event for event in events if event["kind"] == "shifted"]
    if not shifts:
        return []
    lengths = [float(np.hypot(event["shift_x_m"], event["shift_y_m"])) for event in shifts]
    most = int(np.argmax(lengths))
    text = (
        f"The whole map shifted {len(shifts)} times, most by {lengths[most]:.2f} m at map "
        f"{shifts[most]['snapshot']}: loop closures, or trouble of SLAM."
    )
    return [Note(text.replace("1 times, most by", "once, by"))] if len(shifts) == 1 else [Note(text)]


def meanings(results: Run) -> list[tuple[str, str]]:
    """Explain the figures and marks of the page: each term, and what it means."""
    tracking = results.parameters.tracking
    share, overlap = percent(tracking.final_min_share), f"{tracking.final_room_min_iou:g}"
    return [
        ("Coverage", "Known free floor over that of the last map."),
        (
            "Layout final from",
            f"From this map on, at least {share} of the last layout, by area, was in rooms that were there: "
            f"some room of the map overlaps them by {overlap} (intersection over union). A few rooms at the "
            "frontier may still have changed. If only the last map is like that, the layout is still "
            "changing: more maps might change it again.",
        ),
        (
            "Known part final from",
            "The same of the part known at the time, so that rooms not seen yet do not count. If it is early "
            "and the layout late, the exploration took its time; if both are late, rooms were joined or "
            "divided up to the end.",
        ),
        (
            "Unsure, ?",
            f"Walls support less than {percent(UNSURE_BELOW)} of the room's outline; doorways alone take a "
            "room to about 90%.",
        ),
        ("Hatched", "Part of a room's shape that no map has shown: predicted from its walls."),
        ("Red line", "A doorway between two rooms."),
        (
            "Purple line",
            "An unsure border: that its rooms are two has a probability below "
            f"{percent(UNSURE_BORDER_BELOW)}.",
        ),
        ("Colors", "A room keeps its number and color over the whole run; colors mean nothing else."),
        ("Dashed green line", "In curves: the layout is final from here on."),
        ("Dotted orange line", "In curves: the whole map shifted, by a loop closure or trouble of SLAM."),
    ]
