"""Colors of tracks: readable, well apart for neighboring numbers, the same in every output."""

from __future__ import annotations

import colorsys
from functools import lru_cache

from rose2_logs.drawing.shapes import Color

GOLDEN_RATIO = 0.618033988749895
"""Steps of the hue by this share of the circle keep any number of successive colors well apart."""
FIRST_HUE = 0.58
SATURATIONS = (0.62, 0.45, 0.75)
VALUES = (0.90, 0.98, 0.78)

FORMING, SHAPED, SETTLED = "forming", "shape right", "settled"
STATE_TINTS = {FORMING: 0.3, SHAPED: 0.65, SETTLED: 1.0}
"""States of a room's history, and the share of its color, on white, that each is shown with."""
TEMPORARY, TEMPORARY_COLOR = "not in the last map", (150, 150, 150)
"""State of a room that was gone in the end: nothing tells what it should have become."""


def state_colors(track: int) -> dict[str, Color]:
    """Color of each state of a track: its room forms, its shape is right, its area has settled; or gray."""
    red, green, blue = track_color(track)
    tints: dict[str, Color] = {
        state: (
            round(255 - (255 - red) * tint),
            round(255 - (255 - green) * tint),
            round(255 - (255 - blue) * tint),
        )
        for state, tint in STATE_TINTS.items()
    }
    return tints | {TEMPORARY: TEMPORARY_COLOR}


@lru_cache(maxsize=4096)
def track_color(track: int) -> Color:
    """Red, green, blue in 0..255 of a track; it depends on the track's number alone."""
    hue = (FIRST_HUE + track * GOLDEN_RATIO) % 1.0
    kind = (track // 5) % len(SATURATIONS)
    red, green, blue = colorsys.hsv_to_rgb(hue, SATURATIONS[kind], VALUES[kind])
    return round(red * 255), round(green * 255), round(blue * 255)


def shaded(color: Color, share: float) -> Color:
    """Return a color with a share of its brightness."""
    red, green, blue = (round(value * share) for value in color)
    return red, green, blue
