"""Colors in pictures of what programs show."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

SPREAD = 25
"""Least difference between the channels, of 255, of a pixel that has a color at all."""
NEAR = 0.02
"""How far the hues of the same color may be apart, of 1: colors are laid over a map, and lighted."""


def shares_of_hues(picture: Path, colors: Sequence[tuple[float, float, float]]) -> NDArray[np.float64]:
    """Share (N,) of a picture's pixels that have the hue of each color, whose channels are in [0, 1]."""
    wanted = np.array([colorsys.rgb_to_hsv(*color)[0] for color in colors])
    pixels = np.asarray(Image.open(picture).convert("RGB")).reshape(-1, 3)
    kinds, counts = np.unique(pixels, axis=0, return_counts=True)
    is_colored = kinds.max(1).astype(int) - kinds.min(1) > SPREAD
    hues = np.array([colorsys.rgb_to_hsv(*kind)[0] for kind in (kinds[is_colored] / 255).tolist()])
    far = np.abs((hues.reshape(-1, 1) - wanted + 0.5) % 1 - 0.5)
    found: NDArray[np.float64] = (counts[is_colored] @ (far < NEAR)) / len(pixels)
    return found
