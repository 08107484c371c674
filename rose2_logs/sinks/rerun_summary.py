"""The text that a recording opens with: what came out of the run, room by room."""

from __future__ import annotations

import re

from rose2_logs.sinks.sink import RunInfo
from rose2_logs.tracking.hindsight import Hindsight
from rose2_logs.tracking.lives import Moment, RoomLives

_MARKUP = re.compile(r"[\\`*_{}\[\]<>()#!&~$]")
"""What has a meaning in Markdown; after a backslash it has none."""


def summary_text(info: RunInfo, lives: RoomLives, hindsight: Hindsight | None, maps: int) -> str:
    """Write the summary of a run as Markdown.

    Parameters
    ----------
    info : RunInfo
        The run.
    lives : RoomLives
        What is known of every room.
    hindsight : Hindsight, optional
        Since when what was right; without it that is left out.
    maps : int
        Number of maps.
    """
    minutes = "" if lives.last is None else f", {_duration(lives.last.time_s)}"
    text = [
        f"# {_cell(info.log_path.name)}",
        f"**{len(lives.in_last_map)} rooms** at the end, {len(lives.lives)} over the run; "
        f"{maps} maps{minutes}.",
    ]
    if hindsight is not None:
        final = hindsight.layout_final
        text.append(
            "The layout was never as in the end."
            if final is None
            else f"The layout was as in the end **from {_percent(final.coverage)} coverage on** "
            f"({_duration(final.time_s)})."
        )
    rows = [
        "| room | area, m² | first seen | shape right | area settled | walls |",
        "|--:|--:|--:|--:|--:|--:|",
    ]
    for track in lives.in_last_map:
        life = lives.lives[track]
        right = None if hindsight is None else hindsight.shape_right.get(track)
        settled = None if hindsight is None else hindsight.area_settled.get(track)
        walls = "" if life.outline_wall_share is None else _percent(life.outline_wall_share)
        rows.append(
            f"| {track} | {life.area_m2:.1f} | {_percent(life.first.coverage)} | {_moment(right)} "
            f"| {_moment(settled)} | {walls} |"
        )
    text.append("\n".join(rows))
    text.append(
        "Percent of coverage: when the room was first seen; when its shape with the unseen part first "
        "overlapped its last one by 0.8; from when on its area was within 10 % of its last. "
        "Walls: share of its outline that walls back."
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


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _moment(moment: Moment | None) -> str:
    return "" if moment is None else _percent(moment.coverage)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def _cell(value: object) -> str:
    """Text for a cell of a table: names come from a log, and are neither markup nor the end of the cell."""
    return _MARKUP.sub(r"\\\g<0>", " ".join(str(value).split()).replace("|", "/"))
