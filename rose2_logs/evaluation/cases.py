"""Maps with true rooms, as a benchmark lists them in a JSON file.

The file holds ``{"cases": [{"group", "name", "map", "rooms", "resolution_m"}, ...]}`` with paths relative to
itself: `map` is an 8-bit gray image in the convention of ROS maps, `rooms` a label image of the same size.
A case may give ``"rooms_other"``, a second label image, where careful people may draw the rooms in two ways:
the truth that agrees better with the found rooms counts. It may also give ``"origin_xy_m": [x, y]``, the
position of the images' lower left corner in the world.
Images have row 0 at the top, occupancy grids at the origin below; a case converts between the two.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from rose2_logs.errors import CasesError
from rose2_logs.io.saved_maps import cells_of_image
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.system.files import reason_of

Truth = Literal["rooms", "rooms_other"]
"""One of the true rooms of a case, by its name in the list of cases."""

_UNNAMABLE = re.compile("[\0\ud800-\udfff]")
"""What JSON may hold, but no name of a file."""


@dataclass(frozen=True)
class Case:
    """One map with its true rooms.

    Attributes
    ----------
    group, name : str
        Name of the case; predictions are stored as ``<group>/<name>.png``.
    map_path, rooms_path : path
        The two images.
    resolution_m : float
        Side of a cell.
    origin_xy_m : (float, float), optional
        World position of the images' lower left corner, where it is known.
    rooms_other_path : path, optional
        A second image of true rooms, where these may be drawn in two ways.
    """

    group: str
    name: str
    map_path: Path
    rooms_path: Path
    resolution_m: float
    origin_xy_m: tuple[float, float] | None = None
    rooms_other_path: Path | None = None

    def image_in(self, folder: Path) -> Path:
        """Where an image of the case belongs in a folder: ``<group>/<name>.png``.

        Raises
        ------
        CasesError
            If group and name lead out of the folder, or cannot name a file.
        """
        own = PurePath(self.group, f"{self.name}.png")
        if own.anchor or ".." in own.parts or _UNNAMABLE.search(str(own)):
            called = f"{self.group}/{self.name}"
            raise CasesError(
                f"case {called!r}: its image would have no place in {folder}; call group and case as files "
                "may be called, without .. and without a / at the beginning"
            )
        return folder / own

    def snapshot(self) -> OccupancySnapshot:
        """Read the map as an occupancy grid; its origin is (0, 0) where it is not known.

        Where the usual thresholds do not fit its grays, others are decided as for any saved map, and told.

        Raises
        ------
        CasesError
            If the image cannot be read or is not an 8-bit gray one.
        """
        gray = _read_image(self.map_path)
        if gray.ndim != 2 or gray.dtype != np.uint8:
            raise CasesError(f"{self.map_path}: the map must be an 8-bit gray image")
        cells = cells_of_image(self.map_path, gray)
        geometry = GridGeometry(self.resolution_m, self.origin_xy_m or (0.0, 0.0), 0.0, "map", gray.shape)
        return OccupancySnapshot(
            0, 0, 0, str(self.map_path), np.ascontiguousarray(np.flipud(cells)), geometry
        )

    def truth(self, name: Truth = "rooms") -> NDArray[np.int64]:
        """Read the true rooms (H, W) as labels, row 0 at the top.

        Parameters
        ----------
        name : {"rooms", "rooms_other"}
            Which of them; a case without a second truth has only the first.

        Raises
        ------
        CasesError
            If the image cannot be read.
        """
        return _read_labels(self._truth_paths()[name])

    def truths(self) -> dict[Truth, NDArray[np.int64]]:
        """Read every truth of the case, the first one first; all of one size.

        Raises
        ------
        CasesError
            If an image cannot be read, or the second truth is of another size than the first.
        """
        found = {name: _read_labels(path) for name, path in self._truth_paths().items()}
        first = found["rooms"].shape
        for name, labels in found.items():
            if labels.shape != first:
                path = self._truth_paths()[name]
                raise CasesError(f"{path}: of shape {labels.shape}, but {self.rooms_path} is {first}")
        return found

    def _truth_paths(self) -> dict[Truth, Path]:
        paths: dict[Truth, Path] = {"rooms": self.rooms_path}
        if self.rooms_other_path is not None:
            paths["rooms_other"] = self.rooms_other_path
        return paths


def load_cases(path: Path, group: str | None = None) -> tuple[Case, ...]:
    """Read the list of cases.

    Parameters
    ----------
    path : path
        The JSON file.
    group : str, optional
        Take only the cases of this group.

    Raises
    ------
    CasesError
        If the file cannot be read, misses something, or no case is left.
    """
    try:
        listed = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise CasesError(f"{path}: cannot be read as JSON: {reason_of(error)}") from error
    if not isinstance(listed, dict) or not isinstance(listed.get("cases"), list):
        raise CasesError(f'{path}: must hold an object with a list "cases"')
    cases = tuple(_case(path, number, entry) for number, entry in enumerate(listed["cases"]))
    groups = dict.fromkeys(case.group for case in cases)
    chosen = tuple(case for case in cases if group in (None, case.group))
    if not chosen:
        wanted = "no cases" if group is None else f"no group {group!r}; there are: {', '.join(groups)}"
        raise CasesError(f"{path}: {wanted}")
    return chosen


def _case(path: Path, number: int, entry: Any) -> Case:
    try:
        return Case(
            str(entry["group"]),
            str(entry["name"]),
            path.parent / entry["map"],
            path.parent / entry["rooms"],
            float(entry["resolution_m"]),
            _origin(entry.get("origin_xy_m")),
            None if (other := entry.get("rooms_other")) is None else path.parent / other,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise CasesError(
            f"{path}: case {number} needs group, name, map, rooms, resolution_m, and may have rooms_other, "
            f"origin_xy_m: {error!r}"
        ) from error


def _origin(given: Any) -> tuple[float, float] | None:
    if given is None:
        return None
    x, y = given
    return float(x), float(y)


def _read_labels(path: Path) -> NDArray[np.int64]:
    labels = _read_image(path)
    if labels.ndim != 2:
        raise CasesError(f"{path}: the rooms must be a single-channel label image")
    return labels.astype(np.int64)


def _read_image(path: Path) -> NDArray[Any]:
    try:
        with Image.open(path) as image:
            return np.asarray(image)
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise CasesError(f"{path}: cannot be read as an image: {reason_of(error)}") from error
