"""The network that tells whether neighboring cells are in different rooms (PyTorch), and its ONNX file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import onnx.numpy_helper
import torch
from torch import Tensor, nn

from rose2_logs.segmentation.regions.answers import BLOCK
from rose2_logs.segmentation.regions.plan_raster import OUTPUTS

CHANNELS = (16, 32, 48, 80, 112)
"""Channels at 0.2, 0.4, 0.8, 1.6 and 3.2 m a cell. Convolutions are fast with multiples of 16: these take the
time of 16, 28, 40, 56 and 72, and hold nearly twice as many weights."""
INPUTS = 4
HALVED_MIN_SIZE = 64
"""Smaller arrays of numbers, as of biases, are kept in 32 bits."""


def _layer(inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    padding = (kernel - stride + 1) // 2
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, padding, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()
    )


class RoomNetwork(nn.Module):  # type: ignore[misc]
    """A U-shaped network: a map of 0.1 m cells in, an answer for each pair of cells out (log odds)."""

    def __init__(self, channels: tuple[int, ...] = CHANNELS) -> None:
        super().__init__()
        self.stem = _layer(INPUTS, channels[0], 6, 2)
        self.down = nn.ModuleList(
            nn.Sequential(_layer(channels[max(i - 1, 0)], c), _layer(c, c)) for i, c in enumerate(channels)
        )
        self.up = nn.ModuleList(
            nn.Sequential(
                _layer(channels[i + 1] + channels[i], channels[i]), _layer(channels[i], channels[i])
            )
            for i in range(len(channels) - 2, -1, -1)
        )
        self.answers = nn.Conv2d(channels[0], BLOCK**2 * OUTPUTS, 1)
        nn.init.constant_(self.answers.bias, -1.5)
        self.fine = nn.PixelShuffle(BLOCK)

    def forward(self, inputs: Tensor) -> Tensor:
        """Log odds (B, OUTPUTS, H, W) from inputs (B, INPUTS, H, W)."""
        out: Tensor = self.fine(self.blocks(inputs))
        return out

    def blocks(self, inputs: Tensor) -> Tensor:
        """Log odds (B, BLOCK^2 OUTPUTS, H / BLOCK, W / BLOCK), the cells of a block one after the other."""
        return self.after_stem(self.stem(inputs))

    def after_stem(self, x: Tensor) -> Tensor:
        """All that follows on the stem."""
        levels = []
        for i, block in enumerate(self.down):
            x = block(x if i == 0 else nn.functional.max_pool2d(x, 2))
            levels.append(x)
        for block, skip in zip(self.up, reversed(levels[:-1]), strict=True):
            x = nn.functional.interpolate(x, scale_factor=2.0, mode="nearest")
            x = block(torch.cat([x, skip], 1))
        out: Tensor = self.answers(x)
        return out


class _OnBlocks(nn.Module):  # type: ignore[misc]
    """A network whose inputs, too, are blocks of 2 x 2 cells: its stem is a fast convolution of 3 x 3."""

    def __init__(self, network: RoomNetwork) -> None:
        super().__init__()
        self.network = network
        convolution, *rest = network.stem
        out, channels, rows, columns = convolution.weight.shape
        weight = convolution.weight.detach()
        weight = weight.reshape(out, channels, rows // BLOCK, BLOCK, columns // BLOCK, BLOCK)
        weight = weight.permute(0, 1, 3, 5, 2, 4).reshape(
            out, channels * BLOCK**2, rows // BLOCK, columns // BLOCK
        )
        on_blocks = nn.Conv2d(channels * BLOCK**2, out, rows // BLOCK, padding=1, bias=False)
        on_blocks.weight = nn.Parameter(weight)
        self.stem = nn.Sequential(on_blocks, *rest)

    def forward(self, inputs: Tensor) -> Tensor:
        out: Tensor = self.network.after_stem(self.stem(inputs))
        return out


def export_onnx(network: RoomNetwork, path: Path) -> None:
    """Write a network as an ONNX file that takes and gives blocks of cells, at any size.

    Norms are folded in, and weights are kept in 16 bits, which OpenCV reads as 32.
    """
    axes = {"map": {2: "rows", 3: "columns"}, "answers": {2: "rows", 3: "columns"}}
    torch.onnx.export(
        _OnBlocks(network).eval(),
        (torch.zeros(1, INPUTS * BLOCK**2, 128, 128),),
        str(path),
        input_names=["map"],
        output_names=["answers"],
        dynamic_axes=axes,
        opset_version=13,
        dynamo=False,
    )
    model = onnx.load(str(path))
    for tensor in model.graph.initializer:
        values = onnx.numpy_helper.to_array(tensor)
        if values.dtype == np.float32 and values.size >= HALVED_MIN_SIZE:
            tensor.CopyFrom(onnx.numpy_helper.from_array(values.astype(np.float16), tensor.name))
    onnx.save(model, str(path))
