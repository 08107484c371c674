"""The network's answers: which pairs of cells are in different rooms, and which cells are outside."""

from __future__ import annotations

import threading
from itertools import product
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.regions import RegionParameters
from rose2_logs.segmentation.regions.plan_raster import (
    OFFSETS,
    OUTPUTS,
    FloatImage,
    PlanRaster,
    network_input,
    shares_of,
)

STRIDE = 32
"""Inputs are padded to a multiple of this many cells, the coarsest step of the network."""
BLOCK = 2
"""The network sees and answers for blocks of this many cells squared, a channel for each cell of a block."""
ANSWER_STEPS = 1000
"""Answers are rounded to this many steps, so that they are the same whatever instructions a CPU has."""
LOG_ODDS_MAX = 30
"""What is surer is not told from certainty by far."""
TILE_CELLS = 1536
"""Larger plans are looked at in tiles of this side, so that memory does not grow with the map."""
OVERLAP_CELLS = 192
"""Tiles see this far beyond what they answer for; what lies further hardly matters to an answer."""


class AnsweringNetwork:
    """A network from an ONNX file, run by OpenCV."""

    def __init__(self, path: Path) -> None:
        # OpenCV 4 knows no other engine; in OpenCV 5 it is the faster one here.
        classic = {"engine": cv2.dnn.ENGINE_CLASSIC} if hasattr(cv2.dnn, "ENGINE_CLASSIC") else {}
        self._network = cv2.dnn.readNetFromONNX(str(path), **classic)
        self._asked = threading.Lock()
        """Held from question to answer: a network has one input, whichever thread gave it."""

    def __call__(self, raster: PlanRaster, views: int = RegionParameters.answer_views) -> NDArray[np.float32]:
        """Answers (OUTPUTS, H, W) in [0, 1] for a raster (H, W).

        With two views the network sees the map as it is and turned by half, and gives the mean of both.
        """
        height, width = raster.wall.shape
        if max(height, width) <= TILE_CELLS:
            return self._answers(raster, views)
        answers = np.zeros((OUTPUTS, height, width), np.float32)
        step = TILE_CELLS - 2 * OVERLAP_CELLS
        for top, left in product(range(0, height, step), range(0, width, step)):
            low = max(top - OVERLAP_CELLS, 0), max(left - OVERLAP_CELLS, 0)
            seen = np.s_[low[0] : top + step + OVERLAP_CELLS, low[1] : left + step + OVERLAP_CELLS]
            tile = PlanRaster(raster.wall[seen], raster.free[seen])
            if not tile.free.any():
                continue
            if not tile.wall.any():
                # No building: a hundred meters and more without a wall.
                answers[-1, top : top + step, left : left + step] = 1
                continue
            own = np.s_[:, top - low[0] : top - low[0] + step, left - low[1] : left - low[1] + step]
            answers[:, top : top + step, left : left + step] = self._answers(tile, views)[own]
        return answers

    def _answers(self, raster: PlanRaster, views: int) -> NDArray[np.float32]:
        height, width = raster.wall.shape
        rows, columns = (-(-side // STRIDE) * STRIDE for side in (height, width))
        # Half of the padding on each side, but a whole number of pairs of cells.
        top, left = (rows - height) // 4 * 2, (columns - width) // 4 * 2
        pad = ((top, rows - height - top), (left, columns - width - left))
        inputs = network_input(shares_of(np.pad(raster.wall, pad)), shares_of(np.pad(raster.free, pad)))
        out = self._forward(inputs)
        if views > 1:
            out += turned_by_half(self._forward(inputs[:, ::-1, ::-1]))
            out /= 2
        # Steps are made in place: images of all answers are large.
        out = out[:, top : top + height, left : left + width]
        out *= ANSWER_STEPS
        np.rint(out, out=out)
        out /= ANSWER_STEPS
        return out

    def _forward(self, inputs: FloatImage) -> FloatImage:
        channels, rows, columns = inputs.shape
        blocks = inputs.reshape(channels, rows // BLOCK, BLOCK, columns // BLOCK, BLOCK)
        given = blocks.transpose(0, 2, 4, 1, 3).reshape(1, -1, rows // BLOCK, columns // BLOCK)
        with self._asked:
            self._network.setInput(given)
            # The output is the network's own memory until it is clipped into another array.
            odds = np.clip(np.asarray(self._network.forward(), np.float32), -LOG_ODDS_MAX, LOG_ODDS_MAX)
        np.exp(odds, out=odds)
        odds /= odds + 1
        answers = odds.reshape(OUTPUTS, BLOCK, BLOCK, rows // BLOCK, columns // BLOCK)
        out = np.empty((OUTPUTS, rows, columns), np.float32)
        # A copy of the whole with its axes in another order would take five times as long.
        for down, right in product(range(BLOCK), repeat=2):
            out[:, down::BLOCK, right::BLOCK] = answers[:, down, right]
        return out


def turned_by_half(answers: FloatImage) -> FloatImage:
    """Answers (OUTPUTS, H, W) for a map turned by half, as those for the map.

    A pair of cells is told of at the one that is lower or further right, which is the other one when turned.
    Where there is no pair, the answer is 0.
    """
    back, out = answers[:, ::-1, ::-1], np.zeros_like(answers)
    rows, columns = answers.shape[1:]
    for k, (down, right) in enumerate((*OFFSETS, (0, 0))):
        out[k, down:, right:] = back[k, : max(rows - down, 0), : max(columns - right, 0)]
    return out
