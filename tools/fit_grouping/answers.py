"""Runs the network on a plan raster with OpenCV."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fit_grouping.plan_rasters import PlanRaster, network_input, shares_of

STRIDE = 32
"""Inputs are padded to a multiple of this many cells."""
ANSWER_STEPS = 1000
"""Answers are rounded to this many steps, so that they are the same whatever instructions a CPU has."""


class AnsweringNetwork:
    """A network from an ONNX file."""

    def __init__(self, path: Path) -> None:
        self._network = cv2.dnn.readNetFromONNX(str(path))

    def __call__(self, raster: PlanRaster) -> NDArray[np.float32]:
        """Answers (OUTPUTS, H, W) in [0, 1] for a raster (H, W)."""
        height, width = raster.wall.shape
        rows, columns = -(-height // STRIDE) * STRIDE, -(-width // STRIDE) * STRIDE
        # Half of the padding on each side but a whole number of pairs of cells.
        top, left = (rows - height) // 4 * 2, (columns - width) // 4 * 2
        pad = ((top, rows - height - top), (left, columns - width - left))
        inputs = network_input(shares_of(np.pad(raster.wall, pad)), shares_of(np.pad(raster.free, pad)))
        self._network.setInput(np.ascontiguousarray(inputs[None]))
        out: NDArray[np.float32] = self._network.forward()[0]
        out = out[:, top : top + height, left : left + width]
        rounded: NDArray[np.float32] = np.rint(out * ANSWER_STEPS).astype(np.float32) / np.float32(
            ANSWER_STEPS
        )
        return rounded
