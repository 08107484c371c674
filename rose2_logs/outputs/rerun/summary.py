"""The text that a recording opens with: what came out of the run, room by room."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from rose2_logs.model.room_names import NameOf, room_name, short_name
from rose2_logs.model.room_quality import UNSURE_SIGN, is_unsure
from rose2_logs.runs.history import RunSummary
from rose2_logs.runs.sink import RunInfo
from rose2_logs.system.text import counted, listed, percent
from rose2_logs.tracking.track_history import SnapshotRef, TrackHistories

NAMED_MOST = 6
"""Rooms named in one sentence."""
_MARKUP = re.compile(r"[\\`*_{}\[\]<>()#!&~$]")
"""What has a meaning in Markdown; after a backslash it has none."""


def summary_text(info: RunInfo, summary: RunSummary, name_of: NameOf = room_name) -> str:
    """Write the summary of a run as Markdown.

    Parameters
    ----------
    info : RunInfo
        The run.
    summary : RunSummary
        What it came to.
    name_of : callable
        Name of a room by its track.
    """
    histories, convergence, maps = summary.histories, summary.convergence, summary.totals.snapshots
    parts = summary.parts if len(summary.parts) > 1 else {}
    minutes = "" if histories.last is None else f", {_duration(histories.last.time_s)}"
    rooms = len(histories.in_last_map)
    text = [
        f"### {_cell(info.log_path.name)}",
        f"**{counted(rooms, 'room')}** at the end, {len(histories.tracks)} over the run"
        f"{f', {len(convergence.brief)} only briefly' if convergence.brief else ''}; "
        f"{counted(maps, 'map')}{minutes}.",
    ]
    text += [_parts_text(parts)] if parts else []
    final = summary.layout_final
    text.append(
        "**The layout still changed up to the last map**: take the rooms as preliminary."
        if final is None or summary.is_last(final)
        else f"The layout was as in the end **from {_percent(final.coverage)} coverage on** "
        f"({_duration(final.time_s)})."
    )
    known = summary.known_final
    if known is not None and not summary.is_last(known) and known != final:
        text[-1] += (
            f" What was known of it was right **from {_percent(known.coverage)} coverage on** "
            f"({_duration(known.time_s)})."
        )
    text += _worth_a_look(histories, name_of)
    rows = [
        "| room | area, m² | first seen | shape right | settled | walls |",
        "|--:|--:|--:|--:|--:|--:|",
    ]
    for track in histories.in_last_map:
        history = histories.tracks[track]
        right = convergence.shape_right.get(track)
        settled = convergence.area_settled.get(track)
        walls = "" if history.wall_support is None else _percent(history.wall_support)
        rows.append(
            f"| {_cell(short_name(track, name_of))} | {history.area_m2:.1f} "
            f"| {_percent(history.first.coverage)} | {_coverage(right)} | {_coverage(settled)} | {walls} |"
        )
    text.append("\n".join(rows))
    text.append(
        "Coverage when the room was first seen; when its shape, the unseen part included, first overlapped "
        "its last by 0.8; from which on its area stayed within 10 % of the last. "
        "Walls: share of its outline that is supported by walls."
        f"{' On the timeline of coverage, each part begins at the next multiple of 100 %.' if parts else ''}"
    )
    about = {
        "log": info.origin or info.log_path.name,
        "topic": info.topic,
        "method": info.method,
        **{f"version of {name}": version for name, version in info.versions.items()},
    }
    text.append(
        "\n".join(
            ["| run | |", "|---|---|", *(f"| {key} | {_cell(value)} |" for key, value in about.items())]
        )
    )
    return "\n\n".join(text) + "\n"


def _parts_text(parts: Mapping[int, RunSummary]) -> str:
    """Say what each part came to, of a log in which the map was begun anew."""
    named = (
        f"part {number} with {counted(part.totals.snapshots, 'map')} and "
        f"{counted(part.totals.rooms_last, 'room')} at its end"
        for number, part in parts.items()
    )
    return (
        f"**The map was begun anew**: {', '.join(named)}. Coverage is that of the part; what follows is of "
        "the last one."
    )


def _worth_a_look(histories: TrackHistories, name_of: NameOf) -> list[str]:
    """List which rooms are unsure, and where the whole map shifted."""
    lines = []
    shares = [(histories.tracks[track].wall_support, track) for track in histories.in_last_map]
    unsure = sorted((share, track) for share, track in shares if share is not None and is_unsure(share))
    if unsure:
        named = [
            f"{_cell(short_name(track, name_of))}{UNSURE_SIGN} ({_percent(share)})" for share, track in unsure
        ]
        lines.append(
            f"**Unsure**, with little of the outline supported by walls: room {listed(named, NAMED_MOST)}."
        )
    if histories.largest_shift is not None:
        at, motion = histories.largest_shift
        x, y = motion.shift_xy_m
        lines.append(
            f"**The whole map shifted** {'once' if histories.shifts == 1 else f'{histories.shifts} times'}, "
            "most by "
            f"{math.hypot(x, y):.2f} m and {math.degrees(motion.turn_rad):+.1f}° at {_percent(at.coverage)} "
            "coverage: loop closures, or trouble of SLAM."
        )
    return lines


def _percent(share: float) -> str:
    return percent(share, " %")


def _coverage(snapshot_ref: SnapshotRef | None) -> str:
    return "" if snapshot_ref is None else _percent(snapshot_ref.coverage)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def _cell(value: object) -> str:
    """Text for a cell of a table: names come from a log, and are neither markup nor the end of the cell."""
    return _MARKUP.sub(r"\\\g<0>", " ".join(str(value).split()).replace("|", "/"))
