"""What tests that look at a recording need: a driver, a browser, a way to compare pictures."""

from __future__ import annotations

import importlib.util
import os
import shutil
import socket
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

MUST_LOOK = os.environ.get("ROSE2_LOGS_LOOK") == "must"
"""Set by CI, where nothing that these tests need is missing: none is skipped."""
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

needs_vulkan = pytest.mark.skipif(
    not MUST_LOOK and not list(Path("/usr/share/vulkan/icd.d").glob("lvp_icd*")),
    reason="the headless viewer needs a Vulkan driver (mesa-vulkan-drivers)",
)
needs_chromium = pytest.mark.skipif(
    not MUST_LOOK and (CHROMIUM is None or importlib.util.find_spec("playwright") is None),
    reason="needs a browser (chromium) and the package playwright",
)


def free_port() -> int:
    """Return a port that no one listens at: a fixed one may be in use by tests that run beside."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def colored_share(picture: Path, window: tuple[slice, slice]) -> float:
    """Share of a picture's pixels in a window, of rows and columns, that have a color."""
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)[window]
    return float(((pixels.max(-1) - pixels.min(-1)) > 40).mean())


def small(picture: Path, width: int) -> NDArray[np.uint8]:
    """Pixels (H, width, 3) of a picture made small, so that letters and thin lines do not count."""
    image = Image.open(picture).convert("RGB")
    size = (width, round(image.height * width / image.width))
    return np.asarray(image.resize(size, Image.Resampling.BOX))
