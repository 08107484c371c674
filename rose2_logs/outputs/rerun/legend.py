"""What the marks in a recording mean: a strip below the map, and a text about every tab."""

from __future__ import annotations

from collections.abc import Collection

import cv2
import rerun as rr

from rose2_logs.drawing.palette import FORMING, SETTLED, SHAPED, TEMPORARY, track_color
from rose2_logs.drawing.sheet import Key, legend
from rose2_logs.model.borders import UNSURE_BORDER_BELOW
from rose2_logs.model.room_quality import UNSURE_BELOW, UNSURE_SIGN
from rose2_logs.outputs.rerun.lanes import FINAL_IOU, FINAL_SHARE, KNOWN_FINAL_SHARE, SHIFTS
from rose2_logs.outputs.rerun.pictures import FILL_OPACITY
from rose2_logs.outputs.rerun.world import DOOR_COLOR, PAPER, PATH_COLOR, ROBOT_COLOR, Color
from rose2_logs.system.text import percent

MAP_SIGNS, CURVE_NAMES, LEGEND_TEXT = "/legend/map", "/legend/curves", "/legend/text"
MAP_WIDTH_EM, CURVES_WIDTH_EM = 58.0, 50.0
"""Widths of the strips in sizes of their font: what one row of their keys needs."""
WIDTH_PX = 2000
"""Width of the strips in pixels: sharp also on screens with two pixels a point."""
UNSEEN_OPACITY = 0.15
"""Of a room's color where it is predicted."""
SAMPLE = 1
"""Track whose color the samples have."""
CURVES: dict[str, tuple[str, Color]] = {
    "/run/coverage": ("coverage", (90, 190, 90)),
    FINAL_SHARE: ("same rooms", (250, 160, 50)),
    KNOWN_FINAL_SHARE: ("same, where known", (170, 120, 220)),
    FINAL_IOU: ("overlap", (90, 150, 250)),
    SHIFTS: ("map shifted", (255, 80, 80)),
}
"""Curves of the agreement with the final layout, in percent: what they are called and their colors."""


def log_legend(recording: rr.RecordingStream, layers: Collection[str]) -> None:
    """Log the strips and the text, for a recording that shows these layers."""
    for path, keys, width_em in (
        (MAP_SIGNS, map_keys(layers), MAP_WIDTH_EM),
        (CURVE_NAMES, curve_keys(), CURVES_WIDTH_EM),
    ):
        strip = legend(keys, width_em, 1.0)
        strip.paper = PAPER
        png = cv2.imencode(".png", cv2.cvtColor(strip.pixels(WIDTH_PX), cv2.COLOR_RGB2BGR))[1].tobytes()
        recording.log(path, rr.EncodedImage(contents=png, media_type="image/png"), static=True)
    text = rr.TextDocument(legend_text(layers), media_type="text/markdown")
    recording.log(LEGEND_TEXT, text, static=True)


def map_keys(layers: Collection[str]) -> list[Key]:
    """Signs of the map with its rooms."""
    color = track_color(SAMPLE)
    keys = [Key("room: number, area seen", color, opacity=FILL_OPACITY)]
    if "predicted" in layers:
        keys.append(Key("predicted", color, "hatched", UNSEEN_OPACITY))
    keys.append(Key("doorway", DOOR_COLOR, "line"))
    if "path" in layers:
        keys += [Key("path", PATH_COLOR, "line"), Key("robot", ROBOT_COLOR, "arrow")]
    keys.append(Key("unsure: few walls", kind="sign", sign=f"7{UNSURE_SIGN}"))
    return keys


def curve_keys() -> list[Key]:
    """Names of the curves of the agreement."""
    return [Key(name, color, "cross" if path == SHIFTS else "line") for path, (name, color) in CURVES.items()]


def legend_text(layers: Collection[str]) -> str:
    """Write what the marks of every tab mean, as Markdown."""
    rooms = [
        "**7: 22 m²**: room 7, and how much of it was seen; small rooms have only the number",
        f"**7{UNSURE_SIGN}**: unsure, walls support less than {percent(UNSURE_BELOW, ' %')} of its outline",
        "**colors**: each room keeps its own over the whole run",
    ]
    if "predicted" in layers:
        rooms.append("**hatched**: part of the room's shape that was not seen yet")
    rooms.append("**orange lines**: doorways")
    if "path" in layers:
        rooms.append("**blue line, red arrow**: path of the robot, and where it is and heads")
    rooms.append("**gray**: unknown; **black**: occupied")
    stages = {
        "borders": (
            "Borders",
            "doorways, the darker the surer that they part two rooms; purple: a probability below "
            f"{percent(UNSURE_BORDER_BELOW, ' %')}, written with both rooms",
        ),
        "clean_map": ("Clean map", "black: structure; light gray: occupied cells left out as clutter"),
        "score": ("Structure score", "the brighter, the more a cell belongs to straight walls"),
        "segments": ("Walls", "segments in the color of their wall, gray if of none; blue: wall lines"),
        "faces": ("Faces", "cells between wall lines; edges are the darker, the more of them is wall"),
        "voronoi": ("Voronoi graph", "purple: as far from walls on both sides"),
        "spectrum": ("Spectrum", "of the map's Fourier transform; yellow: directions of walls"),
    }
    text = ["**Rooms**", "\n".join(f"- {each}" for each in rooms)]
    tabs = [f"- **{name}**: {meaning}" for layer, (name, meaning) in stages.items() if layer in layers]
    if tabs:
        text += ["**Other tabs of the map**", "\n".join(tabs)]
    text += [
        "**Agreement with the final layout**",
        "- **coverage**: free floor known, of that of the last map\n"
        "- **same rooms**: area of the final rooms that were there already\n"
        "- **same, where known**: the same of the part known at the time\n"
        "- **overlap**: mean overlap of all final rooms\n"
        "- **red cross**: the whole map shifted, by a loop closure or trouble of SLAM",
        "**Room history**",
        f"- **{FORMING}**: its shape still differs from the last\n"
        f"- **{SHAPED}**: its shape, the unseen part included, overlaps the last by 0.8\n"
        f"- **{SETTLED}**: its area stays within 10 % of the last\n"
        f"- **{TEMPORARY}**: gone in the end\n"
        "- a gap: it was lost for a while",
        "Drag the marker at the bottom, or press play; the timeline next to it is chosen there, too.",
    ]
    return "\n\n".join(text) + "\n"
