"""Label images: rooms as the grey values of a PNG."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rose2_logs.errors import OutputError

MAX_8_BIT, MAX_16_BIT = 255, 65535


def write_label_image(path: Path, labels: NDArray[np.integer]) -> None:
    """Write labels as a grey PNG of 8 bit, or of 16 bit where there are more than 255.

    Parameters
    ----------
    path : path
        Where to; its folder is made.
    labels : (H, W) int
        0 = none; row 0 becomes the top of the picture.

    Raises
    ------
    OutputError
        If there are more than 65535 labels or the file cannot be written.
    """
    from PIL import Image

    largest = int(labels.max(initial=0))
    if largest > MAX_16_BIT:
        raise OutputError(f"{path}: {largest} labels do not fit a 16-bit image")
    image = Image.fromarray(labels.astype(np.uint8 if largest <= MAX_8_BIT else np.uint16))
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        image.save(part, format="PNG")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OutputError(f"{path}: cannot be written: {error}") from error
