"""Label images: rooms as the gray values of a PNG."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rose2_logs.errors import OutputError
from rose2_logs.system.files import replacing

MAX_8_BIT, MAX_16_BIT = 255, 65535


def write_label_image(path: Path, labels: NDArray[np.integer]) -> None:
    """Write labels as a gray PNG of 8 bit, or of 16 bit where there are more than 255.

    Parameters
    ----------
    path : path
        The file to write; its folder is created if needed.
    labels : (H, W) int
        0 = none; row 0 becomes the top of the picture.

    Raises
    ------
    OutputError
        If there are more than 65535 labels or the file cannot be written.
    """
    largest = int(labels.max(initial=0))
    if largest > MAX_16_BIT:
        raise OutputError(f"{path}: {largest} labels do not fit a 16-bit image")
    eight_bit = largest <= MAX_8_BIT
    write_image(path, labels.astype(np.uint8) if eight_bit else labels.astype(np.uint16))


def write_image(path: Path, pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """Write gray (H, W) or RGB (H, W, 3) pixels as a PNG, under a hidden name that is then renamed.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    from PIL import Image

    with replacing(path) as part:
        Image.fromarray(pixels).save(part, format="PNG")
