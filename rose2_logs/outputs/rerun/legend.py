"""What the marks in a recording mean: a strip below the map, and a text about every tab."""

from __future__ import annotations

from collections.abc import Collection

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rose2_logs.drawing.palette import FORMING, SETTLED, SHAPED, TEMPORARY, track_color
from rose2_logs.drawing.sheet import Key, legend
from rose2_logs.model.borders import UNSURE_BORDER_BELOW
from rose2_logs.model.room_quality import UNSURE_BELOW, UNSURE_SIGN
from rose2_logs.outputs.rerun.world import DOOR_COLOR, PATH_COLOR, ROBOT_COLOR
from rose2_logs.system.text import percent

LEGEND, LEGEND_TEXT = "/legend", "/legend_text"
WIDTH_EM, WIDTH_PX = 68.0, 2400
"""Width of the strip in sizes of its font, so that all keys stand in one row, and in pixels: sharp also on
screens with two pixels a point."""
ROOM_OPACITY, UNSEEN_OPACITY = 0.6, 0.15
"""Of a room's color where it was seen and where it is predicted."""
SAMPLE = 1
"""Track whose color the samples have."""


def log_legend(recording: rr.RecordingStream, layers: Collection[str]) -> None:
    """Log the strip and the text, for a recording with these layers."""
    done, png = cv2.imencode(".png", cv2.cvtColor(legend_pixels(layers), cv2.COLOR_RGB2BGR))
    assert done
    picture = rr.EncodedImage(contents=png.tobytes(), media_type="image/png")
    recording.log(LEGEND, picture, static=True)
    text = rr.TextDocument(legend_text(layers), media_type="text/markdown")
    recording.log(LEGEND_TEXT, text, static=True)


def legend_pixels(layers: Collection[str]) -> NDArray[np.uint8]:
    """Draw the strip (H, W, 3)."""
    color = track_color(SAMPLE)
    keys = [Key("room as far as seen: number, area", color, opacity=ROOM_OPACITY)]
    if "predicted" in layers:
        keys.append(Key("predicted, unseen", color, "hatched", UNSEEN_OPACITY))
    keys.append(Key("doorway", DOOR_COLOR, "line"))
    if "path" in layers:
        keys += [Key("path", PATH_COLOR, "line"), Key("robot", ROBOT_COLOR, "arrow")]
    keys.append(Key("unsure: little wall around", kind="sign", sign=f"7{UNSURE_SIGN}"))
    return legend(keys, WIDTH_EM, 1.0).pixels(WIDTH_PX)


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
            "doorways, the darker the surer that they part two rooms; purple: surer than not, but below "
            f"{percent(UNSURE_BORDER_BELOW, ' %')}, with both rooms and the probability",
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
        "- **red cross**: the whole map shifted",
        "**Room history**",
        f"- **{FORMING}**: its shape still differs from the last\n"
        f"- **{SHAPED}**: its shape, the unseen part included, overlaps the last by 0.8\n"
        f"- **{SETTLED}**: its area stays within 10 % of the last\n"
        f"- **{TEMPORARY}**: gone in the end\n"
        "- a gap: it was lost for a while",
        "Drag the marker at the bottom, or press play; the timeline next to it is chosen there, too.",
    ]
    return "\n\n".join(text) + "\n"
