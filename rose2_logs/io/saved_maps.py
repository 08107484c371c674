"""Maps saved by map_server (a ``.yaml`` file and its image), one or a sequence, as a source of maps."""

from __future__ import annotations

import logging
import re
import reprlib
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import ReadingParameters
from rose2_logs.config.selection import Times
from rose2_logs.errors import InvalidMapError, LogError
from rose2_logs.io.discovery import load_yaml
from rose2_logs.io.grids import MOST_CELLS, Cells, Grid, check_cells, make_grid
from rose2_logs.io.source import LoggedMap, LogInfo, MessageSource, TopicInfo
from rose2_logs.model.occupancy import UNKNOWN
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

DEFAULT_LIMITS = ReadingParameters()
_repr = reprlib.Repr()

TOPIC = "/map"
FRAME_ID = "map"
# Saved maps have no time; a sequence is read as one map per second, starting at the epoch.
STEP_NS = 10**9
# map_server's defaults, for files that omit them.
OCCUPIED_THRESH = 0.65
FREE_THRESH = 0.196
MODES = ("trinary", "scale", "raw")
FORMATS = ("PNG", "PPM", "BMP", "JPEG", "TIFF")
"""Image formats that are opened, by Pillow's names (PPM includes PGM): those that map savers write."""
# What map savers write in trinary mode for free, unknown and occupied.
SAVED_FREE, SAVED_UNKNOWN, SAVED_OCCUPIED = 254, 205, 0


class MapFilesSource(MessageSource):
    """Saved maps in the order given, as messages on one topic.

    Parameters
    ----------
    path : Path
        Name of the log.
    files : sequence of Path
        The ``.yaml`` files; each is read when it is needed.
    limits : ReadingParameters
        The largest sizes that are accepted.
    """

    def __init__(self, path: Path, files: Sequence[Path], limits: ReadingParameters = DEFAULT_LIMITS) -> None:
        self._files = list(files)
        self._limits = limits
        self.info = LogInfo(
            path,
            "map_server map" if len(files) == 1 else "map_server maps",
            sum(_size(file) for file in files),
            0,
            (len(files) - 1) * STEP_NS,
            (TopicInfo(TOPIC, "map_server", len(files), True, "image"),),
            True,
        )

    def close(self) -> None:
        """Do nothing: no file stays open between maps."""

    def log_times(self, topic: str) -> Times:
        """One map per second, starting at 0 nanoseconds."""
        return np.arange(len(self._files), dtype=np.int64) * STEP_NS

    def read(self, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Yield the maps at `times`."""
        for time in times.tolist():
            number = time // STEP_NS
            file = self._files[number]
            yield LoggedMap(
                time, TOPIC, number + 1, file, partial(read_map, file, time, self._limits.map_max_cells)
            )


def natural_order(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sort key that puts ``map2`` before ``map10``."""
    parts = re.findall(r"(\d+)|(\D+)", path.stem)
    return [(int(digits), "") if digits else (-1, text) for digits, text in parts], str(path)


def is_map_file(path: Path) -> bool:
    """Whether a YAML file describes a map: it names an image and a resolution."""
    try:
        described = load_yaml(path)
    except LogError:
        return False
    return "image" in described and "resolution" in described


def read_map(path: Path, stamp_ns: int = 0, most_cells: int = MOST_CELLS) -> Grid | None:
    """Read one saved map as map_server would.

    Parameters
    ----------
    path : Path
        The ``.yaml`` file: image, resolution, origin (x, y, yaw), negate, occupied_thresh, free_thresh, mode.
    stamp_ns : int
        Stamp that the map gets.
    most_cells : int
        Number of pixels of the largest image that is accepted, according to its header.

    Returns
    -------
    Grid or None
        Row 0, at the origin, is the image's bottom row. None if the image has no pixels.

    Raises
    ------
    InvalidMapError
        If the file or its image cannot be used.
    """
    described = load_yaml(path)
    resolution = _number(path, described, "resolution", None)
    origin = described.get("origin")
    if not (isinstance(origin, Sequence) and len(origin) == 3 and all(_is_finite(part) for part in origin)):
        raise InvalidMapError(
            f"{path}: origin is {_short(origin)}; it must be three finite numbers (x, y, yaw)", file=path
        )
    x, y, yaw = (float(part) for part in origin)
    shade, opaque = _load_image(_image_path(path, described), most_cells)
    pose = (x, y, 0.0, 0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    cells = _cells(path, described, shade, opaque)[::-1].copy()
    try:
        return make_grid(stamp_ns, FRAME_ID, resolution, pose, cells, [])
    except InvalidMapError as error:
        raise InvalidMapError(f"{path}: {error}", file=path) from error


def _cells(
    path: Path, described: Mapping[str, Any], shade: NDArray[np.float32], opaque: NDArray[np.bool_] | None
) -> Cells:
    """Occupancy of pixels with brightness `shade` in 0..1, by the mode and the thresholds of the file."""
    mode = str(described.get("mode", "trinary")).lower()
    if mode not in MODES:
        raise InvalidMapError(f"{path}: mode is {_short(mode)}; it must be one of {', '.join(MODES)}")
    if mode == "raw":
        value = np.round(shade * 255)
        return np.where(value <= 100, value, UNKNOWN).astype(np.int8)
    negate = described.get("negate", 0)
    if negate not in (0, 1):
        raise InvalidMapError(f"{path}: negate is {_short(negate)}; it must be 0 or 1")
    occupied_above = _number(path, described, "occupied_thresh", OCCUPIED_THRESH)
    free_below = _number(path, described, "free_thresh", FREE_THRESH)
    if not 0 <= free_below < occupied_above <= 1:
        raise InvalidMapError(
            f"{path}: free_thresh {free_below} must be below occupied_thresh {occupied_above}, both in 0..1"
        )
    # Rounded, so that a pixel at a threshold compares equal to it.
    occupancy: NDArray[np.float64] = np.round((shade if negate else 1 - shade).astype(float), 6)
    if mode == "scale":
        percent = np.round((occupancy - free_below) / (occupied_above - free_below) * 100)
        percent = np.where(occupancy < free_below, 0, np.where(occupancy > occupied_above, 100, percent))
        return (percent if opaque is None else np.where(opaque, percent, UNKNOWN)).astype(np.int8)
    unknown = ~opaque if opaque is not None else np.zeros(shade.shape, np.bool_)
    saved_as_unknown = np.round(shade * 255) == SAVED_UNKNOWN
    if (
        not negate
        and free_below > 1 - SAVED_UNKNOWN / 255
        and _is_saved_trinary(shade)
        and saved_as_unknown.any()
    ):
        # Until mid 2025, nav2 saved such images with free_thresh 0.25, by which unknown cells load as free.
        text = (
            f"{path}: its free_thresh of {free_below:g} would make unknown pixels ({SAVED_UNKNOWN}) free; "
            "they are read as unknown"
        )
        log_warning(logger, "free_thresh", text, file=path)
        unknown |= saved_as_unknown
    cells = np.where(occupancy > occupied_above, np.int8(100), np.int8(UNKNOWN))
    cells[occupancy < free_below] = 0
    cells[unknown] = UNKNOWN
    return cells


def _is_saved_trinary(shade: NDArray[np.float32]) -> bool:
    """Whether an image contains only the three values that map savers write."""
    return bool(np.isin(np.round(shade * 255), (SAVED_FREE, SAVED_UNKNOWN, SAVED_OCCUPIED)).all())


def _load_image(path: Path, most_cells: int) -> tuple[NDArray[np.float32], NDArray[np.bool_] | None]:
    """Brightness (H, W) in 0..1, the mean of the colors, and which pixels are opaque if it has alpha."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            # Large maps are fine; Pillow still refuses images of more than 180 million pixels.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path, formats=FORMATS) as image:
                check_cells(image.height, image.width, most_cells)
                if image.mode.startswith("I"):
                    return np.asarray(image, np.float32) / np.float32(2**16 - 1), None
                has_alpha = "A" in image.getbands() or "transparency" in image.info
                pixels = np.asarray(
                    image.convert("RGBA" if has_alpha else "RGB" if image.mode != "L" else "L")
                )
    except InvalidMapError as error:
        raise InvalidMapError(f"{path}: {error}", file=path) from error
    except Exception as error:  # whatever a decoder raises on damaged data
        raise InvalidMapError(f"{path}: cannot be read as a map image: {error}", file=path) from error
    if pixels.ndim == 2:
        return pixels.astype(np.float32) / np.float32(255), None
    shade = pixels[..., :3].mean(axis=-1, dtype=np.float32) / np.float32(255)
    return shade, pixels[..., 3] == 255 if has_alpha else None


def _image_path(path: Path, described: Mapping[str, Any]) -> Path:
    image = described.get("image")
    if not isinstance(image, str) or not image:
        raise InvalidMapError(f"{path}: image is {_short(image)}; it must name the map's image file")
    return path.parent / image


def _is_finite(value: object) -> TypeGuard[float]:
    # Compared, not converted: integers in YAML can be too large for a float.
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return False
    return -sys.float_info.max <= value <= sys.float_info.max


def _short(value: object) -> str:
    """Show any value from a file within one line."""
    return _repr.repr(value)


def _number(path: Path, described: Mapping[str, Any], name: str, default: float | None) -> float:
    value = described.get(name, default)
    if not _is_finite(value):
        raise InvalidMapError(f"{path}: {name} is {_short(value)}; it must be a finite number", file=path)
    return float(value)


def _size(path: Path) -> int:
    """Size of a saved map in bytes, as far as its files exist."""
    try:
        image = _image_path(path, load_yaml(path))
        return path.stat().st_size + (image.stat().st_size if image.exists() else 0)
    except LogError:
        return path.stat().st_size if path.exists() else 0
