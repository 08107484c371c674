"""Maps saved by map_server (a ``.yaml`` file and its image), one or a sequence, as a source of maps."""

from __future__ import annotations

import logging
import math
import os
import re
import reprlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path, PureWindowsPath
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.reading import ReadingParameters
from rose2_logs.config.selection import Times
from rose2_logs.errors import InvalidMapError, LogError
from rose2_logs.io.cell_values import (
    FAINT_RATIO,
    LEAST_CELLS,
    MAPS_LOOKED_AT,
    OVERRULED,
    SPIKE_RATIO,
    UNSURE_SHARE,
    WALL_SHARE,
    WALLS_AT_MOST,
)
from rose2_logs.io.discovery import IMAGE_ENDINGS, load_strings, load_yaml
from rose2_logs.io.grids import MOST_CELLS, Cells, Grid, MapWarning, check_cells, make_grid
from rose2_logs.io.source import LoggedMap, LogInfo, MessageSource, TopicInfo
from rose2_logs.model.labels import label_sizes
from rose2_logs.model.occupancy import HIGHEST_PERCENT, UNKNOWN
from rose2_logs.system.text import percent as as_percent
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
ROOMS_KEY = "rooms"
"""Key of the description of an exported plan: the file that lists which room a value stands for."""
NEGATE = {"0": False, "1": True, "false": False, "true": True, "no": False, "yes": True}
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
NOT_A_NUMBER = re.compile(r"[-+]?\.?nan", re.IGNORECASE)
"""Map savers write the yaw of a quaternion that nobody set this way."""
LEVELS = 256
UNKNOWN_SHARE = 0.1
"""Share of a saved map's pixels that are unknown, at least, if one gray between the thresholds stands for it:
walls of one faint gray are fewer."""
FAINT = "faint walls"
HALF_LEVELS = [127, 128]
"""Levels of occupancy one half, which map savers of probabilities write for unknown: gray 128 or 127."""
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

    @property
    def names(self) -> list[str]:
        """Names of the maps."""
        return [file.stem for file in self._files]

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
            decode = partial(self._decode, file, time)
            yield LoggedMap(time, TOPIC, number + 1, file, decode)

    def _decode(self, file: Path, time_ns: int) -> Grid | None:
        return read_map(file, time_ns, self._limits.map_max_cells, self.gray_reading)

    @property
    def value_reading(self) -> Mapping[str, Any] | None:
        """How the grays are read: as decided or asked for, else by the thresholds of each file."""
        return self.gray_reading.as_json() if self.gray_reading else {"values": "as each file says"}

    @cached_property
    def gray_reading(self) -> GrayReading | None:
        """How the grays of all maps are read; None if by the thresholds of each file."""
        if self.occupancy.values == "auto":
            spread = np.linspace(0, len(self._files) - 1, MAPS_LOOKED_AT).round().astype(int)
            looked_at = [self._files[number] for number in np.unique(spread)]
            found = decide_grays(looked_at, self._limits.map_max_cells)
            if found is not None:
                text = f"{self.info.path}: {found.why}; {OVERRULED}"
                log_warning(logger, "values", text, file=self.info.path)
            return found
        if self.occupancy.values != "percent":
            return None
        free, occupied = self.occupancy.free_max_percent, self.occupancy.occupied_min_percent
        return GrayReading("percent", free / HIGHEST_PERCENT, occupied / HIGHEST_PERCENT)


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


@dataclass(frozen=True)
class GrayReading:
    """How the grays of saved maps are read, whatever thresholds their files name.

    Attributes
    ----------
    name : str
        What they are.
    free_below, occupied_above : float
        Occupancy in 0..1 below and above which pixels are free and occupied.
    why : str
        What is told of it: one line.
    keeps_unknown : bool
        Whether pixels of the gray that map savers write for unknown are unknown, whatever the thresholds.
    """

    name: str
    free_below: float
    occupied_above: float
    why: str = ""
    keeps_unknown: bool = False

    def as_json(self) -> dict[str, str | float]:
        """Return name and thresholds, these in percent."""
        return {
            "values": self.name,
            "free_below": round(self.free_below * HIGHEST_PERCENT, 1),
            "occupied_above": round(self.occupied_above * HIGHEST_PERCENT, 1),
        }


def decide_grays(files: Sequence[Path], most_cells: int = MOST_CELLS) -> GrayReading | None:
    """Decide whether the thresholds of saved maps fit their grays, and which ones do if not.

    They do not fit where many pixels are brighter than one half, which stands for unknown, and yet not free:
    such maps hold probabilities. Nor do they where hardly any pixel is occupied and many are between: their
    walls are faint.

    Parameters
    ----------
    files : sequence of Path
        Some of the maps of a run. Those that cannot be read, or are not in trinary mode, are passed over.
    most_cells : int
        As for `read_map`.
    """
    counts = np.zeros(LEVELS, np.int64)
    free_below, occupied_above = FREE_THRESH, OCCUPIED_THRESH
    for file in files:
        with suppress(LogError):  # it is told of where the map is needed
            described = load_strings(file)
            if _mode(file, described) != "trinary":
                continue
            free_below, occupied_above = _thresholds(file, described)
            shade, opaque = _load_image(_image_of(file, described, []), most_cells)
            occupancy = _occupancy(file, described, shade)
            known = occupancy if opaque is None else occupancy[opaque]
            counts += np.bincount(np.round(known * (LEVELS - 1)).astype(int).ravel(), minlength=LEVELS)
    return _decided(counts, free_below, occupied_above)


def _decided(counts: NDArray[np.int64], free_below: float, occupied_above: float) -> GrayReading | None:
    level = np.arange(LEVELS) / (LEVELS - 1)
    free, between = level < free_below, (level >= free_below) & (level <= occupied_above)
    unknown = _unknown_levels(counts, between)
    known = int(counts[~unknown].sum())
    if known < LEAST_CELLS:
        return None
    name = ""
    half = (HALF_LEVELS[0] - 0.5) / (LEVELS - 1)
    brighter = between & (level < half) & ~unknown
    share = counts[brighter].sum() / known
    if unknown[HALF_LEVELS].any() and share > UNSURE_SHARE * (share + counts[free].sum() / known):
        name, free_below = "probabilities", half
        darker = counts[level > level[HALF_LEVELS[-1]]].sum()
        if darker - counts[level > occupied_above].sum() > UNSURE_SHARE * darker:
            occupied_above = 1 - half
    walls, faint = counts[level > occupied_above].sum(), between & ~unknown
    count = int(counts[faint].sum())
    if not name and count > FAINT_RATIO * walls and WALL_SHARE * known <= count <= WALLS_AT_MOST * known:
        mean = float(counts[faint] @ level[faint] / count)
        name = FAINT
        share = count / known
        occupied_above = (free_below + mean) / 2
    if not name:
        return None
    why = (
        f"the grays hold {name}, {as_percent(share)} of the known pixels between the thresholds of the "
        f"description: occupancy below {free_below:.2g} is read as free, above {occupied_above:.2g} as "
        "occupied"
    )
    return GrayReading(name, free_below, occupied_above, why, keeps_unknown=name == FAINT)


def _unknown_levels(counts: NDArray[np.int64], between: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Levels (256,) that stand for unknown: those of one half, else the most frequent one in between."""
    unknown = np.zeros(LEVELS, np.bool_)
    most_frequent = int(np.argmax(np.where(between, counts, 0)))
    for levels in (HALF_LEVELS, [most_frequent]):
        count = counts[levels].sum()
        beside = counts[min(levels) - 1 : max(levels) + 2].sum() - count
        if count > max(UNKNOWN_SHARE * counts.sum(), SPIKE_RATIO * beside):
            unknown[levels] = True
            break
    return unknown


def cells_of_image(path: Path, gray: NDArray[np.uint8], values: str = "auto") -> Cells:
    """Occupancy (H, W) in percent of an image without a description, as a saved map of it would be read.

    Parameters
    ----------
    path : path
        The image, to be named in what is told.
    gray : (H, W) uint8
        Its pixels, row 0 at the top.
    values : str
        As the parameter ``occupancy.values``: whether the thresholds may be decided.
    """
    reading = None
    if values == "auto":
        counts = label_sizes(gray, LEVELS - 1)[::-1]
        reading = _decided(counts, FREE_THRESH, OCCUPIED_THRESH)
        if reading is not None:
            log_warning(logger, "values", f"{path}: {reading.why}; {OVERRULED}", file=path)
    # By the thresholds of no description, what a pixel is follows from its level alone.
    shade = np.arange(LEVELS, dtype=np.float32)[None] / np.float32(LEVELS - 1)
    of_level = _cells(path, {}, shade, None, reading, [])[0]
    return np.asarray(of_level.take(gray))


def read_map(
    path: Path, stamp_ns: int = 0, most_cells: int = MOST_CELLS, reading: GrayReading | None = None
) -> Grid | None:
    """Read one saved map as map_server would.

    Parameters
    ----------
    path : Path
        The ``.yaml`` file: image, resolution, origin (x, y, yaw), negate, occupied_thresh, free_thresh, mode.
    stamp_ns : int
        Stamp that the map gets.
    most_cells : int
        Number of pixels of the largest image that is accepted, according to its header.
    reading : GrayReading, optional
        How grays are read; by default by the thresholds of the file.

    Returns
    -------
    Grid or None
        Row 0, at the origin, is the image's bottom row. None if the image has no pixels.

    Raises
    ------
    InvalidMapError
        If the file or its image cannot be used.
    """
    described = load_strings(path)
    map_warnings: list[MapWarning] = []
    resolution = _number(path, described, "resolution", None)
    origin = described.get("origin")
    parts = [_parsed(part) for part in origin] if isinstance(origin, list) and len(origin) == 3 else []
    if parts and math.isnan(parts[2]) and all(map(math.isfinite, parts[:2])):
        text = "the yaw of its origin is not a number; it is read as 0"
        map_warnings.append(MapWarning("yaw_not_a_number", text))
        parts[2] = 0.0
    if not parts or not all(map(math.isfinite, parts)):
        raise InvalidMapError(
            f"{path}: origin is {_short(origin)}; it must be three finite numbers (x, y, yaw)", file=path
        )
    x, y, yaw = parts
    shade, opaque = _load_image(_image_of(path, described, map_warnings), most_cells)
    pose = (x, y, 0.0, 0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    cells = _cells(path, described, shade, opaque, reading, map_warnings)[::-1].copy()
    try:
        return make_grid(stamp_ns, FRAME_ID, resolution, pose, cells, map_warnings)
    except InvalidMapError as error:
        raise InvalidMapError(f"{path}: {error}", file=path) from error


def _cells(
    path: Path,
    described: Mapping[str, Any],
    shade: NDArray[np.float32],
    opaque: NDArray[np.bool_] | None,
    reading: GrayReading | None,
    map_warnings: list[MapWarning],
) -> Cells:
    """Occupancy of pixels with brightness `shade` in 0..1, by the mode and the thresholds of the file."""
    mode = _mode(path, described)
    if mode == "raw":
        value = np.round(shade * 255)
        if ROOMS_KEY in described:
            text = "its values from 1 to 99 are the rooms of an exported plan; they are read as free"
            map_warnings.append(MapWarning("values", text))
            value[(value > 0) & (value < 100)] = 0
        return np.where(value <= 100, value, UNKNOWN).astype(np.int8)
    occupancy = _occupancy(path, described, shade)
    free_below, occupied_above = _thresholds(path, described)
    if mode == "scale":
        percent = np.round((occupancy - free_below) / max(occupied_above - free_below, 1e-6) * 100)
        percent = np.where(occupancy < free_below, 0, np.where(occupancy > occupied_above, 100, percent))
        return (percent if opaque is None else np.where(opaque, percent, UNKNOWN)).astype(np.int8)
    unknown = ~opaque if opaque is not None else np.zeros(shade.shape, np.bool_)
    keeps_unknown = reading is None or reading.keeps_unknown
    if reading is not None:
        free_below, occupied_above = reading.free_below, reading.occupied_above
    # Until mid 2025, nav2 saved such images with free_thresh 0.25, by which unknown cells load as free.
    is_too_high = keeps_unknown and free_below > 1 - SAVED_UNKNOWN / 255
    if is_too_high and (saved := _saved_as_unknown(shade)) is not None:
        text = (
            f"its free_thresh of {free_below:g} would make unknown pixels ({SAVED_UNKNOWN}) free; "
            "they are read as unknown"
        )
        map_warnings.append(MapWarning("free_thresh", text))
        unknown |= saved
    cells = np.where(occupancy > occupied_above, np.int8(100), np.int8(UNKNOWN))
    cells[occupancy < free_below] = 0
    cells[unknown] = UNKNOWN
    return cells


def _mode(path: Path, described: Mapping[str, Any]) -> str:
    mode = str(described.get("mode", "trinary")).lower()
    if mode not in MODES:
        raise InvalidMapError(f"{path}: mode is {_short(mode)}; it must be one of {', '.join(MODES)}")
    return mode


def _thresholds(path: Path, described: Mapping[str, Any]) -> tuple[float, float]:
    """Return ``free_thresh`` and ``occupied_thresh``."""
    occupied_above = _number(path, described, "occupied_thresh", OCCUPIED_THRESH)
    free_below = _number(path, described, "free_thresh", FREE_THRESH)
    if not 0 <= free_below <= occupied_above <= 1:
        raise InvalidMapError(
            f"{path}: free_thresh {free_below} must not exceed occupied_thresh {occupied_above}, both in 0..1"
        )
    return free_below, occupied_above


def _occupancy(path: Path, described: Mapping[str, Any], shade: NDArray[np.float32]) -> NDArray[np.float64]:
    """Occupancy in 0..1 of brightness in 0..1."""
    negate = NEGATE.get(str(described.get("negate", "0")).lower())
    if negate is None:
        raise InvalidMapError(f"{path}: negate is {_short(described['negate'])}; it must be 0 or 1")
    # Rounded, so that a pixel at a threshold compares equal to it.
    return np.round((shade if negate else 1 - shade).astype(float), 6)


def _saved_as_unknown(shade: NDArray[np.float32]) -> NDArray[np.bool_] | None:
    """Pixels (H, W) of the gray that map savers write for unknown; None if the image is not of their making.

    It is if it has only their three grays, or if that gray is frequent, as in a saved map that was edited.
    """
    gray = np.round(shade * 255)
    saved: NDArray[np.bool_] = gray == SAVED_UNKNOWN
    count = np.count_nonzero(saved)
    if count == 0:
        return None
    is_frequent = count > WALL_SHARE * max(gray.size, LEAST_CELLS) and (gray >= SAVED_FREE).any()
    is_untouched = np.isin(gray, (SAVED_FREE, SAVED_UNKNOWN, SAVED_OCCUPIED)).all()
    return saved if is_frequent or is_untouched else None


def _load_image(path: Path, most_cells: int) -> tuple[NDArray[np.float32], NDArray[np.bool_] | None]:
    """Brightness (H, W) in 0..1, the mean of the colors, and which pixels are opaque if it has alpha."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            # Large maps are fine; Pillow still refuses images of more than 180 million pixels.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path, formats=FORMATS) as image:
                check_cells(image.height, image.width, most_cells)
                if image.mode == "F":
                    raise InvalidMapError("its pixels are fractions; save it with grays from 0 to 255")
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


def _image_of(path: Path, described: Mapping[str, Any], map_warnings: list[MapWarning]) -> Path:
    """Path of a map's image; of one that lies elsewhere on another machine, that beside the description."""
    named = described.get("image")
    if not isinstance(named, str) or not named:
        raise InvalidMapError(f"{path}: image is {_short(named)}; it must name the map's image file")
    image = path.parent / named
    if _is_file(image):
        return image
    plain = unquote(named.removeprefix("file://")) if named.startswith("file://") else named
    # A description that was written on Windows has backslashes.
    name = PureWindowsPath(plain).name
    meant = path.parent / os.path.expanduser(plain)  # noqa: PTH111 (of no home, it says nothing)
    if _is_file(meant):
        return meant
    for beside in (path.parent / name, *(path.with_suffix(ending) for ending in IMAGE_ENDINGS)):
        if _is_file(beside):
            text = f"its image {_short(named)} is not there; {beside.name} next to {path.name} is read"
            map_warnings.append(MapWarning("image_elsewhere", text))
            return beside
    return image


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # no name that a file can have
        return False


def _parsed(value: object) -> float:
    """Return a number as YAML 1.2 writes it, and yaml-cpp reads it; infinity for anything else."""
    text = str(value).strip() if isinstance(value, str) else ""
    if NUMBER.fullmatch(text):
        return float(text)
    return math.nan if NOT_A_NUMBER.fullmatch(text) else math.inf


def _short(value: object) -> str:
    """Show any value from a file within one line."""
    return _repr.repr(value)


def _number(path: Path, described: Mapping[str, Any], name: str, default: float | None) -> float:
    if name not in described and default is not None:
        return default
    value = _parsed(described.get(name))
    if not math.isfinite(value):
        shown = _short(described.get(name))
        raise InvalidMapError(f"{path}: {name} is {shown}; it must be a finite number", file=path)
    return value


def _size(path: Path) -> int:
    """Size of a saved map in bytes, as far as its files exist."""
    try:
        image = _image_of(path, load_strings(path), [])
        return path.stat().st_size + (image.stat().st_size if _is_file(image) else 0)
    except LogError:
        return path.stat().st_size if path.exists() else 0
