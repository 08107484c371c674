"""Colours of tracks: readable, well apart for neighbouring numbers, the same in every output."""

from __future__ import annotations

import colorsys

GOLDEN_RATIO = 0.618033988749895
"""Steps of the hue by this share of the circle keep any number of successive colours well apart."""
FIRST_HUE = 0.58
SATURATIONS = (0.62, 0.45, 0.75)
VALUES = (0.90, 0.98, 0.78)


def track_colour(track: int) -> tuple[int, int, int]:
    """Red, green, blue in 0..255 of a track; it depends on the track's number alone."""
    hue = (FIRST_HUE + track * GOLDEN_RATIO) % 1.0
    kind = (track // 5) % len(SATURATIONS)
    red, green, blue = colorsys.hsv_to_rgb(hue, SATURATIONS[kind], VALUES[kind])
    return round(red * 255), round(green * 255), round(blue * 255)
